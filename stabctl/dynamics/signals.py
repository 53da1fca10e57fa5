"""Inputs and outputs by name: `storage:33` is the power of a storage device at bus 33, `speed` means all speeds.

The label that results show, such as `speed GENROU 2`, names the same signal.

Every signal is a deviation from the operating point. Powers are in pu on the system base unless stated otherwise,
angles in rad, everything else in pu.
"""

import csv
import difflib
import re
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from stabctl import devices
from stabctl._util.errors import StudyError, shown
from stabctl.model import naming
from stabctl.model.case import Case
from stabctl.model.location import Place, circuit, read


class Kind(NamedTuple):
    """A kind of signal that can be an input or output of linear models and controllers."""

    place: str  # what it belongs to: "machine", "group", "bus", "line", "device", "state" or ""
    label: str
    unit: str
    meaning: str


def _kinds(direction: str) -> Mapping[str, Kind]:
    """The kinds of inputs or outputs in `signals.csv`; {machine}, {exciter}, {governor} in labels are their models."""
    with Path(__file__).with_name("signals.csv").open(newline="", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row.pop("direction") == direction]
    return MappingProxyType({row.pop("name"): Kind(**row) for row in rows})


INPUTS, OUTPUTS = _kinds("input"), _kinds("output")
SPEEDS = ("speed", "coi_speed", "rest_speed", "deviation", "frequency", "bus_frequency")  # pu of the rated frequency
OF_ROTOR = ("speed", "angle", "rest_speed", "deviation", "angle_deviation")  # of a machine, or virtual
OF_MACHINE = ("efd", "pm", "ifd", "field", "power")
OF_STORAGE = ("order", "order_q", "order_v")
OF_CONVERTER = ("ipcmd", "iqcmd")
SET_POINTS = {"pset": ("Pset", "Pref"), "qset": ("Qset", "Qext", "Qref"), "vset": ("Vset", "Vref")}  # ports
CONTROLS = ("plant control", "electrical control", "converter")  # of a converter, the outermost first
REFERENCES = {"vref": "exciter", "vs": "exciter", "pref": "governor"}  # input -> role of the control it belongs to


class Signal(NamedTuple):
    """One input or output of a linear model."""

    kind: str
    place: int | Place | None
    label: str
    unit: str
    called: int | Place | None  # the place, a machine by what it is called

    @property
    def name(self) -> str:
        """As it is written in a controller: speed:2, speed:30/1."""
        return self.kind if self.called is None else f"{self.kind}:{self.called}"

    @property
    def number(self) -> int:
        """Number of its machine or bus."""
        if not isinstance(self.place, int):
            raise TypeError(f"{self.label} belongs to no machine and no bus")
        return self.place


def chosen(case: Case, wanted: str | Iterable[str | Signal], kinds: Mapping[str, Kind]) -> tuple[Signal, ...]:
    """The signals named in a list, or in one text separated by commas; a kind alone means all signals of that kind.

    A signal may also be named by its label. Raises `StudyError` if a name is not a signal of the case.
    """
    found: list[Signal] = []
    names = [part for part in naming.listed(wanted) if part] if isinstance(wanted, str) else wanted
    if isinstance(names, Signal) or not isinstance(names, Iterable):
        raise StudyError(f"{wanted!r} is not a list of signals; write 'speed:2' or ['speed:2', 'voltage:7'].")
    for text in names:
        if isinstance(text, Signal):
            found.append(text)
            continue
        name, _, place = str(text).strip().partition(":")
        if name not in kinds and (signal := _labelled(case, str(text).strip(), kinds)):
            found.append(signal)
            continue
        if name not in kinds:
            what, example = ("input", "vref:2") if kinds is INPUTS else ("output", "speed:14")
            similar = difflib.get_close_matches(name, kinds, 3, 0.7)
            instead = (
                f"did you mean {' or '.join(similar)}?"
                if similar
                else f"the {what}s are {', '.join(kinds)}. Add a number for one only: {example}."
            )
            raise StudyError(f"{shown(name)} is not an {what}; {instead}")
        kind = kinds[name]
        places = [place] if place else _everywhere(case, name, kind)
        found += [_signal(case, name, kind, p) for p in places]
    labels = [s.label for s in found]
    for label in labels:
        if labels.count(label) > 1:
            raise StudyError(f"The signal {label!r} appears twice; give each signal once.")
    return tuple(found)


def _labelled(case: Case, label: str, kinds: Mapping[str, Kind]) -> Signal | None:
    """The signal of the case that has this label, such as `speed GENROU 2`."""
    models = "|".join(re.escape(device.name) for device in devices.models().values())
    for name, kind in kinds.items():
        form = re.sub(r"{(\w+)}", lambda part: "(?P<place>.+)" if part[1] == "place" else f"(?:{models})", kind.label)
        if kind.place == "state" or not (match := re.fullmatch(form, label)):
            continue
        with suppress(StudyError):  # the label of another kind: P ESD 1@5 is not the power of a machine
            signal = _signal(case, name, kind, match.groupdict().get("place"))
            if signal.label == label:
                return signal
    return None


def _everywhere(case: Case, name: str, kind: Kind) -> Sequence[int | str | None]:
    """Every machine, bus, circuit or device that has a signal of this kind."""
    if kind.place == "device":
        return naming.keys(case, "storage") or [_device(case, "")]  # which says that there is none
    if name == "storage":
        return list(dict.fromkeys(m.storage_bus for m in case.machines))
    if name in ("load_p", "load_q"):
        return list(dict.fromkeys(load.bus for load in case.loads))
    if kind.place == "bus":
        return [b.bus for b in case.buses]
    if kind.place == "line":
        return naming.keys(case, "branches")
    if kind.place == "":
        return [None]
    numbers = [m.machine for m in case.machines]
    if name in REFERENCES:
        return [n for n in numbers if case.model(n, REFERENCES[name])]
    if name in ("field", "power"):
        return [n for n in numbers if not case.model(n, "exciter" if name == "field" else "governor")]
    if name in OF_CONVERTER:
        return [n for n in numbers if case.model(n, "converter")]
    if name in SET_POINTS:
        return [n for n in numbers if port(case, n, name)]
    if kind.place == "state":
        raise StudyError("Name the states as in the labels of linear models, such as state:speed GENROU 2.")
    if name in (*OF_ROTOR, *OF_MACHINE):
        return [n for n in numbers if _has_rotor(case, n, name in OF_ROTOR)]
    return numbers


def _signal(case: Case, name: str, kind: Kind, place: int | Place | None) -> Signal:
    """The signal of one machine, bus, circuit or device, checked."""
    if kind.place in ("machine", "bus"):
        by_name = naming.machine_number if kind.place == "machine" else naming.bus_number
        if not re.fullmatch(r"[0-9]{1,18}", str(place)):
            place = by_name(case, place) or place
        if not re.fullmatch(r"[0-9]{1,18}", str(place)):
            raise StudyError(
                f"{shown(f'{name}:{place}')} does not name a {kind.place}; give its number, such as {name}:14."
            )
        place = number = int(str(place))
        if kind.place == "machine":
            case.machine(number)
            _belongs(case, name, number)
    if kind.place == "bus" and place not in {b.bus for b in case.buses}:
        raise StudyError(f"There is no bus {place} in {case.name}.")
    elif kind.place == "line":
        circuit(case, place := read(case, str(place)))
    elif kind.place == "device":
        place = _device(case, str(place))
        if name == "charge" and not case.storage[naming.row(case, "storage", place)].energy:
            raise StudyError(f"The capacity of the storage device {place} is unlimited, so it has no state of charge.")
    elif kind.place == "group":
        place = _group(case, name, str(place))
    elif kind.place == "" and place is not None:
        raise StudyError(f"{name} is one signal for the whole system; write {name} without a number.")
    words = {
        "machine" if role == "converter" else role: devices.models()[model].name
        for role in ("machine", "converter", "exciter", "governor")
        if isinstance(place, int) and (model := case.model(place, role))
    }
    called: int | Place | None = place
    if kind.place in ("machine", "group"):
        names = [case.called[int(n)] for n in str(place).split("+")]
        called = names[0] if len(names) == 1 else "+".join(map(str, names))
    return Signal(name, place, kind.label.format(place=called, **words), kind.unit, called)


def _group(case: Case, name: str, text: str) -> int | str:
    """A machine, or several joined by "+", as numbers in ascending order."""
    found = set()
    for part in text.split("+"):
        number = part if re.fullmatch(r"[0-9]{1,18}", part) else naming.machine_number(case, part)
        if number is None:
            raise StudyError(f"{shown(f'{name}:{text}')} does not name machines; give numbers: {name}:13+14.")
        case.machine(int(number))
        _belongs(case, name, int(number))
        found.add(int(number))
    if len(found) > 1 and found >= {m.machine for m in case.machines if _has_rotor(case, m.machine, name in OF_ROTOR)}:
        raise StudyError(f"{shown(f'{name}:{text}')} leaves no other machine to compare with; leave one out.")
    return "+".join(map(str, sorted(found))) if len(found) > 1 else found.pop()


def _device(case: Case, text: str) -> str:
    """A storage device, machine@bus, the second one there machine@bus#2; the machine alone if it has only one."""
    if not case.storage:
        raise StudyError(f"{case.name} has no storage devices; give storage='50MW', for example.")
    return str(naming.keys(case, "storage")[naming.row(case, "storage", text)])


def _belongs(case: Case, name: str, number: int) -> None:
    """Check that the machine has the control that the reference belongs to, or lacks the one that would override it."""
    called = case.called[number]
    if name in (*OF_ROTOR, *OF_MACHINE) and not _has_rotor(case, number, name in OF_ROTOR):
        raise StudyError(
            f"Unit {called} of {case.name} is a converter without a rotor, so it has no signal {name}; choose another."
        )
    if name in OF_CONVERTER and not case.model(number, "converter"):
        raise StudyError(
            f"Unit {called} of {case.name} is not a converter, so it has no signal {name}; choose another."
        )
    if name in SET_POINTS and not port(case, number, name):
        raise StudyError(
            f"Unit {called} of {case.name} has no converter control with a set-point {name}; choose another."
        )
    if name in REFERENCES and not case.model(number, REFERENCES[name]):
        instead = "power" if name == "pref" else "field"
        raise StudyError(f"Machine {called} of {case.name} has no {REFERENCES[name]}; use {instead}:{called}.")
    if name in ("field", "power"):
        reference, control = ("vref", "an exciter") if name == "field" else ("pref", "a governor")
        if case.model(number, REFERENCES[reference]):
            raise StudyError(f"Machine {called} of {case.name} has {control}; use {reference}:{called}.")


def _has_rotor(case: Case, number: int, virtual: bool) -> bool:
    """Whether a unit is a synchronous machine or, if `virtual` rotors count, a converter with one."""
    converter = case.model(number, "converter") if virtual else None
    with_inertia = converter is not None and devices.models()[converter].has("inertia")
    return case.model(number, "machine") is not None or with_inertia


def port(case: Case, number: int, kind: str) -> str | None:
    """The port of a converter's outermost control that a set-point belongs to; None if there is none."""
    for role in CONTROLS:
        model = case.model(number, role)
        fields = devices.models()[model].Input._fields if model else ()
        found = next((name for name in SET_POINTS[kind] if name in fields), None)
        if found:
            return found
    return None


def machines(signal: Signal) -> tuple[int, ...]:
    """Numbers of the machines of a signal of a machine or group."""
    return tuple(map(int, str(signal.place).split("+")))
