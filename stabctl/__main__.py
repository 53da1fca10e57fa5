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
        _end()
    except SystemExit as end:
        if end.code == INTERRUPTED:
            _end()
        raise
    finally:
        _at_rest()


def _at_rest() -> None:
    """Ctrl-C changes nothing any more: the program is ending."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, 0)


def _end() -> None:
    """End an interrupted program without its threads, for which Python would wait, and half-made objects of LLVM."""
    _at_rest()
    atexit._run_exitfuncs()
    os._exit(INTERRUPTED)


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
    if not hasattr(signal, "setitimer"):
        return False
    signal.signal(signal.SIGALRM, _interrupted)
    signal.setitimer(signal.ITIMER_REAL, LATER)
    return True


if __name__ == "__main__":
    main()
