"""Events written as text: `7-8@1s` opens a circuit, `14@2s` trips a machine, `7:+50MW@1s` adds to a load."""

import re
from dataclasses import replace

from stabctl.errors import StudyError
from stabctl.units import seconds

from .events import Event, LoadStep, Open, TripMachine

SHOWN = "7-8@1s (a line opens), 14@2s (a machine trips) or 7:+50MW@1s (a load changes)"
_OPENING = re.compile(r"^(\d{1,18}-\d{1,18}(?:#\d{1,18})?)$", re.ASCII)
_MACHINE = re.compile(r"^(\d{1,18})$", re.ASCII)
_POWER = r"[+-]\d+(?:\.\d*)?(?:[eE][+-]?\d+)?"
_LOAD = re.compile(rf"^(\d{{1,18}}):(?:({_POWER})MW)?(?:({_POWER})Mvar)?$", re.ASCII | re.IGNORECASE)


def opening(text: str, frequency_hz: float) -> Open:
    """The opening of a circuit at both ends: `7-8@1s`, `7-8#2@60cyc`."""
    what, at = _split(text, frequency_hz)
    if match := _OPENING.match(what):
        return Open(match[1], at)
    raise StudyError(f"{text!r} is not a line trip; write it as 7-8@1s, or 7-8#2@1s for the second circuit.")


def machine_trip(text: str, frequency_hz: float) -> TripMachine:
    """The trip of a machine: `14@2s`."""
    what, at = _split(text, frequency_hz)
    if match := _MACHINE.match(what):
        return TripMachine(int(match[1]), at)
    raise StudyError(f"{text!r} is not a machine trip; write it as 14@2s.")


def load_step(text: str, frequency_hz: float) -> LoadStep:
    """A change of load at a bus: `7:+50MW@1s`, `7:-50MW-10Mvar@1s`."""
    what, at = _split(text, frequency_hz)
    match = _LOAD.match(what)
    if match and (match[2] or match[3]):
        return LoadStep(int(match[1]), at, float(match[2] or 0), float(match[3] or 0))
    raise StudyError(
        f"{text!r} is not a load step; write what is added, with its sign, as 7:+50MW@1s or 7:-50MW-10Mvar@1s."
    )


def event(text: str | Event, frequency_hz: float) -> Event:
    """The event that a text describes, or a record with its instant in seconds. `StudyError` if it is not one."""
    if not isinstance(text, str):
        return replace(text, at=seconds(text.at, frequency_hz)) if isinstance(text.at, str) else text
    what, _ = _split(text, frequency_hz)
    for form, read in ((_OPENING, opening), (_MACHINE, machine_trip), (_LOAD, load_step)):
        if form.match(what):
            return read(text, frequency_hz)
    raise StudyError(f"{text!r} is not an event; write {SHOWN}.")


def _split(text: str, frequency_hz: float) -> tuple[str, float]:
    """What happens, and when (s)."""
    what, at, when = text.replace(" ", "").rpartition("@")
    if not at:
        raise StudyError(f"{text!r} has no time; write {SHOWN}.")
    try:
        return what, seconds(when, frequency_hz)
    except StudyError:
        raise StudyError(f"{text!r} is not an event, because {when!r} is not a time; write {SHOWN}.") from None
