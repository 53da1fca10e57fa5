"""The result of the design of a regulator, with what its order reduction lost."""

from dataclasses import dataclass
from typing import Any, Self

from stabctl.controllers.controller import Controller
from stabctl.smallsignal.modes import Modes

from .quadratic import Quadratic
from .result import Design, least
from .robustness import Robustness


@dataclass(frozen=True, repr=False)
class Regulator(Design):
    """A regulator, and the one with all states that it stands for.

    Attributes
    ----------
    full
        Margins of the feedback of all states.
    own
        Margins of the regulator itself, in the full model.
    """

    full: Robustness | None = None
    own: Robustness | None = None

    @classmethod
    def of_cost(cls, cost: Quadratic, one: Controller, after: Modes, **more: Any) -> Self:
        """The regulator for a cost, with the modes with it; what is asked is that the smallest damping ratio rises."""
        return cls((one,), (cost.modes,), (after,), least(after)[0] > least(cost.modes)[0], **more)

    def __str__(self) -> str:
        text = super().__str__()
        if self.full is not None:
            text += f"\nall states: {self.full}"
        if self.own is not None and self.own != self.full:
            text += f"\nwhat it reads: {self.own}"
        return text

    __repr__ = __str__
