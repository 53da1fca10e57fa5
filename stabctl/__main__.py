"""The program: `stabctl`, or `python -m stabctl`."""

import os
import signal
import sys


def main() -> None:
    """Run the command line; Ctrl-C while it loads is one sentence too."""
    while (number := os.open(os.devnull, os.O_RDWR)) <= 2:
        continue  # a standard stream that is closed; the next file would take its place
    os.close(number)
    sys.stdout = sys.stdout or os.fdopen(1, "w")
    sys.stderr = sys.stderr or os.fdopen(2, "w")
    standard = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if standard:
        signal.signal(signal.SIGINT, _interrupted)
    from .cli import main as run

    if standard:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    run()


def _interrupted(*_: object) -> None:
    os.write(2, b"stabctl: interrupted.\n")
    os._exit(130)


if __name__ == "__main__":
    main()
