"""Contingencies of a TOML file: a [[contingency]] with fault, trip and clearing time for each."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from stabctl._util import toml_file
from stabctl._util.errors import StudyError
from stabctl._util.units import seconds
from stabctl.model import naming
from stabctl.model.case import Case
from stabctl.simulation import events
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.events import Event

AT = 1.0  # s   instant of the fault of a contingency, by default
LONGEST = 10.0  # s   clearing time; in practice a few cycles
EXAMPLE = 'write [[contingency]] with fault = "16", trip = "16-21", clear = "8.2cyc"'


def read(path: str | Path, case: Case) -> tuple[Contingency, ...]:
    """The contingencies of a TOML file. Raises StudyError with file, row, key and value of the first error."""
    path = Path(path)
    content = toml_file.read(path, "contingency file")
    rows = content.pop("contingency", None)
    if content:
        raise StudyError(f"{path}: {toml_file.unknown(next(iter(content)), ['contingency'])}")
    if not isinstance(rows, list) or not rows:
        raise StudyError(f"{path} has no contingencies; {EXAMPLE}.")
    try:
        named = ((f"{path}, contingency {i}", row) for i, row in enumerate(rows, start=1))
        return checked(case, [_contingency(where, row, case) for where, row in named])
    except StudyError as error:
        text = str(error)
        raise StudyError(text if text.startswith(str(path)) else f"{path}: {text}") from None


def _contingency(where: str, row: object, case: Case) -> Contingency:
    if not isinstance(row, dict):
        raise StudyError(f"{where} is not a table; {EXAMPLE}.")
    found = toml_file.validated(_Row, row, where)
    trip = (found.trip,) if isinstance(found.trip, str) else tuple(found.trip)
    if found.clear is None and found.fault is not None:
        raise StudyError(f"{where}: clear is missing; it must be {_Row.model_fields['clear'].description}.")
    if found.fault is None and (found.clear is not None or not (trip or found.trip_machine)):
        raise StudyError(f"{where}: fault is missing; it must be {_Row.model_fields['fault'].description}.")
    machines = (found.trip_machine,) if isinstance(found.trip_machine, str) else tuple(found.trip_machine)
    try:
        trips = [_machine_trip(text, case) for text in machines]
        return Contingency(
            found.fault,
            found.clear,
            trip,
            impedance=_impedance(found.impedance),
            events=[replace(one, at=AT + one.at) for at_clearing, one in trips if not at_clearing],
            after=[one for at_clearing, one in trips if at_clearing],
            name=found.name,
        )
    except StudyError as error:
        raise StudyError(f"{where}: {error}") from None


def _bus(value: object) -> object:
    """The number of a bus as text."""
    return str(value) if isinstance(value, int) and not isinstance(value, bool) else value


class _Row(BaseModel):
    """A [[contingency]] of a file."""

    model_config = ConfigDict(extra="forbid", strict=True)

    fault: Annotated[str | None, BeforeValidator(_bus)] = Field(
        None, description='a bus or a point on a circuit, such as "16"'
    )
    clear: str | None = Field(None, description='a clearing time, such as "8.2cyc" or "0.14s"')
    impedance: str = Field("0,0", description='a fault impedance R,X in pu, such as "0.01,0.05"')
    trip_machine: Annotated[str | list[str], BeforeValidator(_bus)] = Field(
        [], description='a machine or a list of machines, such as "9" (when the fault is cleared) or "9@0.5s" after it'
    )
    trip: str | list[str] = Field([], description='a circuit or a list of circuits, such as "16-21"')
    name: str | None = Field(None, description='text, such as "line 16-21"')


def _impedance(text: str) -> complex:
    """A fault impedance written as R,X (pu)."""
    try:
        r, x = map(float, text.split(","))
    except ValueError:
        raise StudyError(f"impedance = {text!r} is not allowed; write R,X in pu, such as '0.01,0.05'.") from None
    return complex(r, x)


def _machine_trip(text: str, case: Case) -> tuple[bool, Event]:
    """Whether a machine is tripped when the fault is cleared, `9`, or after the fault, `9@0.5s`; and its trip."""
    at_clearing = naming.machine_number(case, text) is not None or "@" not in text
    text = f"{text}@0s" if at_clearing else text
    return at_clearing, events.event(text, case.frequency_hz, events.TripMachine)


def checked(case: Case, given: Iterable[Contingency], timed: bool = False) -> tuple[Contingency, ...]:
    """The contingencies, each with a fault and its clearing time or other events, possible, and each different.

    Those with the same times from the fault on differ only if the control has instants of its own (`timed`).
    """
    out = tuple(given)
    if not out:
        raise StudyError("There are no contingencies to survive; give at least one.")
    met: dict[Any, int] = {}
    for i, one in enumerate(out, start=1):
        if not isinstance(one, Contingency):
            raise StudyError(f"Contingency {i} is {one!r}; write Contingency('16', clear='6cyc', trip='16-21').")
        where = f"Contingency {i} ({one.label})"
        if one.fault is None and not (one.trip or one.events or one.after):
            raise StudyError(f"{where} has no fault and no event; write Contingency('16', clear='6cyc', trip='16-21').")
        if one.fault is not None and one.clear is None:
            raise StudyError(f"{where} has no clearing time; write Contingency('16', clear='6cyc', trip='16-21').")
        clear = clearing_s(one, case)
        if one.fault is not None and not 0 < clear <= LONGEST:
            raise StudyError(
                f"{where} is cleared after {clear:g} s; give a clearing time above 0 and at most {LONGEST:g} s."
            )
        try:
            one.check(case)
            one = one.placed(case)
        except StudyError as error:
            raise StudyError(f"{where}: {error}") from None
        at = one.starts(case)
        others = tuple(replace(event, at=round(event.at - at, 9)) for event in one.others(case))
        key = (one.fault, one.trip, clear, one.impedance, others, one.after, at * timed)
        first = met.setdefault(key, i)
        if first != i:
            raise StudyError(f"{where} is the same as contingency {first}; remove one of them.")
    return tuple(one.placed(case) for one in out)


def clearing_s(one: Contingency, case: Case) -> float:
    """Duration of the fault, s."""
    return seconds(one.clear or 0.0, case.frequency_hz)
