"""The eigenvalues of a system whose loops are closed by continuous controllers and a storage law.

A run needs the fastest, which limits its time step, and the one that grows, of which it warns. With x' = A x + B u and
accelerations a = A_w x + L u of the linearized system, and orders u = K x + G a of a law,

    x' = (A + B inv(1 - G L) (K + G A_w)) x

A and B are those of `closed_loop`: the exact derivatives of the devices, with the voltages eliminated. Controllers are
taken without deadbands and limits, as they are where they act. Relays, sampled controllers and estimators close no loop
here, because what they give is constant between two instants. With any of these an eigenvalue that grows tells nothing.
"""

from collections.abc import Callable
from math import isfinite
from numbers import Real
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse.linalg import ArpackError, LinearOperator, eigs

from stabctl._util.errors import StudyError, shown
from stabctl.controllers import Law
from stabctl.controllers.signals import StorageDevice
from stabctl.dynamics import outputs, storage
from stabctl.dynamics.jacobian import array, solver
from stabctl.dynamics.operating_point import OperatingPoint

from . import lti
from .attached import BOUND, Attached
from .control import Acting
from .wired import Wired, orders_of, storage_devices

DENSE = 300  # states up to which all eigenvalues are found
ACCURACY = 1e-2  # of the fastest eigenvalue otherwise
GROWING = 0.01  # 1/s   real part of an eigenvalue that is named
DRIVEN = 1e-6  # 1/s   rate with which a state is held at its limit


class Eigenvalues(NamedTuple):
    """What a run needs to know of the eigenvalues of a closed loop."""

    fastest: float = 0.0  # 1/s   largest magnitude of an eigenvalue; 0 if no loop is closed continuously
    growing: complex | None = None  # 1/s   the rightmost, if all loops are closed here and it grows
    alone: complex | None = None  # 1/s   the same of the system without the control, if both grow


def eigenvalues(point: OperatingPoint, parts: Acting, what: Attached, wired: Wired) -> Eigenvalues:
    """The eigenvalues at rest. Raises `StudyError` if the orders take away more inertia than there is.

    Parameters
    ----------
    point
        The operating point without the control.
    parts
        The control.
    what
        The operating point with its controllers.
    wired
        That, connected for the stepper with the law.
    """
    law, gains = parts.law, np.zeros((0, 3))
    if law is not None and wired.places.follows:
        gains = np.array([_gains(law, device) for device in storage_devices(what.point.case)]).reshape(-1, 3)
    if not gains.any() and not any(f.device.module is lti for f in wired.families):
        return Eigenvalues()
    kept = vars(what.point).setdefault("closed", {})
    whole = not parts.pilots and not any(c.rate or c.relay for c in parts.controllers) and (not law or gains.any())
    if (law, whole) not in kept:
        found = _eigenvalues(what, wired, gains)
        alone = _eigenvalues(Attached(point), wired, gains[:0]).growing if whole and found.growing else None
        kept[law, whole] = found._replace(growing=found.growing if whole else None, alone=alone)
    return kept[law, whole]


def _gains(law: Law, device: StorageDevice) -> tuple[float, float, float]:
    """What `Law.gains` gives. Raises `StudyError` unless it is three numbers."""
    given: Any = law.gains(device)
    if np.shape(given) != (3,) or not all(isinstance(one, Real) and isfinite(one) for one in given):
        raise StudyError(
            f"The law {law} has gains {shown(given)}; its method gains must return three numbers: the slopes of the "
            "order by speed, acceleration and angle."
        )
    return given  # type: ignore[no-any-return]


def _eigenvalues(what: Attached, wired: Wired, gains: np.ndarray) -> Eigenvalues:
    point, rotors, nx = what.point, what.point.rotors, what.point.layout.nx
    moved, speeds = _linear(what)
    states = rotors.speed < nx
    speed = np.where(states, rotors.speed, 0)

    def wanted(rates: np.ndarray, x: np.ndarray, of_speed: np.ndarray) -> np.ndarray:
        """Orders for rates of the states, states and speeds (columns); a speed that is no state has no acceleration."""
        acceleration = np.where(states[:, None], rates[speed], 0.0)
        parts = zip(gains.T, (of_speed, acceleration, x[rotors.angle]), strict=True)
        return sum(gain[:, None] * (seen @ part) for gain, part in parts)  # type: ignore[return-value]

    if gains.any():
        seen, n = _seen(point, wired), len(gains)
        orders = np.zeros((wired.layout.size, n))
        orders[orders_of(wired.layout, point.case), np.arange(n)] = 1.0
        none = np.zeros((nx, n))
        B, of_orders = moved(none, orders), speeds(none, orders)
        direct = np.eye(n) - wanted(B, none, of_orders)
        _check_inertia(direct, point)
        loop = np.linalg.inv(direct)

    def closed(x: np.ndarray) -> np.ndarray:
        """Rates of the states (columns) in the closed loop."""
        x = x.reshape(nx, -1)
        rates = moved(x, None)
        return rates + B @ (loop @ wanted(rates, x, speeds(x, None))) if gains.any() else rates

    if nx > DENSE:
        operator = LinearOperator((nx, nx), matvec=closed, dtype=float)
        try:
            return Eigenvalues(
                float(abs(eigs(operator, 1, tol=ACCURACY, v0=np.ones(nx), return_eigenvectors=False)[0]))
            )
        except ArpackError:
            pass
    found = np.linalg.eigvals(closed(np.eye(nx)))
    last = complex(found[np.argmax(found.real)]) if nx else 0j
    return Eigenvalues(float(np.abs(found).max(initial=0.0)), last if last.real > GROWING else None)


def _check_inertia(direct: np.ndarray, point: OperatingPoint) -> None:
    """Check 1 - G L: where it has no positive eigenvalue, the orders take away more inertia than there is."""
    if np.linalg.eigvals(direct).real.min() <= 0:
        raise StudyError(
            f"The acceleration gain of the law takes away more inertia than the machines of {point.case.name} with "
            "storage have; give one that is larger (nearer to zero, or positive)."
        )


Linear = Callable[[np.ndarray, "np.ndarray | None"], np.ndarray]


def _linear(what: Attached) -> tuple[Linear, Linear]:
    """Rates of the states, and speeds of the rotors, as linear functions of the states and of all signals (columns)."""
    point = what.point
    layout, k, s = point.layout, _without_limits(what), point.s.copy()
    s[[*what.gates, *(place for place, _, _ in what.windows)]] = 1.0
    d = point.equations.at(s, k)
    nx, first = layout.nx, layout.first_setpoint
    driven = np.where(np.abs(d.rates) > DRIVEN, d.rates, 0.0)
    free = ~point.equations.held(s, driven, point.system.limits)
    solve = solver(d.of_currents[:, nx:first] - point.real_admittance())
    rotors = point.rotors.speed
    made = rotors >= layout.first_output  # those of virtual rotors

    def of(rows: Any) -> Linear:
        def function(x: np.ndarray, u: np.ndarray | None) -> np.ndarray:
            z = np.zeros((d.of_rates.shape[1], x.shape[1])) if u is None else u[: d.of_rates.shape[1]].copy()
            z[:nx] = x
            z[nx:first] = -solve(np.asarray(d.of_currents @ z))
            return np.asarray(rows(z))

        return function

    def speeds(z: np.ndarray) -> np.ndarray:
        out = z[np.where(made, 0, rotors)]
        out[made] = array(d.of_outputs)[rotors[made] - layout.first_output] @ z
        return out

    return of(lambda z: (d.of_rates @ z) * free[:, None]), of(speeds)


def _without_limits(what: Attached) -> np.ndarray:
    """The constants of all devices; controllers have neither limits nor deadbands, and relays give nothing."""
    parts = []
    for f in what.point.equations.families:
        k = f.k.copy()
        if f.device.module is lti:
            for row in k:
                at = lti.levels(row)
                row[at : at + 3] = -BOUND, BOUND, BOUND if row[at + 3] > 0 else 0.0
        parts.append(k.ravel())
    return np.concatenate([np.zeros(0), *parts])


def _seen(point: OperatingPoint, wired: Wired) -> np.ndarray:
    """What the law of each storage device sees of the rotors: its group against the mean of the others."""
    a, rotors = wired.places, point.rotors
    unit = storage.places(point.system, point.case).unit
    out = np.zeros((len(unit), len(rotors.unit)))
    for j, own in enumerate(unit):
        i = int(np.flatnonzero(rotors.unit == own)[0])
        group = np.zeros(len(rotors.unit), bool)
        group[a.member[a.first[i] : a.first[i + 1]]] = True
        out[j] = outputs.against_rest(point, group)
    return out
