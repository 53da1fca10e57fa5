"""A simulation that can be advanced an interval at a time, and the run from start to end in one call."""

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from stabctl._util import jit
from stabctl.controllers import Device, Law
from stabctl.dynamics.operating_point import Point
from stabctl.dynamics.system import Signals, buffers
from stabctl.errors import StudyError

from . import events as ev
from . import stepper
from .contingency import Happenings, schedule
from .criterion import DEFAULT, Criterion
from .outcome import End, Outcome, outcome
from .sampled import Sampled, carry
from .topology import stage
from .trajectory import Trajectory

STEP = 1 / 120  # s   default
LEAST_STEP = 1e-7  # s
MOST = 50_000_000  # steps of one run
NO_ROWS = np.empty((0, 0))
AT_ONCE = 1200  # steps in one call of the compiled loop, between which Ctrl-C and progress have their turn
REACH = 2.5  # largest |step * eigenvalue| that RK4 carries, with a margin (it is unstable beyond 2.785)


class Simulation:
    """A system in motion. `advance` carries it on; storage orders may be set between calls where `control` is None.

    Args: the operating point; what happens; the storage law (None: orders as set in `orders`); the largest step (s);
    when to give up; whether to keep the rows of the trajectory; the first instant (s); what is told the time (s) now
    and then. Raises `StudyError` for impossible events or step.
    """

    def __init__(
        self,
        point: Point,
        events: "Happenings | None" = None,
        control: Law | None = None,
        step: float | None = None,
        criterion: Criterion = DEFAULT,
        record: bool = True,
        start: float = 0.0,
        progress: Callable[[float], None] | None = None,
    ) -> None:
        self.progress = progress
        self.point, self.criterion, self.recording = point, Criterion(*map(float, criterion)), record
        self.step = _checked_step(point, step)
        self.changes = ev.timeline(point.case, schedule(point.case, events))
        self.time, self.wall_s, self.steps = start, 0.0, 0
        self.outcome: Outcome | None = None
        self._taken_off: list[str] = []
        self._verdict, self._finished = stepper.DONE, None
        self._at = 0
        while self._at + 1 < len(self.changes) and self.changes[self._at + 1].at <= start + 1e-9:
            self._at += 1
        self._law = point.plant.law.copy()
        if control is not None:
            base = {m.machine: m.base for m in point.case.machines}
            for j, s in enumerate(point.case.storage):
                device = Device(s.rating, base[s.machine], point.case.frequency_hz)
                self._law[j] = tuple(control.par(device))
        self._enter()
        self._buffers = buffers(point.plant, len(point.V))
        self._buffers.z[:] = point.z
        self._work = stepper.scratch(self._buffers, point.plant)
        self._width = len(point.z) + 3 * len(point.case.machines) + len(point.case.storage)
        self._times: list[np.ndarray] = []
        self._rows: list[np.ndarray] = []
        jit.announce()
        self._call(0.0, 0, False)  # compiles, or loads the machine code, outside the time that is measured
        self.wall_s = 0.0

    @property
    def orders(self) -> np.ndarray:
        """Orders (devices) wanted from outside, in ratings, absorbing positive; set them in place."""
        return self._work.wish

    @property
    def speed(self) -> np.ndarray:
        """Speeds (machines) now, pu."""
        return self._buffers.z[self.point.plant.rotor + 1]

    @property
    def angle(self) -> np.ndarray:
        """Angles (machines) now, rad."""
        return self._buffers.z[self.point.plant.rotor]

    @property
    def V(self) -> np.ndarray:
        """Voltages (buses) now, complex, pu."""
        stepper.advance(self._buffers, self._plant, self._stage.net, self._work, self.criterion, 0.0, 0, True, NO_ROWS)
        return self._work.volt.copy()

    @property
    def signals(self) -> Signals:
        """Named views of states and set-points now; to read."""
        return self._buffers.s

    @property
    def island(self) -> np.ndarray:
        """Islands (machines) now, by number; -1 of a machine that is off."""
        return self._stage.net.island

    def advance(self, until: float) -> bool:
        """Carry on to `until` (s), landing on every event on the way; is the system still to be carried on?"""
        while self.outcome is None and self.time < until - 1e-9:
            following = self.changes[self._at + 1].at if self._at + 1 < len(self.changes) else np.inf
            target = min(until, following)
            if target > self.time + 1e-9:
                self._segment(target)
            if self.outcome is None and following <= target + 1e-9:
                self._at += 1
                self._enter()
        return self.outcome is None

    def finish(self) -> Trajectory:
        """The trajectory so far, its last row at the present instant."""
        if self._finished is not None:
            return self._finished
        if self.outcome is None:
            self.outcome = self._end(stepper.DONE)
        if self.recording and self._verdict != stepper.NO_VOLTAGE:
            self._call(0.0, 0, True)
        rows = np.concatenate(self._rows) if self._rows else np.empty((0, self._width))
        times = np.concatenate(self._times) if self._times else np.empty(0)
        peak = self._work.peak.copy()
        for array in (rows, times, peak):
            array.setflags(write=False)
        self._finished = Trajectory(self.point, self.outcome, times, rows, peak, self.step, self.steps, self.wall_s)
        return self._finished

    def _enter(self) -> None:
        self._stage = stage(self.point, self.changes[self._at].switching)
        self._plant = self.point.plant._replace(load=self._stage.load, law=self._law)

    def _segment(self, target: float) -> None:
        steps = max(1, int(np.ceil((target - self.time) / self.step - 1e-6)))
        if steps > MOST:
            raise StudyError(f"{steps:.2g} steps to {target:g} s are too many; give a longer step or a shorter run.")
        start, h, done = self.time, (target - self.time) / steps, 0
        while done < steps and self.outcome is None:
            verdict, made = self._call(h, min(steps - done, AT_ONCE), False)
            done += made
            self.time = target if done == steps else start + h * done
            self.steps += made
            if verdict == stepper.RUNAWAY and self._alone():
                self._take_off()
            elif verdict != stepper.DONE:
                self.outcome = self._end(verdict)
            if self.progress:
                self.progress(self.time)

    def _end(self, verdict: int) -> Outcome:
        self._verdict = verdict
        blame = self._work.rotor[0], self._work.bus[0]
        end = End(verdict, self.time, self._stage, self.speed, *map(int, blame), tuple(self._taken_off))
        return outcome(self.point, end, self.criterion)

    def _alone(self) -> bool:
        """Has the machine that ran away an island of its own, while others run elsewhere?"""
        island = self._stage.net.island
        return (island == island[self._work.rotor[0]]).sum() == 1 and (island >= 0).sum() > 1

    def _take_off(self) -> None:
        """Trip the machine that ran away, as its overspeed protection would, from now on."""
        row = int(self._work.rotor[0])
        gone = [c.switching._replace(tripped=c.switching.tripped | {row}) for c in self.changes[self._at :]]
        later = (replace(c, switching=s) for c, s in zip(self.changes[self._at :], gone, strict=True))
        self.changes = (*self.changes[: self._at], *later)
        self._enter()
        self._taken_off.append(
            f"Machine {self.point.case.machines[row].machine}, alone in its island, left {self.criterion.slowest:g} to "
            f"{self.criterion.fastest:g} pu of speed at {self.time:.3f} s and was taken off."
        )

    def _call(self, h: float, steps: int, last: bool) -> tuple[int, int]:
        history = np.empty((steps + last if self.recording else 0, self._width))
        before = time.perf_counter()
        if not np.isfinite(self.orders).all():
            raise StudyError(f"The storage orders {self.orders} are not finite numbers; set them between -1 and 1.")
        verdict, made = stepper.advance(
            self._buffers, self._plant, self._stage.net, self._work, self.criterion, h, steps, last, history
        )
        self.wall_s += time.perf_counter() - before
        if self.recording:
            self._times.append(self.time + h * np.arange(made + last))
            self._rows.append(history[: made + last])
        return verdict, made


def _checked_step(point: Point, step: float | None) -> float:
    longest = REACH / point.fastest
    if step is None:
        return min(STEP, longest / 2)
    if not LEAST_STEP <= step < np.inf:
        raise StudyError(f"The step {step:g} s is not allowed; it must be at least {LEAST_STEP:g} s.")
    if step > longest:
        raise StudyError(
            f"The step {step:.4g} s is too long for {point.case.name}, whose fastest eigenvalue is near "
            f"{point.fastest:.0f} 1/s; give at most {longest:.3g} s."
        )
    return step


def run(
    point: Point,
    contingency: "Happenings | None" = None,
    until: float = 10.0,
    control: Law | Sampled | None = None,
    step: float | None = None,
    criterion: Criterion = DEFAULT,
    record: bool = True,
    start: float = 0.0,
    progress: Callable[[float], None] | None = None,
) -> Trajectory:
    """Simulate an operating point under a contingency, or events, until `until` (s); the rest as in `Simulation`.

    A law runs inside the compiled loop, a sampled controller between intervals of its rate.
    """
    events = schedule(point.case, contingency, until, start)
    sampled = isinstance(control, Sampled)
    simulation = Simulation(point, events, None if sampled else control, step, criterion, record, start, progress)
    if sampled:
        carry([simulation], control.pilot([simulation]), control.rate, until)
    else:
        simulation.advance(until)
    return simulation.finish()
