"""A frame in the filters, compiled: prediction, correction and measurement equations for all seeds k and machines i.

The equations are those of `_swing`, `_machine_model` and `_filter_bank`. Arrays are (seeds, machines) unless stated
otherwise; results are written into the arrays given for them, or into those that they change.
"""

from math import asin, atan2, cos, sin, sqrt
from typing import NamedTuple

import numpy as np

from stabctl._util.jit import entry, inline
from stabctl._util.words import record

from ._report_errors import angle_variance, current_variance, power_variance
from ._swing import process_covariance


@record
class Constants(NamedTuple):
    """Constants of the machines, arrays (machines, ...): fields of `RotorUnits`, `Swing` and `QAxis`."""

    impedance: np.ndarray
    mva: np.ndarray
    has_omega: np.ndarray  # 1 with a speed in the swing equation, else 0
    F: np.ndarray  # (machines, 3, 3)
    B: np.ndarray  # (machines, 3, 3)
    walk: np.ndarray  # (machines, 5, 5)
    c: np.ndarray
    d: np.ndarray
    A: np.ndarray  # (machines, 2, 2)
    drive: np.ndarray  # (machines, 2, 2)
    out: np.ndarray  # (machines, 2)
    speed: np.ndarray
    slope: np.ndarray
    knee: np.ndarray
    exponential: np.ndarray  # 1 or 0
    step: np.ndarray  # (frames + 1, machines, 2)
    ramp: np.ndarray  # (frames + 1, machines, 2)


@record
class Kept(NamedTuple):
    """What is kept of the last report of every machine."""

    P: np.ndarray
    variance: np.ndarray
    size: np.ndarray
    g: np.ndarray
    missing: np.ndarray
    current: np.ndarray  # in the frame of the rotor
    voltage: np.ndarray
    rate: np.ndarray  # pu   change of P per frame before


@inline
def clipped(x, limit):
    """x between -limit and limit."""
    return min(max(x, -limit), limit)


@inline
def turned_back(phasor, angle):
    """phasor exp(-j angle)."""
    return phasor * complex(cos(angle), -sin(angle))


@inline
def iron(size, slope, knee, exponential):
    """The iron over psi''q at a flux |psi''|: S(|psi''|)/|psi''| times the slope, exponential (1) or quadratic (0)."""
    return slope * (exponential * size**knee + (1 - exponential) * np.maximum(size - knee, 0.0) ** 2 / size)


@entry
def see(V, I, c, angle, magnitude, ZI, E, current, P, variance):
    """Internal voltages, currents on the machine base, air-gap powers and their variances from the phasors."""
    for k in range(V.shape[0]):
        for i in range(V.shape[1]):
            ZI[k, i] = c.impedance[i] * I[k, i]
            e = V[k, i] + ZI[k, i]
            if abs(e) < 1e-3:
                e = complex(1e-3, 0.0)
            own = I[k, i] / c.mva[i]
            E[k, i], current[k, i] = e, own
            P[k, i] = e.real * own.real + e.imag * own.imag
            variance[k, i] = power_variance(V[k, i] * complex(own.real, -own.imag), angle, magnitude)


@entry
def move(x, P, I, received, c, kept, g, after, F, change):
    """States a frame later, their derivative F (seeds, machines, 5, 5), and the change of the current."""
    longest = c.ramp.shape[0] - 1
    for k in range(P.shape[0]):
        for i in range(P.shape[1]):
            m = kept.missing[k, i] + 1
            dP = P[k, i] - kept.P[k, i] if received[k, i] else 0.0
            dg = g[k, i] - kept.g[k, i]
            u0, u1, u2 = kept.P[k, i] - kept.g[k, i], m * dP - dg, m * m * dP - dg
            u0 += c.has_omega[i] * x[k, i, 1] * (x[k, i, 2] - u0 - u1 / 2)
            for r in range(3):
                after[k, i, r] = c.B[i, r, 0] * u0 + c.B[i, r, 1] * u1 + c.B[i, r, 2] * u2
                for j in range(3):
                    after[k, i, r] += c.F[i, r, j] * x[k, i, j]
                    F[k, i, r, j] = c.F[i, r, j]
            before, now = kept.current[k, i], turned_back(I[k, i], after[k, i, 0])
            moved = now - before if received[k, i] else complex(0.0, 0.0)
            change[k, i] = moved
            flux, frames = kept.size[k, i] / (1 + c.speed[i] * x[k, i, 1]), min(m, longest)
            ratio = iron(flux, c.slope[i], c.knee[i], c.exponential[i])
            psi = c.out[i, 0] * x[k, i, 3] + c.out[i, 1] * x[k, i, 4]
            for r in range(2):
                drive, ramp = c.drive[i, r, 0], c.ramp[frames, i, r]
                value = drive * before.real + ramp * moved.real + c.drive[i, r, 1] * ratio * psi
                F[k, i, 3 + r, 0] = drive * before.imag + ramp * moved.imag
                for j in range(2):
                    value += c.A[i, r, j] * x[k, i, 3 + j]
                    F[k, i, 3 + r, 3 + j] = c.A[i, r, j] + c.drive[i, r, 1] * ratio * c.out[i, j]
                after[k, i, 3 + r] = value


@entry
def spread(x, P, variance, of_current, received, c, kept, change, window, settings, hidden, Q):
    """Process covariance Q (seeds, machines, 5, 5), as in `_swing`.

    `window` (3, seeds, machines) has what the filter of the PMUs adds: standard deviation of the current, variance of
    the power, and the jump of iq; `settings` are the standard deviations of angle and magnitude, the share of the
    model error (0 without measured power), and the factor of jumps; `hidden` (seeds, machines, 3) has the standard
    deviations of angle, speed and current from what happened between two reports. If the power bends between them, it
    is off the ramp by 1/12 of its second difference on average.
    """
    angle, magnitude, share, together = settings
    longest = c.ramp.shape[0] - 1
    for k in range(P.shape[0]):
        for i in range(P.shape[1]):
            here, m = received[k, i], kept.missing[k, i] + 1
            dP = P[k, i] - kept.P[k, i] if here else 0.0
            frames = min(m, longest)
            power = (kept.variance[k, i] + (variance[k, i] if here else kept.variance[k, i])) / 2
            power += (share * (x[k, i, 2] + kept.g[k, i] - kept.P[k, i])) ** 2 + window[1, k, i]
            if here and share > 0:
                power += (m * (dP - m * kept.rate[k, i]) / 12) ** 2
            noise = of_current[k, i]
            if noise == 0.0:
                noise = current_variance(kept.current[k, i], angle, magnitude)
            further = window[0, k, i] + (abs(change[k, i]) if m > 1 else 0.0)  # the current may have moved in between
            first, second = c.step[frames, i, 0], c.step[frames, i, 1]
            jumped = together * window[2, k, i]
            flux = first * jumped, second * jumped
            driven = (
                c.drive[i, 0, 0] * sqrt(noise) + first * further,
                c.drive[i, 1, 0] * sqrt(noise) + second * further,
            )
            current = (
                hidden[k, i, 2] + abs(kept.current[k, i] + change[k, i]) * hidden[k, i, 0]
            )  # iq depends on the angle
            between = hidden[k, i, 0], hidden[k, i, 1], 0.0, first * current, second * current
            process_covariance(k, i, c, Q, together * dP, m, power, flux, driven, between)


@entry
def expect(x, V, ZI, E, c, angle, magnitude, floor, seen, expected, middle, variance, slope):
    """What the report says: angle of E, its expectation and variance, and the slope (seeds, machines, 5).

    `middle` is the angle theta to which the slope, that of a chord of the arc sine, and the variance belong.
    """
    for k in range(V.shape[0]):
        for i in range(V.shape[1]):
            size = abs(E[k, i])
            arg = atan2(E[k, i].imag, E[k, i].real)
            psi = c.out[i, 0] * x[k, i, 3] + c.out[i, 1] * x[k, i, 4]
            theta = asin(clipped((1 + c.speed[i] * x[k, i, 1]) * psi / size, 0.99))
            y = arg - x[k, i, 0]
            y -= 2 * np.pi * np.rint(y / (2 * np.pi))
            apart = clipped(y - theta, 1.0) / 2
            between, square = clipped(theta + apart, 1.4), apart * apart
            chord = 1 / (size * cos(between) * (1 - square / 6 * (1 - square / 20)))  # sin(apart)/apart to 1e-5
            seen[k, i], expected[k, i], middle[k, i] = arg, x[k, i, 0] + theta, between
            slope[k, i, 0], slope[k, i, 1], slope[k, i, 2] = 1.0, 0.0, 0.0
            slope[k, i, 3], slope[k, i, 4] = c.out[i, 0] * chord, c.out[i, 1] * chord
            variance[k, i] = angle_variance(V[k, i], ZI[k, i], E[k, i], between, angle, magnitude) + floor


@entry
def keep(x, P, variance, I, E, received, g, kept):
    """Keep what the next frame begins with."""
    for k in range(P.shape[0]):
        for i in range(P.shape[1]):
            kept.g[k, i] = g[k, i]
            kept.missing[k, i] += 1
            if received[k, i]:
                kept.rate[k, i] = (P[k, i] - kept.P[k, i]) / kept.missing[k, i]
                kept.P[k, i], kept.variance[k, i], kept.missing[k, i] = P[k, i], variance[k, i], 0
                kept.current[k, i] = turned_back(I[k, i], x[k, i, 0])
                kept.voltage[k, i] = turned_back(E[k, i], x[k, i, 0])
                kept.size[k, i] = abs(E[k, i])


@entry
def propagate(P, F, Q, half):
    """P = F P F' + Q; `half` (5, 5) is work space."""
    n = P.shape[2]
    for k in range(P.shape[0]):
        for i in range(P.shape[1]):
            for a in range(n):
                for b in range(n):
                    half[a, b] = 0.0
                    for j in range(n):
                        half[a, b] += F[k, i, a, j] * P[k, i, j, b]
            for a in range(n):
                for b in range(a, n):
                    value = Q[k, i, a, b]
                    for j in range(n):
                        value += half[a, j] * F[k, i, b, j]
                    P[k, i, a, b] = P[k, i, b, a] = value


@entry
def correct(x, P, seen, rejected, reset, limits, nis, S, gain, doubt):
    """Use the angles that were received; `limits` are the gate and the rejections allowed."""
    gate, allowed = limits
    n = x.shape[2]
    for k in range(x.shape[0]):
        for i in range(x.shape[1]):
            if not seen.received[k, i]:
                nis[k, i], rejected[k, i] = np.nan, min(rejected[k, i] + 1, allowed)
                for a in range(n):
                    gain[k, i, a] = 0.0
                continue
            y = seen.angle[k, i] - seen.expected[k, i]
            y -= 2 * np.pi * np.rint(y / (2 * np.pi))
            for turn in range(2):  # the second one with the larger covariance
                S[k, i] = seen.variance[k, i]
                for a in range(n):
                    gain[k, i, a] = 0.0
                    for b in range(n):
                        gain[k, i, a] += P[k, i, a, b] * seen.slope[k, i, b]
                    S[k, i] += seen.slope[k, i, a] * gain[k, i, a]
                if turn == 0:
                    nis[k, i] = y * y / S[k, i]
                    if nis[k, i] <= gate or rejected[k, i] < allowed:
                        break
                    for a in range(n):
                        P[k, i, a, a] += y * y * reset[i, a]
            if nis[k, i] > gate and rejected[k, i] < allowed:
                rejected[k, i] += 1
                doubt[k, i] = y * y
                for a in range(n):
                    gain[k, i, a] = 0.0
                continue
            rejected[k, i], doubt[k, i] = 0, 0.0
            for a in range(n):  # (1 - K h) P (1 - K h)' + K R K' = P - p p'/S if K = p/S, p = P h'
                x[k, i, a] += gain[k, i, a] * y / S[k, i]
                for b in range(n):
                    P[k, i, a, b] -= gain[k, i, a] * gain[k, i, b] / S[k, i]
            for a in range(n):
                gain[k, i, a] /= S[k, i]
