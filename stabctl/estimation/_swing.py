"""The swing equation over a frame, governors, and the covariance of noise, missing reports and what is left out.

State of a machine: x = [delta (rad), s = omega - 1 (pu), Pm (pu machine), e, k (pu)]; input is the air-gap power P, and
a governor adds g to Pm:

    d delta/dt = wb s,   2H omega ds/dt = Pm + g - P - D s,   dPm/dt = white noise of density q,
    (e, k): the fluxes of `machine_model`, driven by the current I.

A classical machine has no omega in its swing equation.

Process noise over a frame T has five sources:
    walk   q * integral of h h', h(t) = [wb t^2/4H, t/2H, 1];
    power  (var P + (share (Pm - P))^2) * h h', h = [c, d, 0, 0, 0], c = wb T^2/4H, d = T/2H; share is the model error;
           the noise of a report acts in the frames before and after it, so that it counts in full;
    flux   var iq * h h', h = [0, 0, 0, response of e and k to iq over a frame];
    jump   P and iq jump by dP and di at an unknown instant since the last report, m frames ago. The share u of this
           time that is left is uniform: delta has moved by -c m^2 u^2 dP, s by -d m u dP, e and k by u times their
           response to di. Means -dP c/3 and -dP d/2 (the same as of a ramp), covariance r r' times that of
           (u^2, u, 0, u, u): var u^2 = 4/45, var u = cov(u, u^2) = 1/12;
    hidden what the power did between two reports beyond that jump.

A governor changes the mechanical power with the speed (`devices.governors.tgov`):

    clip(Pref - K s, Pmin, Pmax) - Pref -> 1/(1+sTs) (1+sT3)/(1+sTc) (1+sT4)/(1+sT5) -> g

Pref is what the filter knows as its state Pm; the power of the turbine is Pm + g.

The noise of the phasors moves the measured angle, power and current of a machine. V and I have independent errors of
standard deviation sa (rad) in angle and sm (relative) in magnitude. An error of E = V + Z I moves the measured rotor
angle arg E - theta, sin theta = omega psi''q/|E|, by Im(dE/E) + t Re(dE/E), t = tan theta. Its variance is

    R = sum over a = V/E, Z I/E of  sa^2 (Re a - t Im a)^2 + sm^2 (Im a + t Re a)^2,                (R)

and with V conj(I) = P + jQ (the losses in Re Z are neglected), and I exp(-j delta) = iq - j id,

    var P = 2 sm^2 P^2 + 2 sa^2 Q^2,   var iq = sm^2 iq^2 + sa^2 id^2.                              (P)

A machine without a report coasts with the power it reported last. The error sigma of this power is unknown, but not
small after a disturbance: it is taken to be the largest change at the machines that do report, and if the network was
switched, at least the whole power of the machine, electrical or mechanical. A constant error sigma moves angle and
speed by

    r = [r_d, r_s],   dr_s/dt = sigma / 2H,   dr_d/dt = wb r_s,

whose outer product r r', with the correlation of unknown instants (`UNKNOWN`), is added to the covariance while no
report arrives. The next report tells the power at both ends of the gap, but not what it did in between: it may have
jumped there and back if the gap is longer than `SHORTEST` and the network was switched, or have swung. Then this is
process noise. Beyond `LINEAR` the angle is too uncertain for an extended filter, and the fluxes, which the current has
moved, are not known: `UNSURE` is added to the covariance until they have decayed. A machine without a PMU that was not
observable across a switching is treated like this however short the gap, and its filter starts anew then, and again
when its fluxes have decayed.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from stabctl._util.jit import entry, inline
from stabctl.devices.blocks.lags import SHORT

REJECTED = 1 / 30  # s   for which the gate rejects reports before it accepts one
STATES = 5
JUMP = np.full((STATES, STATES), 1 / 12)
JUMP[0, 0], JUMP[2], JUMP[:, 2] = 4 / 45, 0, 0


class Swing(NamedTuple):
    """The swing equation over a frame: [delta, s, Pm] = F [delta, s, Pm] + B u, u = [P0, m dP, m^2 dP]."""

    F: np.ndarray  # (machines, 3, 3)
    B: np.ndarray  # (machines, 3, 3)
    walk: np.ndarray  # (machines, 5, 5)   covariance of the random walk
    c: np.ndarray  # (machines) rad/pu   change of the angle per unit of power in a frame
    d: np.ndarray  # (machines)          change of the speed
    reset: np.ndarray  # (machines, 5)   variances added per square of the innovation that the gate accepts at last


def swing(
    H: np.ndarray, D: np.ndarray, *, hz: float, T: float, walk: float, flux: np.ndarray, with_power: bool = True
) -> Swing:
    """The swing equation over a frame; exact except for D T/2H in B.

    When the gate accepts an innovation y after its `rejections`, y may come from an error of the angle, of the
    flux, or of the speed (without measured power, of the acceleration): each gets the variance that explains y alone.

    Parameters
    ----------
    H, D : (machines,) array, s and pu
        Inertia constant and damping.
    hz, T : float
        Frequency (Hz) and length of a frame (s).
    walk : float
        Density of the random walk, pu/s^0.5.
    flux : (machines,) array
        1 of machines with q-axis fluxes, else 0.
    with_power : bool
        The measured power is an input; without it the model is that of a constant acceleration.
    """
    wb, n = 2 * np.pi * hz, len(H)
    a, b, one = wb / (2 * H), 1 / (2 * H), np.ones(n)
    A, B, Q = np.zeros((3, n, 3, 3))
    A[:, 0, 1], A[:, 1, 1], A[:, 1, 2] = wb, -D * b, b
    c, d = a * T**2 / 2, b * T
    B[:, 0, 0], B[:, 0, 2], B[:, 1, 0], B[:, 1, 1] = -c, -c / 3, -d, -d / 2
    upper = a * a * T**5 / 20, a * b * T**4 / 8, a * T**3 / 6, b * b * T**3 / 3, b * T**2 / 2, one * T
    for i, j, values in zip(*np.triu_indices(3), upper, strict=True):
        Q[:, i, j] = Q[:, j, i] = values
    since = (rejections(T) + 1) * T
    acceleration = 0 * one if with_power else one / (a * since**2)
    reset = np.stack([one, one / (wb * since), acceleration, flux, flux], -1) ** 2
    return Swing(expm(A * T), B, np.pad(walk**2 * Q, ((0, 0), (0, 2), (0, 2))), c, d, reset)


def rejections(T: float) -> int:
    """Reports in a row that the gate rejects before it accepts one, with frames of the length T (s)."""
    return int(REJECTED / T + 1e-9)


@inline
def process_covariance(k, i, model, Q, jump, frames, power, flux, noise, hidden):
    """Write the process covariance of machine i and seed k into Q (seeds, machines, 5, 5).

    Parameters
    ----------
    k, i : int
        Seed and machine.
    model : Swing
        The model, or any record with its c, d and walk.
    Q : (seeds, machines, 5, 5) array
        The result.
    jump, frames : float
        Jump of the power, and frames since it was last known.
    power : float
        Variance of the power over the frame.
    flux, noise : (2) tuple, pu
        Response of e and k to the jump of iq, and to its standard deviation over the frame.
    hidden : (5) tuple, rad and pu
        Standard deviations of the states from what the power did between reports (`MissingReports`).
    """
    c, d, late, size = model.c[i], model.d[i], frames * jump, sqrt(power)
    moved = -c * late * frames, -d * late, 0.0, flux[0], flux[1]
    blurred = c * size, d * size, 0.0, noise[0], noise[1]
    for a in range(STATES):
        for b in range(STATES):
            Q[k, i, a, b] = model.walk[i, a, b] + JUMP[a, b] * moved[a] * moved[b]
            if (a < 3) == (b < 3):  # the noises of power and current are independent
                Q[k, i, a, b] += blurred[a] * blurred[b]
            Q[k, i, a, b] += UNKNOWN[a, b] * hidden[a] * hidden[b]


GOVERNOR = ("K", "Ts", "Tc", "T3", "T4", "T5", "Pmax", "Pmin")


class Governors:
    """The governors of all machines, advanced a frame of the length T at a time; K = 0 without one.

    Parameters
    ----------
    constants : dict of (machines,) arrays
        `GOVERNOR`, as in the table `tgov`.
    T : float, s
        Length of a frame.
    """

    def __init__(self, constants: dict[str, np.ndarray], T: float) -> None:
        self.at = np.flatnonzero(constants["K"] > 0)
        c = {name: constants[name][self.at] for name in GOVERNOR}
        self._droop, n = np.stack([c["K"], c["Pmin"], c["Pmax"]]), len(self.at)
        whole = np.zeros((n, 4, 4))  # states and demand
        signal = np.tile([0.0, 0.0, 0.0, 1.0], (n, 1))  # as a row over states and demand
        for row, (lead, lag) in enumerate(((0 * c["Ts"], c["Ts"]), (c["T3"], c["Tc"]), (c["T4"], c["T5"]))):
            acts = (lag >= SHORT)[:, None]
            lag, own = np.maximum(lag, SHORT)[:, None], np.eye(4)[row]
            whole[:, row] = acts * (signal - own) / lag
            signal = np.where(acts, own + lead[:, None] / lag * (signal - own), signal)
        self._A, self._C = expm(whole * T) if n else whole, signal
        self.x: np.ndarray | None = None

    def step(self, slip: np.ndarray, reference: np.ndarray) -> np.ndarray:
        """Advance a frame with this speed (pu) and reference (pu machine); g at its end (seeds, machines)."""
        out = np.zeros(slip.shape)
        if self.x is None:
            self.x = np.zeros((len(slip), len(self.at), 4))
        govern(slip, reference, self.at, self._droop, self._A, self._C, self.x, out)
        return out


@entry
def govern(slip, reference, at, droop, A, C, x, out):
    """Advance the states and demands x (seeds, governors, 4) a frame; g at its end is written into `out`."""
    for k in range(slip.shape[0]):
        for j in range(at.shape[0]):
            i = at[j]
            low, high = min(droop[1, j] - reference[k, i], 0.0), max(droop[2, j] - reference[k, i], 0.0)
            x[k, j, 3] = min(max(-droop[0, j] * slip[k, i], low), high)
            before = x[k, j, 0], x[k, j, 1], x[k, j, 2], x[k, j, 3]
            g = C[j, 3] * x[k, j, 3]
            for a in range(3):
                x[k, j, a] = 0.0
                for b in range(4):
                    x[k, j, a] += A[j, a, b] * before[b]
                g += C[j, a] * x[k, j, a]
            out[k, i] = g


class Tuning(NamedTuple):
    """Assumptions beyond the noise of the phasors."""

    walk: float = 0.005  # pu/s^0.5   of the power reference of a machine
    share: float = 0.01  # -          error of the model, as a share of the accelerating power
    jerk: float = 0.05  # pu/s/s^0.5 of the acceleration, kinematic model


TUNING = Tuning()


@inline
def angle_variance(V, ZI, E, turn, angle, magnitude):
    """(R): variance (rad^2) of arg E - turn; standard deviations of angle (rad) and magnitude (-)."""
    tilt = (1 + 1j * np.tan(turn)) / E  # Re a - t Im a and Im a + t Re a are the parts of a (1 + j t)
    v, i = V * tilt, ZI * tilt
    return angle**2 * (v.real**2 + i.real**2) + magnitude**2 * (v.imag**2 + i.imag**2)


def computed_angle_variance(
    V: np.ndarray, I: np.ndarray, Z: np.ndarray, tilt: np.ndarray, *, angle: float, magnitude: float
) -> np.ndarray:
    """(R) where E = V + Z I is a sum of reports, over all parts V, I (..., reports); tilt = (1 + j t)/E."""
    a = (V + Z[..., None] * I) * tilt[..., None]
    return angle**2 * (a.real**2).sum(-1) + magnitude**2 * (a.imag**2).sum(-1)


def computed_power_variance(
    V: np.ndarray, I: np.ndarray, phasors: tuple[np.ndarray, np.ndarray], *, angle: float, magnitude: float
) -> np.ndarray:
    """(P) where V and I, the phasors, are sums of reports with these parts (..., reports)."""
    S = V * phasors[1].conj()[..., None] + phasors[0].conj()[..., None] * I
    return magnitude**2 * (S.real**2).sum(-1) + angle**2 * (S.imag**2).sum(-1)


def computed_current_variance(I: np.ndarray, *, angle: float, magnitude: float) -> np.ndarray:
    """Variance of a part of a current that is a sum of reports (..., reports), whatever the frame."""
    return max(angle, magnitude) ** 2 * (np.abs(I) ** 2).sum(-1)


@inline
def power_variance(S, angle, magnitude):
    """(P): variance of the power at the terminals, S = V conj(I), in its units squared."""
    return 2 * magnitude**2 * S.real**2 + 2 * angle**2 * S.imag**2


@inline
def current_variance(I, angle, magnitude):
    """(P): variance of iq, the real part of a current in the frame of the rotor, in its units squared."""
    return magnitude**2 * I.real**2 + angle**2 * I.imag**2


SHORTEST = 0.05 - 1e-9  # s   no fault is cleared faster: two jumps are at least that far apart
SWINGING = 0.1  # s   gap in which the power deviates from a ramp by as much as sigma, without a switching
LINEAR = 0.3  # rad   standard deviation of an angle up to which the equations are linear
RECOVERY = 2.0  # s
UNSURE = np.diag([LINEAR, 4e-3]) ** 2  # rad^2, pu^2   variances of angle and speed of a filter that may be wrong
UNKNOWN = np.eye(5)  # correlation of the states, of angle and speed and of the fluxes
UNKNOWN[0, 1] = UNKNOWN[1, 0] = np.sqrt(3) / 2
UNKNOWN[3, 4] = UNKNOWN[4, 3] = 1 / 2


class MissingReports:
    """Errors of power, angle and speed (standard deviations) that the reports leave open, arrays (seeds, machines).

    Parameters
    ----------
    P : (seeds, machines) array, pu machine
        Powers at the start.
    c, d : (machines,) array
        Changes of angle (rad) and speed (pu) per unit of power in a frame.
    wb, T : float
        Rated angular frequency (rad/s) and length of a frame (s).
    """

    def __init__(self, P: np.ndarray, c: np.ndarray, d: np.ndarray, *, wb: float, T: float) -> None:
        self._before, self._c, self._d, self._turn, self._T = np.repeat(P[:, None, :], P.shape[1], 1), c, d, wb * T, T
        self.power = np.zeros(P.shape)
        self.blind = np.zeros(P.shape, bool)  # filters of machines without a PMU that start anew
        self.moved, self._switched = np.zeros((*P.shape, 2)), np.zeros(P.shape, bool)  # r while no report arrives
        self.lost = np.zeros(P.shape, int)  # frames for which a filter is still not to be trusted
        self.hidden = np.zeros((*P.shape, 3))  # r, and the current (pu), that the report of this frame leaves open

    def step(
        self,
        here: np.ndarray,
        missing: np.ndarray,
        switched: np.ndarray,
        computed: np.ndarray,
        *,
        whole: np.ndarray,
        before: np.ndarray,
        now: np.ndarray,
        variance: np.ndarray,
    ) -> None:
        """Advance a frame.

        Parameters
        ----------
        here : (seeds, machines) array of bool
            Machines with a report.
        missing : (seeds, machines) array
            Frames without a report up to the last one.
        switched : (seeds, 1) array of bool
            Whether the network was switched since the last frame.
        computed : (seeds, machines) array of bool
            Machines whose report follows from those of others.
        whole : (seeds, machines) array
            What a switching may change the power by.
        before, now, variance : (seeds, machines) array
            Powers as last reported and in this frame, and their variance.
        """
        self._switched |= switched
        self.blind = here & computed & (self.lost == 1)  # at the end the fluxes are at rest: the filter begins again
        self.lost = np.maximum(self.lost - 1, 0)
        if here.all() and not missing.any() and self._T < SHORTEST:
            self._switched[:], self.hidden[:] = False, 0.0
            return
        first = missing == 0
        self._before = np.where(first[..., None], before[:, None, :], self._before)
        moved = ((now[:, None, :] - self._before) ** 2 - 2 * variance[:, None, :]) * here[:, None, :]
        sigma = np.sqrt(np.maximum(moved.max(-1), 0.0))
        sigma = np.where(self._switched, np.maximum(sigma, whole), sigma)
        r = self.moved
        r = np.stack([r[..., 0] + self._turn * r[..., 1] + self._c * sigma, r[..., 1] + self._d * sigma], -1)
        gap = (missing + 1) * self._T
        share = np.where(self._switched & (gap > SHORTEST), 1.0, np.minimum(gap / SWINGING, 1.0) * ~first)
        self.hidden = np.where(here, share, 0.0)[..., None] * np.concatenate([r, sigma[..., None]], -1)
        self.moved = np.where(here[..., None], 0.0, r)
        found = here & computed & self._switched & ~first & (gap > SHORTEST)
        self.blind |= found
        self.lost[found | (self.hidden[..., 0] > LINEAR)] = round(RECOVERY / self._T)
        self.power = np.where(here, 0.0, sigma)
        self._switched &= ~here
