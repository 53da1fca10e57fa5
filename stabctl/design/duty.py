"""Use of the storage devices in a contingency: energy, switching, and the state afterwards."""

from typing import Any, NamedTuple

import numpy as np

from stabctl.clearing.trial import Trial
from stabctl.dynamics import storage
from stabctl.simulation.control import acting
from stabctl.simulation.simulation import Simulation
from stabctl.simulation.trajectory import Trajectory

ACTING = 0.02  # ratings   smaller orders count as none
LAST = 0.5  # s   over which the final voltage is averaged
SAMPLED = 0.25  # s   between the energies of a long run
AFTER = 10.0  # s   watched after the devices have their energy back


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


class Later(NamedTuple):
    """The system and its devices long after a contingency.

    Attributes
    ----------
    stable
        Whether the system remained stable.
    energy_kwh
        Range of the energy of every device, summed.
    left_kwh
        How far the devices are from their initial energy at the end, summed.
    """

    stable: bool
    energy_kwh: float
    left_kwh: float


def later(trial: Trial, k: int, within_s: float) -> Later:
    """What is left some time after a contingency, cleared at the grid's point k; it is watched a little longer.

    Raises
    ------
    TypeError
        If the control of the trial needs what is called from outside at frames.
    """
    parts = acting(trial.control)
    if parts.pilots or parts.controllers:
        raise TypeError("only a law of the storage devices is watched for long")
    options: Any = {"step": trial.search.step, "criterion": trial.search.criterion, "record": False}
    simulation = Simulation(trial.point, trial.events(k), parts.law, **options)
    at = storage.places(trial.point.system, trial.point.case).energy
    end, kwh = trial.last_event(k) + within_s, trial.point.case.base_mva / 3.6
    found = [simulation.s[at] * kwh]
    while simulation.time < end - 1e-9 and simulation.advance(min(simulation.time + SAMPLED, end)):
        found.append(simulation.s[at] * kwh)
    simulation.advance(end + AFTER)
    left = np.abs(found[-1] - found[0]).sum()
    return Later(simulation.finish().outcome.stable, float(np.ptp(found, axis=0).sum()), float(left))


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
