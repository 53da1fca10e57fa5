"""Signals that controllers read behind an estimator: measured by PMUs, estimated, relative to centers of inertia.

The speed of a machine relative to the center of inertia (COI) of the others comes from estimates of different ages:

    w_i = s_i(own age) - sum_{j != i} H_j s_j(remote age) / sum_{j != i} H_j,   over the machines of its island, or 0

Every speed is extrapolated to the present with its acceleration, s + a t, t its age but at most `REACH`. The variance
has what longer ages leave out, and the change of the acceleration since then, as the own one shows it. A machine
without a report stays in both sums, with a growing variance. A speed that differs from most others by more than a swing
does counts as unknown.

Where the network was switched after the time stamp of an estimate, the acceleration has changed since then by an
unknown share of |P|/2H, and the speed by this times the time since the switching: the whole of it for the own estimate
and for machines without a PMU, `SHARED` of it for those of the others, which change together.

Controllers read speeds and angles of rotors, relative to the centers of the machines in one island, as in
`stabctl.simulation.center`:

    y = rest + sum of own e(own) - sum of other e(remote),    e the slips, or the angles, extrapolated to the present

A machine's own estimates are used for what its own controller reads of it; everything else is known as late as reports
of other machines arrive.

They also read magnitudes, angles, frequencies and powers from PMUs at buses, lines and terminals. A lost report leaves
the last one. Reports arrive at once where the controller belongs to the machine at that place, and with the latency of
the PMUs otherwise.
"""

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from stabctl.dynamics import outputs
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.dynamics.signals import OUTPUTS, Signal, machines
from stabctl.model.location import Place, circuit
from stabctl.model.network import INTACT, Switching
from stabctl.simulation.simulation import Simulation

from .estimators import Estimate
from .pmu import Frame, Instrument, Pmu

ROTOR_KINDS = ("speed", "deviation", "rest_speed", "coi_speed", "angle", "angle_deviation")
OF_MACHINE = ("pe", "qe", "vt")
PHASOR_KINDS = ("voltage", "bus_angle", "bus_frequency", "flow", "flow_q", *OF_MACHINE)
STREAM = 3  # of the random numbers of a seed
REACH = 0.1  # s   longest extrapolation
COAST = 0.5  # s   time without a report after which the storage of a machine stays idle
ENOUGH = 0.7  # -   share of the island's inertia that must have reported by then, otherwise the storage stays idle
SHARED = 0.4  # -   of a change of a machine's acceleration that others make too, before it is reported
LIMIT = 3e-3  # pu   standard deviation of a deviation, beyond which it is not usable (180 mHz at 60 Hz)
PLAUSIBLE = 0.05  # pu   difference of a speed from most others, beyond which its filter has lost the rotor
LOST = 1.0  # pu^2   variance of such a speed
LEAST = 3e-4  # pu   standard deviation of the speeds of machines about that of the COI, at least


class Deviations(NamedTuple):
    """Machines relative to the COI of the others, arrays (seeds, machines)."""

    speed: np.ndarray  # pu
    acceleration: np.ndarray  # pu/s
    sigma: np.ndarray  # pu   standard deviation of the speed
    usable: np.ndarray  # bool   own estimate valid, and of enough of the island; sigma below `LIMIT` or the deviation
    own: Estimate  # as the machines know it, with slips and their variance extrapolated to the present
    remote: Estimate  # as others know it, the same


class CoiReference:
    """The COI of the other machines, from estimates that arrive late.

    Parameters
    ----------
    inertia : (machines,) array, s
        H on one base.
    rate : int, 1/s
        Frames per second.
    own, remote : int, frames
        Ages of a machine's own estimate and of those of the others.
    """

    def __init__(self, inertia: np.ndarray, rate: int, own: int, remote: int) -> None:
        self.H, self.T, self.own, self.remote = inertia, 1 / rate, own, remote
        self._past: deque[tuple[Estimate, np.ndarray]] = deque(maxlen=remote - own + 1)
        self._silent: np.ndarray | None = None

    def step(
        self, now: Estimate, island: np.ndarray, without: np.ndarray | None = None, since: np.ndarray | None = None
    ) -> Deviations:
        """The deviations at the instant of the frame.

        Parameters
        ----------
        now : Estimate
            The estimates of this frame.
        island : (seeds, machines) array
            Numbers of islands, -1 for tripped machines.
        without : (seeds, machines) array of bool, optional
            Machines without a PMU: what they know of themselves comes from the others, and as late as that.
        since : (seeds, 1) array, optional
            Frames since the network was switched.
        """
        silent = np.zeros(now.slip.shape) if self._silent is None else self._silent
        self._silent = silent = np.where(now.received, 0.0, silent + self.T)
        if np.ptp(now.slip) > PLAUSIBLE:
            lost = (island >= 0) & (np.abs(now.slip - np.median(now.slip, axis=1, keepdims=True)) > PLAUSIBLE)
            now = now._replace(variance=np.where(lost, LOST, now.variance))
            silent = np.where(lost, np.maximum(silent, 2 * self.T), silent)
        whole, sure = island.max(initial=0) == 0 and island.min(initial=0) == 0, now.variance < LIMIT**2
        if (silent > 1.5 * self.T).any():
            now = self._together(now, silent, island)
        valid = silent <= COAST + 1e-9
        self._past.append((now, valid))
        remote, remote_valid = self._past[0]
        jumped = np.zeros(now.slip.shape)  # change of the acceleration, which the others may have done too
        for e, _ in self._past:
            jumped = np.maximum(jumped, (e.acceleration - remote.acceleration) ** 2)
        own, far = self._extrapolated(now, self.own), self._extrapolated(remote, self.remote)
        unseen, together = self._unseen(now, self.own, since), self._unseen(remote, self.remote, since) * SHARED
        short, late = (max(age * self.T - REACH, 0.0) for age in (self.own, self.remote))
        (s, a, var), (rs, ra, rvar), left = own[:3], far[:3], short * own.acceleration
        if without is not None and without.any():
            s, a, var, left = np.where(without, (rs, ra, rvar, late * ra), (s, a, var, left))
            unseen = np.where(without, together / SHARED, unseen)
            together = np.where(without, unseen, together)
        H = self.H if whole else self.H * (island >= 0)
        shares = np.empty((6, *rs.shape))
        shares[0], shares[1], shares[2], shares[3] = H * remote_valid, H, H * rs, H * ra
        shares[4], shares[5] = H * H * rvar, H * together
        reporting, *sums = _others(shares, island, whole)
        alone = sums[0] == 0
        weight = np.where(alone, 1.0, sums[0])
        usable = valid & (island >= 0) & (reporting > 0) & (reporting + self.H >= ENOUGH * (sums[0] + self.H))
        jumped *= (SHARED * (self.remote - self.own) * self.T) ** 2
        left = left - late * sums[2] / weight
        sigma = np.sqrt(var + unseen**2 + left**2 + (sums[3] + sums[4] ** 2) / weight**2 + jumped)
        speed = np.where(alone, 0.0, s - sums[1] / weight)
        usable &= sure & (sigma < np.maximum(LIMIT, np.abs(speed)))
        return Deviations(speed, np.where(alone, 0.0, a - sums[2] / weight), sigma, usable, own, far)

    def _together(self, e: Estimate, silent: np.ndarray, island: np.ndarray) -> Estimate:
        """A silent machine stays in synchronism: its speed is near that of the COI, as near as those of the others are.

        This prior and the estimate are weighted by their inverse variances.
        """
        H = self.H * (silent < self.T) * (island >= 0)
        total, first, second = (_others(w, island, False) for w in (H, H * e.slip, H * e.slip**2))
        weight = np.where(total > 0, total, 1.0)
        mean = first / weight
        spread = np.maximum(second / weight - mean**2, LEAST**2)
        gain = np.where((silent > 1.5 * self.T) & (total > 0), e.variance / (e.variance + spread), 0.0)
        slip = e.slip + gain * (mean - e.slip)
        return e._replace(slip=slip, acceleration=(1 - gain) * e.acceleration, variance=(1 - gain) * e.variance)

    def _extrapolated(self, e: Estimate, age: int) -> Estimate:
        """Slip, at most `REACH` later, and its variance `age` frames later."""
        since = age * self.T
        slip = e.slip + min(since, REACH) * e.acceleration
        return e._replace(slip=slip, variance=e.variance + since**2 * e.drift) if age else e

    def _unseen(self, e: Estimate, age: int, since: np.ndarray | None) -> np.ndarray:
        """Change of the speed if the power is lost with the switching, `since` (seeds, 1) frames ago, unseen so far."""
        if since is None or since.min() >= age:
            return np.zeros(e.slip.shape)
        return np.where(since < age, (since + 1) * self.T, 0.0) * e.whole + np.zeros(e.slip.shape)


def _others(weight: np.ndarray, island: np.ndarray, whole: bool) -> np.ndarray:
    """Sum (..., seeds, machines) of the weights of the other machines in every machine's island.

    The own weight is left out, not subtracted: that of an infinite bus is larger than the others by 16 digits.
    """
    others = 1.0 - np.eye(weight.shape[-1])
    if whole:
        return np.asarray(weight @ others)
    same = (island[:, :, None] == island[:, None, :]) & (island >= 0)[:, None, :]
    return ((same * others) @ weight[..., None])[..., 0]


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
    leaders : sequence of int, optional
        Rows of the machines whose islands are meant; by default the first of each group. While one is off, it is the
        first of the group that is on.
    """

    def __init__(
        self,
        point: OperatingPoint,
        signals: Sequence[tuple[Signal, bool]],
        inertia: np.ndarray,
        ages: tuple[float, float],
        leaders: Sequence[int] | None = None,
    ) -> None:
        numbers = [m.machine for m in point.case.machines]
        self._kinds = [s.kind for s, _ in signals]
        self._own = np.array([own for _, own in signals], bool)
        self._angular = np.array([kind in ("angle", "angle_deviation") for kind in self._kinds], bool)
        self._group = np.array([_members(s, numbers) for s, _ in signals], bool).reshape(len(signals), len(numbers))
        self._leaders = self._group.argmax(axis=1) if leaders is None else leaders
        self._H, self._wb = inertia, 2 * np.pi * point.case.frequency_hz
        self._ages = tuple(min(age, REACH) for age in ages)
        self._zero = np.array([float(kind in ("speed", "rest_speed", "coi_speed")) for kind in self._kinds])
        self._weights: dict[bytes, tuple[np.ndarray, np.ndarray, np.ndarray]] = {}

    def __call__(self, k: int, estimates: Deviations, island: np.ndarray, rest: np.ndarray) -> np.ndarray:
        """Values (signals) in simulation k, with the islands (machines) there; those at rest where nothing is known."""
        both, known = self.relative(k, estimates, island, 0.0)
        return np.where(known, self._zero + np.where(self._angular, both[:, 1], both[:, 0]), rest)

    def relative(
        self, k: int, estimates: Deviations, island: np.ndarray, start: np.ndarray | float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Slips, angles less those of the start (machines), and accelerations (signals, 3), and which are known."""
        key = island.tobytes()
        if key not in self._weights:
            self._weights[key] = self._shares(island)
        first, second, read = self._weights[key]
        own, remote = estimates.own, estimates.remote
        near, far = (self._states(k, e, age, start) for e, age in zip((own, remote), self._ages, strict=True))
        both = np.where(self._own[:, None], first @ near, first @ far) - second @ far
        return both, ~(read & ~estimates.usable[k]).any(axis=1)

    def _states(self, k: int, e: Estimate, age: float, start: np.ndarray | float) -> np.ndarray:
        """The same of all machines (machines, 3) at the present, of estimates with slips at the present."""
        slip, rate, angle = e.slip[k], e.acceleration[k], 0 * e.slip[k]
        if e.angle is not None:
            angle = e.angle[k] + self._wb * age * (slip - rate * age / 2) - start
        return np.stack([slip, angle, rate], 1)

    def _shares(self, island: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Weights (signals, machines) of what is added and of what is subtracted, and the machines of the groups.

        A machine that is off, or in another island than the one that is meant, is not read.
        """
        first, second = np.zeros((2, *self._group.shape))
        read = self._group.copy()
        for i, (kind, group, leader) in enumerate(zip(self._kinds, self._group, self._leaders, strict=True)):
            here = island >= 0
            if (group & here).any():
                here = here & (island == (island[leader] if here[leader] else island[group & here][0]))
                read[i] = group & here
            own, others = _mean(self._H * (group & here)), _mean(self._H * (~group & here))
            others = others if others.any() else own
            whole = _mean(self._H * here)
            first[i], second[i] = {
                "speed": (own, 0 * own), "deviation": (own, others), "rest_speed": (others, 0 * own),
                "coi_speed": (whole, 0 * own), "angle": (own, whole), "angle_deviation": (own, others),
            }[kind]  # fmt: skip
        return first, second, read


def _members(signal: Signal, numbers: Sequence[int]) -> np.ndarray:
    """The machines of a signal."""
    of = machines(signal) if OUTPUTS[signal.kind].place in ("machine", "group") else ()
    return np.isin(numbers, of)


def _mean(H: np.ndarray) -> np.ndarray:
    """Shares of the inertia; zero if there is none."""
    total = H.sum()
    return np.asarray(H / total if total > 0 else H)


class PhasorSignals:
    """Signals from PMUs in simulations of one operating point, each with the errors of its seed.

    Parameters
    ----------
    simulations : sequence of Simulation
        The simulations.
    signals : sequence of (Signal, bool)
        The signals, and whether the controller that reads each belongs to the machine there.
    pmu : Pmu
        The PMUs.
    seeds : sequence of int
        Seeds of noise and losses.
    """

    def __init__(
        self, simulations: Sequence[Simulation], signals: Sequence[tuple[Signal, bool]], pmu: Pmu, seeds: Sequence[int]
    ) -> None:
        point = simulations[0].point
        hz, numbers = point.case.frequency_hz, [m.machine for m in point.case.machines]
        self.simulations, self._point = simulations, point
        self._signals = [s for s, _ in signals]
        self._kinds = np.array([s.kind for s in self._signals])
        self._late = np.array([not own for _, own in signals], bool)
        near = [s.kind == "bus_angle" and outputs.near(point, s.number) for s in self._signals]
        self._near = np.array([np.broadcast_to(one, len(numbers)) for one in near], float).T
        self._row = np.array([numbers.index(s.number) if s.kind in OF_MACHINE else -1 for s in self._signals], int)
        self._share = np.array([1.0 if i < 0 else point.case.base_mva / point.case.machines[i].base for i in self._row])
        self._instrument = Instrument(pmu, [[seed, STREAM] for seed in seeds], len(signals), hz)
        self._past: deque[_Report] = deque(maxlen=pmu.remote_frames(hz) - pmu.own_frames(hz) + 1)
        self._ends: dict[Switching, tuple[np.ndarray, np.ndarray]] = {}

    def frame(self, at: float, V: np.ndarray, machines: Frame, angle: np.ndarray, inertia: np.ndarray) -> None:
        """Reports at an instant (s) with bus voltages (seeds, buses), those of the machines, their angles and inertia.

        An angle is that from the COI of the machines which were in the island of its bus at rest.
        """
        true = [self._true(v, s.switching) for v, s in zip(V, self.simulations, strict=True)]
        volts, currents = (np.array(columns) for columns in zip(*true, strict=True))
        seen = self._instrument.report(at, volts, currents, np.zeros(volts.shape))
        here = self._row >= 0
        U, I, received = (
            np.where(here, own[:, self._row], other)
            for own, other in ((machines.V, seen.V), (machines.I, seen.I), (machines.received, seen.received))
        )
        coi = (inertia * angle) @ self._near / np.maximum(inertia @ self._near, 1e-300)
        new = _Report(U, I, seen.frequency, coi)
        if self._past:
            last = self._past[-1]
            new = _Report(*(np.where(received, now, old) for now, old in zip(new, last, strict=True)))
        self._past.append(new)

    def __call__(self, k: int) -> np.ndarray:
        """Values (signals) in simulation k."""
        now, late = self._past[-1], self._past[0]
        V, I, frequency, coi = (np.where(self._late, b[k], a[k]) for a, b in zip(now, late, strict=True))
        power = V * I.conjugate() * self._share
        turned = np.angle(V * np.exp(-1j * coi))
        values = {
            "voltage": np.abs(V), "vt": np.abs(V), "bus_angle": turned, "bus_frequency": 1 + frequency,
            "flow": power.real, "pe": power.real, "flow_q": power.imag, "qe": power.imag,
        }  # fmt: skip
        return np.array([values[kind][i] for i, kind in enumerate(self._kinds)])

    def _true(self, V: np.ndarray, switching: Switching) -> tuple[np.ndarray, np.ndarray]:
        """Voltages and currents (signals) where the PMUs are."""
        if switching not in self._ends:
            self._ends[switching] = self._wiring(dict(switching.branches))
        buses, Y = self._ends[switching]
        ends = V[buses]
        return ends[:, 0], (Y * ends).sum(axis=1)

    def _wiring(self, states: dict) -> tuple[np.ndarray, np.ndarray]:
        """Buses (signals, 2) whose voltages matter, and admittances (signals, 2) from these to the current."""
        buses, Y = np.zeros((len(self._signals), 2), int), np.zeros((len(self._signals), 2), complex)
        place = self._point.net.place
        for i, signal in enumerate(self._signals):
            if signal.kind in ("flow", "flow_q"):
                assert isinstance(signal.place, Place)
                row, _ = circuit(self._point.case, signal.place)
                at, p = outputs.line(self._point, signal.place, states.get(row, INTACT))
                buses[i], Y[i] = at[::2] // 2, (complex(p.g, p.b), complex(p.gm, p.bm))
            elif signal.kind not in OF_MACHINE:
                buses[i] = place[signal.number]
        return buses, Y


class _Report(NamedTuple):
    """The last phasors and frequencies (seeds, signals), and the angles of the COI that were estimated then."""

    V: np.ndarray
    I: np.ndarray
    frequency: np.ndarray
    coi: np.ndarray
