"""Answers that come in parts: a line of JSON for each, until the work ends or the page no longer listens."""

import json
from collections.abc import AsyncIterator, Callable
from queue import SimpleQueue
from threading import Event, Thread
from typing import Any

from stabctl.errors import StudyError

from .searches import Tell


class Left(Exception):
    """The page no longer listens."""


async def parts(work: Callable[[Tell], None]) -> AsyncIterator[bytes]:
    """Run `work(tell)` in a thread, and give what it tells."""
    from anyio import to_thread

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
        except StudyError as error:
            told.put({"error": str(error)})
        finally:
            told.put(None)

    Thread(target=run, daemon=True).start()
    try:
        while (part := await to_thread.run_sync(told.get, abandon_on_cancel=True)) is not None:
            yield json.dumps(part).encode() + b"\n"
    finally:
        left.set()
        told.put(None)  # ends the thread that waits, which would delay the end of the server
