"""The command line: parses arguments, calls the library, prints results."""

import gc
import os
import sys
import warnings
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from stabctl.errors import StabctlError, sentence

from . import (
    cases,
    clearing_time,
    estimate,
    linearize,
    models,
    modes,
    place,
    powerflow,
    screen,
    simulate,
    sweep,
    swing,
    tables,
)


class Commands(TyperGroup):
    """The commands; Ctrl-C prints a message too, before the library turns it into a silent exit."""

    def invoke(self, ctx: Any) -> Any:
        """Run a command and return its result, or 130 if it was interrupted."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            return _complain("interrupted.", 130)


app = typer.Typer(
    cls=Commands,
    add_completion=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    no_args_is_help=True,
    help="Controller design and linear analysis for transient stability with energy storage.",
)
app.command("cases")(cases.cases)
app.command("tables")(tables.tables)
app.command("models")(models.models)
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


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"stabctl {version('stabctl')}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", is_eager=True, callback=_print_version)
    ] = False,
) -> None:
    pass


def main() -> None:
    """Run the command line; a user error prints one line on stderr and exits with code 2."""
    warnings.simplefilter("ignore", RuntimeWarning)
    os.environ.setdefault("MPLBACKEND", "agg")  # figures go to files
    if os.environ.get("COLUMNS", "").strip() == "0":
        del os.environ["COLUMNS"]  # a terminal of unknown width
    gc.disable()  # collecting garbage while libraries load would cost an eighth of a short command
    try:
        code = app(standalone_mode=False)
    except StabctlError as error:
        code = _complain(sentence(error))
    except OSError as error:
        code = _complain(sentence(error) + ("; choose another file or folder." if error.filename else ""))
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
