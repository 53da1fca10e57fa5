"""The contingencies that a storage law is designed for, and those that it is tuned with."""

from collections.abc import Iterable, Sequence
from itertools import islice
from typing import Any

import numpy as np

from stabctl.clearing import Screen
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StudyError, shown
from stabctl.simulation.contingency import Contingency

COUNT = 20  # contingencies taken from a screen


def faults(point: OperatingPoint, given: Any) -> tuple[Contingency, ...]:
    """The contingencies, checked."""
    if not point.case.storage:
        raise StudyError(f"{point.case.name} has no storage devices to control; give storage='50MW', for example.")
    if isinstance(given, Screen):
        given = spread(given, COUNT)
    several = [given] if isinstance(given, Contingency | str) else given
    if not isinstance(several, Iterable):
        raise StudyError(f"{shown(given)} is not a list of contingencies; give [Contingency('16', trip='16-21'), ...].")
    found = list(dict.fromkeys(Contingency(c) if isinstance(c, str) else c for c in several))
    if not found:
        raise StudyError("There is no contingency to design the law for; give at least one.")
    for c in found:
        if not isinstance(c, Contingency) or c.fault is None:
            raise StudyError(f"{shown(c)} is not a contingency with a fault; give Contingency('16', trip='16-21').")
    return tuple(found)


def spread(found: Screen, count: int) -> tuple[Contingency, ...]:
    """The most critical contingencies of a screen that have a clearing time, in turn for each machine that is lost."""
    queues: dict[Any, list[Contingency]] = {}
    for pair in found.pairs:
        if pair.cycles:
            queues.setdefault(pair.machine, []).append(pair.contingency)
    rounds = (
        queue[k]
        for k in range(max(map(len, queues.values()), default=0))
        for queue in queues.values()
        if k < len(queue)
    )
    return tuple(islice(rounds, count))


def training(faults: Sequence[Contingency], share: float, seed: int) -> tuple[Contingency, ...]:
    """The contingencies of the training, of faults in the order of their clearing times: a share of each part."""
    if not 0 < share <= 1:
        raise StudyError(f"training = {share:g} is not a share; give more than 0 and at most 1, such as 0.5.")
    count = max(1, round(share * len(faults)))
    draw = np.random.default_rng(seed)
    parts = np.array_split(np.arange(len(faults)), count)
    return tuple(faults[int(draw.choice(part))] for part in parts)
