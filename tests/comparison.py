"""A run beside the reference: the same signals at the same instants."""

from pathlib import Path

import numpy as np

from stabctl.simulation import simulation
from stabctl.simulation.criterion import Criterion

DATA = Path(__file__).parent / "reference" / "data"
EARLY = 1 / 960  # s   the reference's switchings act half of its step of 1/480 s early
KEEP_ON = Criterion(max_angle=np.inf, low_voltage_s=0.0)


def recorded(case, name):
    """Signal -> what the reference recorded of it, in our units, with the times `t`."""
    with np.load(DATA / case / f"{name}.npz", allow_pickle=False) as data:
        return {signal: data[signal].astype(float) for signal in data.files}


def simulated(point, events, until, step=1 / 960, control=None):
    return simulation.run(point, events, until, control=control, step=step, criterion=KEEP_ON)


def signals(run):
    """Our signals, named as those of the reference."""
    net, case = run.point.net, run.point.case
    size = np.abs(run.arrays.V)
    return {
        "speed": run.arrays.speed - 1,
        "angle": run.arrays.angle,
        "terminal": size[:, net.machine_bus],
        "hv": size[:, [net.place[m.storage_bus] for m in case.machines]],
        "Efd": run.arrays.Efd,
        "Pm": run.arrays.Pm,
        "Pe": run.arrays.P / case.base_mva,
    }


def differences(run, theirs, switchings, until, agreed=True):
    """Signal -> largest difference from the reference up to `until` (s).

    Ours are interpolated between their rows, about 1 ms apart, at the instants of the reference. Signals that jump
    are left out within 1/100 s of a switching, where the two programs put the jump at different instants, and where
    `agreed` (for every instant of the reference) is false.
    """
    found, t = {}, theirs["t"]
    for signal, ours in signals(run).items():
        keep = t <= min(until, run.time[-1])
        if signal in ("terminal", "hv", "Efd", "Pe"):
            keep &= np.all([np.abs(t - s) > 0.01 for s in switchings], axis=0)
            keep &= agreed
        mine = np.stack([np.interp(t[keep], run.time, column) for column in ours.T], 1)
        found[signal] = np.abs(mine - theirs[signal][keep]).max()
    return found
