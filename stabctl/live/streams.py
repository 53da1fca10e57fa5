"""Answers that come in parts: a line of JSON for each, until the work ends or the page no longer listens."""

import json
from collections.abc import AsyncIterator, Callable
from queue import SimpleQueue
from threading import BoundedSemaphore, Event, Thread
from typing import Any

from stabctl.errors import StabctlError, bug, sentence

from .searches import Tell

MOST = 8  # searches at a time, those included that end after their present simulation because the page has left


class Left(Exception):
    """The page no longer listens."""


class Searches:
    """Searches in threads, a few at a time."""

    def __init__(self) -> None:
        self._room = BoundedSemaphore(MOST)

    def start(self, work: Callable[[Tell], None]) -> AsyncIterator[bytes] | None:
        """Run `work(tell)` in a thread; what it tells, in lines. None if too many are running."""
        if not self._room.acquire(blocking=False):
            return None
        told: SimpleQueue[dict[str, Any] | None] = SimpleQueue()
        left = Event()

        def tell(part: dict[str, Any]) -> None:
            if left.is_set():
                raise Left
            told.put(part)

        def run() -> None:
            try:
                work(tell)
            except Left:
                pass
            except StabctlError as error:
                told.put({"error": sentence(error)})
            except Exception as error:
                told.put({"error": bug(error)})
            finally:
                self._room.release()
                told.put(None)

        Thread(target=run, daemon=True).start()
        return _lines(told, left)


async def _lines(told: "SimpleQueue[dict[str, Any] | None]", left: Event) -> AsyncIterator[bytes]:
    """What is told, until it ends or the page leaves."""
    from anyio import to_thread

    try:
        while (part := await to_thread.run_sync(told.get, abandon_on_cancel=True)) is not None:
            yield json.dumps(part).encode() + b"\n"
    finally:
        left.set()
        told.put(None)  # ends the thread that waits, which would delay the end of the server
