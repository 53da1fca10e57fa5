"""Searches that are repeated: what is asked for in the second and third round; the smallest shift, by trying all."""

from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
from mixed import mixed_point

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.assessment import redispatch as shifting
from stabctl.assessment import remedies
from stabctl.assessment.redispatch import STEP, TINY, _Room
from stabctl.clearing.trial import Search

SEARCH = Search(0.5, 3.0)
FAULTS = {name: st.Contingency(bus, clear="10cyc") for name, bus in zip("abcd", ("20", "30", "40", "50"), strict=True)}


def margin(name, shortest=3.0):
    found = SimpleNamespace(contingency=FAULTS[name], search=SEARCH, lowest_unstable=shortest)
    return SimpleNamespace(found=found, required=6.0)


def studied(lost, shortest=3.0):
    return SimpleNamespace(insecure=tuple(margin(name, shortest) for name in lost))


ROUNDS = {  # lost at first; what each change gives up, and what is lost with it -> wanted in each round
    "nothing is lost": ("", [("", ""), ("", "")], [""]),
    "at once": ("ab", [("", "")], ["ab"]),
    "a second one": ("a", [("", "b"), ("", "")], ["a", "ab"]),
    "a third one": ("a", [("", "b"), ("", "c"), ("", "")], ["a", "ab", "abc"]),
    "never more than three": ("a", [("", "b"), ("", "c"), ("", "d"), ("", "")], ["a", "ab", "abc"]),
    "given up": ("ab", [("b", "b"), ("", "")], ["ab"]),
    "given up, and a new one": ("ab", [("b", "bc"), ("", "")], ["ab", "abc"]),
    "a shorter fault": ("a", [("", "a"), ("", "a")], ["a", "aA"]),
}


@pytest.mark.parametrize("name", ROUNDS)
def test_what_is_lost_with_a_change_is_wanted_of_the_next(name):
    """A small letter is the guaranteed clearing time, a capital the shortest fault that is lost."""
    lost, rounds, wanted = ROUNDS[name]
    asked_for, left = [], iter(rounds)

    def find(contingencies):
        asked_for.append([(str(one.fault), one.clear) for one in contingencies])
        unsolved, after = next(left)
        labels = tuple(FAULTS[one].label for one in unsolved)
        return SimpleNamespace(unsolved=labels, point=after, control="law")

    def again(after, control):
        assert control == "law"
        return studied(after)

    asked = SimpleNamespace(study=studied(lost), again=again)
    found = list(remedies._rounds(asked, find, remedies.ROUNDS))
    names = {FAULTS[one].fault: one for one in FAULTS}
    told = ["".join(names[f].upper() if clear == "3.0cyc" else names[f] for f, clear in one) for one in asked_for]
    assert told == wanted
    assert [len(after.insecure) for _, after in found] == [len(after) for _, after in rounds[: len(wanted)]]
    assert {clear for one in asked_for for _, clear in one} <= {"6.0cyc", "3.0cyc"}


def test_the_first_change_with_which_the_fewest_are_lost_is_the_remedy(monkeypatch):
    ends = [("one", "abc"), ("two", "a"), ("three", "b")]
    monkeypatch.setattr(remedies, "state", lambda study: len(study.insecure))
    monkeypatch.setattr(remedies, "_remark", lambda change, after, why: f"{change}: {why}")
    monkeypatch.setattr(remedies, "_shifted", lambda asked: None)
    monkeypatch.setattr(remedies, "_retuned", lambda asked: None)
    most = []

    def rounds(asked, find, number):
        most.append(number)
        for change, lost in ends:
            yield change, studied(lost)
        raise StudyError("no more")

    monkeypatch.setattr(remedies, "_rounds", rounds)
    asked = SimpleNamespace(study=studied("abcd"), prices=st.Prices())
    found = remedies.remedy("redispatch", asked)
    assert (found.before, found.after, found.change, found.remark) == (4, 1, "two", "two: no more")
    ends.clear()
    none = remedies.remedy("stabilizers", asked)
    assert (none.before, none.after, none.change, none.remark) == (4, None, None, "no more")
    assert most == [remedies.ROUNDS, 1]


@pytest.mark.parametrize("groups", [1, 2, 3])
def test_the_smallest_shift_is_the_smallest(groups):
    """Whatever is enough, if more is enough then, too; each group alone after the same share of all."""
    rng = np.random.default_rng(groups)
    for last, _ in product((0, 1, 2, 3, 7, 8, 13), range(12)):
        least, weights = rng.integers(0, 2 * last + 2), rng.integers(0, 4, groups)
        room = SimpleNamespace(power=np.ones(groups), last=last, shift=lambda steps: list(steps))
        enough = lambda steps, least=least, weights=weights: bool(weights @ steps >= least + (least == 0))  # noqa: E731
        found = shifting._smallest(room, enough)
        same = next((n for n in range(1, last + 1) if enough([n] * groups)), None)
        if same is None:
            assert found is None
            continue
        wanted = [same] * groups
        for g in range(groups if groups > 1 else 0):
            wanted[g] = next(n for n in range(same + 1) if enough([*wanted[:g], n, *wanted[g + 1 :]]))
        assert found == wanted
    assert shifting._tried(13) == [1, 2, 4, 8, 13]
    assert shifting._tried(8) == [1, 2, 4, 8]
    assert shifting._tried(1) == [1]
    assert shifting._tried(0) == []


def test_groups_that_share_a_machine_are_one():
    rows = [np.array([c == "1" for c in text]) for text in ("11000", "00100", "01010", "00001", "00110")]
    found = shifting._joined(rows)
    assert sorted("".join("01"[int(x)] for x in group) for group in found) == ["00001", "11110"]


def test_who_gives_up_power_and_who_takes_it():
    """Machines ahead give in proportion to what they produce; others of their island take by what is left."""
    point = mixed_point()
    case, rotors = point.case, point.rotors
    names = [m.machine for m in case.machines]
    produced = point.flow.S.real * case.base_mva
    ahead = [np.isin(names, one) for one in ([7, 3], [1021])]
    room = _Room.of(point, ahead, [np.isin(names, [5])])
    spare = {m.machine: m.base - p for m, p in zip(case.machines, produced, strict=True)}
    P = dict(zip(names, produced, strict=True))
    assert (np.asarray(rotors.unit) == np.arange(len(names))).all()
    for group, givers, takers in zip((0, 1), ([7, 3], [1021]), ([12], [1022, 1023, 1024]), strict=True):
        takers = [n for n in takers if P[n] > 0 and spare[n] > 0]
        give = [P[n] / sum(P[k] for k in givers) if n in givers else 0.0 for n in names]
        take = [spare[n] / sum(spare[k] for k in takers) if n in takers else 0.0 for n in names]
        assert room.give[group] == pytest.approx(give)
        assert room.take[group] == pytest.approx(take)
        assert room.power[group] == pytest.approx(sum(P[n] for n in givers))
        assert room.spare[group] == pytest.approx(sum(spare[n] for n in takers))
    shift = room.shift([3, 0])
    now = shift.point.flow.S.real * case.base_mva
    moved = 3 * STEP * room.power[0]
    change = dict(zip(names, now - produced, strict=True))
    assert [change[7], change[3]] == pytest.approx([-moved * P[n] / (P[7] + P[3]) for n in (7, 3)], abs=1e-5)
    assert [change[n] for n in (5, 1021, 1022, 1024)] == pytest.approx([0] * 4, abs=1e-5)
    assert shift.mw == pytest.approx(sum(x for n, x in change.items() if n not in (7, 3) and abs(x) > TINY), abs=1e-6)
    assert shift.words.startswith(f"{moved:.4g} MW less at machines 7, 3; ")
    assert room.group == [case.machine(n).called for n in (7, 3, 1021)]


@pytest.mark.parametrize(("lost", "turned", "wanted"), [((7, 3), 1, (7, 3)), ((7, 3), -1, (12, 5)), ((), 1, ())])
def test_the_group_that_is_ahead_gives_up_power_lost_or_not(lost, turned, wanted):
    """Of its island; the other one, however far it turns, takes no part."""
    point = mixed_point()
    names = np.array([m.machine for m in point.case.machines])
    start = np.linspace(-1, 1, len(names))
    moved = np.where(names > 1000, 50.0, np.where(np.isin(names, [7, 3]), 2.0 * turned, [0.5] * len(names)))
    angle = np.array([start, start + moved])
    run = SimpleNamespace(point=point, unstable_machines=lost, arrays=SimpleNamespace(angle=angle))
    assert names[shifting._ahead(run)].tolist() == list(wanted)
