"""What the reports of PMUs leave open: the noise of measured angles, powers and currents, and missing reports.

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

whose outer product r r', with the correlation `_swing.HIDDEN` of unknown instants, is added to the covariance while no
report arrives. The next report tells the power at both ends of the gap, but not what it did in between: it may have
jumped there and back if the gap is longer than `SHORTEST` and the network was switched, or have swung. Then this is
process noise. Beyond `LINEAR` the angle is too uncertain for an extended filter, and the fluxes, which the current has
moved, are not known: `UNSURE` is added to the covariance until they have decayed. A machine without a PMU that was not
observable across a switching is treated like this however short the gap, and its filter starts anew then, and again
when its fluxes have decayed.
"""

import numpy as np

from stabctl._util.jit import inline


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
