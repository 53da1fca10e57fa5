"""The rounds of a search: starts in parallel, of which fewer go on after each; a store keeps every round."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

from stabctl.jobs.runner import Runner
from stabctl.jobs.task import Found, Kind, Task, fingerprint, sha256, text

from .case_values import Device
from .parts import Asked, Parts
from .problem import KEPT
from .search import Search

ROUNDS = (1.0, 8), (0.6, 10), (0.2, 12), (0.0, 12)  # share of the starts, at least one, and steps
LOWERING = 40  # steps, in which the gains are lowered; once more if limits are missed then
LOWERED = len(ROUNDS)  # number of the first round in which they are
FORMAT = 4


class Round(NamedTuple):
    """A round of one start."""

    start: int
    round: int

    def given(self) -> dict[str, Any]:
        """Column -> plain value."""
        return self._asdict()


class Work(NamedTuple):
    """A search, and the steps of its next round."""

    search: Search
    steps: int


def run_round(task: Task) -> Found:
    """Run a round; its row has everything that the next one needs."""
    done = task.shared.search.run(task.shared.steps)
    merit = done.best[1]
    return Found({"level": merit.level, "missed": merit.missed, "state": done.state})


FOUND = {"level": float, "missed": float, "state": str}
TUNING = Kind("tuning", {"start": int, "round": int}, FOUND, run_round, FORMAT)


class Rounds:
    """The searches of a problem.

    Parameters
    ----------
    runner
        Runs the rounds, and keeps them.
    parts, asked, devices
        What is tuned, and what for.
    tell
        Called with the level and the share done.
    """

    def __init__(
        self, runner: Runner, parts: Parts, asked: Asked, devices: Sequence[Device], tell: Callable[[str, float], None]
    ) -> None:
        self.runner, self.parts, self.asked, self.tell = runner, parts, asked, tell
        self.known, self.done, self.whole = "", 0, 1
        if runner.remote:
            cases = [(fingerprint(one.given.case), one.intact) for one in parts.networks]
            self.known = text([cases, list(devices), asked])

    def best(self, starts: int, seed: int) -> Search:
        """The best of several starts; where the damping wanted is reached, with lower gains."""
        problem = self.parts.problem(self.asked)
        self.whole = sum(max(1, round(starts * share)) * steps for share, steps in ROUNDS)
        points = list(self.parts.starts(problem, (starts + 1) // 2, seed))
        searches = [(k, Search(problem, points[k // 2], k % 2 == 0, self.count)) for k in range(starts)]
        with ThreadPoolExecutor(self.runner.workers) as pool:
            for n, (share, steps) in enumerate(ROUNDS):
                kept = searches[: max(1, round(starts * share))]
                searches = list(pool.map(lambda one, n=n, steps=steps: self.run(one, (n, seed), steps), kept))
                searches.sort(key=lambda one: -one[1].best[1].value)
                if searches[0][1].best[1].reaches(problem.goal):
                    break
        k, best = searches[0]
        if not self.parts.tunables or not best.best[1].reaches(problem.goal):
            return best
        lowered = Search(self.parts.problem(self.asked, lowered=True), best.best[0].p, tell=self.count)
        for again in range(2):
            _, lowered = self.run((k, lowered), (LOWERED + again, seed), LOWERING)
            if lowered.best[1].missed >= -KEPT:
                return lowered
        return best

    def run(self, one: tuple[int, Search], which: tuple[int, int], steps: int) -> tuple[int, Search]:
        """A round of a start, run or kept: the search after it."""
        (start, search), (n, seed) = one, which
        key = sha256([self.known, start, n, seed, search.now.p.tolist()]) if self.known else ""
        row = self.runner.ask(Task(key, Round(start, n), Work(search, steps), TUNING))
        return start, Search.resumed(search.problem, row["state"], self.count)

    def count(self, level: float) -> None:
        """A step was made."""
        self.done += 1
        self.tell(f"worst damping {level:z.4f}", min(self.done / self.whole, 1.0))
