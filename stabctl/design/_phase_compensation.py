"""Phase compensation: the residue method, and chains of equal lags.

The residue method damps one mode. A feedback u = k H(s) y moves an eigenvalue by k H(s) R for small k, R the residue of
the transfer function from u to y. The compensator H turns H(s) exp(-s delay) R into the negative real axis, so that the
gain adds damping alone. Source: M. Aboul-Ela et al., Damping Controller Design for Power System Oscillations Using
Global Signals, IEEE Trans. Power Systems 11, 1996.

A damper with several inputs has weights x to be found, and passes each input through a washout and a chain of equal
lags:

    u = sum over inputs i and k = 0 ... order of  x_ik  sTw/(1+sTw)  1/(1+s/w)^k  y_i

The output is linear in the weights, so the derivatives of the eigenvalues are exact. With lags enough, the sum is any
filter with poles at w: it advances, delays and selects frequencies.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from stabctl._util.errors import StudyError
from stabctl.controllers.controller import Controller
from stabctl.controllers.from_control import tustin
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.smallsignal.closed_loop import closed_loop
from stabctl.smallsignal.modes import Modes

if TYPE_CHECKING:
    import control


MOST = np.deg2rad(60)  # phase of one stage
UNSEEN = 1e-9  # residue of a mode that a feedback cannot move
ASIDE = 0.2  # of the frequency given, within which a mode is taken for the one that is meant


def residue_damper(
    point: OperatingPoint, input: str, output: str, hz: float | None, washout: float, more: dict[str, Any]
) -> tuple[Controller, float, float]:
    """The compensator of one signal for one input; the gain that counts as 1; frequency (Hz) of the mode.

    Parameters
    ----------
    point
        The operating point.
    input, output
        The signal that is read and the input that is driven.
    hz
        Frequency of the mode; None is the least damped electromechanical one.
    washout
        Time constant of the washout, s.
    more
        Other fields of the controller.
    """
    modes = closed_loop(point, inputs=output, outputs=input).modes()
    k = meant(modes, hz)
    residue, s = complex(modes.residues()[k]), complex(modes.eigenvalues[k])
    if abs(residue) < UNSEEN:
        raise StudyError(
            f"The mode at {modes.frequency_hz[k]:.3f} Hz is not seen in {input}, or not moved by {output}; "
            "choose others."
        )
    held = more["delay"] + (0.5 / more["rate"] if more["rate"] else 0.0)
    H = compensator(np.pi - float(np.angle(residue)) + s.imag * held, s.imag, washout)
    return Controller.from_control(H, input, output, **more), abs(s) / abs(residue), float(modes.frequency_hz[k])


def meant(modes: Modes, hz: float | None) -> int:
    """Index of the electromechanical mode nearest to a frequency, or of the least damped one."""
    swings = modes.swings()
    if not swings:
        raise StudyError(f"{modes.linear.name} has no electromechanical mode to damp.")
    if hz is None:
        return min(swings, key=lambda k: modes.damping_ratio[k])
    k = min(swings, key=lambda k: abs(modes.frequency_hz[k] - hz))
    if abs(modes.frequency_hz[k] - hz) > ASIDE * hz:
        known = ", ".join(f"{modes.frequency_hz[k]:.3f}" for k in swings)
        raise StudyError(f"{modes.linear.name} has no electromechanical mode near {hz:g} Hz; they are at {known} Hz.")
    return k


def compensator(phase: float, w: float, washout: float, filter_s: float = 0.0) -> "control.TransferFunction":
    """Washout, filter, and equal lead-lag stages with a phase (rad) and unit magnitude at w (rad/s).

    K(s) = c sTw/(1+sTw) 1/(1+sTf) ((1+sT1)/(1+sT2))^n,  T1 = 1/(w sqrt(a)),  T2 = a T1,  a = (1-sin f)/(1+sin f),

    where f is the phase that washout and filter leave to each stage. Source: P. Kundur, Power System Stability and
    Control, 1994, section 12.5; J. Sadikovic, PhD thesis, ETH Zurich, 2006 (residue method).
    """
    import control

    s = control.tf("s")
    fixed = washout * s / (1 + washout * s) / (1 + filter_s * s)
    left = phase - float(np.angle(fixed(1j * w)))
    left = (left + np.pi) % (2 * np.pi) - np.pi
    sign = 1.0
    if abs(left) > np.pi / 2:  # a change of sign is half a turn
        sign, left = -1.0, left - np.sign(left) * np.pi
    stages = int(np.ceil(abs(left) / MOST - 1e-9))
    whole = sign * fixed
    if stages:
        a = (1 - np.sin(left / stages)) / (1 + np.sin(left / stages))
        T = 1 / (w * np.sqrt(a))
        for _ in range(stages):
            whole = whole * (1 + T * s) / (1 + a * T * s)
    return whole / abs(complex(whole(1j * w)))


def lag_chain_damper(
    inputs: tuple[str, ...], output: str, order: int, *, corner: float, washout: float, rate: int | None, **more: Any
) -> tuple[Callable[[np.ndarray], list[Controller]], int]:
    """The controller with some weights, and the number of weights.

    Parameters
    ----------
    inputs, output
        What it reads and drives.
    order
        Lags in the chain of every input.
    corner
        Corner frequency w of the lags, rad/s.
    washout
        Time constant of the washout, s.
    rate
        Frames per second; None if it is continuous.
    **more
        Other fields of `Controller`.
    """
    A, B, C, D = _chain(order, corner, washout)
    each = np.eye(len(inputs))
    A, B, C, D = (np.kron(each, M) for M in (A, B, C, D))
    if rate is not None:
        A, B, C, D = tustin(A, B, C, D, rate)

    def make(x: np.ndarray) -> list[Controller]:
        return [Controller(inputs, (output,), A, B, x[None] @ C, x[None] @ D, rate=rate, **more)]

    return make, len(C)


def _chain(order: int, corner: float, washout: float) -> tuple[np.ndarray, ...]:
    """States [low-pass of the washout, lags], outputs [washed out, after every lag]."""
    n = order + 1
    A, B = np.zeros((n, n)), np.zeros((n, 1))
    C, D = np.eye(n), np.zeros((n, 1))
    A[0, 0] = B[0, 0] = 1 / washout
    A[0, 0], C[0, 0], D[0, 0] = -1 / washout, -1.0, 1.0
    for k in range(1, n):
        A[k] = corner * C[k - 1]
        A[k, k] -= corner
        B[k] = corner * D[k - 1]
    return A, B, C, D
