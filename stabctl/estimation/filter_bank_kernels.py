"""The equations of `filter_bank`, compiled: loops over seeds k, machines i and states; arrays are changed in place."""

import numpy as np

from stabctl._util.jit import entry


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
