"""Events written as text: `7-8@1s` opens a circuit, `14@2s` trips a machine, `7:+50MW@1s` adds to a load."""

import re
from dataclasses import replace

from stabctl.errors import StudyError
from stabctl.units import seconds

from .events import Event, LoadStep, Open, TripMachine

SHOWN = "7-8@1s (a line opens), 14@2s (a machine trips) or 7:+50MW@1s (a load changes)"
NUMBERS = re.compile(r"\d{1,18}-\d{1,18}(?:#\d{1,18})?", re.ASCII)
_MACHINE = re.compile(r"\d{1,18}|[^:]+/[^:/]+", re.ASCII)
_POWER = r"[+-]\d+(?:\.\d*)?(?:[eE][+-]?\d+)?"
_LOAD = re.compile(rf"([^:]+):(?:({_POWER})\s*MW)?\s*(?:({_POWER})\s*Mvar)?", re.ASCII | re.IGNORECASE)


def opening(text: str, frequency_hz: float) -> Open:
    """The opening of a circuit at both ends: `7-8@1s`, `7-8#2@60cyc`, `7-8 ckt 2@1s`."""
    what, at = _split(text, frequency_hz)
    if _circuit(what):
        return Open(what, at)
    raise StudyError(f"{text!r} is not a line trip; write it as 7-8@1s, or 7-8#2@1s for the second circuit.")


def machine_trip(text: str, frequency_hz: float) -> TripMachine:
    """The trip of a machine: `14@2s`, `30/1@2s`."""
    what, at = _split(text, frequency_hz)
    if _MACHINE.fullmatch(what):
        return TripMachine(int(what) if what.isdecimal() else what, at)
    raise StudyError(f"{text!r} is not a machine trip; write it as 14@2s.")


def load_step(text: str, frequency_hz: float) -> LoadStep:
    """A change of load at a bus: `7:+50MW@1s`, `7:-50MW-10Mvar@1s`."""
    what, at = _split(text, frequency_hz)
    match = _LOAD.fullmatch(what)
    if match and (match[2] or match[3]):
        bus = int(match[1]) if match[1].isdecimal() and len(match[1]) < 19 else match[1]
        return LoadStep(bus, at, float(match[2] or 0), float(match[3] or 0))
    raise StudyError(
        f"{text!r} is not a load step; write what is added, with its sign, as 7:+50MW@1s or 7:-50MW-10Mvar@1s."
    )


def _circuit(what: str) -> bool:
    """Whether it has the form of a circuit: two numbers, or the names of two buses; or an identifier."""
    return bool(NUMBERS.fullmatch(what)) or ("-" in what and any(c.isalpha() for c in what))


def event(text: str | Event, frequency_hz: float) -> Event:
    """The event that a text describes, or a record with its instant in seconds. `StudyError` if it is not one."""
    if not isinstance(text, str):
        return replace(text, at=seconds(text.at, frequency_hz)) if isinstance(text.at, str) else text
    what, _ = _split(text, frequency_hz)
    for is_one, read in ((_LOAD.fullmatch, load_step), (_MACHINE.fullmatch, machine_trip), (_circuit, opening)):
        if is_one(what):
            return read(text, frequency_hz)
    raise StudyError(f"{text!r} is not an event; write {SHOWN}.")


def _split(text: str, frequency_hz: float) -> tuple[str, float]:
    """What happens, and when (s)."""
    what, at, when = text.rpartition("@")
    what, when = what.strip(), when.replace(" ", "")
    if not any(c.isalpha() for c in what.rpartition(":")[0] or what):
        what = what.replace(" ", "")
    if not at:
        raise StudyError(f"{text!r} has no time; write {SHOWN}.")
    try:
        return what, seconds(when, frequency_hz)
    except StudyError:
        raise StudyError(f"{text!r} is not an event, because {when!r} is not a time; write {SHOWN}.") from None
