"""The proof: critical clearing times of a fleet and of its neighbors, by the criterion of `stabctl clearing-time`."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from stabctl.clearing import Run, Search, Trial
from stabctl.clearing.critical_time import BELOW
from stabctl.clearing.last_stable import last_stable
from stabctl.controllers import Law
from stabctl.simulation import contingency as simulated
from stabctl.simulation.sampled import Sampled

from .siting import Evidence
from .trials import Trials

GRID = 0.125  # cycles
LIMIT = 60.0  # cycles
MARGINS = (1.0, 1.02, 1.03, 1.05, 1.1)  # of the sizes, tried until half the step and twice the time change nothing


class Critical(NamedTuple):
    """How long a contingency may last with a fleet."""

    cycles: float | None  # critical clearing time on a grid of about 1/8 cycle that holds the target; None: at no time
    stable: bool  # at the target
    machine: int | None  # goes first just beyond


def critical(trials: Trials, mw: np.ndarray, k: int, control: Law | Sampled | None = None) -> Critical:
    """How long contingency k may last with a fleet (candidates, MW); `control`: another than the trials' law."""
    one, law = trials.contingencies[k], control or trials.law
    target = one.clear * trials.point.case.frequency_hz
    steps = max(1, round(target / GRID))
    grid = target / steps
    limit = max(LIMIT, 2 * target)
    point = trials.point.resized(trials.fleet(mw))
    search = Search(grid, limit, trials.observed_s, trials.step, trials.criterion)
    trial = Trial(point, simulated.Contingency(one.fault, trip=one.trip), law, search)

    def attempt(j: int) -> Run:
        trials.count()
        return trial.attempt(j)

    found = last_stable(attempt, search.last, steps, 2, search.points(BELOW))
    stable = (found.runs.get(steps) or attempt(steps)).stable
    cycles = None if found.status == "unstable_at_zero" else found.critical * grid
    return Critical(cycles, stable, found.machine)


def proof(trials: Trials, mw: np.ndarray, control: Law | Sampled | None = None) -> list[Critical]:
    """How long every contingency may last with a fleet (candidates, MW)."""
    return trials.each(lambda k: critical(trials, mw, k, control))


def table(
    trials: Trials, mw: np.ndarray, found: Sequence[Critical], others: Mapping[str, Sampled]
) -> tuple[Evidence, ...]:
    """The fleet (candidates, MW), less of it, without each site, more finely simulated, and under other controllers.

    `found` is the fleet's own proof; `others` are the controllers by name. Where the fleet itself does not do for finer
    steps or another controller, the first of `MARGINS` that does is shown, or the last one where none does.
    """
    rows = [_row(mw, found), _row(0.9 * mw, proof(trials, 0.9 * mw), scale=0.9)]
    for i in (int(i) for i in np.argsort(-mw) if mw[i] > 0):
        s = trials.point.case.storage[i]
        rest = np.where(np.arange(len(mw)) == i, 0.0, mw)
        rows.append(_row(rest, proof(trials, rest), without=f"{s.machine}@{s.bus}"))
    finer = trials.refined()
    enough = next((m for m in MARGINS if not finer.lost(m * mw)), MARGINS[-1])
    rows.append(_row(trials.fleet(enough * mw), proof(finer, enough * mw), scale=enough, finer=True))
    for name, control in others.items():
        for margin in MARGINS:
            fleet = trials.fleet(margin * mw)
            row = _row(fleet, proof(trials, fleet, control), scale=margin, control=name)
            if margin == 1 or margin == MARGINS[-1] or not row.lost:
                rows.append(row)
            if not row.lost:
                break
    return tuple(rows)


def _row(mw: np.ndarray, found: Sequence[Critical], **what: Any) -> Evidence:
    return Evidence(float(mw.sum()), tuple(c.cycles for c in found), tuple(c.stable for c in found), **what)


def energies(trials: Trials, mw: np.ndarray) -> np.ndarray:
    """Energy (candidates, MWh) that every device has to hold: the widest swing of its store over all contingencies."""

    def swing(k: int) -> np.ndarray:
        return np.ptp(trials.run(mw, k).arrays.energy, axis=0)

    return np.max(trials.each(swing), axis=0)
