"""How far beyond stability an unstable run was: its margin after the single-machine-equivalent (SIME) method."""

from typing import NamedTuple

import numpy as np

from stabctl.simulation.outcome import Kind
from stabctl.simulation.separation import ahead
from stabctl.simulation.trajectory import Trajectory


class Margin(NamedTuple):
    """Energies of the single-machine equivalent of an unstable run, pu s on the system base."""

    excess: float  # left where deceleration ends: minus the margin of SIME, zero in the critical run
    given: float  # its maximum since clearing


def margin(trajectory: Trajectory, cleared_s: float) -> Margin | None:
    """The margin of a recorded unstable run that was cleared at an instant (s).

    The machines fall into two groups at the widest gap between their angles at the end; each group is one machine in
    its center of inertia, and the two are one of M = M_S M_N / (M_S + M_N) with the difference w of their speeds. The
    excess is M w_u^2 / 2 at the last minimum of w, where the accelerating power turns positive again, or at the end
    where voltages collapse before that (Pavella, Ernst, Ruiz-Vega, "Transient Stability of Power Systems: A Unified
    Approach to Assessment and Control", 2000). A run that returned and was lost in a later swing has none. `None` of a
    run without deceleration, of one that left the frequency range, and of one in which a phase-locked loop or storage
    lost synchronism: they say nothing about the distance.
    """
    after = trajectory.time > cleared_s - 1e-9
    if trajectory.outcome.machine not in (None, *trajectory.point.rotor_names):  # a phase-locked loop, or storage
        return None
    if trajectory.outcome.kind is Kind.FREQUENCY_INSTABILITY or after.sum() < 3 or trajectory.arrays.angle.shape[1] < 2:
        return None
    w, M = _equivalent(trajectory)
    w = w[after]
    falling = np.flatnonzero(np.diff(w) <= 0)
    if not len(falling):
        return None
    at = falling[-1] + 1
    if at == len(w) - 1 and trajectory.outcome.kind is not Kind.VOLTAGE_COLLAPSE:
        return None
    if w[at] < 0:
        return None
    return Margin(M * w[at] ** 2 / 2, M * w[:at].max() ** 2 / 2)


def _equivalent(trajectory: Trajectory) -> tuple[np.ndarray, float]:
    """Speed (rows, pu) of the group of machines that is lost against the others, and inertia (s) of the equivalent."""
    H, numbers = trajectory.point.inertia, trajectory.point.rotor_names
    end = trajectory.arrays.angle[-1] - trajectory.arrays.angle[0]
    first = ahead(end)
    lost = next((i for i, number in enumerate(numbers) if number == trajectory.outcome.machine), np.argmax(end))
    share = np.where(first, H / H[first].sum(), -H / H[~first].sum())
    w = trajectory.arrays.speed @ share
    return (w if first[lost] else -w), float(2 * H[first].sum() * H[~first].sum() / H.sum())
