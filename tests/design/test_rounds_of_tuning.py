"""Starts of a search in rounds: which go on, in which order, when it ends, and the lowering of gains after it."""

from types import SimpleNamespace

import numpy as np
import pytest

from stabctl.design.tuning import rounds
from stabctl.design.tuning.problem import KEPT

ALL = [steps for _, steps in rounds.ROUNDS]


class Search:
    """A start that is better after every round; the goal is reached after a certain one."""

    def __init__(self, problem, point, first=None, count=None, tell=None):
        self.problem, self.point, self.first, self.tell = problem, point, first, tell or count
        self.value, self.missed, self.reached = 0.0, 0.0, False

    @property
    def best(self):
        merit = SimpleNamespace(value=self.value, missed=self.missed, reaches=lambda goal: self.reached and goal == 0.1)
        return SimpleNamespace(p=np.array([self.value])), merit


@pytest.fixture
def searched(monkeypatch):
    def search(starts, values, *, reached=9, lowered=(), tunables=True):
        """The best, and every run: number of the start, of the round, seed and steps."""
        monkeypatch.setattr(rounds, "Search", Search)
        runs, left = [], iter(lowered)

        def run(self, one, which, steps):
            (k, search), (n, seed) = one, which
            runs.append((k, n, seed, steps))
            if n < rounds.LOWERED:
                assert (search.problem.name, search.point, search.first) == ("usual", f"point {k // 2}", k % 2 == 0)
                search.value, search.reached = values[k] * (n + 1), n + 1 >= reached
            else:
                assert search.problem.name == "lowered"
                search.missed = next(left)
            return k, search

        monkeypatch.setattr(rounds.Rounds, "run", run)
        told = []
        parts = SimpleNamespace(
            networks=[], tunables=tunables,
            problem=lambda asked, lowered=False: SimpleNamespace(goal=0.1, name="lowered" if lowered else "usual"),
            starts=lambda problem, number, seed: (f"point {i}" for i in range(number)),
        )  # fmt: skip
        runner = SimpleNamespace(remote=False, workers=1)
        every = rounds.Rounds(runner, parts, "asked", (), lambda *said: told.append(said))
        best = every.best(starts, 5)
        return best, runs, every, told

    return search


@pytest.mark.parametrize("starts", [1, 2, 5, 10])
def test_fewer_starts_go_on_after_each_round_and_the_best_are_kept(searched, starts):
    values = np.random.default_rng(starts).permutation(starts) + 1.0
    best, runs, every, _ = searched(starts, values)
    order, wanted = list(range(starts)), []
    for n, (share, steps) in enumerate(rounds.ROUNDS):
        order = order[: max(1, round(share * starts))]
        wanted += [(k, n, 5, steps) for k in order]
        order.sort(key=lambda k: -values[k])
    assert runs == wanted
    assert best.value == values.max() * len(rounds.ROUNDS)
    assert every.whole == sum(steps for *_, steps in runs)


@pytest.mark.parametrize("reached", [1, 2, 4])
@pytest.mark.parametrize(("lowered", "kept"), [((0.0,), 0), ((-9.0, -KEPT / 2), 1), ((-9.0, -8.0), None)])
def test_the_goal_ends_the_search_and_gains_are_lowered_at_most_twice(searched, reached, lowered, kept):
    best, runs, _, _ = searched(3, [1.0, 3.0, 2.0], reached=reached, lowered=lowered)
    assert max(n for _, n, *_ in runs if n < rounds.LOWERED) == reached - 1
    last = [(1, rounds.LOWERED + i, 5, rounds.LOWERING) for i in range(len(lowered))]
    assert runs[-len(last) :] == last
    if kept is None:
        assert (best.problem.name, best.point, best.value) == ("usual", "point 0", 3.0 * reached)
    else:
        assert (best.problem.name, best.missed) == ("lowered", lowered[kept])
        assert best.point == np.array([3.0 * reached])


def test_without_parameters_nothing_is_lowered_and_the_share_done_is_at_most_one(searched):
    best, runs, every, told = searched(2, [2.0, 1.0], reached=1, tunables=False)
    assert (best.value, len(runs)) == (2.0, 2)
    for _ in range(every.whole + 3):
        every.count(0.0123)
    assert told[0] == ("worst damping 0.0123", 1 / every.whole)
    assert [share for _, share in told[-4:]] == [1.0] * 4
