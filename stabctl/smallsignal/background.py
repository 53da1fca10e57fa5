"""A computation in a second thread, which ends when it is no longer needed."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from threading import Event
from typing import Generic, TypeVar

Result = TypeVar("Result")


class Background(AbstractContextManager["Background[Result]"], Generic[Result]):
    """A computation in a thread. On leaving the context it ends the next time it tells how far it is.

    Parameters
    ----------
    work : callable
        Given a function that it calls with the part of the work done, from 0 to 1; what it raises, `result` raises.
    """

    def __init__(self, work: Callable[[Callable[[float], None]], Result]) -> None:
        self.part = 0.0
        self._left = Event()
        self._pool = ThreadPoolExecutor(1)
        self._result = self._pool.submit(work, self._said)

    def __exit__(self, *_: object) -> None:
        self._left.set()
        self._pool.shutdown()

    def ended(self) -> bool:
        """Whether it has ended."""
        return self._result.done()

    def result(self) -> Result:
        """What it returns; waits until it has ended."""
        return self._result.result()

    def _said(self, part: float) -> None:
        if self._left.is_set():
            raise LeftError
        self.part = part


class LeftError(Exception):
    """The computation is no longer needed."""
