"""The kinds of signals that can be inputs and outputs of linear models and controllers."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple


class Kind(NamedTuple):
    """A kind of signal: what it belongs to, its label, unit and meaning."""

    place: str  # "machine", "group", "bus", "line", "device", "state" or ""
    label: str
    unit: str
    meaning: str


def _kinds(rows: Mapping[str, tuple[str, str, str, str]]) -> Mapping[str, Kind]:
    return MappingProxyType({name: Kind(*row) for name, row in rows.items()})


INPUTS = _kinds(
    {
        "storage": ("bus", "P storage bus {place}", "pu", "active power absorbed by a storage device at a bus"),
        "order": (
            "device",
            "order ESD {place}",
            "ratings",
            "order to a storage device of the case, positive to absorb",
        ),
        "order_q": (
            "device",
            "reactive order ESD {place}",
            "ratings",
            "reactive order to a storage device, within its MVA, positive to absorb",
        ),
        "order_v": (
            "device",
            "voltage order ESD {place}",
            "pu",
            "change of the voltage reference of a storage device behind a converter that has one",
        ),
        "vs": ("machine", "stabilizer input {exciter} {place}", "pu", "signal added to the stabilizers of an exciter"),
        "vref": ("machine", "reference {exciter} {place}", "pu", "voltage reference of an exciter"),
        "pref": ("machine", "reference {governor} {place}", "pu", "load reference of a governor, machine base"),
        "field": ("machine", "field voltage {machine} {place}", "pu", "field voltage of a machine without exciter"),
        "power": (
            "machine",
            "mechanical power {machine} {place}",
            "pu",
            "mechanical power of a machine without governor, machine base",
        ),
        "ipcmd": (
            "machine",
            "active current {machine} {place}",
            "pu",
            "active current command of a converter, its base",
        ),
        "iqcmd": ("machine", "reactive current {machine} {place}", "pu", "reactive current command, converter base"),
        "pset": (
            "machine",
            "P set-point {machine} {place}",
            "pu",
            "power set-point of a converter's outermost control, its base",
        ),
        "qset": (
            "machine",
            "Q set-point {machine} {place}",
            "pu",
            "reactive power (or voltage) set-point of that control",
        ),
        "vset": (
            "machine",
            "V set-point {machine} {place}",
            "pu",
            "voltage set-point of a plant control or static var unit",
        ),
        "load_p": ("bus", "P load bus {place}", "pu", "active power added to a load, with its voltage dependence"),
        "load_q": ("bus", "Q load bus {place}", "pu", "reactive power added to a load, with its voltage dependence"),
    }
)
OUTPUTS = _kinds(
    {
        "speed": ("machine", "speed {machine} {place}", "pu", "speed of a rotor, real or virtual"),
        "angle": ("machine", "angle {machine} {place} to COI", "rad", "rotor angle relative to the COI"),
        "coi_speed": ("", "speed COI", "pu", "speed of the center of inertia (COI)"),
        "rest_speed": ("machine", "speed COI without {place}", "pu", "COI speed of all other machines"),
        "deviation": (
            "group",
            "speed deviation {place}",
            "pu",
            "speed of a machine, or COI speed of a group (13+14), minus the COI speed of the others",
        ),
        "angle_deviation": (
            "group",
            "angle deviation {place}",
            "rad",
            "angle of a machine, or mean angle of a group (13+14), minus the mean angle of the others",
        ),
        "voltage": ("bus", "voltage bus {place}", "pu", "magnitude of a bus voltage"),
        "bus_angle": ("bus", "angle bus {place} to COI", "rad", "angle of a bus voltage relative to the COI"),
        "frequency": ("bus", "frequency bus {place}", "pu", "bus frequency: rate of the bus angle, inputs constant"),
        "bus_frequency": (
            "bus",
            "measured frequency bus {place}",
            "pu",
            "frequency from the filtered bus angle (20 ms)",
        ),
        "rocof": ("bus", "rate of frequency bus {place}", "Hz/s", "rate of the measured frequency, filtered (100 ms)"),
        "efd": ("machine", "field voltage {machine} {place}", "pu", "field voltage"),
        "pm": ("machine", "mechanical power {machine} {place}", "pu", "mechanical power, machine base"),
        "pe": ("machine", "P {machine} {place}", "pu", "active power at the terminals, machine base"),
        "qe": ("machine", "Q {machine} {place}", "pu", "reactive power at the terminals, machine base"),
        "vt": ("machine", "terminal voltage {machine} {place}", "pu", "terminal voltage of a machine"),
        "ifd": ("machine", "field current {machine} {place}", "pu", "field current"),
        "vs": ("machine", "stabilizing signal {place}", "pu", "output of a stabilizer"),
        "absorbed": ("device", "P ESD {place}", "pu", "power absorbed by a storage device"),
        "absorbed_q": ("device", "Q ESD {place}", "pu", "reactive power absorbed by a storage device"),
        "energy": ("device", "energy ESD {place}", "pu s", "energy in a storage device"),
        "charge": ("device", "charge ESD {place}", "-", "state of charge of a storage device, 0 to 1"),
        "state": ("state", "{place}", "", "a state, by its label in linear models"),
        "flow": ("line", "P line {place}", "pu", "active power into a circuit from the first bus named"),
        "flow_q": ("line", "Q line {place}", "pu", "reactive power into a circuit from the first bus named"),
        "current": ("line", "current line {place}", "pu", "current into a circuit from the first bus named, magnitude"),
    }
)

OF_ROTOR = ("speed", "angle", "rest_speed", "deviation", "angle_deviation")  # of a machine, or virtual
OF_MACHINE = ("efd", "pm", "ifd", "field", "power")
OF_STORAGE = ("order", "order_q", "order_v")
OF_CONVERTER = ("ipcmd", "iqcmd")
SET_POINTS = {"pset": ("Pset", "Pref"), "qset": ("Qset", "Qext", "Qref"), "vset": ("Vset", "Vref")}  # ports
CONTROLS = ("plant control", "electrical control", "converter")  # of a converter, the outermost first
REFERENCES = {"vref": "exciter", "vs": "exciter", "pref": "governor"}  # input -> role of the control it belongs to
