"""How a run ended: one of five kinds, with sentences that explain it."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from stabctl import devices
from stabctl._util.errors import StudyError
from stabctl._util.wording import capitalized, enumerated, listed
from stabctl.dynamics import family
from stabctl.dynamics.assembly import Angle
from stabctl.dynamics.layout import Layout
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.model import naming
from stabctl.model.network import Switching

from . import _judgment
from ._buffers import Part
from .criterion import Criterion, frequency_range, with_frequency
from .recording import Extremes
from .swings import Swings
from .topology import Stage

SLACK = 1e-9  # pu   distance of a frequency from its limit that is rounding
SOURCE = "a machine or grid-forming converter"


class Kind(StrEnum):
    """Kinds of outcome."""

    STABLE = "stable"
    LOST_SYNCHRONISM = "lost_synchronism"
    FREQUENCY_INSTABILITY = "frequency_instability"
    VOLTAGE_COLLAPSE = "voltage_collapse"
    ISLANDED = "islanded"


@dataclass(frozen=True)
class Outcome:
    """The end of a run."""

    kind: Kind
    message: str
    time_s: float  # s   when it ended
    machine: int | str | None = None  # that lost synchronism first: its name or number, or "ESD 1@2" of storage
    bus: int | None = None  # number of the bus whose voltage collapsed, or whose storage is empty or full
    swings: Swings | None = None  # the last ones of a run that reached its end; None if they are not judged
    stalled: tuple[int, ...] = ()  # numbers of the buses whose motor loads have stalled at the end
    cycling: tuple[str, ...] = ()  # storage devices in a limit cycle at full power at the end
    cut_off: str = ""  # what the switching has separated or blacked out, as a sentence
    off_frequency: tuple[int | str, ...] = ()  # units of the island, one of several, whose frequency left its range

    @property
    def stable(self) -> bool:
        """Whether every island with a source kept its synchronism, its voltage, and a frequency within the range.

        What the switching itself cuts off from all sources is blacked out, its load lost; the message says so.
        """
        return self.kind in (Kind.STABLE, Kind.ISLANDED) and self.machine is None

    def __str__(self) -> str:
        return self.message


class End(NamedTuple):
    """How the stepper ended."""

    verdict: int  # of the stepper
    time: float  # s
    stage: Stage
    speed: np.ndarray  # (rotor units, then angles without weight) pu
    weight: np.ndarray  # (the same) s   in the center of inertia of their island
    island: np.ndarray  # (the same) -1 if it is off, or turns no island
    machine: int  # row of the critical one of these
    bus: int  # row of the critical bus
    outside_s: float  # s   longest time that an island was outside the frequency range
    taken_off: Mapping[int, str]  # unit -> a sentence, of machines that ran away alone in their island
    swings: Swings | None  # if it reached its end
    stalled: "Stalled"  # motor loads
    cycling: dict[str, float]  # 1/s   storage devices in a limit cycle, and how often they reverse
    relay: bool  # the law is a relay without delay
    loop: "ControlLoop"  # that the control closes
    seen: Extremes | None  # of speeds and voltages; None if the signals were not recorded
    switching: Switching  # what is open, faulted or tripped


def outcome(point: OperatingPoint, end: End, criterion: Criterion) -> Outcome:
    """The outcome of a run."""
    bus, t = point.case.buses[end.bus].bus, end.time
    number, called = _critical(point, end)
    cut_off = _cut_off(point, end)
    cut = " ".join((cut_off, *end.taken_off.values())).strip()
    if not end.stage.net.islands:
        return Outcome(
            Kind.VOLTAGE_COLLAPSE,
            f"The system is blacked out at {t:.3f} s: no machine or grid-forming converter is left. {cut}".strip(),
            t,
        )
    kind, machine, blamed, off = Kind.ISLANDED if cut else Kind.STABLE, None, None, tuple[int | str, ...]()
    several = end.stage.net.islands > 1
    match end.verdict:
        case _judgment.SLIPPED | _judgment.UNLOCKED:
            kind, machine, where = Kind.LOST_SYNCHRONISM, number, " of its island" if cut or several else ""
            text = (
                f"{capitalized(called)} lost synchronism at {t:.3f} s: {_angle(point, end)} moved "
                f"{np.rad2deg(criterion.max_angle):.0f} degrees relative to the center of inertia{where}"
                f"{_at_limit(point, end)}."
            )
        case _judgment.RUNAWAY:
            kind, machine = Kind.LOST_SYNCHRONISM, number
            text = (
                f"The speed of {called} left the range {criterion.slowest:g} to {criterion.fastest:g} pu at {t:.3f} s."
            )
        case _judgment.FREQUENCY:
            kind = Kind.FREQUENCY_INSTABILITY
            off, text = _off_frequency(point, end, criterion)
        case _judgment.NO_VOLTAGE:
            kind, blamed = Kind.VOLTAGE_COLLAPSE, bus
            text = f"Voltage collapse at bus {bus} at {t:.3f} s: the network equations have no solution."
        case _judgment.LOW_VOLTAGE:
            kind, blamed = Kind.VOLTAGE_COLLAPSE, bus
            watched = (one for one in point.system.watched if one.bus == end.bus and end.stage.net.alive[one.other])
            lost = max(watched, key=lambda one: one.low).name
            text = (
                f"Voltage collapse at bus {bus} at {t:.3f} s: its voltage stayed below the limit of {lost} "
                f"for {criterion.low_voltage_s:g} s without a fault."
            )
        case _judgment.EMPTY | _judgment.FULL_STORE:
            kind, blamed, empty = Kind.VOLTAGE_COLLAPSE, bus, end.verdict == _judgment.EMPTY
            state, need = ("empty", "needs its power") if empty else ("full", "has more power than it needs")
            what = f"{capitalized(called)} is {state} at {t:.3f} s"
            text = f"{what}, and its island, which has no machine, {need}: it is lost."
        case _ if not end.weight.any():
            text = f"Every island kept its voltage until {t:.3f} s; without a rotor, synchronism is not judged."
        case _ if cut:
            said = f"{_outside(point, end, criterion)}{_seen(point, end.seen)}{_frequencies(point, end)}"
            text = f"Every island stayed in synchronism until {t:.3f} s{said}."
        case _:
            converters = point.rotors.virtual.any() or len(point.system.unweighted.rows)
            everything = "All machines and converters" if converters else "All machines"
            said = f"{_outside(point, end, criterion)}{_seen(point, end.seen)}"
            said += _frequencies(point, end) if several else ""
            text = f"{everything} stayed in synchronism until {t:.3f} s{said}."
    sentences = (cut, text, str(end.swings or "")) if end.verdict == _judgment.DONE else (text, cut)
    message = " ".join(
        s for s in (*sentences, _still_faulted(point, end), str(end.stalled), _cycling(point, end), str(end.loop)) if s
    )
    return Outcome(kind, message, t, machine, blamed, end.swings, end.stalled.buses, tuple(end.cycling), cut_off, off)


def _critical(point: OperatingPoint, end: End) -> tuple[int | str | None, str]:
    """The critical unit: its name or number, and what it is called in a sentence."""
    rotors, other = point.rotors, _unweighted(point, end)
    if other is not None and other.unit < 0:
        return other.name, f"storage device {other.name}"
    if other is None and not len(rotors.unit):
        return None, ""
    machine = point.case.machines[rotors.unit[end.machine] if other is None else other.unit]
    if other is None and not rotors.virtual[end.machine]:
        return machine.called, f"machine {machine.called}"
    model = point.case.model(machine.machine, "converter")
    return machine.called, f"converter {machine.called} ({devices.models()[str(model)].name})"


def _unweighted(point: OperatingPoint, end: End) -> Angle | None:
    """The critical angle, if it is not that of a rotor unit."""
    rows, row = point.system.unweighted.rows, end.machine - len(point.rotors.unit)
    return rows[row] if 0 <= row < len(rows) else None


def check_numbers(layout: Layout, s: np.ndarray, part: Part, t: float) -> None:
    """Raise `StudyError` if states in s have no finite values, for those that were the first in the last step."""
    rates, states = (~np.isfinite(values[: layout.nx]) for values in (part.rate, s))
    if states.any():
        first = rates if np.isfinite(part.x).all() and rates.any() else states
        names = tuple(dict.fromkeys(layout.states[i].label for i in np.flatnonzero(first)))
        raise StudyError(
            f"Without a finite value at {t:.3f} s: {listed(names)}; check the equations of the device for a division "
            "by zero."
        )


def _cut_off(point: OperatingPoint, end: End) -> str:
    """What the switching has separated from the rest of an island, or left without a source; empty if nothing.

    The rest is the part with the largest inertia. The islands that the network had before are no event.
    """
    now = end.stage
    where, before, on = now.island_of_bus, point.island, now.net.island >= 0
    if where.max() == 0:
        return ""
    rotors = point.rotors
    weight = np.bincount(
        where[point.system.unit_bus[rotors.unit]], rotors.inertia * on[rotors.unit], minlength=where.max() + 1
    )
    largest = {int(max(np.unique(where[before == own]), key=lambda k: weight[k])) for own in np.unique(before)}
    loads, parts = {load.bus for load in point.case.loads}, []
    for k in (k for k in range(where.max() + 1) if k not in largest or not now.net.alive[where == k].any()):
        buses = [b.bus for b, island in zip(point.case.buses, where, strict=True) if island == k]
        places = enumerate(zip(point.case.machines, point.net.machine_bus, on, strict=True))
        machines = [m.called for i, (m, at, runs) in places if where[at] == k and (runs or i in end.taken_off)]
        held = [row.name for row in point.system.unweighted.rows if row.virtual and where[row.bus] == k]
        lost = ", its load lost" * (not loads.isdisjoint(buses))
        rest = f"without {SOURCE}: blacked out{lost}"
        if machines or held:
            rest = f"with {enumerated('machine', machines) if machines else enumerated('storage device', held)}"
        parts.append(f"{enumerated('bus', buses)} {rest}")
    return f"The switching cut off {'; and '.join(parts)}." if parts else ""


def _angle(point: OperatingPoint, end: End) -> str:
    """Which angle of the critical unit moved."""
    other = _unweighted(point, end)
    if other is not None and not other.virtual:
        return "the angle of its phase-locked loop"
    return "its virtual angle" if other is not None or point.rotors.virtual[end.machine] else "its angle"


def _at_limit(point: OperatingPoint, end: End) -> str:
    """That the frequency of the critical phase-locked loop is at a limit, in words; empty if it is not."""
    other = _unweighted(point, end)
    if other is None or other.least + SLACK < end.speed[end.machine] < other.most - SLACK:
        return ""
    low, high = (limit * point.case.frequency_hz for limit in (other.least, other.most))
    return f", its frequency at a limit of its range from {low:.2f} to {high:.2f} Hz"


def _off_frequency(point: OperatingPoint, end: End, criterion: Criterion) -> tuple[tuple[int | str, ...], str]:
    """The units of the island that left the frequency range, if it is one of several, and a sentence on it."""
    mine = end.island == end.island[end.machine]
    H = np.where(mine, end.weight, 0.0)
    hz = point.case.frequency_hz
    island, off = "The frequency", tuple[int | str, ...]()
    if len(np.unique(end.island[end.island >= 0])) > 1:
        names = *point.rotor_names, *(row.name for row in point.system.unweighted.rows)
        noun = "machine" if end.machine < len(point.rotors.unit) else "storage device"
        off = tuple(names[i] for i in np.flatnonzero(mine))
        island += f" of the island of {enumerated(noun, off)}"
    return off, (
        f"{island} was outside {frequency_range(criterion, hz)} for {criterion.frequency_delay_s:g} s at "
        f"{end.time:.3f} s: it is {hz * end.speed @ H / H.sum():.2f} Hz."
    )


def _outside(point: OperatingPoint, end: End, criterion: Criterion) -> str:
    """How long the frequency of an island was outside its range, or that it ends there unjudged; empty if neither."""
    left = f", outside {frequency_range(criterion, point.case.frequency_hz)}"
    rotors = slice(len(point.rotors.unit))  # storage is itself a governor
    off = (end.speed[rotors] < criterion.min_frequency) | (end.speed[rotors] > criterion.max_frequency)
    if (off & ~with_frequency(criterion, point.system) & (end.island[rotors] >= 0)).any():
        return f"{left}, which is not checked without a governor"
    return f"{left} for {end.outside_s:.2g} s at most" if criterion.frequency_delay_s and end.outside_s else ""


def _seen(point: OperatingPoint, seen: Extremes | None) -> str:
    """The least and greatest frequency of a rotor and the lowest voltage, in words; empty if they were not recorded."""
    if seen is None or np.isnan(seen.slowest).all():
        return ""
    low, high = int(np.nanargmin(seen.slowest)), int(np.nanargmax(seen.fastest))
    ends = [f"{speed * point.case.frequency_hz:.2f}" for speed in (seen.slowest[low], seen.fastest[high])]
    named = [_rotor(point, i) for i in (low, high)]
    frequency = f"{ends[0]} ({named[0]}) to {ends[1]} Hz ({named[1]})" if ends[0] != ends[1] else f"{ends[0]} Hz"
    if np.isnan(seen.lowest).all():
        return f"; frequency {frequency}"
    row, after = int(np.nanargmin(seen.lowest)), " after clearing" if seen.cleared else ""
    return (
        f"; frequency {frequency}, lowest voltage{after} {seen.lowest[row]:.2f} pu at bus {point.case.buses[row].bus}"
    )


def _rotor(point: OperatingPoint, i: int) -> str:
    """What a rotor unit, or a device whose angle is not that of one, is called in a sentence."""
    if i >= len(point.rotor_names):
        return f"storage device {point.system.unweighted.rows[i - len(point.rotor_names)].name}"
    return f"{'converter' if point.rotors.virtual[i] else 'machine'} {point.rotor_names[i]}"


def _frequencies(point: OperatingPoint, end: End) -> str:
    """The frequency of every island at the end, in words."""
    island, H = end.island, end.weight
    groups = [island == k for k in np.unique(island) if k >= 0]
    found = [f"{end.speed[own] @ H[own] / H[own].sum() * point.case.frequency_hz:.2f} Hz" for own in groups]
    if len(found) == 1:
        return f"; final frequency {found[0]}"
    first = [_rotor(point, int(np.flatnonzero(own)[0])) for own in groups]
    shown = [f"{f} in the island of {called}" for f, called in zip(found, first, strict=True)]
    return f"; final frequencies {listed(shown, 8)}"


def _still_faulted(point: OperatingPoint, end: End) -> str:
    """A sentence on faults that are still on; empty if there are none."""
    if not end.switching.faulted:
        return ""
    names, buses = naming.circuits(point.case.branches), point.case.buses
    places = [f"at bus {buses[row].bus}" for row, _ in end.switching.faults]
    places += [f"on circuit {names[row]}" for row, state in end.switching.branches if state.faulted]
    one = len(places) == 1
    faults, rest = ("fault", "is still on: it is") if one else ("faults", "are still on: they are")
    return f"The {faults} {' and '.join(places)} {rest} not cleared before the end of the run."


def _cycling(point: OperatingPoint, end: End) -> str:
    """A sentence on storage devices in a limit cycle; empty if there are none."""
    if not end.cycling:
        return ""
    what = enumerated("storage device", end.cycling)
    verb, rate = "reverses" if len(end.cycling) == 1 else "reverse", max(end.cycling.values())
    limits = ", or from ramp limit to ramp limit" if any(s.ramp for s in point.case.storage) else ""
    advice = "widen" if end.relay else "reduce its gain or delay, or widen"
    return (
        f"{capitalized(what)} still {verb} between full charging and full discharging{limits}, up to "
        f"{rate:.2g} times per second: a limit cycle of the control; {advice} its deadband."
    )


def _growth(s: complex) -> str:
    """What grows with an eigenvalue (1/s), and how fast."""
    hz = abs(s.imag) / (2 * np.pi)
    return f"{f'an oscillation at {hz:.2g} Hz' if hz else 'a deviation'} grows by {s.real:.2g} 1/s"


class ControlLoop(NamedTuple):
    """The loop that the control closes, and the step of the run."""

    fastest: float  # 1/s   of its eigenvalues
    growing: complex | None  # 1/s   the one that grows
    alone: complex | None  # 1/s   and that without the control
    step: float  # s
    trusted: bool  # whether the step is short enough
    apart: bool  # orders and the accelerations they cause did not agree somewhere
    chatter: bool  # orders jumped in step after step
    without: tuple[str, ...]  # sentences about controllers that read machines that are off

    def __str__(self) -> str:
        """Sentences on what makes the run doubtful; empty if nothing does."""
        said = []
        if self.growing is not None:
            advice = "reduce the gain" if self.alone is None else f"without the control, {_growth(self.alone)}"
            said.append(
                f"Where the control acts, the closed loop is unstable at rest: {_growth(self.growing)}; {advice}."
            )
        if not self.trusted:
            said.append(
                f"The control closes a loop with an eigenvalue near {self.fastest:.3g} 1/s, too fast for the step of "
                f"{1e3 * self.step:.3g} ms: its orders may chatter, and the run cannot be trusted; reduce its gain, or "
                "give a shorter step."
            )
        if self.apart:
            said.append(
                "The orders did not agree with the accelerations that they cause, and the run cannot be trusted; "
                "reduce the acceleration gain."
            )
        if self.chatter:
            said.append(
                "The orders jumped in step after step, and when they jump depends on the step of the run; widen the "
                "deadband of the law, or reduce its gain."
            )
        return " ".join((*said, *self.without))


class Stalled(NamedTuple):
    """Motor loads beyond their breakdown slip that do not reaccelerate; they draw several times their current."""

    buses: tuple[int, ...]  # bus numbers
    slip: tuple[float, ...]  # pu

    def __str__(self) -> str:
        """A sentence; empty if there are none."""
        if not self.buses:
            return ""
        low, high = (f"{100 * one:.0f}" for one in (min(self.slip), max(self.slip)))
        slips = f"{low} %" if low == high else f"{low} to {high} %"
        loads, have = ("load", "has") if len(self.buses) == 1 else ("loads", "have")
        return f"The motor {loads} at {enumerated('bus', self.buses)} {have} stalled, with a slip of {slips}."


def stalled(point: OperatingPoint, s: np.ndarray, alive: np.ndarray) -> Stalled:
    """The motor loads that have stalled, at buses with voltage.

    Parameters
    ----------
    point : OperatingPoint
        Its devices.
    s : (signals,) array
        All signals.
    alive : (buses,) array of bool
        Buses with voltage.
    """
    found: list[tuple[int, float]] = []
    for f in point.system.families:
        n = len(f.device.State._fields)
        for w, k in zip(f.w, f.k, strict=True) if f.device.stalled else ():
            at, bus = w[family.STATE], w[family.BUS]
            x, row = f.device.State(*s[at : at + n]), (bus - point.layout.nx) // 2
            if alive[row] and f.device.call("stalled", x, s[bus : bus + 2], f.device.Par(*k)):
                found.append((point.case.buses[row].bus, float(x.slip)))
    return Stalled(*zip(*found, strict=True)) if found else Stalled((), ())
