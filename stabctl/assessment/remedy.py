"""What would help a system, verified: a change, its cost, and what the same study finds before and after it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.simulation.control import Control

from .prices import Prices

if TYPE_CHECKING:
    import pandas as pd


class State(NamedTuple):
    """What a study says of a system."""

    secure: bool
    contingencies: int
    lost: int  # contingencies that are not survived
    margin: str  # the smallest (cycles): `+3`, `+2 or more`; empty without contingencies
    margin_cycles: float | None  # the same as a number; None if it is a bound
    damping_ratio: float | None  # the least of the oscillations that are judged; None without one
    violating: int | None  # of the contingencies simulated, those that violate the criteria; None if none is judged
    voltages: int  # buses outside the normal range


class Change(NamedTuple):
    """A change of a system."""

    words: str
    point: OperatingPoint  # the system with it
    control: Control  # with which it is studied
    code: str  # the method of a case that makes it, as Python
    mw: float | None  # of storage, or of power from other machines
    cost: float | None  # None without a price
    unsolved: tuple[str, ...] = ()  # labels of contingencies for which it was not found to suffice


@dataclass(frozen=True, repr=False)
class Remedy:
    """Something that may help a system, and what a study finds with it.

    Attributes
    ----------
    kind : {"stabilizers", "storage", "redispatch"}
        What is changed.
    before : State
        What the study finds without it.
    after : State or None
        What the same study finds with it; None if nothing was found.
    change : Change or None
        The change; `change.point` is the changed system, and `change.cost` what it costs.
    prices : Prices
        Prices of which the cost is made.
    remark : str
        Why nothing was found, or nothing that suffices.

    Examples
    --------
    >>> study = st.study(st.load("two_area"), clear="10cyc", faults="lines", worst=0, remedies="redispatch")
    >>> remedy, = study.remedies
    >>> remedy.solves, remedy.change.words
    (True, '... MW less at machines 1, 2; ... MW more at machines 3, 4')
    """

    kind: str
    before: State
    after: State | None = None
    change: Change | None = None
    prices: Prices = Prices()  # noqa: RUF009
    remark: str = ""

    @property
    def solves(self) -> bool:
        """Whether the system is secure with it."""
        return self.after is not None and self.after.secure

    @property
    def order(self) -> tuple[bool, float, float]:
        """By which the best is the first: secure, few contingencies lost, cheap."""
        lost = self.after.lost if self.after else math.inf
        return not self.solves, lost, math.inf if self.cost is None else self.cost

    @property
    def cost(self) -> float | None:
        """What it costs; None without a price, or if nothing was found."""
        return self.change.cost if self.change else None

    @property
    def price(self) -> str:
        """The cost with its currency; empty without one."""
        return "" if self.cost is None else f"{self.cost:,.0f} {self.prices.currency}".rstrip()

    @property
    def verdict(self) -> str:
        """Whether it is enough, in a sentence."""
        if self.after is None:
            return f"Nothing was found. {self.remark}".strip()
        return "The system is secure with it." if self.solves else f"It is not enough. {self.remark}".strip()

    def rows(self) -> list[tuple[str, str]]:
        """What changes, in words: contingencies not survived, smallest margin, damping ratio, violations, voltages.

        Each is a name with `before to after`, or the value that stays the same; one that is not known is a dash.
        """
        states = [self.before, *([self.after] if self.after else [])]
        named = {
            "contingencies not survived": [f"{s.lost}" for s in states],
            "smallest margin (cycles)": [s.margin or "-" for s in states],
            "least damping ratio": [_or_dash(s.damping_ratio, "z.4f") for s in states],
            "contingencies that violate criteria": [_or_dash(s.violating, "d") for s in states],
            "voltages outside": [f"{s.voltages}" for s in states],
        }
        if self.before.violating is None:
            del named["contingencies that violate criteria"]
        return [(name, " to ".join(dict.fromkeys(values))) for name, values in named.items()]

    def __str__(self) -> str:
        if self.change is None or self.after is None:
            return f"{self.kind.capitalize()}: {self.verdict[0].lower()}{self.verdict[1:]}"
        cost = f", cost {self.price}" if self.price else ""
        told = ", ".join(f"{name} {values}" for name, values in self.rows() if "voltages" not in name)
        return f"{self.kind.capitalize()}: {self.change.words}{cost}: {told}. {self.verdict}"

    __repr__ = __str__


def _or_dash(value: float | None, form: str) -> str:
    return "-" if value is None else f"{value:{form}}"


def table(remedies: Sequence[Remedy]) -> "pd.DataFrame":
    """The remedies, a row each."""
    import pandas as pd

    rows = [
        {
            "kind": r.kind,
            "change": r.change.words if r.change else "",
            "mw": r.change.mw if r.change else None,
            "cost": r.cost,
            "currency": r.prices.currency,
            "solves": r.solves,
            **{f"{name}_before": value for name, value in r.before._asdict().items()},
            **{f"{name}_after": r.after._asdict()[name] if r.after else None for name in State._fields},
            "verdict": r.verdict,
        }
        for r in remedies
    ]
    same = ["secure_before", "secure_after", "contingencies_after"]  # of a study with remedies, or in `solves`
    return pd.DataFrame(rows).drop(columns=same).rename(columns={"contingencies_before": "contingencies"})
