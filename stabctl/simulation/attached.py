"""An operating point with controllers: the places of all that they read and drive, and the sensors that they need."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from stabctl._util.errors import StudyError, shown
from stabctl._util.wording import enumerated
from stabctl.controllers.controller import Controller
from stabctl.controllers.realization import Matrices, anti_windup
from stabctl.devices.sensors import bus_angle, bus_voltage, line_current, line_power
from stabctl.dynamics import outputs
from stabctl.dynamics.extension import Extension
from stabctl.dynamics.inputs import DRAWN, extended, place
from stabctl.dynamics.layout import SetPoint, StatePlace
from stabctl.dynamics.named import Named, driven_machine, named
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.dynamics.signals import INPUTS, OUTPUTS, Signal, chosen, machines
from stabctl.model import naming

from . import center, frame, lti
from . import gate as gates

NONE = np.zeros((0, 0))
ANYWHERE = 0.37 + 1.93j  # where a transfer function is evaluated that is zero everywhere or almost nowhere
BOUND = 1e300  # in place of an infinite limit, which must not be multiplied by zero


@dataclass(frozen=True, eq=False)
class Attached:
    """An operating point with controllers."""

    point: OperatingPoint
    named: tuple[Named, ...] = ()
    rates: tuple[int, ...] = ()  # 1/s, of the sampled controllers that are compiled; place k is bit k
    called: tuple["Called", ...] = ()
    windows: tuple[tuple[int, float, float], ...] = ()  # place of a flag, its start and end, s
    measured: tuple["Measured", ...] = ()
    gates: tuple[int, ...] = ()  # places of the flags of gates
    units: tuple[np.ndarray, ...] = ()  # of every controller, the unit of each input, -1: none or several

    def without(self, off_s: np.ndarray) -> tuple[str, ...]:
        """A sentence for each controller whose outputs elsewhere follow signals of units that went off (units, s)."""
        return tuple(filter(None, map(partial(_without, self.point, off_s), self.named, self.units)))


def _without(point: OperatingPoint, off_s: np.ndarray, c: Named, units: np.ndarray) -> str:
    """The sentence about a controller; empty if its outputs elsewhere follow no such signal."""
    off, machines = np.isfinite(off_s), point.case.machines
    gone = (units >= 0) & off[units]
    if c.controller.law is not None or not gone.any():
        return ""
    lost = {m.machine for m, out in zip(machines, off, strict=True) if out}
    on = [driven_machine(point.case, s) not in lost for s in c.outputs]
    A, B, C, D = c.undelayed
    gain = D + C @ np.linalg.solve(ANYWHERE * np.eye(len(A)) - A, B)
    if not gain[on][:, gone].any():
        return ""
    rows = np.unique(units[gone]).tolist()
    names, first = enumerated("machine", [machines[row].called for row in rows]), off_s[rows].min()
    return (
        f"{c.controller.name} reads {names}, off from {first:.3f} s: the signals from there count as at rest, and its "
        "design, which is for all machines in service, does not hold any more."
    )


@dataclass(frozen=True)
class Called:
    """A Python function: where it reads, and where its held outputs are."""

    named: Named
    reads: np.ndarray
    units: np.ndarray  # (inputs) the unit that an input belongs to, -1: none
    held: slice
    gates: np.ndarray  # places of the flags, all above 0 while the gate is open


@dataclass(frozen=True)
class Measured:
    """A controller behind an estimator, and the places (inputs) of what it reads, which the estimator sets."""

    named: Named
    reads: np.ndarray


def attached(point: OperatingPoint, controllers: Sequence[Controller], measured: Sequence[Controller] = ()) -> Attached:
    """The operating point with controllers, which it keeps; it does not move.

    Parameters
    ----------
    point : OperatingPoint
        The operating point.
    controllers : sequence of Controller
        Controllers that read the true signals.
    measured : sequence of Controller
        Controllers behind an estimator. Each of their inputs is a set-point, at rest until the estimator sets it.

    Raises
    ------
    StudyError
        If a controller reads or drives what the case does not have.
    EquilibriumError
        If a controller forms an algebraic loop with the devices, which it names.
    """
    if not controllers and not measured:
        return Attached(point)
    kept = vars(point).setdefault("attached", {})
    key = tuple(controllers), tuple(measured)
    if key not in kept:
        kept[key] = _Attachment(point, *([named(point, c) for c in several] for several in key)).done()
    return kept[key]


def resized(point: OperatingPoint, ratings: Iterable[float]) -> OperatingPoint:
    """The point with other storage ratings (devices, MW), and with the controllers that it keeps attached."""
    new = point.resized(ratings)
    known = vars(point).get("attached", {})
    kept = {key: replace(a, point=new if a.point is point else a.point.resized(ratings)) for key, a in known.items()}
    vars(new)["attached"] = kept
    return new


def _opening(point: OperatingPoint, signal: str) -> Signal:
    """The one signal of a gate."""
    found = chosen(point.case, [signal], OUTPUTS)
    if len(found) != 1:
        raise StudyError(f"gate: {shown(signal)} are {len(found)} signals; give one, such as {found[0].name}.")
    return found[0]


def check_ramps(what: Attached) -> None:
    """Refuse to simulate controllers of devices with a ramp limit, which stands between a law and its device."""
    case = what.point.case
    limited = {str(key) for key, s in zip(naming.keys(case, "storage"), case.storage, strict=True) if s.ramp}
    for c in what.named:
        for driven in (s.place for s in c.outputs if s.kind == "order" and str(s.place) in limited):
            raise StudyError(
                f"Controller {c.controller.name} drives the order of storage {driven}, whose ramp limit holds for laws "
                "only; leave it out, and give a sampled controller a ramp (ratings per second) of its own."
            )


class _Attachment:
    """Adds controllers one after the other."""

    def __init__(self, point: OperatingPoint, true: Sequence[Named], behind: Sequence[Named]) -> None:
        controllers = [*true, *behind]
        gates_of = [c.controller.gate for c in controllers]
        opening = [_opening(point, g.signal) if g and g.signal else None for g in gates_of]
        read = [s for c in true for s in c.inputs] + [g for g in opening if g is not None]
        drawn = [s for c in controllers for s in c.outputs if s.kind in DRAWN]
        self.base = extended(point, drawn, read)
        self.more = Extension(self.base)
        self.controllers, self.opening, self.behind = controllers, opening, {id(c) for c in behind}
        rates = {c.controller.rate for c in controllers if c.controller.law is None}
        self.rates = tuple(sorted(r for r in rates if r))
        self.sensors = _Sensors(self.base, self.more)
        self.ports: dict[Signal, list[tuple[int, int, int]]] = {}
        self.called: list[tuple[Named, list[int], int, list[int]]] = []
        self.windows: list[tuple[int, float, float]] = []
        self.flags: list[int] = []
        self.measured: list[tuple[Named, list[int]]] = []
        self.unit = {m.machine: i for i, m in enumerate(point.case.machines)}
        for signal in dict.fromkeys(s for c in controllers for s in c.outputs):
            self.ports[signal] = self._ports(signal)

    def _ports(self, signal: Signal) -> list[tuple[int, int, int]]:
        """The inputs of devices that a signal drives."""
        if signal.kind == "vs":
            found = self.more.ports(self.unit[signal.number], "Vs")
        else:
            found = self.more.readers(place(self.base, signal))
        if not found:
            raise StudyError(f"No device of {self.base.case.name} reads {signal.label}, so it cannot be driven.")
        return found

    def done(self) -> Attached:
        """The operating point with all of them."""
        driven = [self._drive(c) for c in self.controllers]
        for c, signal, places in zip(self.controllers, self.opening, driven, strict=True):
            self._add(c, signal, *places)
        point, final = self.more.build(), self.more.place
        own = [f.device.fastest(k) for f in point.system.families if f.device.fastest is not None for k in f.k]
        point = replace(point, fastest=max([point.fastest, *own]))
        called = []
        for c, reads, held, flags in self.called:
            at, open_at = (np.array([final(place) for place in places], int) for places in (reads, flags))
            held_at = slice(final(held), final(held) + len(c.outputs))
            called.append(Called(c, at, np.array(self._units(c), int), held_at, open_at))
        windows = tuple((final(at), start, end) for at, start, end in self.windows)
        measured = tuple(Measured(c, np.array([final(r) for r in reads], int)) for c, reads in self.measured)
        gates_at = tuple(final(at) for at in self.flags)
        units = tuple(np.array(self._units(c), int) for c in self.controllers)
        return Attached(point, tuple(self.controllers), self.rates, tuple(called), windows, measured, gates_at, units)

    def _drive(self, c: Named) -> tuple[list[int], int, int]:
        """What the outputs of a controller are added to, the place of the first of the sums, and its owner."""
        more, owner = self.more, self._owner(c)
        base = [int(more.connected(self.ports[s], 0)) for s in c.outputs]
        out = more.outputs([more.value(at) for at in base], owner)
        for i, s in enumerate(c.outputs):
            more.connected(self.ports[s], out + i)
            if s.kind in ("field", "power"):  # Efd or Pm of a machine without exciter or governor
                more.supersede(place(self.base, s), out + i)
        return base, out, owner

    def _add(self, c: Named, opening: Signal | None, base: list[int], out: int, owner: int) -> None:
        what, more, m, p = c.controller, self.more, len(c.inputs), len(c.outputs)
        reads = self._estimated(c) if id(c) in self.behind else [self.sensors.place(s) for s in c.inputs]
        one = self.base.layout.one
        opens, window = one if opening is None else self._flag(c, opening), one
        if what.gate is not None and (what.gate.start > -np.inf or what.gate.end < np.inf):
            window = more.memory(1)
            self.windows.append((window, what.gate.start, what.gate.end))
        if what.law is not None:
            held = more.memory(p)
            k = self._constants(c, Matrices(NONE, NONE, NONE, np.zeros((p, 0))), 0)
            more.add("frame", frame, [0, 0, 0, owner, *base, opens, window, held, out], [*k, 0, 0.0, -1], what.name)
            self.called.append((c, reads, held, [opens, window]))
            return
        matrices = c.matrices
        k = self._constants(c, matrices, m)
        n = len(matrices.A)
        if what.rate is None:
            labels = [StatePlace("controller", 0, owner, f"x{i + 1}", f"x{i + 1} {what.name}") for i in range(n)]
            w = [more.states(labels, [0.0] * n), 0, 0, owner, *reads, *base, opens, window, out]
            more.add("lti", lti, w, k, what.name)
            return
        memory = more.memory(n + what.frames * p + p + n + p)
        tail = [what.frames, what.ramp / what.rate, self.rates.index(what.rate)]
        more.add("frame", frame, [0, 0, 0, owner, *reads, *base, opens, window, memory, out], [*k, *tail], what.name)

    def _estimated(self, c: Named) -> list[int]:
        """A set-point for each input of a controller behind an estimator, at the value at rest."""
        points = (SetPoint(-1, "measured", f"measured {s.label}", None) for s in c.inputs)
        reads = [self.more.setpoint(one, float(rest)) for one, rest in zip(points, c.rest, strict=True)]
        self.measured.append((c, reads))
        return reads

    def _owner(self, c: Named) -> int:
        """The unit of a controller that drives one machine only: it is frozen when the machine is off."""
        driven = {self.unit[s.number] if INPUTS[s.kind].place == "machine" else -1 for s in c.outputs}
        return driven.pop() if len(driven) == 1 else -1

    def _flag(self, c: Named, opening: Signal) -> int:
        """Place of a flag, 1 while the gate of a controller is open."""
        bounds, flag = c.controller.gate, self.more.memory(1)
        assert bounds is not None
        k = [max(bounds.low, -BOUND), min(bounds.high, BOUND), float(bounds.magnitude)]
        self.more.add("gate", gates, [0, 0, 0, -1, self.sensors.place(opening), flag], k, c.controller.name)
        self.flags.append(flag)
        return flag

    def _constants(self, c: Named, M: Matrices, m: int) -> list[float]:
        """The row of constants, as `lti` describes it."""
        what, n, p = c.controller, len(M.A), len(c.outputs)
        low, high = c.limits
        L = anti_windup(what, n)
        levels = [max(low, -BOUND), min(high, BOUND), what.deadband, float(what.relay)]
        parts: list[Any] = [[n, m, p], *(X.ravel() for X in M), c.rest[:m], self._units(c)[:m], levels, L.ravel()]
        return np.concatenate(parts).tolist()

    def _units(self, c: Named) -> list[int]:
        """The unit of every input, which counts as at rest while that is off; -1 if it belongs to none or several."""
        return [self._unit(s) for s in c.inputs]

    def _unit(self, signal: Signal) -> int:
        if signal.kind == "state":
            return self.base.layout.states[outputs.state(self.base, signal)].unit
        own = machines(signal) if OUTPUTS[signal.kind].place in ("machine", "group") else ()
        return self.unit[own[0]] if len(own) == 1 else -1


class _Sensors:
    """Places of signals; each that no device gives gets one sensor, which is added to the extension of the point."""

    def __init__(self, base: OperatingPoint, more: Extension) -> None:
        self._base, self._more = base, more
        self._found: dict[Signal, int] = {}

    def place(self, signal: Signal) -> int:
        """Place of a signal."""
        if signal not in self._found:
            self._found[signal] = self._sensor(signal)
        return self._found[signal]

    def _sensor(self, signal: Signal) -> int:
        """Place of a signal that was not asked for before."""
        base, kind = self._base, signal.kind
        if outputs.given(kind):
            return self._more.given(outputs.place(base, signal))
        if kind == "state":
            return outputs.state(base, signal)
        if kind == "frequency":
            raise StudyError(
                f"A controller cannot read frequency:{signal.place}, the exact rate of a bus angle; let it read "
                f"bus_frequency:{signal.place}, the measured frequency."
            )
        if kind == "speed":
            return int(base.rotors.speed[base.rotor_numbers.index(signal.number)])
        rest = float(outputs.value(base, signal)(base.s))
        if kind in ("angle", "rest_speed", "coi_speed", "deviation", "angle_deviation"):
            return self._center(signal, rest)
        if kind in outputs.OF_LINE:
            ends, par = outputs.line(base, signal.place)
            first, second = (int(base.layout.nx + k) for k in ends[[0, 2]])
            table, device = ("line_current", line_current) if kind == "current" else ("line_power", line_power)
            out = self._more.outputs([rest] if kind == "current" else [0.0, 0.0])
            self._more.add(table, device, [0, first, second, -1, out], par, signal.place)
            return out + (kind == "flow_q")
        out = self._more.outputs([rest])
        at = base.layout.nx + 2 * base.net.place[signal.number]
        if kind == "voltage":
            self._more.add("bus_voltage", bus_voltage, [0, at, at, -1, out], [], f"bus {signal.place}")
        else:
            mean = self._center(signal._replace(kind="coi_angle"), 0.0)
            self._more.add("bus_angle", bus_angle, [0, at, at, -1, mean, out], [], f"bus {signal.place}")
        return out

    def _center(self, signal: Signal, rest: float) -> int:
        """A mean of angles or speeds; see `center`. That of the island of a bus has the rotors that it had at rest."""
        rotors, kind = self._base.rotors, signal.kind
        group: np.ndarray = np.zeros(len(rotors.unit))
        if kind == "coi_angle":
            group = outputs.near(self._base, signal.number) * 1.0
        elif signal.place is not None:
            group = np.isin(self._base.rotor_numbers, machines(signal)) * 1.0
        own, mean, others = {
            "deviation": (1.0, -1.0, 1), "angle_deviation": (1.0, -1.0, 1), "angle": (1.0, -1.0, 0),
            "rest_speed": (0.0, 1.0, 1),
            "coi_speed": (0.0, 1.0, 0), "coi_angle": (1.0, 0.0, 0),
        }[kind]  # fmt: skip
        unit = -1 if kind in ("coi_speed", "coi_angle") else int(rotors.unit[group.argmax()])
        places = rotors.angle if kind in ("angle", "angle_deviation", "coi_angle") else rotors.speed
        out = self._more.outputs([rest])
        k = [len(group), own, mean, others, rest, *group, *rotors.inertia, *rotors.unit]
        self._more.add("center", center, [0, 0, 0, unit, *map(int, places), out], k, signal.label)
        return out
