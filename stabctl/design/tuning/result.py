"""The result of a tuning, with what speaks for it."""

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from stabctl import devices
from stabctl._util import files
from stabctl._util.errors import StudyError
from stabctl._util.wording import counted
from stabctl.model import naming
from stabctl.model.case import Case
from stabctl.smallsignal.closed_loop import closed_loop

from ..result import Design
from .parts import Asked, Parts
from .problem import LOW, STABLE, Peak, Problem, Trial, highest, spare
from .search import Search

if TYPE_CHECKING:
    import pandas as pd

KEPT = 2e-4  # of a limit, that the search leaves as a reserve
BINDING = 1e-3  # relative distance from a bound, from which it counts as reached
STATIONARY = 1e-3  # damping ratio that 1 % of every parameter may still promise at the end


@dataclass(frozen=True)
class Worst:
    """The least damping ratio of some scenarios.

    Attributes
    ----------
    damping
        Damping ratio.
    frequency_hz
        Frequency of the mode, Hz.
    name
        Network, and factor of the gains.
    """

    damping: float
    frequency_hz: float
    name: str

    def __str__(self) -> str:
        return f"{self.damping:.4f} at {self.frequency_hz:.3f} Hz ({self.name})"


@dataclass(frozen=True, repr=False)
class Tuned(Design):
    """Tuned controllers: a design with its parameters and margins over all networks.

    Attributes
    ----------
    worst_case
        Least damping ratio of all networks, of every mode above 0.1 Hz.
    doubled
        The same with doubled gains; None without controllers.
    sensitivity
        Largest |S| of a loop, and its loop and network; None without controllers.
    disk_margin
        Least disk margin of a loop; None without controllers.
    values
        Every parameter: device, name, value, unit, bounds.
    gains
        Largest gain at high frequencies allowed, and that found, of each controller by name.
    case
        The case of the first network with what was tuned in it: parameters, and packaged stabilizers.
    left_out
        Networks that were left out, and why.
    promise
        Rise of the damping ratio that a linear program still promises for changes of 1 %: 0 at a stationary point.
    steps
        Steps of the search.
    packaged
        Model and machine of each packaged stabilizer that was tuned.
    """

    worst_case: Worst | None = None
    doubled: Worst | None = None
    sensitivity: tuple[float, str] | None = None
    disk_margin: float | None = None
    values: tuple[tuple[str, str, float, str, float, float], ...] = ()
    gains: tuple[tuple[str, float, float], ...] = ()
    case: Case | None = None
    left_out: tuple[tuple[str, str], ...] = ()
    promise: float = 0.0
    steps: int = 0
    packaged: tuple[tuple[str, int], ...] = ()

    @classmethod
    def found(cls, parts: Parts, asked: Asked, search: Search, left_out: tuple[tuple[str, str], ...]) -> "Tuned":
        """The result of a search."""
        trial, merit = search.best
        split = parts.laws.size
        values = [np.exp(part) for part in parts.laws.parts(trial.p[:split])]
        controllers = [t.controller(v) for t, v in zip(parts.tunables, values, strict=True)]
        points = [one.tuned(parts.of_case, trial.p[split:]) for one in parts.networks]
        worst = _worst(search.problem, trial, 1.0)
        short = (asked.damping or 0.0) - worst.damping
        short = max(short, -merit.missed) if merit.missed < -KEPT else short
        design = Design.of(points, controllers, short=short)
        given = [one.given for one in parts.networks]
        changed = any(a is not b.point for a, b in zip(given, parts.networks, strict=True)) or bool(parts.of_case)
        promise = search.promise()
        own = {name: getattr(design, name) for name in ("controllers", "before", "after", "reached", "short")}
        made = cls(
            **own,
            replaced=tuple(closed_loop(point).modes() for point in given) if changed else (),
            worst_case=worst,
            doubled=_worst(search.problem, trial, 2.0) if controllers else None,
            sensitivity=_peak(parts, trial, Peak(1.0)) if controllers else None,
            disk_margin=1 / _peak(parts, trial, Peak(1.0, 0.5))[0] if controllers else None,
            values=tuple(_values(parts, trial.p)),
            gains=tuple(
                (t.name, t.fast, float(np.exp(t.structure.fast @ np.log(v))))
                for t, v in zip(parts.tunables, values, strict=True)
            ),
            case=_case(parts, values, points[0].case),
            left_out=left_out,
            promise=promise,
            steps=search.steps,
            packaged=tuple((t.structure.model, t.machine) for t in parts.tunables if t.machine is not None),
        )
        return replace(made, remarks=tuple(made._remarks(merit.missed)))

    @property
    def damping(self) -> float:
        """Least damping ratio of all networks, of every mode above 0.1 Hz."""
        assert self.worst_case is not None
        return self.worst_case.damping

    @property
    def parameters(self) -> "pd.DataFrame":
        """Every parameter that was tuned, with its bounds, and which of them decides."""
        import pandas as pd

        rows = []
        for device, name, value, unit, low, high in self.values:
            at = "low" if value <= low * (1 + BINDING) else "high" if value >= high * (1 - BINDING) else ""
            rows.append((device, name, value, unit, low, high, at))
        return pd.DataFrame(rows, columns=["device", "parameter", "value", "unit", "low", "high", "at_bound"])

    @property
    def summary(self) -> dict[str, Any]:
        """The numbers of the result, as plain values."""
        worst, doubled = (asdict(one) if one else None for one in (self.worst_case, self.doubled))
        return {
            "worst": worst,
            "doubled": doubled,
            "sensitivity": self.sensitivity and self.sensitivity[0],
            "disk_margin": self.disk_margin,
            "reached": self.reached,
            "parameters": self.parameters.to_dict("records"),
            "gains": {name: found for name, _, found in self.gains},
            "networks": len(self.before),
            "left_out": dict(self.left_out),
            "promise": self.promise,
            "steps": self.steps,
            "remarks": list(self.remarks),
        }

    @property
    def dyr(self) -> str:
        """DYR records of the packaged stabilizers that were tuned; "" if none."""
        return "".join(record(self.case, model, n) for model, n in self.packaged if self.case is not None)

    def save_dyr(self, path: str | Path) -> Path:
        """Write `dyr` to a file.

        Parameters
        ----------
        path : str or Path
            The file.

        Returns
        -------
        Path

        Raises
        ------
        StudyError
            If no packaged stabilizer was tuned, or the file cannot be written.
        """
        if not self.packaged:
            raise StudyError(
                "No packaged stabilizer was tuned, so there is no DYR record; give stabilizers(model=...)."
            )
        path = files.path_of(path)
        files.replace(path, self.dyr.encode())
        return path

    def _remarks(self, missed: float) -> list[str]:
        lines = [f"Worst of all networks, every mode above {LOW:g} Hz: {self.worst_case}."]
        if self.doubled:
            lines.append(f"With doubled gains: {self.doubled}.")
        if self.sensitivity:
            size, where = self.sensitivity
            lines.append(
                f"Largest sensitivity of a loop: {size:.2f} ({where}); least disk margin: {self.disk_margin:.2f}."
            )
        at_limit = sum(found >= allowed * (1 - BINDING) for _, allowed, found in self.gains)
        if self.gains:
            most = max(found for *_, found in self.gains)
            lines.append(
                f"Largest gain at high frequencies: {most:.0f}; {at_limit} of {len(self.gains)} controllers have the "
                "largest one allowed."
            )
        if missed < -KEPT:
            lines.append("Not all limits are kept; ask for less, or give other devices or bounds.")
        if self.damping < 0:
            lines.append("Nothing was found that stabilizes every network; leave that one out, or add devices.")
        if self.promise > STATIONARY:
            lines.append("The search ended before nothing more could be gained; more starts may find more damping.")
        for why in dict.fromkeys(reason for _, reason in self.left_out):
            names = [n for n, reason in self.left_out if reason == why]
            lines.append(
                f"Left out because {why}: {', '.join(names)}."
                if len(names) < 20
                else f"{counted(len(names), 'network')} left out because {why}."
            )
        return lines


def _worst(problem: Problem, trial: Trial, factor: float) -> Worst:
    """The least damping ratio of all plants with a factor of the gains."""
    factors = factor * np.ones(len(problem.laws.placed))
    found = []
    for k, one in enumerate(problem.plants):
        s = trial.loop(k, factors).eigenvalues
        value = spare(s)
        value = np.where((np.abs(s.imag) >= 2 * np.pi * LOW) | (value < 0), value, np.inf)
        i = int(value.argmin())
        found.append((float(value[i]), float(abs(s[i].imag) / (2 * np.pi)), one.name))
    return Worst(*min(found))


def _peak(parts: Parts, trial: Trial, peak: Peak) -> tuple[float, str]:
    """The largest |S - shift| of a loop over all plants, and where it is; inf if one is unstable."""
    found, drives = [], list(dict.fromkeys(t.output for t in parts.tunables))
    for k, one in enumerate(parts.plants):
        loop = trial.loop(k)
        if loop.eigenvalues.real.max() > STABLE:
            return np.inf, one.name
        size, w, i = highest(loop, peak)
        found.append((size, f"{drives[i]}, {w / (2 * np.pi):.2f} Hz, {one.name}"))
    return max(found)


def _values(parts: Parts, p: np.ndarray) -> list[tuple[str, str, float, str, float, float]]:
    owners = [t.name for t in parts.tunables for _ in t.structure.variables] + ["case"] * len(parts.of_case)
    pairs = zip(owners, parts.variables, np.exp(p).tolist(), strict=True)
    return [(owner, v.name, x, v.unit, v.low, v.high) for owner, v, x in pairs]


def _case(parts: Parts, values: list[np.ndarray], case: Case) -> Case:
    """The case with the packaged stabilizers as they were tuned."""
    for t, v in zip(parts.tunables, values, strict=True):
        if t.machine is not None:
            case = case.with_device(t.structure.model, t.machine, **t.structure.values(v))
    return case


def record(case: Case, model: str, number: int) -> str:
    """The DYR record of a stabilizer: bus, model, identifier and constants in the order of its file."""
    device = devices.every()[model]
    kind, order = list(device.dyr.items())[-1]
    par = next(par for key, par in case.devices[model].items() if naming.number(key) == number)
    known = dict(par._asdict()) | dict.fromkeys(("bus", "bus1", "bus2"), 0)
    texts = []
    for word in order.split():
        over, _, under = word.lstrip("+'").partition("_over_")
        value = known[over] / known[under] if under else known[over]
        texts.append(str(int(value)) if word.startswith("+") else f"{value:.8g}")
    machine = case.machine(number)
    identifier = machine.name.partition("/")[2] or "1"
    return f"{machine.bus} '{kind}' {identifier} {' '.join(texts)} /\n"
