"""The result of the design of a regulator, compared with feedback of all states."""

from dataclasses import dataclass
from typing import Any, Self

from stabctl.controllers.controller import Controller
from stabctl.smallsignal.modes import Modes

from .quadratic import Quadratic
from .result import Design, least
from .robustness import Robustness


@dataclass(frozen=True, repr=False)
class Regulator(Design):
    """A regulator, and the state feedback that it approximates.

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
        """The regulator for a cost; its aim is reached if the smallest damping ratio increases.

        Parameters
        ----------
        cost : Quadratic
            The cost and the plant.
        one : Controller
            The regulator.
        after : Modes
            Modes with the regulator.
        **more
            Other fields, such as `full` and `own`.

        Returns
        -------
        Regulator
        """
        return cls((one,), (cost.modes,), (after,), least(after)[0] > least(cost.modes)[0], **more)

    def __str__(self) -> str:
        text = super().__str__()
        if self.full is not None:
            text += f"\nall states: {self.full}"
        if self.own is not None and self.own != self.full:
            text += f"\ngiven inputs: {self.own}"
        return text

    __repr__ = __str__
