"""The result of a tuning, with what speaks for it."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from stabctl import devices
from stabctl._util import files
from stabctl._util.errors import StudyError
from stabctl._util.wording import counted
from stabctl.model.case import Case
from stabctl.smallsignal.closed_loop import closed_loop

from ..evidence import Check, compared
from ..outages import by_reason
from ..result import Design
from .devices import parameters
from .parts import Asked, Parts
from .problem import KEPT, LOW, Peak, Trial, highest
from .robustness import RingDown, Worst, clearing, gains_and_outages, ring_down, shorter, worst
from .search import Search

if TYPE_CHECKING:
    import pandas as pd

BINDING = 1e-3  # relative distance from a bound, from which it counts as reached
STATIONARY = 1e-3  # damping ratio that 1 % of every parameter may still promise at the end


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
        The case of the intact network nearest to load level 1 with what was tuned in it, parameters and packaged
        stabilizers; `base`, `ring_down` and `checks` are of it, too.
    left_out
        Networks that were left out, and why.
    lowered
        Whether the damping wanted was reached, and the gains were lowered.
    promise
        Rise of the damping ratio that a linear program still promises for changes of 1 %: 0 at a stationary point. If
        the gains were lowered: fall of the logarithm of the largest one relative to its bound, times 0.02.
    steps
        Steps of the search.
    packaged
        Model and machine of each packaged stabilizer that was tuned.
    robustness
        What differs from the networks tuned for, and the worst damping then.
    ring_down
        Speeds after a small pulse, of the nonlinear simulation and of the linear model; None if it is unstable.
    reserves
        Share of the limits of each controller, by name, that three standard deviations of its noise leave.
    checks
        Clearing times of the most critical line faults, without and with the controllers.

    Examples
    --------
    >>> found = st.design.pss(st.load("two_area_thyristor"), [1, 3], damping=0.1, starts=1)
    >>> found.reached, found.damping > 0.099
    (True, True)
    >>> found.parameters[["device", "parameter", "unit"]].head(2)
           device parameter unit
    0  vs 1 tuned         K   pu
    1  vs 1 tuned        Tw    s
    """

    worst_case: Worst | None = None
    doubled: Worst | None = None
    sensitivity: tuple[float, str] | None = None
    disk_margin: float | None = None
    values: tuple[tuple[str, str, float, str, float, float], ...] = ()
    gains: tuple[tuple[str, float, float], ...] = ()
    case: Case | None = None
    left_out: tuple[tuple[str, str], ...] = ()
    lowered: bool = False
    promise: float = 0.0
    steps: int = 0
    packaged: tuple[tuple[str, int], ...] = ()
    robustness: tuple[tuple[str, Worst], ...] = ()
    ring_down: RingDown | None = None
    reserves: tuple[tuple[str, float], ...] = ()
    checks: tuple[Check, ...] = ()

    @classmethod
    def found(
        cls,
        parts: Parts,
        asked: Asked,
        search: Search,
        *,
        elsewhere: Sequence[Parts],
        checks: int,
        seed: int,
        left_out: tuple[tuple[str, str], ...],
    ) -> "Tuned":
        """The result of a search."""
        trial, merit = search.best
        split = parts.laws.size
        values = [np.exp(part) for part in parts.laws.parts(trial.p[:split])]
        controllers = [t.controller(v) for t, v in zip(parts.tunables, values, strict=True)]
        usual = min(parts.networks, key=lambda one: (not one.intact, abs(one.level - 1)))
        networks = [usual, *(one for one in parts.networks if one is not usual)]
        points = [one.tuned(parts.of_case, trial.p[split:]) for one in networks]
        one = np.ones(len(controllers))
        least = worst(trial, one)
        missed = () if merit.missed >= -KEPT else tuple(_missed(parts, trial, asked))
        design = Design.of(points, controllers, short=(asked.damping or 0.0) - least.damping)
        given = [one.given for one in networks]
        changed = any(a is not b.point for a, b in zip(given, networks, strict=True)) or bool(parts.of_case)
        promise = search.promise()
        own = {name: getattr(design, name) for name in ("controllers", "before", "after", "short")}
        robust = list(gains_and_outages(parts, trial, asked.gains, seed))
        for other in elsewhere:
            own_trial = other.problem(asked).at(trial.p)
            beside = " and its outages" * any(not network.intact for network in other.networks)
            robust.append((f"{other.networks[0].name}{beside}, not tuned for", worst(own_trial, one)))
        made = cls(
            **own,
            reached=design.reached and not missed,
            robustness=tuple(robust),
            ring_down=ring_down(points[0], controllers) if design.after[0].stable and points[0].case.loads else None,
            reserves=tuple(parts.reserves(trial.logs)),
            checks=clearing(points[0], given[0] if changed else None, controllers, checks),
            replaced=tuple(closed_loop(point).modes() for point in given) if changed else (),
            worst_case=least,
            doubled=worst(trial, 2 * one) if controllers else None,
            sensitivity=_peak(parts, trial, Peak(1.0)) if controllers else None,
            disk_margin=1 / _peak(parts, trial, Peak(1.0, 0.5))[0] if controllers else None,
            values=tuple(_values(parts, trial.p)),
            gains=tuple(
                (t.name, t.fast, float(np.exp(t.structure.fast @ np.log(v))))
                for t, v in zip(parts.tunables, values, strict=True)
            ),
            case=_case(parts, values, points[0].case),
            left_out=left_out,
            lowered=trial.problem.shares is not None,
            promise=promise,
            steps=search.steps,
            packaged=tuple((t.structure.model, t.machine) for t in parts.tunables if t.machine is not None),
        )
        return replace(made, remarks=tuple(made._remarks(missed, usual.level)))

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
            at = "low" if value - low <= BINDING * abs(low) else "high" if high - value <= BINDING * abs(high) else ""
            rows.append((device, name, value, unit, low, high, at))
        return pd.DataFrame(rows, columns=["device", "parameter", "value", "unit", "low", "high", "at_bound"])

    @property
    def summary(self) -> dict[str, Any]:
        """The numbers of the result, as plain values."""
        least, doubled = (asdict(one) if one else None for one in (self.worst_case, self.doubled))
        rows = [{"what": what, **asdict(one)} for what, one in self.robustness]
        columns = ("replaced", "before", "after")
        cycles = {c.label: {k: getattr(c, k) and getattr(c, k).cycles for k in columns} for c in self.checks}
        return {
            "worst": least,
            "doubled": doubled,
            "sensitivity": self.sensitivity and self.sensitivity[0],
            "disk_margin": self.disk_margin,
            "reached": self.reached,
            "parameters": self.parameters.to_dict("records"),
            "gains": {name: found for name, _, found in self.gains},
            "robustness": rows,
            "ring_down": self.ring_down and self.ring_down.difference,
            "reserves": dict(self.reserves),
            "clearing_cycles": cycles,
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

        Examples
        --------
        >>> options = {"outages": "none", "levels": [1.0], "check_levels": [], "checks": 0, "starts": 1}
        >>> some = st.design.stabilizers([1, 3], model="ieeest", stages=1)
        >>> found = st.design.tune(st.load("two_area_thyristor"), some, damping=0.1, **options)
        >>> found.save_dyr("stabilizers.dyr")
        PosixPath('stabilizers.dyr')
        """
        if not self.packaged:
            raise StudyError(
                "No packaged stabilizer was tuned, so there is no DYR record; give stabilizers(model=...)."
            )
        path = files.path_of(path)
        files.replace(path, self.dyr.encode())
        return path

    @property
    def holds(self) -> "pd.DataFrame":
        """The worst damping with other gains, a controller out, and at load levels not tuned for."""
        import pandas as pd

        rows = [(what, one.damping, one.frequency_hz, one.name) for what, one in self.robustness]
        return pd.DataFrame(rows, columns=["what", "damping_ratio", "frequency_hz", "where"])

    def _simulated(self) -> Iterator[str]:
        """What the nonlinear simulation says."""
        if self.ring_down:
            yield (
                "After a small pulse the nonlinear simulation and the linear model differ by "
                f"{100 * self.ring_down.difference:.1f} % of the largest speed deviation."
            )
        if self.checks:
            yield compared(self.checks)
        for c in shorter(self.checks):
            yield f"A clearing time falls by more than 1/8 cycle: {c.label}, {c.gained}."

    def _remarks(self, missed: Sequence[str] = (), level: float = 1.0) -> list[str]:
        lines = [f"Worst of all networks, every mode above {LOW:g} Hz: {self.worst_case}."]
        if self.worst_replaced is not None:
            lines.append(f"With the parameters and stabilizers that the case has: {self.worst_replaced:z.4f}.")
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
        if self.reserves:
            name, least = min(self.reserves, key=lambda pair: pair[1])
            lines.append(f"Three standard deviations of the noise leave {max(least, 0):.2f} of the limits of {name}.")
        if level != 1 and (self.ring_down or self.checks):
            lines.append(f"The simulations are at {100 * level:g} % of the load.")
        lines += self._simulated()
        if missed:
            lines.append(f"Not reached: {' or '.join(missed)}; ask for less, or give other devices or bounds.")
        if self.damping < 0:
            lines.append("Nothing was found that stabilizes every network; leave out the worst, or add devices.")
        if self.promise > STATIONARY and not self.lowered:
            lines.append("Other parameters may give more damping: more starts may find them.")
        for why, names in by_reason(self.left_out):
            lines.append(
                f"Left out because {why}: {', '.join(names)}."
                if len(names) < 20
                else f"{counted(len(names), 'network')} left out because {why}."
            )
        return lines


def _missed(parts: Parts, trial: Trial, asked: Asked) -> Iterator[str]:
    """The limits asked for that are not kept."""
    if asked.reserve is not None and min(share for _, share in parts.reserves(trial.logs)) < asked.reserve - KEPT:
        yield f"a reserve of {asked.reserve:g} for noise"
    if asked.doubled is not None and worst(trial, 2 * np.ones(len(parts.tunables))).damping < asked.doubled:
        yield f"a damping ratio of {asked.doubled:g} with doubled gains"
    for peak in asked.peaks:
        found, of = _peak(parts, trial, peak)[0], "of all loops together" if peak.together else "of each loop"
        if found > peak.bound:
            what = f"a disk margin of {1 / peak.bound:g}" if peak.shift else f"a sensitivity of {peak.bound:g}"
            yield f"{what} {of} (found: {1 / found if peak.shift else found:.4g})"


def _peak(parts: Parts, trial: Trial, peak: Peak) -> tuple[float, str]:
    """The largest |S - shift| of a loop over all plants, and where it is; inf if one is unstable."""
    found, drives = [], list(dict.fromkeys(t.output for t in parts.tunables))
    for k, one in enumerate(parts.plants):
        loop = trial.loop(k)
        if not loop.stable:
            return np.inf, one.name
        size, w, i = highest(loop, peak)
        found.append((size, f"{drives[i]}, {w / (2 * np.pi):.2f} Hz, {one.name}"))
    return max(found)


def _values(parts: Parts, p: np.ndarray) -> list[tuple[str, str, float, str, float, float]]:
    """Every parameter of the controllers, the gain of each with its sign, and of the case."""
    owners: list[tuple[str, float]] = []
    for t in parts.tunables:
        owners += [(t.name, t.structure.sign), *[(t.name, 1.0)] * (len(t.structure.variables) - 1)]
    owners += [("case", 1.0)] * len(parts.of_case)
    pairs = zip(owners, parts.variables, np.exp(p).tolist(), strict=True)
    return [(owner, v.name, k * x, v.unit, *sorted((k * v.low, k * v.high))) for (owner, k), v, x in pairs]


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
    known = dict(parameters(case, model, number)._asdict()) | dict.fromkeys(("bus", "bus1", "bus2"), 0)
    texts = []
    for word in order.split():
        over, _, under = word.lstrip("+'").partition("_over_")
        value = known[over] / known[under] if under else known[over]
        texts.append(str(int(value)) if word.startswith("+") else f"{value:.8g}")
    machine = case.machine(number)
    identifier = machine.name.partition("/")[2] or "1"
    return f"{machine.bus} '{kind}' {identifier} {' '.join(texts)} /\n"
