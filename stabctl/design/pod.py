"""Power-oscillation damper: by the residue method, or with the weights of several inputs by linear programs.

A feedback u = k H(s) y moves an eigenvalue by k H(s) R for small k, R the residue of the transfer function from u to y.
The compensator H turns H(s) exp(-s delay) R into the negative real axis, so that the gain adds damping alone. Source:
M. Aboul-Ela et al., Damping Controller Design for Power System Oscillations Using Global Signals, IEEE Trans. Power
Systems 11, 1996.

That serves one mode. Where one device must damp several, each input passes a washout and a chain of equal lags, whose
weights x are tuned:

    u = sum over inputs i and k = 0 ... order of  x_ik  sTw/(1+sTw)  1/(1+s/w)^k  y_i

The output is linear in the weights, so the derivatives of the eigenvalues are exact. With enough lags, the sum is any
washed-out filter with poles at -w: it advances, delays and selects frequencies.
"""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from stabctl._util.errors import StudyError, shown
from stabctl._util.units import hertz, quantity
from stabctl.controllers.controller import Controller
from stabctl.controllers.from_control import tustin
from stabctl.controllers.timing import checked_frames, duration
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.dynamics.signals import INPUTS, OUTPUTS, chosen
from stabctl.model.case import Case
from stabctl.model.fleet import Fleet
from stabctl.smallsignal.closed_loop import closed_loop

from ._tuning import Loop, Make, Scenario, common, separate, worst
from .outages import Outages
from .pairs import SIGNALS, UNSEEN, meant, pairs
from .result import Design, Requirement, operating_points

if TYPE_CHECKING:
    import control

STAGE = np.deg2rad(60)  # phase of one stage at most
LAGS, MOST_LAGS = 3, 8  # in the filter of an input: tried by default, and allowed
GAINS = np.geomspace(0.01, 3.0, 40)  # gains that are tried, relative to that which moves the mode by its own size
STEP = 0.02  # damping ratio that a weight of size 1 gives


def pod(
    base: "Case | OperatingPoint | Outages | Sequence[OperatingPoint]",
    input: str | Sequence[str] | None = None,
    output: str | None = None,
    *,
    damping: float = 0.1,
    spread: str | float = 0.0,
    mode: str | float | None = None,
    order: int | None = None,
    rate: int | None = None,
    delay: str | float = 0.0,
    washout: str | float = 3.0,
    limits: tuple[float, float] | float | None = None,
    storage: "Fleet | None" = None,
    name: str = "pod",
) -> Design:
    """Design a power-oscillation damper from signals to one input.

    Parameters
    ----------
    base : Case, OperatingPoint, Outages, or sequence of OperatingPoint
        The system; of several operating points the first gives the phase, and the gain serves all of them.
    input : str or sequence of str, optional
        The signals that are read, such as "deviation:1", "flow:7-8" or "deviation:1, deviation:4"; by default that of
        the best pair of `pairs`.
    output : str, optional
        The input that is driven, such as "order:1@8"; by default that of the best pair.
    damping : float
        Damping ratio to reach. By the residue method it is that of the mode; no other mode of 0.1 to 3 Hz may fall
        below it or, if it was lower before, by more than 0.002. With an order, all modes of 0.1 to 3 Hz shall reach it.
    spread : str or float
        Change of the gain with which the damping must hold too: 0.5 or "50%" for 50 to 150 % of it.
    mode : str or float, Hz, optional
        Frequency of the mode for the residue method, and for the best pair; by default the least damped
        electromechanical one.
    order : int, optional
        Lags in the filter of every input, whose weights are tuned; by default the fewest of 1 to 3 with which several
        inputs reach the damping, and for a single input lead-lag stages by the residue method.
    rate : int, 1/s, optional
        Frames per second; continuous without it.
    delay : str or float, s
        Time from measurement to output.
    washout : str or float, s
        Time constant of the washout.
    limits : pair of float, optional
        Limits of the output, in the unit of the input driven.
    storage : str, float, mapping, or iterable of Storage, optional
        Storage devices in place of the case's own, as in `simulate`.
    name : str
        Name of the controller.

    Returns
    -------
    Design

    Raises
    ------
    StudyError
        If there is no such signal, or the mode cannot be damped with it.

    Examples
    --------
    >>> base = st.load("two_area_thyristor").initialize(storage="3@11=50MW")
    >>> print(st.design.pod(base, "deviation:3", "order:3@11", damping=0.05, rate=60, delay="100ms"))
    1 controller: smallest damping ratio of 0.1 to 3 Hz: -0.0087 without, 0.0500 with.
    """
    points = operating_points(base, storage)
    hz, given = None if mode is None else hertz(mode), input is not None and output is not None
    if input is None or output is None:
        best = pairs(points[0], input or SIGNALS, output, mode=hz, delay=delay).best
        input, output = input or best[0], output or best[1]
    reads = _signals(points[0], input, output)
    share = quantity(spread, "-")
    if not 0 <= share < 1:
        raise StudyError(f"spread = {shown(spread)} is not allowed; give a share of the gain, such as 0.5.")
    if order is not None and (isinstance(order, bool) or not isinstance(order, int) or not 1 <= order <= MOST_LAGS):
        raise StudyError(f"order = {shown(order)} is not allowed; give 1 to {MOST_LAGS}.")
    late, slow = duration("delay", delay), duration("washout", washout)
    if not 0 < slow <= 1e4:
        raise StudyError(f"washout = {shown(washout)} is not allowed; give more than 0 and at most 1e4 s.")
    if rate is not None:
        checked_frames(name, rate, late)
    by_residue = order is None and len(reads) == 1
    if mode is not None and given and not by_residue:
        raise StudyError(
            "With an order or several inputs all modes of 0.1 to 3 Hz are damped, not one mode; leave mode out, or "
            "give one input without an order."
        )
    bounds: Any = (-np.inf, np.inf) if limits is None else limits
    more: dict[str, Any] = {"rate": rate, "delay": late, "limits": bounds, "name": name}
    factors = (1.0, 1 - share, 1 + share) if share else (1.0,)
    if by_residue:
        return _one(points, _residue_damper(points[0], reads[0], output, hz, slow, more), damping, factors)
    corner = 2 * np.pi * _middle(points[0])
    found: Design | None = None
    for n in range(1, LAGS + 1) if order is None else [order]:
        make, count = _lag_chain_damper(reads, output, n, corner=corner, washout=slow, **more)
        new = _several(points, make, count, damping, factors)
        found = new if found is None or new.short < found.short else found
        if found.reached:
            break
    assert found is not None
    return found


def _signals(point: OperatingPoint, input: str | Sequence[str], output: str) -> tuple[str, ...]:
    """Names of the signals that are read; they and the one that is driven are checked."""
    reads, drives = chosen(point.case, input, OUTPUTS), chosen(point.case, output, INPUTS)
    if not reads:
        raise StudyError("A damper reads at least one signal; give one, such as deviation:1, or leave the input out.")
    if len(drives) != 1:
        raise StudyError(f"A damper has one output; give a single one, such as order:1@5, not {shown(output)}.")
    return tuple(s.name for s in reads)


def _residue_damper(
    point: OperatingPoint, input: str, output: str, hz: float | None, washout: float, more: dict[str, Any]
) -> tuple[Controller, float, float]:
    """The compensator of one signal for one input; the gain that counts as 1; frequency (Hz) of the mode."""
    modes = closed_loop(point, inputs=output, outputs=input).modes()
    k = meant(modes, hz)
    residue, s = complex(modes.residues()[k]), complex(modes.eigenvalues[k])
    if abs(residue) < UNSEEN:
        raise StudyError(
            f"The mode at {modes.frequency_hz[k]:.3f} Hz is not seen in {input}, or not moved by {output}; "
            "choose others."
        )
    held = more["delay"] + (0.5 / more["rate"] if more["rate"] else 0.0)  # a frame is held: half of it on average
    H = compensator(np.pi - float(np.angle(residue)) + s.imag * held, s.imag, washout)
    return Controller.from_control(H, input, output, **more), abs(s) / abs(residue), float(modes.frequency_hz[k])


def compensator(phase: float, w: float, washout: float) -> "control.TransferFunction":
    """Washout and equal lead-lag stages with a phase (rad) and unit magnitude at w (rad/s).

    K(s) = c sTw/(1+sTw) ((1+sT1)/(1+sT2))^n,  T1 = 1/(w sqrt(a)),  T2 = a T1,  a = (1-sin f)/(1+sin f),

    where f is the phase that the washout leaves to each stage. Source: P. Kundur, Power System Stability and
    Control, 1994, section 12.5; R. Sadikovic, Use of FACTS Devices for Power Flow Control and Damping of Oscillations
    in Power Systems, PhD thesis, ETH Zurich, 2006 (residue method).
    """
    import control

    s = control.tf("s")
    fixed = washout * s / (1 + washout * s)
    left = phase - float(np.angle(fixed(1j * w)))
    left = (left + np.pi) % (2 * np.pi) - np.pi
    sign = 1.0
    if abs(left) > np.pi / 2:  # a change of sign is half a turn
        sign, left = -1.0, left - np.sign(left) * np.pi
    stages = int(np.ceil(abs(left) / STAGE - 1e-9))
    whole = sign * fixed
    if stages:
        a = (1 - np.sin(left / stages)) / (1 + np.sin(left / stages))
        T = 1 / (w * np.sqrt(a))
        for _ in range(stages):
            whole = whole * (1 + T * s) / (1 + a * T * s)
    return whole / abs(complex(whole(1j * w)))


def _lag_chain_damper(
    inputs: tuple[str, ...], output: str, order: int, *, corner: float, washout: float, rate: int | None, **more: Any
) -> tuple[Callable[[np.ndarray], list[Controller]], int]:
    """The controller with some weights, and their number; corner frequency of the lags in rad/s, washout in s."""
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
    B[0, 0] = 1 / washout
    A[0, 0], C[0, 0], D[0, 0] = -1 / washout, -1.0, 1.0
    for k in range(1, n):
        A[k] = corner * C[k - 1]
        A[k, k] -= corner
        B[k] = corner * D[k - 1]
    return A, B, C, D


def _one(
    points: Sequence[OperatingPoint],
    compensated: tuple[Controller, float, float],
    damping: float,
    factors: Sequence[float],
) -> Design:
    """The smallest gain of a compensator with which its mode reaches the damping everywhere."""
    one, unit, hz = compensated

    def make(gain: np.ndarray) -> list[Controller]:
        return [one.scaled(float(gain[0]))]

    loops = [Loop(point, [one]) for point in points]
    asked = [Requirement(damping).sparing(loop.eigenvalues([one.scaled(0.0)]), hz) for loop in loops]
    scenarios = [Scenario(loop, k, what) for loop, what in zip(loops, asked, strict=True) for k in factors]
    gain, spare = common(scenarios, make, np.array([unit]), GAINS)
    return Design.of(points, make(gain), short=-spare, needed=worst(scenarios, make, 0 * gain) < 0)


def _several(
    points: Sequence[OperatingPoint], make: Make, count: int, damping: float, factors: Sequence[float]
) -> Design:
    """The weights with which all modes reach the damping everywhere."""
    none = np.zeros(count)
    loops = [Loop(point, make(none)) for point in points]
    scenarios = [Scenario(loop, k, Requirement(damping)) for loop in loops for k in factors]
    rows = [one.rows(make, none, np.ones(count), damping)[1] for one in scenarios if one.factor == 1.0]
    slopes = np.abs(np.concatenate(rows)).max(axis=0, initial=0.0)
    if not slopes.any():
        raise StudyError(
            "The modes with too little damping are not observable in the inputs or not controllable "
            "by the output; choose others."
        )
    weights, spare = separate(scenarios, make, none, STEP / np.where(slopes > 0, slopes, slopes.max()))
    return Design.of(points, make(weights), short=-spare, needed=worst(scenarios, make, none) < 0)


def _middle(point: OperatingPoint) -> float:
    """Geometric middle (Hz) of the frequencies of the electromechanical modes."""
    modes = closed_loop(point).modes()
    meant(modes, None)  # raises if there are none
    hz = modes.frequency_hz[modes.swings()]
    return float(np.sqrt(hz.min() * hz.max()))
