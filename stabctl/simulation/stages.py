"""The stages of recorded Runge-Kutta steps, made once more: every signal at each of them, and which limits acted."""

from typing import NamedTuple

import numpy as np

from stabctl._util.errors import StudyError

from ._buffers import Run, buffers
from .method import STAGES
from .stepper import START, Cursor, replay
from .topology import Stage, stage
from .trajectory import Trajectory
from .wired import Wired, wired


class Stages(NamedTuple):
    """Steps on one network, each with its stages (`method.STAGES`)."""

    network: Stage
    first: int  # row of the trajectory at which the first step begins
    sizes: np.ndarray  # (steps) s
    signals: np.ndarray  # (steps, stages, signals)
    held: np.ndarray  # (steps, stages, limited states) whether a state is held at its limit
    clipped: np.ndarray  # (steps, stages, limited states) -1, 1: clipped to its lower or upper limit after the stage


def stages(trajectory: Trajectory) -> list[Stages]:
    """The stages of all steps of a recorded run, network by network.

    Orders are those recorded, whatever gave them. A step that was divided where the power of storage jumped is not
    made again as it was.

    Raises
    ------
    StudyError
        If the run was not recorded, a machine was disconnected, or the voltages of a stage are not found.
    """
    point, rows, time = trajectory.point, trajectory.rows, trajectory.time
    if len(rows) < 2 or np.isfinite(trajectory.happened.off_s).any():
        raise StudyError(
            f"The run of {point.case.name} has no derivatives, because it was not recorded or a machine was "
            "disconnected; give another contingency."
        )
    system = wired(point, None)
    starts = np.array([change.at for change in trajectory.happened.changes])
    network = np.searchsorted(starts, time[:-1] + 1e-9, side="right") - 1
    found = []
    for k in np.unique(network):
        mine = np.flatnonzero(network == k)  # consecutive
        now = stage(point, trajectory.happened.changes[k].switching)
        run = buffers(system.start, system.layout, system.places)
        sizes = np.diff(time)[mine]
        shape = len(mine), STAGES, len(system.places.limited)
        made = Stages(
            now, int(mine[0]), sizes, np.empty((len(mine), STAGES, len(run.s))), np.empty(shape), np.empty(shape)
        )
        _replay(system, now, run, rows[mine], made)
        found.append(made)
    return found


def constants(system: Wired, network: Stage, k: np.ndarray) -> np.ndarray:
    """The constants of all devices on a network; k are those of the intact one."""
    k = k.copy()
    for table, row, par in network.constants:
        at = system.constants_at(table) + row * len(par)
        k[at : at + len(par)] = par
    return k


def _replay(system: Wired, network: Stage, run: Run, rows: np.ndarray, made: Stages) -> None:
    p = system.program._replace(k=constants(system, network, system.program.k))
    again, at, rows, held = True, START, np.ascontiguousarray(rows), None
    while again:
        again, at = replay(
            p, system.places, network.net, run, made.sizes, rows, Cursor(*at), made.signals, made.held, made.clipped
        )
        if again:
            held = system.prepare_newton(p, system.places, network, run)
    del held  # until here
    if Cursor(*at).step < len(made.sizes):
        raise StudyError("The voltages of a stage were not found, so the run has no derivatives there.")
