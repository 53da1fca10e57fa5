"""A simulation that can be advanced an interval at a time, and the run from start to end in one call."""

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from stabctl._util.errors import StudyError
from stabctl._util.wording import listed
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.model import naming
from stabctl.model.network import Switching

from . import _judgment, stepper, steps, swings
from ._buffers import NOTE, buffers
from .contingency import Disturbance, timed_events
from .control import Control, Frames, Pilot, carry
from .criterion import DEFAULT, Criterion, frequency_range
from .outcome import ControlLoop, End, Outcome, check_numbers, outcome, stalled
from .recording import Recorded, Recording
from .setup import Setup, setup
from .swings import Swings
from .timeline import timeline
from .trajectory import Happened, Trajectory

FURTHER = 5.0  # s   by which a run is continued while its swings may grow
REVERSALS = 5.0  # 1/s   of full power, from which on a storage device is in a limit cycle; swings make up to 4
SLOW = 0.75  # 1/s   the same in swings that last: two reversals within the last 1.4 s, or more
TIMED = _judgment.LOW_VOLTAGE, _judgment.FREQUENCY, _judgment.EMPTY, _judgment.FULL_STORE  # whose instant is earlier


class Simulation:
    """A simulation that is advanced an interval at a time; without a law, storage orders can be set in between.

    Parameters
    ----------
    system : Setup
        The operating point with its control. Python functions are called by `frames`; the inputs of controllers behind
        an estimator are set from outside, at the places in `attached.measured`.
    events : Contingency, event, str, or list of them, optional
        What happens, as in `simulate`.
    record : bool or "rotors"
        Keep the trajectory, or only the signals up to the angles and speeds of the rotors.
    every : float, s
        Least time between two rows of the trajectory; by default every step is kept.
    start : float, s
        Start time.
    progress : callable, optional
        Called with the simulated time (s) at intervals.

    Raises
    ------
    StudyError
        If an event is not possible.
    """

    def __init__(
        self,
        system: Setup,
        events: "Disturbance | None" = None,
        *,
        record: Recorded = True,
        every: float = 0.0,
        start: float = 0.0,
        progress: Callable[[float], None] | None = None,
    ) -> None:
        self.progress, self.setup, self.attached, self.step = progress, system, system.attached, system.step
        self.point = point = system.point
        self.changes = timeline(point.case, timed_events(point.case, events))
        self.time, self.wall_s, self.steps = start, 0.0, 0
        self.outcome: Outcome | None = None
        self._taken_off: dict[int, str] = {}
        self._verdict = _judgment.DONE
        self._finished: Trajectory | None = None
        self._swings: tuple[float, Swings | None] | None = None  # instant and last swings then
        self._at, self._since, self._start = 0, start, start
        self._off = np.full(len(point.case.machines), np.inf)
        while self._at + 1 < len(self.changes) and self.changes[self._at + 1].at <= start + 1e-9:
            self._at += 1
        self.wired = system.wired
        self._record = Recording(point, record, self.wired.layout.first_memory, every=every, span=swings.SPAN)
        self._run = buffers(self.wired.start, self.wired.layout, system.places)
        self._enter()
        self._clock = system.places.seen.time
        self.frames = tuple((c.named.controller.rate or 1, Frames(c, self)) for c in self.attached.called)
        self._windows()
        if not stepper.advance.signatures():  # compile it, or load it, outside the time that is measured
            self._call(steps.NONE, False)
            self.wall_s = 0.0

    @property
    def orders(self) -> np.ndarray:
        """Storage orders (devices) in per unit of the ratings, positive to absorb; set them in place."""
        return self._run.s[self.wired.wanted]

    @property
    def s(self) -> np.ndarray:
        """Every signal now; only the inputs of `attached.measured` may be set. Outputs are those of the last stage."""
        return self._run.s

    @property
    def speed(self) -> np.ndarray:
        """Speeds (rotor units) now, pu."""
        return self._run.s[self.point.rotors.speed]

    @property
    def angle(self) -> np.ndarray:
        """Angles (rotor units) now, rad."""
        return self._run.s[self.point.rotors.angle]

    @property
    def acceleration(self) -> np.ndarray:
        """Accelerations (rotor units), pu/s, as last evaluated; of rotors whose speed is a state."""
        return self._run.f[self.point.rotors.speed]

    @property
    def V(self) -> np.ndarray:
        """Voltages (buses) now, complex, pu."""
        self.settled()
        return self._run.volt.copy()

    def at_frame(self) -> np.ndarray:
        """Every signal at a frame, with the voltages of the outputs that were held before it."""
        return self._run.s if self._known else self.settled()

    def settled(self) -> np.ndarray:
        """Every signal now, with voltages and outputs brought up to date."""
        self._advance(steps.NONE, True, stepper.NO_ROWS)
        return self._run.s

    @property
    def island(self) -> np.ndarray:
        """Island numbers (units) now; -1 for a disconnected machine."""
        return self._on.network.net.island

    @property
    def switching(self) -> Switching:
        """What is open, faulted or tripped now."""
        return self.changes[self._at].switching

    def affordable(self, until: float) -> None:
        """Raise `StudyError` if a run to `until` (s) takes too many steps, or too much memory."""
        width = self._record.per_step(self.step)
        steps.affordable(self.point, self.step, until - self.time, width, loop=self.setup.closed.fastest)

    def advance(self, until: float, beyond: float | None = None) -> bool:
        """Advance to `until` (s), stopping exactly at every event; returns whether the run continues.

        Orders may have changed, and the steps are those of an advance to `beyond`, by default to `until`. If that is
        infinite, they have not, and the run goes on.
        """
        self.affordable(until)
        if beyond != np.inf:
            self._run.solve.moves[:] = 0  # orders may have changed
        while self.outcome is None and self.time < until - 1e-9:
            following = self._following
            whole = min([beyond or until, following, *(t for t in self._edges if t > self.time + 1e-9)])
            target = min(until, whole)
            if target > self.time + 1e-9:
                self._segment(target, whole)
                self._windows()
            if self.outcome is None and following <= target + 1e-9:
                self._at += 1
                self._enter()
        return self.outcome is None

    def whole(self, until: float) -> float:
        """The last instant (s) up to `until` at which a step of a run that goes on begins."""
        if until >= self._following - 1e-9 or self._edges:
            return until
        return steps.whole(max(self._since, self.time), until, self.step, self.wired.rates)

    @property
    def _following(self) -> float:
        """Instant (s) of the next event."""
        return self.changes[self._at + 1].at if self._at + 1 < len(self.changes) else np.inf

    def finish(self) -> Trajectory:
        """The trajectory so far, its last row at the present instant."""
        if self._finished is not None:
            return self._finished
        if self.outcome is None:
            self.swings()  # up to the last step; the row at its end comes after
        if self._record.recording and self._verdict != _judgment.NO_VOLTAGE:
            self._record.event()
            self._call(steps.NONE, True)
        if self.outcome is None:
            self.outcome = self._end(_judgment.DONE)
        times, rows = self._record.kept(self.wired.layout.first_memory)
        peak = self._run.watch.angles[1].copy()
        for array in (rows, times, peak):
            array.setflags(write=False)
        happened = Happened(self.changes[: self._at + 1], self._off.copy(), self.island)
        cost = self.step, self.steps, self.wall_s, int(self._run.notes[NOTE.newton])
        self._finished = Trajectory(self.point, self.outcome, times, rows, peak, happened, *cost)
        return self._finished

    def swings(self) -> Swings | None:
        """The last swings so far; None if they are not judged: too soon after the last event, or a machine alone."""
        if self._swings is None or self._swings[0] != self.time:
            self._swings = self.time, self._last_swings()
        return self._swings[1]

    def _last_swings(self) -> Swings | None:
        begin = max(self._since, self.time - swings.SPAN)
        if self.time - begin < swings.LEAST - 1e-9:
            return None
        rotors, half_s = self.point.rotors, (self.time - begin) / 2
        island, names, limit = self.island[rotors.unit], self.point.rotor_names, self.setup.criterion.decay
        angles, middle = self._record.angles(begin, begin + half_s)
        return swings.judged(angles, middle, island, self._on.places.weight, names, half_s, limit)

    def _enter(self) -> None:
        self._since, self._known = self.time, False
        self._run.solve.moves[:], self._run.late[0], self._run.loop.known[0] = 0, -1.0, 0
        self._run.notes[NOTE.slow :] = self._run.newton[:] = 0
        self._on = self.setup.on(self.changes[self._at].switching)
        self._record.enter(self._on.network.net, self._on.places)
        self._off[(self.island < 0) & np.isinf(self._off)] = self.time

    def _windows(self) -> None:
        """Open and close the windows of time in which controllers act."""
        windows = self.attached.windows
        self._known = self._known and not windows
        for place, start, end in windows:
            self._run.s[place] = 1.0 if start <= self.time + 1e-9 < end else 0.0
        self._edges = sorted({edge for _, *both in windows for edge in both})

    def _segment(self, target: float, whole: float) -> None:
        all_steps, done = steps.steps(self.time, target, self.step, self.wired.rates, whole=whole), 0
        count = len(all_steps.sizes)
        while done < count and self.outcome is None:
            now = slice(done, done + self._record.at_once)
            settle = bool(self.frames) and now.stop >= count
            verdict, made = self._call(steps.Steps(*(column[now] for column in all_steps)), False, settle)
            done += made
            self.time = target if done == count else float(all_steps.starts[done])
            self.steps += made
            if verdict in (_judgment.RUNAWAY, _judgment.FREQUENCY) and self._alone():
                self._trip(verdict)
            elif verdict != _judgment.DONE:
                self.outcome = self._end(verdict)
            if self.progress:
                self.progress(self.time)

    def _end(self, verdict: int) -> Outcome:
        self._check_orders()
        check_numbers(self.point.layout, self._run.s, self._run.part, self.time)
        self._verdict = verdict
        instant = self.time - (float(self._run.late[0]) if verdict in TIMED else 0.0)
        if not self._on.network.net.islands:
            instant = float(self._off.max())  # blacked out
        bus, rotor = int(self._run.notes[NOTE.bus]), int(self._run.notes[NOTE.rotor])
        outside = self._run.watch.off[1].max(initial=0.0)
        last = self.swings() if verdict == _judgment.DONE else None
        net, places = self._on.network.net, self._on.places
        weight = np.r_[places.weight, places.other_weight]
        island = np.r_[self.island[places.unit], np.where(places.other_weight > 0, net.island_at[places.other_bus], -1)]
        end = End(
            verdict, instant, self._on.network, self._run.s[np.r_[places.speed, places.other_speed]], weight, island,
            rotor, bus, outside, self._taken_off, last, stalled(self.point, self._run.s, net.alive), self._cycling(),
            self._relay, self._loop(), self._record.extremes, self.switching,
        )  # fmt: skip
        return outcome(self.point, end, self.setup.criterion)

    def _check_orders(self) -> None:
        """Raise `StudyError` if the law gives no finite orders, although what it reads is finite."""
        s, layout, rotors = self._run.s, self.point.layout, self.point.rotors
        wrong = np.flatnonzero(~np.isfinite(s[self.wired.wanted]))
        if len(wrong) and all(np.isfinite(s[at]).all() for at in (layout.voltages, rotors.speed, rotors.angle)):
            names = naming.keys(self.point.case, "storage")
            raise StudyError(
                f"The law {self.setup.parts.law} has no finite order at {self.time:.3f} s for ESD "
                f"{listed([str(names[k]) for k in wrong])}; check its equations and parameters for a division by zero "
                "and the root of a negative number."
            )

    @property
    def _relay(self) -> bool:
        """Whether the law is a relay without delay."""
        law = self.setup.parts.law
        return law is not None and law.relay

    def _loop(self) -> ControlLoop:
        """The loop that the control closes."""
        apart, chatter = (bool(self._run.notes[note]) for note in (NOTE.open, NOTE.chatter))
        loop = self.setup.closed
        trusted, without = steps.trusted(self.step, loop.fastest), self.attached.without(self._off)
        return ControlLoop(*loop, self.step, trusted, apart, chatter, without)

    def _cycling(self) -> dict[str, float]:
        """Storage devices whose orders reverse without end, or faster than machines swing.

        By name; the values are times per second.
        """
        if self._verdict != _judgment.DONE:
            return {}
        elapsed, names, last = self.time - self._start, naming.keys(self.point.case, "storage"), self.swings()
        turns = self._run.watch.turns[1] / -np.expm1(-max(elapsed, 1.0) / _judgment.MEMORY)  # a mean of what there is
        lasting = last is not None and last.lasting and self.time > self._since + swings.SPAN - 1e-9
        least = SLOW if lasting else REVERSALS
        return {str(name): float(rate) for name, rate in zip(names, turns, strict=True) if rate > least}

    def _alone(self) -> bool:
        """Whether the runaway machine is alone in its island, while others that were there before are running."""
        row, island, before = self._run.notes[NOTE.rotor], self.island[self.point.rotors.unit], self.point.rotor_island
        if row >= len(island):  # storage
            return False
        return (island == island[row]).sum() == 1 and ((island >= 0) & (before == before[row])).sum() > 1

    def _trip(self, verdict: int) -> None:
        """Trip the machine that ran away or left the frequency range, as its protection would."""
        row = int(self.point.rotors.unit[self._run.notes[NOTE.rotor]])
        now, *later = (
            replace(c, switching=c.switching._replace(tripped=c.switching.tripped | {row}))
            for c in self.changes[self._at :]
        )
        self.changes = (*self.changes[: self._at + 1], replace(now, at=self.time, automatic=True), *later)
        self._at += 1
        self._enter()
        self._run.watch.off[:2, self._run.notes[NOTE.rotor]] = 0.0
        rules, hz = self.setup.criterion, self.point.case.frequency_hz
        left = f"left the speed range {rules.slowest:g} to {rules.fastest:g} pu at {self.time:.3f} s"
        if verdict == _judgment.FREQUENCY:
            left = f"was outside {frequency_range(rules, hz)} for {rules.frequency_delay_s:g} s at {self.time:.3f} s"
        noun = "Converter" if self.point.rotors.virtual[self._run.notes[NOTE.rotor]] else "Machine"
        number = self.point.case.machines[row].called
        self._taken_off[row] = f"{noun} {number}, alone in its island, {left} and was tripped."

    def _call(self, now: steps.Steps, last: bool, settle: bool = False) -> tuple[int, int]:
        """Make steps; with `last`, record their end too, with `settle`, only evaluate all signals there."""
        history = np.empty((len(now.sizes) + last, self._record.width))
        before = time.perf_counter()
        self._run.s[self._clock] = self.time
        if not np.isfinite(self.orders).all():
            raise StudyError(f"The storage orders {self.orders} are not finite numbers; set them between -1 and 1.")
        verdict, made = self._advance(now, last or settle, history)
        if settle and verdict == _judgment.NO_VOLTAGE and made == len(now.sizes):
            verdict, settle = _judgment.DONE, False  # at this instant, which an event or the frame may change
        self._known = settle and verdict == _judgment.DONE
        self.wall_s += time.perf_counter() - before
        self._record.add(np.append(now.starts[:made], self.time) if last else now.starts[:made], history[: made + last])
        return verdict, made

    def _advance(self, now: steps.Steps, last: bool, history: np.ndarray) -> tuple[int, int]:
        """Steps of the compiled loop; Newton's method is prepared where it asks for it."""
        plan, at, verdict = stepper.Plan(now.sizes, now.due, last), stepper.START, _judgment.NEWTON
        while verdict == _judgment.NEWTON:
            on, rules = self._on, self.setup.rules
            verdict, at = stepper.advance(on.program, on.places, on.network.net, self._run, rules, plan, at, history)
            at = stepper.Cursor(*at)
            if verdict == _judgment.NEWTON:
                self._newton = self.wired.prepare_newton(on.program, on.places, on.network, self._run)
        return verdict, at.step


def run(
    point: OperatingPoint,
    contingency: "Disturbance | None" = None,
    until: float = 10.0,
    control: Control = None,
    *,
    step: float | None = None,
    criterion: Criterion = DEFAULT,
    **how: Any,
) -> Trajectory:
    """Simulate an operating point under a contingency, or events, until `until` (s); the rest is that of `run_of`."""
    return run_of(setup(point, control, step=step, criterion=criterion), contingency, until, **how)


def run_of(
    system: Setup,
    contingency: "Disturbance | None",
    until: float,
    *,
    record: Recorded = True,
    every: float = 0.0,
    start: float = 0.0,
    longest: float = 0.0,
    progress: Callable[[float], None] | None = None,
) -> Trajectory:
    """Simulate a system with its control under a contingency or events until `until` (s); the rest as in `Simulation`.

    Laws and controllers run inside the compiled loop, Python functions and estimators between intervals of their rate.
    A run whose swings have not settled is continued, to `longest` (s) at most.
    """
    events = timed_events(system.point.case, contingency, until, start)
    simulation = Simulation(system, events, record=record, every=every, start=start, progress=progress)
    pilots: list[Pilot] = [*((one.rate, one.pilot([simulation])) for one in system.parts.pilots), *simulation.frames]
    ends = _ends(simulation, until, longest)
    if pilots:
        carry([simulation], pilots, ends)
    else:
        for end in ends:
            simulation.advance(end, beyond=np.inf)
    return simulation.finish()


def _ends(simulation: Simulation, until: float, longest: float) -> Iterator[float]:
    """The end of a run, later while its swings are judged and have not settled; they are where a step begins."""
    while until < longest - 1e-9 and simulation.outcome is None and simulation.setup.criterion.decay:
        yield simulation.whole(until)
        last = simulation.swings()
        if last is not None and last.settled:
            break
        until = min(until + FURTHER, longest)
    yield until
