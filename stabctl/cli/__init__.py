"""The command line: parses arguments, calls the library, prints results."""

import gc
import os
import sys
import warnings
from contextlib import suppress
from typing import Any, TextIO

import click

from stabctl._util.errors import StabctlError, one_line, sentence

from .parameters import Commands

COMPLETION = "_STABCTL_COMPLETE"
CLOSED_PIPE = 141  # exit code; what a shell reports for a program ended by SIGPIPE

COMMANDS: dict[str, str | click.Command] = {
    "cases": "listings.cases",
    "tables": "listings.tables",
    "models": "listings.models",
    "import": "listings.importing",
    "check": "listings.check",
    "powerflow": "powerflow.powerflow",
    "scr": "powerflow.scr",
    "simulate": "simulate.simulate",
    "clearing-time": "clearing.clearing_time",
    "screen": "clearing.screen",
    "study": "study.study",
    "place": "place.place",
    "estimate": "estimate.estimate",
    "modes": "linear.modes",
    "weak-grid": "linear.weak_grid",
    "verify": "verify.verify",
    "design": Commands(
        "Design controllers: stabilizers, oscillation dampers, regulators, storage laws.",
        {
            "optimum": "design_optimum.optimum",
            "law": "design_law.law",
            "tune": "design_tune.tune",
            "pss": "design_tune.pss",
            "pod": "design.pod",
            "lqr": "design.lqr",
            "lqg": "design.lqg",
        },
        short_help="Design controllers.",
    ),
    "live": "live.live",
    "linearize": "linear.linearize",
    "swing": Commands(
        "Theory of one and two machines: equal area, feedback laws, minimum time.",
        {
            "table1": "swing.table1",
            "equal-area": "swing.equal_area",
            "feedback": "swing.feedback",
            "minimum-time": "swing.minimum_time",
        },
        short_help="Theory of one and two machines.",
    ),
    "sweep": Commands(
        "Run many simulations from one study file, on all cores or a Dask cluster.",
        {"run": "sweep.run", "show": "sweep.show"},
        short_help="Run many simulations from one study file.",
    ),
}
version = click.version_option(package_name="stabctl", message="stabctl %(version)s", help="Print the version.")
app = version(
    Commands(
        "Controller design and linear analysis for transient stability with energy storage.",
        COMMANDS,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
)


def main() -> None:
    """Run the command line and exit; the exit code is 2 after a user error, which is one line on stderr."""
    warnings.simplefilter("ignore", RuntimeWarning)
    os.environ.setdefault("MPLBACKEND", "agg")  # figures go to files
    if os.environ.get("COLUMNS", "").strip() == "0":
        del os.environ["COLUMNS"]  # a terminal of unknown width
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")  # a character that the terminal does not have
    if COMPLETION in os.environ:  # a shell asks what may come next
        app.main(prog_name="stabctl", complete_var=COMPLETION)
    gc.disable()  # collecting garbage while libraries load would cost an eighth of a short command
    try:
        code = _run(sys.argv[1:])
        sys.stdout.flush()
    except BrokenPipeError:
        code = CLOSED_PIPE
    except OSError as error:
        code = _complain(f"The output cannot be written: {error.strerror or error}.")
    _flush(sys.stdout)
    _flush(sys.stderr)
    sys.exit(code)


def _run(words: list[str]) -> int:
    """The exit code of a command."""
    try:
        with app.make_context("stabctl", words) as context:
            code: Any = context.command.invoke(context)
    except StabctlError as error:
        return _complain(sentence(error))
    except OSError as error:
        if not error.filename:
            raise  # the output cannot be written
        return _complain(f"{sentence(error)}; choose another file or folder.")
    except KeyboardInterrupt as error:
        return _complain(" ".join(["interrupted.", *getattr(error, "__notes__", ())]), 130)
    except click.exceptions.Exit as end:
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
