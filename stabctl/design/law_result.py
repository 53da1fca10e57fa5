"""The result of the design of a storage law: the law, and its clearing time in every contingency."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from stabctl._util.verbs import verb
from stabctl._util.wording import counted, listed
from stabctl.controllers import Law
from stabctl.simulation.contingency import Contingency

from .critical_machines import Group
from .law_jobs import Measured
from .law_limits import SLACK, LawLimits
from .law_text import Parameter, parameters

if TYPE_CHECKING:
    import pandas as pd

STEP = 0.125  # cycles   a clearing time this much shorter counts as equal, as it depends on the grid


class Judged(NamedTuple):
    """One contingency: without a law, with the reference law, with the designed law."""

    contingency: Contingency
    training: bool
    none: Measured
    reference: Measured
    designed: Measured
    group: Group | None

    @property
    def gain(self) -> float:
        """Clearing time gained over the reference law, cycles."""
        return self.designed.reach - self.reference.reach


class Gain(NamedTuple):
    """Clearing times gained over the reference law in several contingencies, cycles."""

    number: int
    median: float
    lower: float  # quartile
    upper: float  # quartile
    least: float
    most: float
    below: int  # contingencies in which the designed law is more than a step of the grid below the reference law

    def __str__(self) -> str:
        return (
            f"median gain {self.median:+g} cycles (quartiles {self.lower:+g} and {self.upper:+g}, range "
            f"{self.least:+g} to {self.most:+g}) over the paper's law in {counted(self.number, 'contingency')}, "
            f"{self.below or 'none'} of them more than {STEP:g} cycles below it"
        )


@dataclass(frozen=True, repr=False)
class LawDesign:
    """A designed storage law.

    Attributes
    ----------
    case
        Name of the case.
    law
        The law, for `control`.
    reference
        The law that it is compared with: the paper's.
    contingencies
        What it reaches in each contingency.
    limits
        Limits of the design.
    kept
        Whether the law keeps them in all training contingencies.
    tried, simulations, wall_s
        Laws that were tried, simulations, and computing time (s).
    no_limit_cycle
        Whether the law has no stable limit cycle at the operating point.
    """

    case: str
    law: Law
    reference: Law
    contingencies: tuple[Judged, ...]
    limits: LawLimits
    kept: bool
    tried: int
    simulations: int
    wall_s: float
    no_limit_cycle: bool

    plot = verb("stabctl.plotting.law_design:plot")
    report = verb("stabctl.report.law_page:write")

    @property
    def training(self) -> tuple[Judged, ...]:
        """The contingencies that the law was tuned with."""
        return tuple(c for c in self.contingencies if c.training)

    @property
    def unseen(self) -> tuple[Judged, ...]:
        """The other contingencies."""
        return tuple(c for c in self.contingencies if not c.training)

    @property
    def gain(self) -> Gain:
        """Gain in the unseen contingencies, or in those of the training if all are."""
        return _gain(self.unseen or self.training)

    @property
    def groups(self) -> tuple[Group, ...]:
        """The group of machines that lose synchronism together, of each contingency in which there is one."""
        return tuple(c.group for c in self.contingencies if c.group)

    @property
    def parameters(self) -> "tuple[Parameter, ...]":
        """The parameters of the law in text."""
        return parameters(self.law)

    @property
    def df(self) -> "pd.DataFrame":
        """A row for every contingency: clearing times (cycles) and what each law asks of the storage."""
        import pandas as pd

        return pd.DataFrame([_row(c) for c in self.contingencies])

    def save(self, path: str | Path) -> Path:
        """Write the law to a TOML file, for `--controller`.

        Parameters
        ----------
        path : str or Path
            File to write, ending in .toml.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        StudyError
            If the file cannot be written.
        """
        return Path(self.law.save(path))

    def remarks(self) -> tuple[str, ...]:
        """What was found, in sentences."""
        where = "unseen" if self.unseen else "training"
        said = [f"In the {where} contingencies: {self.gain}."]
        leaving = dict.fromkeys(str(g) for g in self.groups if len(g.machines) > 1)
        said += [f"In {self.case}, {listed(list(leaving))}."] if leaving else []
        if not self.kept:
            said.append("The law exceeds a limit of the design in a training contingency.")
        if not self.no_limit_cycle:
            said.append("It has a stable limit cycle at the operating point; give a larger smallest deadband.")
        work = f"{counted(self.tried, 'law')} tried, {self.simulations} simulations in {self.wall_s:.1f} s"
        return (*said, f"The law was tuned with {counted(len(self.training), 'contingency')} ({work}).")

    def __str__(self) -> str:
        law = ", ".join(f"{p.name} {p.value}" for p in self.parameters)
        return "\n".join([f"{self.case}: {law}", *self.remarks()])

    __repr__ = __str__


def _gain(judged: Sequence[Judged]) -> Gain:
    gains = np.array([c.gain for c in judged])
    lower, median, upper = (float(x) for x in np.percentile(gains, [25, 50, 75]))
    below = int((gains < -STEP - SLACK).sum())
    return Gain(len(gains), median, lower, upper, float(gains.min()), float(gains.max()), below)


def _row(c: Judged) -> dict[str, Any]:
    row: dict[str, Any] = {
        "fault": c.contingency.fault,
        "trip": " ".join(c.contingency.trip),
        "training": c.training,
        "group": "" if c.group is None else "+".join(map(str, c.group.machines)),
    }
    for name, found in (("none", c.none), ("paper", c.reference), ("designed", c.designed)):
        row[f"{name}_cycles"] = found.reach
    row["gain_cycles"] = c.gain
    for name, found in (("paper", c.reference), ("designed", c.designed)):
        use = found.duty
        row |= {
            f"{name}_kwh": found.energy_kwh,
            f"{name}_switchings": use.switchings,
            f"{name}_coi_hz": use.coi_hz,
            f"{name}_voltage": use.voltage,
        }
    after = c.designed.later
    row |= {"left_kwh": after and after.left_kwh, "stable_later": after and after.stable}
    return row
