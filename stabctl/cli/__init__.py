"""The command line: parses, calls, prints."""

import gc
import sys
import warnings

import typer

from stabctl.errors import StabctlError, sentence

from . import (
    cases,
    clearing_time,
    estimate,
    linearize,
    modes,
    place,
    powerflow,
    screen,
    simulate,
    sweep,
    swing,
    tables,
)

app = typer.Typer(
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    no_args_is_help=True,
    help="Controller design and linear analysis for transient stability with energy storage.",
)
app.command("cases")(cases.cases)
app.command("tables")(tables.tables)
app.command("powerflow")(powerflow.powerflow)
app.command("simulate")(simulate.simulate)
app.command("clearing-time")(clearing_time.clearing_time)
app.command("screen")(screen.screen)
app.command("place")(place.place)
app.command("estimate")(estimate.estimate)
app.command("modes")(modes.modes)
app.command("linearize")(linearize.linearize)
app.add_typer(swing.app, name="swing")
app.add_typer(sweep.app, name="sweep")


def main() -> None:
    """Run the command line; a user's mistake is one line on stderr and exit code 2."""
    warnings.simplefilter("ignore", RuntimeWarning)
    gc.disable()  # a command is short and makes few cycles; collecting while libraries load costs an eighth of it
    try:
        code = app(standalone_mode=False)
    except (StabctlError, OSError) as error:
        code = _complain(sentence(error))
    except KeyboardInterrupt:
        code = _complain("interrupted.", 130)
    except Exception as error:
        if not hasattr(error, "format_message"):
            raise
        if type(error).__name__ == "NoArgsIsHelpError":
            print(error.format_message())
            sys.exit(0)
        code = _complain(error.format_message(), getattr(error, "exit_code", 2))
    sys.exit(code if isinstance(code, int) else 0)


def _complain(sentence: str, code: int = 2) -> int:
    print("stabctl:", " ".join(sentence.split()), file=sys.stderr)
    return code
