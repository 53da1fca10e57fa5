"""An operating point with a storage control law, connected for the stepper.

After the outputs of the system comes a memory: the orders requested from the storage devices, and three signals of
every rotor unit: its speed deviation and acceleration relative to the COI of the others in its island, and whether it
is on.
"""

from dataclasses import dataclass, replace
from types import ModuleType

import numpy as np

from stabctl import devices
from stabctl.controllers import Device, Law, hold
from stabctl.dynamics import family
from stabctl.dynamics.layout import Layout
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.dynamics.program import Program, program
from stabctl.dynamics.rows import NO_UNIT
from stabctl.dynamics.tables import Family
from stabctl.errors import StudyError

from .plant import Frame, frame


@dataclass(frozen=True, eq=False)
class Wired:
    """Tables of the system and its law, places of its signals, and where a run starts."""

    program: Program
    families: tuple[Family, ...]
    layout: Layout
    frame: Frame
    wanted: slice  # of the orders in s
    start: np.ndarray  # s

    def constants_at(self, table: str) -> int:
        """Place in the program's constants of the first constant of a table."""
        at = 0
        for f in self.families:
            if f.name == table:
                return at
            at += f.k.size
        raise KeyError(table)


def wired(point: OperatingPoint, control: Law | None) -> Wired:
    """The system of an operating point with a control law; its calls are kept with the system."""
    kept, law = point.system.kept, control.module if control is not None else None
    families, layout, places = _families(point, control)
    key = "wired", law
    if key not in kept:
        kept[key] = program(families)
    k = np.concatenate([np.zeros(0), *(f.k.ravel() for f in families)])
    orders, deviation, m = places
    held = orders_of(layout)
    start = np.zeros(layout.size)
    start[: layout.first_memory] = point.s[: layout.first_memory]
    online = deviation + 2 * m
    start[online : online + len(point.case.machines)] = 1.0
    made = frame(point.system, layout, deviation, held, relay=_switches(families, law))
    return Wired(kept[key]._replace(k=k), families, layout, made, slice(orders, orders + len(held)), start)


def orders_of(layout: Layout) -> np.ndarray:
    """Places of the set-points of the storage devices' orders."""
    found = [k for k, point in enumerate(layout.setpoints) if (point.unit, point.name) == (NO_UNIT, "order")]
    return layout.first_setpoint + np.array(found, np.int64)


def _switches(families: tuple[Family, ...], law: ModuleType | None) -> bool:
    """Whether the orders switch between fixed values: a relay, no ramp limit, no other device with a memory."""
    others = any(hasattr(f.device, "step") for f in families if f.name not in ("law", "hold"))
    ramped = any(f.name == "hold" and (f.k > 0).any() for f in families)
    return bool(getattr(law, "RELAY", False)) and not ramped and not others


def _families(point: OperatingPoint, control: Law | None) -> tuple[tuple[Family, ...], Layout, tuple[int, int, int]]:
    """The system's families, those of the law and of the holds; the layout; places of orders and deviations, rotors."""
    system, case = point.system, point.case
    n, m, first = len(case.storage), len(system.rotors.unit), system.layout.size
    deviation = first + n
    layout = replace(system.layout, memory=system.layout.memory + n + 2 * m + len(case.machines))
    if not n:
        return system.families, layout, (first, deviation, m)
    esd = system.family("esd")
    j, unit = np.arange(n), esd.w[:, family.UNIT]
    rotor = np.full(len(case.machines), -1)
    rotor[system.rotors.unit] = np.arange(m)
    common = [np.zeros(n, np.int64), esd.w[:, family.BUS], esd.w[:, family.BUS], unit]
    order, wanted = orders_of(layout), first + j
    columns = [*common, wanted, deviation + 2 * m + unit, np.full(n, layout.step), order]
    ramp = esd.k[:, [devices.every()["esd"].Par._fields.index("ramp")]]
    holds = Family("hold", hold, np.stack(columns, 1), ramp, esd.keys)
    if control is None:
        return (*system.families, holds), layout, (first, deviation, m)
    if (rotor[unit] < 0).any():
        number = case.machines[unit[rotor[unit] < 0][0]].machine
        raise StudyError(
            f"The storage of machine {number} of {case.name} cannot be controlled by its speed, because it is a "
            "converter without a rotor; assign the storage to a synchronous machine."
        )
    base = {machine.machine: machine.base for machine in case.machines}
    of = [Device(s.rating, base[s.machine], case.frequency_hz) for s in case.storage]
    k = np.array([tuple(control.par(device)) for device in of], float)
    own = deviation + rotor[unit]
    law = Family("law", control.module, np.stack([*common, own, own + m, wanted], 1), k, esd.keys)
    return (*system.families, law, holds), layout, (first, deviation, m)
