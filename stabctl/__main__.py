"""The program: `stabctl`, or `python -m stabctl`."""

import os
import signal
import sys
import threading
from types import FrameType

INTERRUPTED = 130  # exit code; what a shell reports for a program ended by Ctrl-C
LATER = 0.002  # s   after which Ctrl-C in an import is tried again


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
        from .cli import main as run

        run()
        if _pending():
            raise KeyboardInterrupt
    except KeyboardInterrupt:
        os.write(2, b"stabctl: interrupted.\n")
        sys.exit(INTERRUPTED)
    except SystemExit as end:
        if end.code == INTERRUPTED and any(not one.daemon for one in threading.enumerate()[1:]):
            os._exit(INTERRUPTED)  # jobs under way in threads, which Python would wait for
        raise
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # it is ending
        _pending()


def _pending() -> bool:
    """Whether a Ctrl-C in an import is still to be tried again; it no longer is."""
    if not hasattr(signal, "setitimer"):
        return False
    left, _ = signal.setitimer(signal.ITIMER_REAL, 0)
    if left:
        signal.signal(signal.SIGALRM, signal.SIG_IGN)
    return left > 0


def _interrupted(_: int, frame: FrameType | None) -> None:
    """Ctrl-C; in an import, where it may be lost or leave a part of a library behind, once that is complete."""
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib") and hasattr(signal, "setitimer"):
            signal.signal(signal.SIGALRM, _interrupted)
            signal.setitimer(signal.ITIMER_REAL, LATER)
            return
        frame = frame.f_back
    raise KeyboardInterrupt


if __name__ == "__main__":
    main()
