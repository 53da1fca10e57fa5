"""The fastest eigenvalue of a system whose loops are closed by continuous controllers and a storage law.

With x' = A x + B u of the system, and orders u = K x + L x' of a law that reads speeds, angles and accelerations,

    x' = A x + B inv(1 - L B) (K + L A) x

The products A x and B u are differences of the simulated rates, near enough to choose a step by. Deadbands and limits
of controllers are left out: this is how fast the loop is where it acts. Relays and sampled controllers close no loop
here, because what they give is constant between two instants.
"""

import numpy as np
from scipy.sparse.linalg import ArpackError, LinearOperator, eigs

from stabctl.controllers import Law
from stabctl.dynamics import storage
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.model.network import UNSWITCHED

from . import _newton, lti
from ._buffers import buffers
from .attached import BOUND, Attached
from .criterion import DEFAULT, numbers
from .stepper import NOTHING
from .topology import stage
from .wired import Wired, orders_of, storage_devices

DENSE = 100  # states up to which all eigenvalues are found
ACCURACY = 1e-2  # of the fastest eigenvalue otherwise
SMALL = 1e-4  # length of a change of the states
RULES = numbers(DEFAULT)
ORDER = 0.05  # largest change of what a controller gives, and of a storage order


def fastest(what: Attached, law: Law | None, wired: Wired) -> float:
    """Largest magnitude (1/s) of an eigenvalue of the closed loop; 0 if no loop is closed continuously.

    Parameters
    ----------
    what
        The operating point with its controllers.
    law
        The law of the storage devices, if any.
    wired
        Both, connected for the stepper.
    """
    gains = np.zeros((0, 3))
    if law is not None and wired.places.follows:
        gains = np.array([law.gains(device) for device in storage_devices(what.point.case)]).reshape(-1, 3)
    if not gains.any() and not any(f.device.module is lti for f in wired.families):
        return 0.0
    kept = vars(what.point).setdefault("closed", {})
    if law not in kept:
        kept[law] = _fastest(Rates(what, wired), gains)
    return kept[law]


class Rates:
    """The rates of the states of a system at rest as linear functions of the states and of the storage orders."""

    def __init__(self, what: Attached, wired: Wired) -> None:
        self.point, self.wired, layout = what.point, wired, wired.layout
        self.nx, self.orders = layout.nx, orders_of(layout, what.point.case)
        self._net = stage(what.point, UNSWITCHED).net
        none = np.zeros(0, np.int64)
        self._places = wired.places._replace(held=none, gated=False, relay=False, follows=False)
        self._program = wired.program._replace(k=wired.program.k.copy(), step=np.zeros((0, 5), np.int64))
        self._rest = wired.start.copy()
        self._rest[[*what.gates, *(place for place, _, _ in what.windows)]] = 1.0
        given, at = [none], 0
        for f in wired.families:
            if f.device.module is lti:
                for row, k in enumerate(f.k):
                    levels = at + f.k.shape[1] * row + lti.levels(k)
                    relay = k[lti.levels(k) + 3] > 0
                    self._program.k[levels : levels + 3] = -BOUND, BOUND, BOUND if relay else 0.0
                given += [out + np.arange(int(k[2])) for out, k in zip(f.w[:, -1], f.k, strict=True)]
            at += f.k.size
        self._given = np.concatenate(given)

    def moved(self, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rates of the states (1/s) and changes of the rotors' signals (speeds, angles), for changes of both."""
        size = max(float(np.abs(u).max(initial=0.0)) / ORDER, float(np.linalg.norm(x)) / SMALL)
        if not size:
            return np.zeros(self.nx), np.zeros((2, len(self.point.rotors.unit)))
        s, f = self._at(x / size, u / size)
        given = float(np.abs(s - self._rest)[self._given].max(initial=0.0)) / ORDER
        if given > 1:
            size *= given
            s, f = self._at(x / size, u / size)
        back, b = self._at(-x / size, -u / size)
        rotors = self.point.rotors
        change = size / 2 * (s - back)
        return size / 2 * (f - b), change[np.array([rotors.speed, rotors.angle])]

    def _at(self, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """All signals and the rates, with the states and orders changed from rest."""
        run = buffers(self._rest, self.wired.layout, self._places)
        run.s[: self.nx] += x
        run.s[self.orders] += u
        _newton.advance(self.wired, self._program, self._places, self._net, run, RULES, NOTHING._replace(last=True))
        return run.s, run.f[: self.nx]


def _fastest(plant: Rates, gains: np.ndarray) -> float:
    orders, no_orders = np.eye(len(plant.orders)), np.zeros(len(plant.orders))
    seen = _seen(plant.point, plant.wired) if len(gains) else np.zeros((0, len(plant.point.rotors.unit)))
    speed = plant.point.rotors.speed
    states = speed < plant.nx

    def wanted(rate: np.ndarray, signals: np.ndarray) -> np.ndarray:
        """Orders of the law for rates of the states and signals of the rotors; virtual ones have no acceleration."""
        if not len(gains):
            return no_orders
        acceleration = np.where(states, rate[np.where(states, speed, 0)], 0.0)
        return sum(gains[:, k] * (seen @ of) for k, of in enumerate((signals[0], acceleration, signals[1])))

    by_orders = [plant.moved(np.zeros(plant.nx), u) for u in orders] if len(gains) else []
    loop = np.linalg.inv(orders - np.array([wanted(*one) for one in by_orders]).T) if by_orders else None
    B = np.array([rate for rate, _ in by_orders]).T

    def moved(x: np.ndarray) -> np.ndarray:
        """Rates of the states in the closed loop."""
        rate, signals = plant.moved(x, no_orders)
        return rate if loop is None else rate + B @ (loop @ wanted(rate, signals))

    if plant.nx > DENSE:
        operator = LinearOperator((plant.nx, plant.nx), matvec=moved, dtype=float)
        try:
            return float(abs(eigs(operator, 1, tol=ACCURACY, v0=np.ones(plant.nx), return_eigenvectors=False)[0]))
        except ArpackError:
            pass
    return float(np.abs(np.linalg.eigvals(np.array([moved(x) for x in np.eye(plant.nx)]).T)).max(initial=0.0))


def _seen(point: OperatingPoint, wired: Wired) -> np.ndarray:
    """What the law of each storage device sees of the rotors: its group against the mean of the others."""
    a, rotors = wired.places, point.rotors
    unit = storage.places(point.system, point.case).unit
    out = np.zeros((len(unit), len(rotors.unit)))
    for j, own in enumerate(unit):
        i = int(np.flatnonzero(rotors.unit == own)[0])
        group = np.zeros(len(rotors.unit), bool)
        group[a.member[a.first[i] : a.first[i + 1]]] = True
        rest = np.where(group, 0.0, rotors.inertia)
        out[j] = np.where(group, rotors.inertia, 0.0) / rotors.inertia[group].sum() - rest / (rest.sum() or 1.0)
    return out
