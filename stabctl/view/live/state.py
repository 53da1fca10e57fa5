"""What a page asks for, checked when it arrives, and the operating point that it needs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import lru_cache
from threading import RLock
from typing import Any

from stabctl._util.errors import StudyError, shown
from stabctl.controllers import BangBang, Feedback, Law
from stabctl.controllers.controller import Controller
from stabctl.devices import every
from stabctl.devices.storage import MODELS
from stabctl.dynamics import operating_point
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.model.case import Case
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.control import Control, ordered

AT, UNTIL = 1.0, 10.0  # s   of the fault, and the end of a run
LAWS = "bang-bang", "feedback", "idle"
FILE = "file"  # instead of these: the law of a file
KEPT = 24  # operating points
STORES = tuple(name for name, one in MODELS.items() if not every()[one.device].kit.finite)  # others need an energy


@dataclass(frozen=True)
class State:
    """The settings of a page; quantities in the units of its sliders."""

    fault: str = ""  # 83, or 7-8@0.4
    trip: str = ""  # circuit opened to clear a fault at a bus; empty: none
    clear: float = 6.0  # cycles
    percent: float = 0.0  # %   rating of every machine's storage device, of the machine's MVA
    megawatts: Mapping[int, float] = field(default_factory=dict)  # MW, of machines with a rating of their own
    store: str = "ideal"  # model of the storage devices
    law: str = LAWS[0]
    deadband: float = 100.0  # mHz
    gain: float = 0.1  # pu/(rad/s)   of the feedback
    delay: float = 0.0  # cycles   of the signals of the law, which then come once per cycle; 0: it acts at every step
    level: float = 100.0  # %   of the load
    required: float = 0.0  # cycles   clearing time that is required; 0: none
    compare: bool = False  # with a run without storage
    signals: tuple[str, ...] = ("speed",)

    @property
    def stored(self) -> bool:
        """Whether there is storage of the page, in place of the case's own."""
        return self.percent > 0 or any(self.megawatts.values())

    def equipped(self, case: Case) -> bool:
        """Whether there is storage, of the page or of the case."""
        return self.stored or bool(case.storage)

    @property
    def plain(self) -> BangBang | Feedback | None:
        """The law of the storage devices without the delay."""
        if self.law in ("idle", FILE):
            return None
        if self.law == "feedback":
            return Feedback(self.gain, deadband=self.deadband / 1e3)
        return BangBang(self.deadband / 1e3)

    def control(self, hz: float) -> Law | None:
        """The law of the storage devices in a system of rated frequency `hz`."""
        law, rate = self.plain, round(hz)
        return law.sampled(rate, self.delay / rate) if law and self.delay else law

    @property
    def contingency(self) -> Contingency:
        """The fault and its clearing."""
        return Contingency(self.fault, f"{self.clear:g}cyc", self.trip or (), at=AT)


def read(given: Any) -> State:
    """The state in a message. `StudyError` if it has a field or value that is not allowed."""
    if not isinstance(given, dict):
        raise StudyError(f"{shown(given)} is not a state of the page.")
    known = {f.name: getattr(State(), f.name) for f in fields(State)}
    found: dict[str, Any] = {}
    for name, value in given.items():
        if name not in known:
            raise StudyError(f"The page has no setting {name!r}.")
        found[name] = _value(name, value, known[name])
    state = State(**found)
    for what, chosen, known_ones in (("law", state.law, (*LAWS, FILE)), ("storage model", state.store, STORES)):
        if chosen not in known_ones:
            raise StudyError(f"There is no {what} {chosen!r}; choose one of {', '.join(known_ones)}.")
    if min(state.clear, state.required, state.percent, state.delay, *state.megawatts.values(), 0) < 0:
        raise StudyError("Times and ratings cannot be negative.")
    if not state.level > 0:
        raise StudyError("The load level must be above 0.")
    if state.delay != round(state.delay):
        raise StudyError(f"A delay of {state.delay:g} cycles is not allowed; give a whole number.")
    return state


def _value(name: str, value: Any, example: Any) -> Any:
    """A value of the kind of the example."""
    try:
        if isinstance(example, bool | str):
            if type(value) is type(example):
                return value
        elif isinstance(example, float):
            if isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e6:
                return float(value)
        elif isinstance(example, tuple):
            if isinstance(value, list) and all(isinstance(v, str) for v in value):
                return tuple(value)
        elif isinstance(value, dict):
            return {int(k): _value(name, v, 0.0) for k, v in value.items()}
    except ValueError:
        pass
    raise StudyError(f"{name} = {shown(value)} is not a setting of the page.")


class Wrong(Exception):
    """A message that no page sends."""


def number(message: dict[str, Any], name: str, default: float | None = None, most: float = 1e6) -> float:
    """A number of a message, from 0 to `most`. Raises Wrong if it is none."""
    value = message.get(name, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value <= most:
        raise Wrong
    return float(value)


class Points:
    """Operating points of a case by load level, with and without storage devices: solved once, the last ones kept.

    Parameters
    ----------
    case : Case
        The system.
    given : sequence of Law or Controller
        Controllers that act in every run, and a law that can be chosen.
    """

    def __init__(self, case: Case, given: Sequence[Law | Controller] = ()) -> None:
        self.case, self._lock = case, RLock()
        self.controllers = [one for one in given if isinstance(one, Controller)]
        self.law = next((one for one in given if not isinstance(one, Controller)), None)
        law = FILE if self.law else "idle" if ordered(self.controllers) else LAWS[0]
        self.first = State(law=law)  # with which the page opens
        self._bare = lru_cache(KEPT)(self._solve)
        self._equipped = lru_cache(KEPT)(self._equip)

    def bare(self, state: State) -> OperatingPoint:
        """The case as it is, at the load level."""
        with self._lock:
            return self._bare(state.level)

    @property
    def laws(self) -> tuple[str, ...]:
        """The laws to choose from, that of a file first."""
        return LAWS if self.law is None else (FILE, *LAWS)

    def control(self, state: State) -> Control:
        """What acts in a run: the law of the storage devices, and the controllers."""
        law = self.law if state.law == FILE else state.control(self.case.frequency_hz)
        law = law if state.equipped(self.case) else None
        acting: list[Law | Controller] = [*([] if law is None else [law]), *self.controllers]
        return tuple(acting) if self.controllers else law

    def of(self, state: State) -> OperatingPoint:
        """With the storage devices of the state; if it has none, those of the case."""
        if not state.stored:
            return self.bare(state)
        with self._lock:
            point = self._equipped(state.level, "1%mva", state.store)
        base = {m.machine: m.base for m in self.case.machines}
        share = state.percent / 100
        return point.resized(state.megawatts.get(s.machine, share * base[s.machine]) for s in point.case.storage)

    def without(self, state: State) -> OperatingPoint:
        """Without storage, at the load level."""
        with self._lock:
            return self._equipped(state.level, "none", "ideal") if self.case.storage else self._bare(state.level)

    def _solve(self, level: float) -> OperatingPoint:
        return operating_point.solve(self.case if level == 100 else self.case.with_load_level(level / 100))

    def _equip(self, level: float, sizes: str, store: str) -> OperatingPoint:
        bare = self._bare(level)
        return operating_point.solve(bare.case.with_storage(sizes, storage_model=store), bare.flow)
