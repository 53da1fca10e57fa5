"""The result of the design of a storage law: its limits, its parameters, and clearing times in every contingency.

The score of a law is the clearing time that it gains, less penalties for exceeded limits.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import numpy as np

from stabctl._util.schema import NOT_NEGATIVE, POSITIVE
from stabctl._util.validation import guard
from stabctl._util.verbs import verb
from stabctl._util.wording import counted, listed
from stabctl.controllers import Law, SampledLaw, StorageLaw
from stabctl.simulation.contingency import Contingency

from .critical_machines import Group
from .law_measurement import Measured

if TYPE_CHECKING:
    import pandas as pd

SLACK = 1e-9  # excess that is rounding
MEAN = 0.1  # weight of the mean gain beside the median, which has many ties on a grid
SHORT = 4.0  # cycles lost for a cycle below the reference law, in one contingency
EXCEEDED = 20.0  # cycles lost in a contingency that exceeds a limit, and as much again for a limit exceeded twice
LEFT = 0.05  # share of the energy that may be missing in the end
EFFORT = 0.02  # cycles lost for as much energy as the reference law uses
STEP = 0.125  # cycles   a clearing time this much shorter counts as equal, as it depends on the grid


@dataclass(frozen=True)
class LawLimits:
    """Limits of a storage law, in each of its contingencies, cleared at the critical time.

    Parameters
    ----------
    energy : float, kWh, optional
        Energy of all devices together: the range of each.
    switchings : int
        Sign changes of an order within a swing.
    coi : float, Hz, optional
        Deviation of the speed of the center of inertia.
    voltage : float, pu
        Lowest voltage of a bus at the end.
    min_voltage : float, pu
        Voltage at a device down to which it is able to act.
    deadband : float, Hz
        Smallest deadband, above the noise of the speeds.
    return_within : float, s
        Time after which the devices have their energy back, within 5 % of what they used; 0: no return.

    Examples
    --------
    >>> st.design.LawLimits(energy="150kWh", return_within="60s")
    LawLimits(energy=150.0, switchings=2, coi=None, voltage=0.0, min_voltage=0.5, deadband=0.02, return_within=60.0)
    """

    energy: Annotated[float | None, "kWh", "energy of all devices", POSITIVE] = None
    switchings: Annotated[int, "-", "sign changes of an order within a swing", NOT_NEGATIVE] = 2
    coi: Annotated[float | None, "Hz", "deviation of the speed of the center of inertia", POSITIVE] = None
    voltage: Annotated[float, "pu", "lowest voltage at the end", NOT_NEGATIVE] = 0.0
    min_voltage: Annotated[float, "pu", "voltage down to which a device is able to act", NOT_NEGATIVE] = 0.5
    deadband: Annotated[float, "Hz", "smallest deadband", NOT_NEGATIVE] = 0.02
    return_within: Annotated[float, "s", "time after which the energy is back", NOT_NEGATIVE] = 120.0

    def __post_init__(self) -> None:
        guard(self)

    def exceeded(self, found: Measured) -> float:
        """By how much a law exceeds the limits in one contingency.

        Parameters
        ----------
        found : Measured
            What was measured with the law.

        Returns
        -------
        float
            Sum of the excesses, each relative to its limit; 0 if all limits are kept.
        """
        use, after = found.duty, found.later
        over = [
            found.energy_kwh / self.energy - 1 if self.energy else 0.0,
            (use.switchings - self.switchings) / max(self.switchings, 1),
            use.coi_hz / self.coi - 1 if self.coi else 0.0,
            1 - use.voltage / self.voltage if self.voltage else 0.0,
            after.left_kwh / (LEFT * after.energy_kwh) - 1 if after and after.energy_kwh else 0.0,
            0.0 if after is None or after.stable else 1.0,
        ]
        return float(sum(x for x in over if x > SLACK))

    def kept(self, found: Sequence[Measured]) -> bool:
        """Whether a law keeps the limits in all contingencies.

        Parameters
        ----------
        found : sequence of Measured
            What was measured with the law, one entry per contingency.

        Returns
        -------
        bool
        """
        return not any(map(self.exceeded, found))

    def score(self, found: Sequence[Measured], reference: Sequence[Measured]) -> float:
        """Score of a law, compared with the reference law in the same contingencies.

        Parameters
        ----------
        found, reference : sequence of Measured
            What was measured with the law and with the reference law, one entry per contingency.

        Returns
        -------
        float, cycles
            Median gain plus a tenth of the mean gain, less the penalties for shorter clearing times, exceeded limits
            and energy.
        """
        gain = np.array([m.reach - r.reach for m, r in zip(found, reference, strict=True)])
        energy = sum(r.energy_kwh for r in reference)
        used = sum(m.energy_kwh for m in found) / energy if energy else 0.0
        over = sum(1 + excess for m in found if (excess := self.exceeded(m)))
        lost = SHORT * float(np.maximum(-gain, 0).sum()) + EXCEEDED * over + EFFORT * used
        return float(np.median(gain)) + MEAN * float(gain.mean()) - lost


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


class Parameter(NamedTuple):
    """A parameter: what it is called, its value with the unit, what it does."""

    name: str
    value: str
    meaning: str


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

    Examples
    --------
    >>> limits = st.design.LawLimits(return_within=0)
    >>> options = {"resolution": "2cyc", "scan": 0, "observe": "2s"}
    >>> found = st.design.law(st.load("two_area"), "7-8@0.4", storage="50MW", limits=limits, **options)
    >>> found.kept, found.gain.median
    (True, 8.0)
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

    plot = verb("stabctl.view.figures.storage_control:plot_law_design")
    report = verb("stabctl.view.pages.law_page:write")

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
    def parameters(self) -> tuple[Parameter, ...]:
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

        Examples
        --------
        >>> options = {"resolution": "4cyc", "scan": 0, "observe": "1s", "longest": 0}
        >>> found = st.design.law(st.load("two_area").classical(), "7-8@0.4", storage="50MW", **options)
        >>> found.save("law.toml")
        PosixPath('law.toml')
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


def parameters(law: Law) -> tuple[Parameter, ...]:
    """The parameters of a storage law that have an effect.

    Raises
    ------
    TypeError
        If it is another law.
    """
    inner = law.law if isinstance(law, SampledLaw) else law
    if not isinstance(inner, StorageLaw):
        raise TypeError(f"{type(inner).__name__} is not a StorageLaw")
    found = list(_of_storage_law(inner))
    if isinstance(law, SampledLaw):
        found.append(Parameter("rate", f"{law.rate}/s", "frames per second"))
        found += [Parameter("delay", f"{1e3 * law.delay:g} ms", "time from measurement to output")] if law.delay else []
    return tuple(found)


def _of_storage_law(law: StorageLaw) -> Iterator[Parameter]:
    groups = ", ".join("+".join(map(str, group)) for group in law.groups)
    yield Parameter("groups", groups or "none", "machines whose devices use the speed and angle of the group")
    yield Parameter("angle gain", f"{law.angle_gain:g} 1/s", "k of the surface w + k Δδ")
    if law.slope:
        yield Parameter("slope", f"{law.slope:g} Hz", "surface beyond the deadband at which the power is full")
    else:
        yield Parameter("relay", "yes", "full power beyond the deadband")
    yield Parameter("deadband", f"{law.deadband:g} Hz", "surface without action")
    if law.min_voltage:
        yield Parameter("lowest voltage", f"{law.min_voltage:g} pu", "voltage below which a device idles")
    if law.max_acceleration:
        yield Parameter("fastest", f"{law.max_acceleration:g} Hz/s", "rate of the deviation above which a device idles")
    if law.arm_at:
        yield Parameter("armed at", f"{law.arm_at:g} Hz", "surface beyond which the law is armed")
        yield Parameter("time-out", f"{law.timeout:g} s", "time for which it stays armed")
    if law.return_time:
        yield Parameter("return", f"{law.return_time:g} s", "time constant with which idle devices return their energy")


def _gain(judged: Sequence[Judged]) -> Gain:
    gains = np.array([c.gain for c in judged])
    lower, median, upper = (float(x) for x in np.percentile(gains, [25, 50, 75]))
    below = int((gains < -STEP - SLACK).sum())
    return Gain(len(gains), median, lower, upper, float(gains.min()), float(gains.max()), below)


def _row(c: Judged) -> dict[str, Any]:
    row: dict[str, Any] = {
        "fault": str(c.contingency.fault),
        "trip": ", ".join(map(str, c.contingency.trip)),
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
