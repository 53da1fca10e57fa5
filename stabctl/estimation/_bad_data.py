"""Bad data: PMUs that disagree with all others through the network model are detected and identified.

Voltages V of the machines are compared with V', which the network model computes from the reports of all others. It is
exact through faults and swings, so that e = 1 - V'/V is only noise, whatever the machines do:

    e = G a + noise,   a_j = 1 - exp(-j phi_j) / (1 + m_j)

if the phasors of PMU j are turned by phi_j and scaled by 1 + m_j, exactly, with the columns g_j of G from the reports.
C is the covariance of the real and of the imaginary part of the noise. As for bad data in state estimation, the fewest
PMUs that explain e are sought. A set M of them explains

    T_M = b* A^-1 b,   b = G_M* C^-1 e,   A = G_M* C^-1 G_M,

of e* C^-1 e; for one PMU it is chi-square with two degrees of freedom if all PMUs are good. A set of two must explain
`LIMIT` more than one. Those PMUs are named that belong to every set within `CLEAR` of the best. PMUs with nearly
parallel columns explain the same, as those of two machines alone may: neither of them is named.

`suspects` names the PMUs that explain e, and those that explain its mean, exponential over `WINDOW`. The offsets of the
clocks are constant: their variance does not fall with the mean. A PMU that repeats the same phasor is bad, too.

A PMU that was left out is used again when its e has been normal for `RETURN`: no report repeated or beyond `LIMIT`, the
mean square and the square of the mean below `USUAL` and `CENTERED` times their variances (both are 2 on average).
"""

from typing import NamedTuple

import numpy as np

from stabctl.model.network import Switching

from ._network_model import AMPLIFIED, NetworkModel
from .pmu import Frame, Pmu

LIMIT = 40.0  # T of one PMU; the probability of more is exp(-20)
CLEAR = 16.0  # difference of T below which two explanations are alike
PARALLEL = 0.9  # squared correlation of two columns, from which on they are alike; up to 0.7 of neighbors in ieee39
WINDOW = 0.5  # s   of the mean
RETURN = 5.0  # s
USUAL, CENTERED = 4.0, 12.0
SAME = 3  # equal reports in a row


class Alarm(NamedTuple):
    """A PMU found to be bad, or right again."""

    seed: int
    machine: int | str
    time_s: float
    why: str
    left_out: bool = True

    def __str__(self) -> str:
        now = "left out" if self.left_out else "used again"
        return f"seed {self.seed}: the PMU of machine {self.machine} is {now} from {self.time_s:.3f} s on; {self.why}"


class Residuals(NamedTuple):
    """Residuals of some machines, and what is known of them."""

    of: np.ndarray  # rows of the machines with a residual, then of those with a PMU
    e: np.ndarray  # (n)
    white: np.ndarray  # (n, n)   covariance of the noise of the reports
    turns: np.ndarray  # (n, PMUs)   g_j in columns

    def mean(self, last: "Residuals | None", share: float) -> "Residuals":
        """Exponential mean with the `last` one; G and covariance are exact, also where the network changes."""
        if last is None or not np.array_equal(last.of, self.of):
            return self
        kept = 1 - share
        white = kept**2 * last.white + share**2 * self.white
        return Residuals(self.of, kept * last.e + share * self.e, white, kept * last.turns + share * self.turns)

    def suspects(self, clock: float) -> dict[int, float]:
        """Columns of the PMUs to blame, and the angles (rad) by which their phasors are turned.

        None if the residuals are normal, or if it is not clear which PMUs are bad. `clock` is the standard deviation
        (rad) of the constant offsets of the clocks.
        """
        C = self.white + clock**2 * self.turns @ self.turns.conj().T + 1e-12 * np.eye(len(self.e))
        weighted = np.linalg.solve(C, np.column_stack([self.e, self.turns]))
        if (self.e.conj() @ weighted[:, 0]).real <= LIMIT:
            return {}
        b, A = self.turns.conj().T @ weighted[:, 0], self.turns.conj().T @ weighted[:, 1:]
        power, square = np.maximum(A.diagonal().real, 1e-9), np.abs(b) ** 2
        i, j = np.triu_indices(len(b), 1)
        det = power[i] * power[j] - np.abs(A[i, j]) ** 2
        both = power[j] * square[i] - 2 * (b[i].conj() * A[i, j] * b[j]).real + power[i] * square[j]
        parallel = np.abs(A) ** 2 > PARALLEL * np.outer(power, power)
        one = (parallel * square / power).max(axis=1)
        two = np.divide(both, det, out=np.zeros(len(det)), where=~parallel[i, j] & (det > 0)) - LIMIT
        best = max(one.max(), two.max(initial=0.0))
        if best <= LIMIT:
            return {}
        sets: list[tuple[int, ...]] = [(int(m),) for m in np.flatnonzero(one > best - CLEAR)]
        sets += [(int(i[m]), int(j[m])) for m in np.flatnonzero(two > best - CLEAR)]
        widest = list(sets[-1])
        a = dict(zip(widest, np.linalg.solve(A[np.ix_(widest, widest)], b[widest]), strict=True))
        common = sorted(set.intersection(*map(set, sets)))
        return {column: -float(np.angle(1 - a[column])) for column in common}


class PmuCheck:
    """The check of all PMUs; arrays (seeds, machines)."""

    def __init__(self, network: NetworkModel, pmu: Pmu, frequency_hz: float, shape: tuple[int, int]) -> None:
        self.network, self._noise, self._rate = network, max(pmu.angle, pmu.magnitude), pmu.rate
        self._clock = 2 * np.pi * frequency_hz * pmu.clock
        self._share = 1 - np.exp(-1 / (WINDOW * pmu.rate))
        self._mean: list[Residuals | None] = [None] * shape[0]
        self._same = np.zeros(shape, int)
        self._return = np.zeros((4, *shape), complex)  # of PMUs left out: reports, sums of e, of |e|^2 and of variances
        self._last: np.ndarray | None = None

    def __call__(
        self, frame: Frame, others: np.ndarray, switching: list[Switching], used: np.ndarray
    ) -> list[tuple[int, int, str]]:
        """Seeds and rows of the machines whose PMUs are found bad with this frame, and why.

        Parameters
        ----------
        frame : Frame
            The reports.
        others : (seeds, others) array, pu
            Reported currents of storage devices and loads.
        switching : list of Switching
            What is open, faulted and tripped, for each seed.
        used : (seeds, machines) array of bool
            Machines whose reports are used.
        """
        known, found = frame.received & used, []
        before = np.full(frame.V.shape, np.nan) if self._last is None else self._last
        repeated = frame.received & (before == frame.V) & (self._noise > 0)
        self._same = np.where(frame.received, np.where(repeated, self._same + 1, 0), self._same)
        self._last = np.where(frame.received, frame.V, before)
        for k, now in enumerate(switching):
            stuck = np.flatnonzero((self._same[k] >= SAME) & known[k])
            if stuck.size:
                found += [(k, int(row), "it repeats the same phasors") for row in stuck]
                self.begin(k)
                continue
            fresh = known[k] & (self._same[k] == 0)
            found += self._turned(k, frame, others[k], switching=now, known=fresh, complete=(fresh == used[k]).all())
        return found

    def begin(self, k: int) -> None:
        """Forget the means of seed k: other PMUs are used from now on."""
        self._mean[k] = None

    def recovered(
        self, frame: Frame, others: np.ndarray, switching: list[Switching], *, used: np.ndarray, left_out: np.ndarray
    ) -> list[tuple[int, int]]:
        """Seeds and rows of machines whose PMUs, left out so far, have been right for `RETURN`; as in a call."""
        self._return[:, ~left_out] = 0
        waiting, found = left_out & frame.received, []
        for k in np.flatnonzero(waiting.any(-1)):
            known = frame.received[k] & used[k]
            computed = self.network.computed(frame.V[k], frame.I[k], others[k], switching=switching[k], known=known)
            if computed is None:
                continue
            places = np.flatnonzero(~known)
            for place, row in enumerate(places):
                parts = (np.abs(computed.V_parts[place]) ** 2).sum()
                if not waiting[k, row] or not parts < AMPLIFIED**2:
                    continue
                own = computed.V_parts[place] / frame.V[k, row]
                of_clocks, e = self._shared(own, len(known)), 1 - own.sum()
                white = self._noise**2 * (1 + (np.abs(own) ** 2).sum())
                normal = np.abs(e) ** 2 / (white + of_clocks)
                if self._same[k, row] or normal > LIMIT:
                    self._return[:, k, row] = 0
                    continue
                self._return[:, k, row] += 1, e, normal, white
                if self._settled(self._return[:, k, row], of_clocks):
                    found.append((int(k), int(row)))
                    self.begin(int(k))
        return found

    def _shared(self, parts: np.ndarray, machines: int) -> float:
        """Variance of e from the clocks: one clock turns voltage and current of a machine."""
        return float(self._clock**2 * (1 + (np.abs(parts[:machines] + parts[machines : 2 * machines]) ** 2).sum()))

    def _settled(self, sums: np.ndarray, of_clocks: float) -> bool:
        """Whether the reports of `RETURN` are normal; if they are not, all begins anew."""
        n, total, squares, white = sums[0].real, sums[1], sums[2].real, sums[3].real
        if n < RETURN * self._rate:
            return False
        right = squares < USUAL * n and np.abs(total / n) ** 2 < CENTERED * (white / n**2 + of_clocks)
        sums[:] = 0
        return bool(right)

    def _turned(
        self, k: int, frame: Frame, others: np.ndarray, *, switching: Switching, known: np.ndarray, complete: bool
    ) -> list[tuple[int, int, str]]:
        at, L = self.network.each_from_the_rest(switching, known)
        if not len(at):
            return []
        seen = self._residuals((at, np.flatnonzero(known)), L, frame.V[k], np.r_[frame.V[k], frame.I[k], others])
        found = seen.suspects(self._clock)
        if complete:  # the mean of all is over the same frames
            self._mean[k] = mean = seen.mean(self._mean[k], self._share)
            found = found or mean.suspects(self._clock)
        if found:
            self.begin(k)
        told = "its phasors are turned by {:.2f} degrees"
        return [(k, int(seen.of[len(at) + j]), told.format(np.rad2deg(turn))) for j, turn in found.items()]

    def _residuals(
        self, rows: tuple[np.ndarray, np.ndarray], L: np.ndarray, V: np.ndarray, reports: np.ndarray
    ) -> Residuals:
        """The residuals of the machines `rows[0]`, where those of `rows[1]` have a PMU."""
        (at, known), n = rows, len(V)
        parts = L * reports / V[at, None]
        errors = np.eye(len(reports))[at] - parts
        white = self._noise**2 * errors @ errors.conj().T
        return Residuals(np.concatenate(rows), 1 - parts.sum(-1), white, errors[:, known] + errors[:, n + known])
