"""A run beside the reference: the same signals at the same instants."""

import gzip

import numpy as np

from stabctl.simulation import simulation
from stabctl.simulation.criterion import Criterion

SIGNALS = {  # signal -> file of the reference, its units as ours
    "speed": "speed_pu",
    "angle": "angle_rad",
    "terminal": "terminal_voltage_pu",
    "hv": "hv_voltage_pu",
    "Efd": "efd_pu",
    "Pm": "pmech_pu_machine",
    "Pe": "pelect_pu_100MVA",
}
EARLY = 1 / 960  # s   the reference's switchings act half of its step of 1/480 s early
KEEP_ON = Criterion(max_angle=np.inf, low_voltage_s=0.0)


def table(path):
    """Times and columns of one file of the reference."""
    with gzip.open(path, "rt") as file:
        data = np.genfromtxt(file, delimiter=",", skip_header=1)
    return data[:, 0], data[:, 1:]


def simulated(point, events, until, step=1 / 960, control=None):
    return simulation.run(point, events, until, control=control, step=step, criterion=KEEP_ON)


def signals(run):
    """Our signals, named as in SIGNALS."""
    net, case = run.point.net, run.point.case
    size = np.abs(run.arrays.V)
    return {
        "speed": run.arrays.speed,
        "angle": run.arrays.angle,
        "terminal": size[:, net.machine_bus],
        "hv": size[:, [net.place[m.storage_bus] for m in case.machines]],
        "Efd": run.arrays.Efd,
        "Pm": run.arrays.Pm,
        "Pe": run.arrays.P / case.base_mva,
    }


def differences(run, folder, name, switchings, until, agreed=None):
    """Signal -> largest difference from the reference up to `until` (s).

    Ours are interpolated between their rows, about 1 ms apart, at the instants of the reference. Signals that jump
    are left out within 1/100 s of a switching, where the two programs put the jump at different instants, and where
    `agreed` (a row of the reference each) is false.
    """
    found, ours = {}, signals(run)
    for signal, file in SIGNALS.items():
        t, theirs = table(folder / f"{name}__{file}.csv.gz")
        keep = t <= min(until, run.time[-1])
        if signal in ("terminal", "hv", "Efd", "Pe"):
            keep &= np.all([np.abs(t - s) > 0.01 for s in switchings], axis=0)
            keep &= True if agreed is None else agreed
        mine = np.stack([np.interp(t[keep], run.time, column) for column in ours[signal].T], 1)
        found[signal] = np.abs(mine - theirs[keep]).max()
    return found
