"""Stores of energy, each ideal or behind any converter of storage: see the table of `storage`."""

from typing import Any, Protocol


class Store(Protocol):
    """What a file of a store contains; x are the states share, energy and reactive, with those of a converter."""

    NAME: str
    Par: Any  # its own parameters, beside those of every storage device
    FINITE: bool  # whether its energy must be limited
    automatic: Any  # its parameters after the start from those before, or None

    def most(self, x: Any, p: Any) -> tuple[Any, Any]:
        """Largest power that it takes and gives, over the rating; full or empty it is stopped elsewhere."""

    def rate(self, x: Any, P: Any, p: Any) -> Any:
        """Derivative of its energy (pu), where it takes the power P (pu system)."""
