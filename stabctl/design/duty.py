"""What a run asks of the storage devices, and what it leaves behind."""

from typing import NamedTuple

import numpy as np

from stabctl.simulation.trajectory import Trajectory

ACTING = 0.02  # ratings   smaller orders count as none
LAST = 0.5  # s   over which the final voltage is averaged


class Duty(NamedTuple):
    """Energy, switching and side effects of the storage in one run.

    Attributes
    ----------
    energy_kwh
        Range of the energy of every device, summed.
    switchings
        Largest number of sign changes of an order within one swing of its machine: between two instants at which the
        speed of the machine rises above that of the others.
    coi_hz
        Largest deviation of the speed of the center of inertia.
    voltage
        Lowest bus voltage at the end, pu, of buses that were energized.
    """

    energy_kwh: float
    switchings: int
    coi_hz: float
    voltage: float


def duty(run: Trajectory) -> Duty:
    """The duty of the storage devices in a recorded run; zero energy and no switchings without devices."""
    a, case = run.arrays, run.point.case
    coi = case.frequency_hz * np.abs(a.coi_speed - a.coi_speed[0]).max()
    energy = 1e3 * float(np.ptp(a.energy, axis=0).sum())
    voltage = np.abs(a.V[run.time >= run.time[-1] - LAST]).mean(axis=0)
    return Duty(energy, _switchings(run), float(coi), float(voltage[np.abs(a.V[0]) > 0].min()))


def _switchings(run: Trajectory) -> int:
    a, H, names = run.arrays, run.point.inertia, run.point.rotor_names
    most = 0
    for j, device in enumerate(run.point.case.storage):
        called = run.point.case.machine(device.machine).called
        if called not in names:
            continue
        i = names.index(called)
        w = a.speed[:, i] - (a.speed @ H - a.speed[:, i] * H[i]) / (H.sum() - H[i])
        w = w - w[0]
        rises = np.flatnonzero((w[:-1] <= 0) & (w[1:] > 0)) + 1
        sign = np.sign(np.where(np.abs(a.order[:, j]) > ACTING, a.order[:, j], 0.0))
        acts = np.flatnonzero(sign)
        changes = acts[1:][sign[acts[1:]] != sign[acts[:-1]]]
        swings = np.histogram(changes, [0, *rises.tolist(), len(w)])[0]
        most = max(most, int(swings.max(initial=0)))
    return most
