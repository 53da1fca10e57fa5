"""Signals of controllers from the estimator: speeds and angles of rotors, relative to centers of inertia.

    y = rest + sum of own e(own) - sum of other e(remote),    e the slips, or the angles, extrapolated to the present

The centers are those of the machines in one island, as in `stabctl.simulation.center`. A machine's own estimates are
used for what its own controller reads of it; everything else is known as late as reports of other machines arrive.
"""

from collections.abc import Sequence

import numpy as np

from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.dynamics.signal_kinds import OUTPUTS
from stabctl.dynamics.signals import Signal, machines

from .coi import REACH, Deviations
from .estimators import Estimate

KINDS = ("speed", "deviation", "rest_speed", "coi_speed", "angle", "angle_deviation")


class RotorSignals:
    """Signals of rotors from estimates.

    Parameters
    ----------
    point : OperatingPoint
        The operating point.
    signals : sequence of (Signal, bool)
        The signals, and whether the controller that reads each belongs to its machine.
    inertia : (machines) array, s
        H on one base, as the estimator knows it.
    ages : pair of float, s
        Ages of a machine's own estimate and of those of others.
    """

    def __init__(
        self,
        point: OperatingPoint,
        signals: Sequence[tuple[Signal, bool]],
        inertia: np.ndarray,
        ages: tuple[float, float],
    ) -> None:
        numbers = [m.machine for m in point.case.machines]
        self._kinds = [s.kind for s, _ in signals]
        self._own = np.array([own for _, own in signals], bool)
        self._angular = np.array([kind in ("angle", "angle_deviation") for kind in self._kinds], bool)
        self._group = np.array([_members(s, numbers) for s, _ in signals], bool).reshape(len(signals), len(numbers))
        self._H, self._wb = inertia, 2 * np.pi * point.case.frequency_hz
        self._ages = tuple(min(age, REACH) for age in ages)
        self._zero = np.array([float(kind in ("speed", "rest_speed", "coi_speed")) for kind in self._kinds])
        self._weights: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}

    def __call__(self, k: int, estimates: Deviations, island: np.ndarray, rest: np.ndarray) -> np.ndarray:
        """Values (signals) in simulation k, with the islands (machines) there; those at rest where nothing is known."""
        key = island.tobytes()
        if key not in self._weights:
            self._weights[key] = self._shares(island)
        first, second = self._weights[key]
        near = first @ np.stack(self._states(k, estimates.own, self._ages[0]), 1)
        far = first @ (remote := np.stack(self._states(k, estimates.remote, self._ages[1]), 1)), second @ remote
        both = np.where(self._own[:, None], near, far[0]) - far[1]
        y = self._zero + np.where(self._angular, both[:, 1], both[:, 0])
        known = ~(self._group & ~estimates.usable[k]).any(axis=1)
        return np.where(known, y, rest)

    def _states(self, k: int, e: Estimate, age: float) -> tuple[np.ndarray, np.ndarray]:
        """Slips and angles (machines) of simulation k at the present, of estimates with slips at the present."""
        slip = e.slip[k]
        if e.angle is None:
            return slip, np.zeros(slip.shape)
        return slip, e.angle[k] + self._wb * age * (slip - e.acceleration[k] * age / 2)

    def _shares(self, island: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Weights (signals, machines) of what is added and of what is subtracted."""
        first, second = np.zeros((2, *self._group.shape))
        for i, (kind, group) in enumerate(zip(self._kinds, self._group, strict=True)):
            here = island >= 0
            if group.any():
                here = here & (island == island[group][0])
            own, others = _mean(self._H * (group & here)), _mean(self._H * (~group & here))
            others = others if others.any() else own
            whole = _mean(self._H * here)
            first[i], second[i] = {
                "speed": (own, 0 * own), "deviation": (own, others), "rest_speed": (others, 0 * own),
                "coi_speed": (whole, 0 * own), "angle": (own, whole), "angle_deviation": (own, others),
            }[kind]  # fmt: skip
        return first, second


def _members(signal: Signal, numbers: Sequence[int]) -> np.ndarray:
    """The machines of a signal."""
    of = machines(signal) if OUTPUTS[signal.kind].place in ("machine", "group") else ()
    return np.isin(numbers, of)


def _mean(H: np.ndarray) -> np.ndarray:
    """Shares of the inertia; zero if there is none."""
    total = H.sum()
    return np.asarray(H / total if total > 0 else H)
