"""The program: `stabctl`, or `python -m stabctl`."""

import atexit
import os
import signal
import sys
from types import FrameType
from typing import Any

INTERRUPTED = 130  # exit code; what a shell reports for a program ended by Ctrl-C
LATER = 0.002  # s   after which Ctrl-C is tried again


def main() -> None:
    """Run the command line; Ctrl-C while it loads is one sentence too."""
    while (number := os.open(os.devnull, os.O_RDWR)) <= 2:
        continue  # a standard stream that is closed; the next file would take its place
    os.close(number)
    sys.stdout = sys.stdout or os.fdopen(1, "w")
    sys.stderr = sys.stderr or os.fdopen(2, "w")
    try:
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, _interrupted)
            sys.unraisablehook = _ignored
        from .cli import main as run

        run()
    except KeyboardInterrupt:
        os.write(2, b"stabctl: interrupted.\n")
    except SystemExit as end:
        if end.code != INTERRUPTED:
            raise
    finally:  # it is ending, and Ctrl-C changes nothing any more
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, 0)
    atexit._run_exitfuncs()
    os._exit(INTERRUPTED)  # without waiting for threads, or freeing what a compiler left unfinished


def _interrupted(_: int, frame: FrameType | None) -> None:
    """Ctrl-C; where it may be lost or leave a part of a library behind, a little later: in imports and destructors."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        return  # the program is ending
    while frame is not None:
        of = frame.f_code
        if (of.co_name == "__del__" or of.co_filename.startswith("<frozen importlib")) and _again():
            return
        frame = frame.f_back
    raise KeyboardInterrupt


def _ignored(error: Any) -> None:
    """An error that Python cannot raise where it occurs, as in a callback; Ctrl-C is tried again."""
    if not issubclass(error.exc_type, KeyboardInterrupt) or not _again():
        sys.__unraisablehook__(error)


def _again() -> bool:
    """Try Ctrl-C again soon, if the system can."""
    if possible := hasattr(signal, "setitimer"):
        signal.signal(signal.SIGALRM, _interrupted)
        signal.setitimer(signal.ITIMER_REAL, LATER)
    return possible


if __name__ == "__main__":
    main()
