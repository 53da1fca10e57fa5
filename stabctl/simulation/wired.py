"""An operating point with a storage control law, connected for the stepper.

After the outputs of the system comes a memory (`Memory`): the orders that the law wants, the delay lines of a sampled
law and the orders behind them, those at the beginning of a step, and what `Relative` describes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from stabctl._util.errors import StudyError
from stabctl.controllers import Law, StorageDevice, hold
from stabctl.devices.device import of as device_of
from stabctl.dynamics import storage
from stabctl.dynamics.family import Family
from stabctl.dynamics.layout import Layout
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.dynamics.program import Program, complex_currents, program
from stabctl.dynamics.rows import NO_UNIT
from stabctl.model.case import Case

from . import line
from ._buffers import Run
from ._newton import newton, space
from ._places import Places, Relative, places, with_ratings
from .topology import Stage


@dataclass(frozen=True, eq=False)
class Wired:
    """Tables of the system and its law, places of its signals, and where a run starts."""

    program: Program
    families: tuple[Family, ...]
    layout: Layout
    places: Places
    wanted: slice  # of the orders in s
    rates: tuple[int, ...]  # 1/s, of the sampled controllers and of the law; place k is bit k
    start: np.ndarray  # s
    kept: dict[Any, Any] = field(repr=False)  # what follows from the tables, shared by all systems of one structure

    def prepare_newton(self, p: Program, places: Places, network: Stage, run: Run) -> Any:
        """Let a run solve for the voltages by Newton's method; returns what must live as long as it is on this network.

        The calls for complex numbers are kept with the system.
        """
        if "newton" not in self.kept:
            self.kept["newton"] = complex_currents(self.families)
        own = space(self.kept["newton"], network.pattern, places, run)
        call = newton.bound(p, places, network.net, run, own)
        run.newton[:] = call.address, call.words
        return call

    def constants_at(self, table: str) -> int:
        """Place in the program's constants of the first constant of a table."""
        at = 0
        for f in self.families:
            if f.name == table:
                return at
            at += f.k.size
        raise KeyError(table)


class Memory(NamedTuple):
    """Places of what follows the outputs of the system."""

    orders: slice  # that the law, or the user, wants
    lines: int  # of the delay lines of a sampled law
    acting: int  # orders behind these lines
    begun: int  # orders at the beginning of a step, and those wanted there
    relative: Relative
    end: int


def wired(
    point: OperatingPoint, control: Law | None, rates: tuple[int, ...] = (), gates: tuple[int, ...] = ()
) -> Wired:
    """The system of an operating point with a control law; its calls are kept with the system.

    Parameters
    ----------
    point
        The operating point.
    control
        The law of the storage devices; None: orders are set from outside.
    rates
        Rates of the sampled controllers, 1/s.
    gates
        Places of the flags of the gates of controllers.
    """
    own = control.rate if control is not None else None
    rates = rates if own is None or own in rates else (*rates, own)
    law = control and (control.device, control.frames, control.relay, control.groups, own and rates.index(own))
    kept, key = point.system.kept, ("wired", law, rates, gates)
    if key not in kept:
        kept[key] = _wired(point, control, rates, gates)
    return _with_constants(kept[key], point, control)


def _wired(point: OperatingPoint, control: Law | None, rates: tuple[int, ...], gates: tuple[int, ...]) -> Wired:
    """As `wired`, without a look at what the system keeps."""
    memory = _memory(point, control)
    layout = replace(point.system.layout, memory=point.system.layout.memory + memory.end - point.system.layout.size)
    families = (*point.system.families, *_families(point, control, memory, layout, rates))
    start = np.zeros(layout.size)
    start[memory.relative.online : memory.relative.time] = 1.0
    for i, value in enumerate(control.device.start if control else ()):
        start[memory.orders.start + i : memory.lines : memory.orders.step] = value
    held = np.r_[orders_of(layout, point.case), np.array(gates, np.int64)]
    esd = storage.places(point.system, point.case)
    how: dict[str, Any] = {
        "begun": memory.begun,
        "wanted": np.r_[memory.orders],
        "own": _own(point),
        "groups": _groups(point, control),
    }
    how |= {"gated": bool(gates), "acting": _acting(point.case, len(held)), **_switches(families, control)}
    made = places(point.system, layout, memory.relative, held, esd.order, **how)
    return Wired(program(families), families, layout, made, memory.orders, rates, start, point.system.kept)


def _with_constants(system: Wired, point: OperatingPoint, control: Law | None) -> Wired:
    """The system with the parameters, limits and signals of an operating point whose devices have the same places."""
    more = {"hold": storage.ramps(point.system, point.case)[:, None], "law": _parameters(control, point.case)}
    own = (f._replace(k=more.get(f.name, f.k)) for f in system.families[len(point.system.families) :])
    families = (*point.system.families, *own)
    k = np.concatenate([np.zeros(0), *(f.k.ravel() for f in families)])
    start = system.start.copy()
    start[: system.layout.first_memory] = point.s[: system.layout.first_memory]
    acting = _acting(point.case, len(system.places.held))
    made = with_ratings(system.places, point.system, acting=acting, **_switches(families, control))
    return replace(system, program=system.program._replace(k=k), families=families, places=made, start=start)


def orders_of(layout: Layout, case: Case) -> np.ndarray:
    """Places of the set-points of the storage devices' orders, in the order of the case's table."""
    found = [k for k, point in enumerate(layout.setpoints) if (point.unit, point.name) == (NO_UNIT, "order")]
    out = np.empty(len(found), np.int64)
    out[storage.by_table(case)] = found
    return layout.first_setpoint + out


def _acting(case: Case, held: int) -> np.ndarray:
    """Rows of what is held that change a power: not the orders of devices without a rating, which divide no step."""
    return np.array([j for j in range(held) if j >= len(case.storage) or case.storage[j].rating > 0], np.int64)


def _memory(point: OperatingPoint, control: Law | None) -> Memory:
    """Places after the outputs of the system."""
    n, m, first = len(point.case.storage), len(point.rotors.unit), point.system.layout.size
    stride = len(control.device.Output._fields) if control is not None else 1
    lines = first + n * stride
    sampled = control is not None and control.rate is not None
    acting = lines + n * control.frames if sampled and control is not None else first
    begun = acting + n if sampled else lines
    speed = begun + 2 * n
    relative = Relative(speed, speed + m, speed + 2 * m, speed + 3 * m, speed + 3 * m + len(point.case.machines))
    return Memory(slice(first, lines, stride), lines, acting, begun, relative, relative.end)


def _switches(families: tuple[Family, ...], control: Law | None) -> dict[str, bool]:
    """Whether the orders switch between fixed values, follow the signals and the accelerations they cause, may jump.

    An order that switches behind a ramp limit, or beside another device with a memory, is held over a step instead.
    """
    others = any(f.device.step is not None for f in families if f.name not in ("law", "hold"))
    ramped = any(f.name == "hold" and (f.k > 0).any() for f in families)
    relay = control is not None and control.relay
    follows = control is not None and not control.relay and control.rate is None
    more = {name: follows and getattr(control, name) for name in ("inertial", "abrupt")}
    return {"relay": relay and not (ramped or others), "follows": follows, **more}


def _own(point: OperatingPoint) -> np.ndarray:
    """The rotor unit of each storage device, -1: none."""
    rotor = np.full(len(point.case.machines), -1)
    rotor[point.rotors.unit] = np.arange(len(point.rotors.unit))
    return rotor[storage.places(point.system, point.case).unit]


def _families(
    point: OperatingPoint, control: Law | None, memory: Memory, layout: Layout, rates: tuple[int, ...]
) -> tuple[Family, ...]:
    """The devices of the law, their delay lines and the holds."""
    system, case, n = point.system, point.case, len(point.case.storage)
    if not n:
        return ()
    esd, j, of = storage.places(system, case), np.arange(n), memory.relative
    unit = esd.unit
    common = [np.zeros(n, np.int64), esd.bus, esd.bus, unit]
    order, wanted = orders_of(layout, case), np.r_[memory.orders]
    sampled = control is not None and control.rate is not None
    acting = memory.acting + j if sampled else wanted
    aim = memory.begun + n + j if control is not None and not control.relay and not sampled else acting
    columns = [*common, acting, of.online + unit, memory.begun + j, aim, np.full(n, layout.step), order]
    holds = Family("hold", device_of(hold), np.stack(columns, 1), storage.ramps(system, case)[:, None], esd.keys)
    if control is None:
        return (holds,)
    own = _own(point)
    if (own < 0).any():
        number = case.machines[unit[own < 0][0]].called
        raise StudyError(
            f"The storage of machine {number} of {case.name} cannot be controlled by its speed, because it is a "
            "grid-following converter without a rotor; assign the storage to a machine or grid-forming converter."
        )
    reads = [of.speed + own, of.acceleration + own, of.angle + own, esd.energy, np.full(n, of.time)]
    places_of = np.stack([*common, *reads, wanted], 1)
    law = Family("law", control.device, places_of, _parameters(control, case), esd.keys)
    if not sampled:
        return law, holds
    lines = [wanted, np.full(n, of.due), memory.lines + control.frames * j, acting]
    bits = np.tile([float(control.frames), float(rates.index(control.rate or 0))], (n, 1))
    return law, Family("line", device_of(line), np.stack([*common, *lines], 1), bits, esd.keys), holds


def _parameters(control: Law | None, case: Case) -> np.ndarray:
    """Constants of a law (devices, constants); none without a law."""
    if control is None:
        return np.zeros((len(case.storage), 0))
    return np.array([tuple(control.par(device)) for device in storage_devices(case)], float)


def storage_devices(case: Case) -> list[StorageDevice]:
    """What a law may know of each storage device of a case."""
    base = {machine.machine: machine.base for machine in case.machines}
    return [
        StorageDevice(
            s.rating, base[s.machine], case.frequency_hz, case.base_mva, s.energy * s.charge * 3600 / case.base_mva
        )
        for s in case.storage
    ]


def _groups(point: OperatingPoint, control: Law | None) -> Sequence[np.ndarray]:
    """Rotor units of the group of each rotor unit: that of the law, or itself alone."""
    numbers = list(point.rotor_numbers)
    found = [np.array([i]) for i in range(len(numbers))]
    for group in control.numbers(point.case) if control is not None else ():
        for n in group:
            if n not in numbers:
                raise StudyError(
                    f"Unit {point.case.called[n]} of {point.case.name} has no rotor; leave it out of the group."
                )
        members = np.array([numbers.index(n) for n in group])
        for i in members:
            found[i] = members
    return found
