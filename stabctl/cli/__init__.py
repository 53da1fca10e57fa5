"""The command line: parses arguments, calls the library, prints results."""

import gc
import os
import sys
import warnings
from contextlib import suppress
from typing import Annotated, Any, TextIO

import typer

from stabctl._util.errors import StabctlError, one_line, sentence

from . import clearing, design, estimate, linear, listings, live, place, powerflow, simulate, sweep, swing

CLOSED_PIPE = 141  # exit code; what a shell reports for a program ended by SIGPIPE

app = typer.Typer(
    add_completion=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    no_args_is_help=True,
    help="Controller design and linear analysis for transient stability with energy storage.",
)
app.command("cases")(listings.cases)
app.command("tables")(listings.tables)
app.command("models")(listings.models)
app.command("import")(listings.importing)
app.command("check")(listings.check)
app.command("powerflow")(powerflow.powerflow)
app.command("scr")(powerflow.scr)
app.command("simulate")(simulate.simulate)
app.command("clearing-time")(clearing.clearing_time)
app.command("screen")(clearing.screen)
app.command("place")(place.place)
app.command("estimate")(estimate.estimate)
app.command("modes")(linear.modes)
app.command("weak-grid")(linear.weak_grid)
app.add_typer(design.app, name="design")
app.command("live")(live.live)
app.command("linearize")(linear.linearize)
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
    """Run the command line and exit; the exit code is 2 after a user error, which is one line on stderr."""
    warnings.simplefilter("ignore", RuntimeWarning)
    os.environ.setdefault("MPLBACKEND", "agg")  # figures go to files
    if os.environ.get("COLUMNS", "").strip() == "0":
        del os.environ["COLUMNS"]  # a terminal of unknown width
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")  # a character that the terminal does not have
    gc.disable()  # collecting garbage while libraries load would cost an eighth of a short command
    try:
        code = _run(sys.argv[1:])
        sys.stdout.flush()
    except BrokenPipeError:
        code = CLOSED_PIPE
    except OSError as error:
        code = _complain(f"The output cannot be written: {error.strerror}.")
    _flush(sys.stdout)
    _flush(sys.stderr)
    sys.exit(code)


def _run(words: list[str]) -> int:
    """The exit code of a command."""
    try:
        with typer.main.get_command(app).make_context("stabctl", words) as context:
            code: Any = context.command.invoke(context)
    except StabctlError as error:
        return _complain(sentence(error))
    except BrokenPipeError:
        raise
    except OSError as error:
        if error.filename:
            return _complain(f"{sentence(error)}; choose another file or folder.")
        return _complain(f"The output cannot be written: {error.strerror or error}.")
    except KeyboardInterrupt as error:
        return _complain(" ".join(["interrupted.", *getattr(error, "__notes__", ())]), 130)
    except typer.Exit as end:
        return end.exit_code
    except Exception as error:
        if _interrupted(error):
            return _complain("interrupted.", 130)
        if not hasattr(error, "format_message"):
            raise
        if type(error).__name__ == "NoArgsIsHelpError":
            print(error.format_message())
            return 0
        return _complain(error.format_message(), getattr(error, "exit_code", 2))
    return code if isinstance(code, int) else 0


def _interrupted(error: BaseException | None) -> bool:
    """Whether Ctrl-C is behind the error: an import turns it into another one."""
    return error is not None and (isinstance(error, KeyboardInterrupt) or _interrupted(error.__context__))


def _complain(text: str, code: int = 2) -> int:
    with suppress(OSError):  # nobody reads it
        print("stabctl:", one_line(text), file=sys.stderr)
    return code


def _flush(stream: TextIO) -> None:
    """Write what is left, or nowhere: a reader that has gone is no error at exit."""
    try:
        stream.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
