"""The networks that a tuning serves: outages, load levels, and networks after contingencies."""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stabctl._util.errors import StabctlError, StudyError, shown
from stabctl.dynamics.operating_point import OperatingPoint, operating_point, solve
from stabctl.model import naming
from stabctl.model.case import Case
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.events import Clear, Event, Fault, Open, described

from ..outages import Outages, outages, reason
from ..result import operating_points
from .case_values import Device, Shared, value


@dataclass(frozen=True, eq=False)
class Network:
    """A network at its power flow.

    Attributes
    ----------
    point
        Its operating point, without what the controllers replace.
    devices
        Devices of the case, with what they replace.
    intact
        Whether no branch is out of service.
    level
        Its load level.
    """

    point: OperatingPoint
    devices: Any
    intact: bool
    level: float

    @property
    def name(self) -> str:
        """Name of its case."""
        return self.point.case.name

    @property
    def given(self) -> OperatingPoint:
        """Its operating point with what the controllers replace."""
        same = self.devices == self.point.case.devices
        return self.point if same else solve(replace(self.point.case, devices=self.devices), self.point.flow)

    def tuned(self, of_case: Sequence[Shared], logs: np.ndarray) -> OperatingPoint:
        """Its operating point with other parameters of the case."""
        if not of_case:
            return self.point
        found: dict[str, float] = {}
        for (paths, one), x in zip(of_case, np.exp(logs).tolist(), strict=True):
            found |= {path: x * (value(self.point.case, path) if one.unit == "x" else 1.0) for path in paths}
        return solve(self.point.case.set(found), self.point.flow)


def networks(
    bases: Any,
    devices: Sequence[Device],
    which: str,
    levels: Iterable[float],
    contingencies: Iterable[Contingency | str],
) -> tuple[list[Network], list[tuple[str, str]]]:
    """Every network with its operating point, without what the devices replace; and those left out, with the reason."""
    if which not in ("all", "none"):
        raise StudyError(f"outages = {shown(which)} is not allowed; choose 'all' or 'none'.")
    known = isinstance(bases, Outages)
    points, shares = operating_points(bases), list(levels)
    if not shares:
        raise StudyError("levels names no load level; give 1.0, for example.")
    listed = [contingencies] if isinstance(contingencies, str | Contingency) else contingencies
    several = [c if isinstance(c, Contingency) else Contingency(c) for c in listed]
    found: list[Network] = []
    left_out: list[tuple[str, str]] = []
    for point in points:
        for level in shares:
            case = point.case if level == 1 else point.case.with_load_level(level)
            name = case.name if level == 1 else f"{case.name} at {100 * level:g} %"
            case = replace(case, name=name)
            bare = case
            for one in devices:
                bare = one.prepared(bare)
            try:
                own = [operating_point(bare) if bare is not point.case else point]
            except StabctlError as error:
                if point is points[0] and level == 1:
                    raise
                left_out.append((name, reason(error)))
                continue
            if which == "all" and not known:
                more, out = _outages(own[0])
                own += more
                left_out += out
            for c in several:
                try:
                    own.append(operating_point(_after(bare, c)))
                except StabctlError as error:
                    left_out.append((f"{name} after {c.label}", reason(error)))
            first = not known or point is points[0]
            found += [Network(made, case.devices, made is own[0] and first, level) for made in own]
    return found, left_out


def _outages(point: OperatingPoint) -> tuple[list[OperatingPoint], list[tuple[str, str]]]:
    """The outages of a point, if any has an operating point."""
    try:
        every = outages(point)
    except StudyError as error:
        return [], [(f"outages of {point.case.name}", reason(error))]
    return list(every.points[1:]), [(f"{point.case.name} without {name}", why) for name, why in every.left_out]


def _after(case: Case, c: Contingency) -> Case:
    """The case without the circuits that a contingency opens; raises `StudyError` if it does more, or opens none."""
    opened = defaultdict[int, dict[int | str, Event]](dict)  # row of a branch -> end -> its opening
    others: list[Event] = []
    for one in c.with_clear("1cyc").timed(case):
        if isinstance(one, Open):
            opened[naming.row(case, "branches", str(one.branch))][one.end] = one
        elif not isinstance(one, Fault | Clear):
            others.append(one)
    others += [one for ends in opened.values() if len(ends) == 1 and "both" not in ends for one in ends.values()]
    if others:
        raise StudyError(f"only opened circuits are tuned for, not: {described(others[0])}")
    if not opened:
        raise StudyError("no circuit is open afterwards")
    rest = tuple(b for i, b in enumerate(case.branches) if i not in opened)
    return replace(case, name=f"{case.name} after {c.label}", branches=rest)
