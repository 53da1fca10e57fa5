"""Inputs: a set-point of z, or a power drawn from a bus."""

from typing import NamedTuple

import numpy as np

from stabctl.dynamics.operating_point import Point
from stabctl.dynamics.system import sizes

from .signals import Signal


class Draw(NamedTuple):
    """A power drawn from a bus: direction 1 (active) or j (reactive), and its shares against voltage."""

    bus: int
    direction: complex
    power: float  # share that is constant power
    current: float  # share that is constant current; the rest is constant admittance
    v0: float  # pu   voltage at which the power is the one asked for
    v_low: float  # pu   below it everything is an admittance

    def current_of(self, V: complex) -> complex:
        """Current into the network (pu) per pu of power: -conj(direction / V) at V = v0."""
        m = max(abs(V), self.v_low)
        shape = self.power / m**2 + self.current / (m * self.v0)
        shape += (1 - self.power - self.current) / self.v0**2
        return -self.direction.conjugate() * shape * V


def place(point: Point, signal: Signal) -> int | None:
    """Place in z of a set-point; None for a drawn power."""
    n, case = sizes(point.plant, len(point.V)), point.case
    first = n.states + n.voltages
    if signal.kind == "order":
        return first + 2 * n.machines + [f"{s.machine}@{s.bus}" for s in case.storage].index(signal.place)
    if signal.kind in ("storage", "load_p", "load_q"):
        return None
    machine = [m.machine for m in case.machines].index(signal.place)
    return first + machine + n.machines * (signal.kind in ("pref", "power"))


def draw(point: Point, signal: Signal) -> Draw:
    """The drawn power: a storage device is constant power, a load change is like the bus's first load."""
    bus = point.net.place[signal.place]
    v0 = float(abs(point.V[bus]))
    if signal.kind == "storage":
        return Draw(bus, 1 + 0j, 1.0, 0.0, v0, 0.5)
    load = next((b for b in point.case.loads if b.bus == signal.place), None)
    reactive = signal.kind == "load_q"
    direction = 1j if reactive else 1 + 0j
    if load is None:
        return Draw(bus, direction, 0.0, 0.0, v0, 0.5)
    shares = (load.q_power, load.q_current) if reactive else (load.p_power, load.p_current)
    return Draw(bus, direction, *shares, v0, load.v_low)


def slopes(point: Point, signal: Signal) -> np.ndarray:
    """Derivative (2) of the current into the bus of a drawn power, at the operating point."""
    d = draw(point, signal)
    current = d.current_of(complex(point.V[d.bus]))
    return np.array([current.real, current.imag])
