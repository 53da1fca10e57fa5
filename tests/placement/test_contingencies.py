"""The contingencies to be survived: lists, screens and files, and their mistakes."""

from dataclasses import replace

import pytest

from stabctl._util.errors import StudyError
from stabctl.clearing import ClearingTime, Lines, Screen, Search
from stabctl.controllers import Controller, Gate
from stabctl.placement.contingencies import clearing_s, contingencies, from_screen, packaged, without_fault
from stabctl.placement.place import BY_SCREEN
from stabctl.simulation.contingency import Contingency

GOOD = '[[contingency]]\nfault = "16"\ntrip = "16-21"\nclear = "6cyc"\n'
ONE = Contingency("16", "6cyc", "16-21")


@pytest.fixture
def read(cases, tmp_path):
    """Contingencies of ieee39 from the text or bytes of a file."""

    def made(text):
        path = tmp_path / "these.toml"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return contingencies(cases("ieee39"), path)

    return made


def test_a_file_is_a_list_of_contingencies(read, cases):
    assert read(GOOD) == (ONE,)
    more = GOOD + '[[contingency]]\nfault = 29\nclear = "80ms"\nname = "north"\n'
    more += GOOD.replace("16", "26", 1).replace("16-21", "26-29")
    bare, two = read(more)[1:]
    assert bare == Contingency("29", "80ms", name="north")
    assert [clearing_s(one, cases("ieee39")) for one in (bare, two)] == pytest.approx([0.08, 0.1])
    assert two.label == "26 trip 26-29"
    several = read(GOOD.replace('"16-21"', '["16-21", "16-24"]'))[0]
    assert [*map(str, several.trip)] == ["16-21", "16-24"]
    along = read('[[contingency]]\nfault = "16-21@0.4"\nclear = "0.1s"\n')[0]
    assert (along.label, along.trip) == ("16-21@0.4", ())


def test_a_byte_order_mark_does_no_harm(read):
    assert read(b"\xef\xbb\xbf" + GOOD.encode()) == read(GOOD)


def test_a_list_a_single_one_and_a_path_as_text(cases, tmp_path):
    case = cases("ieee39")
    (tmp_path / "these.toml").write_text(GOOD)
    for given in ([ONE], ONE, iter([ONE]), str(tmp_path / "these.toml")):
        assert contingencies(case, given) == (ONE,)


@pytest.mark.parametrize(
    ("name", "classical", "count"), [("ieee39", True, 9), ("ieee39", False, 9), ("wnaps", False, 8)]
)
def test_the_packaged_files_are_possible(cases, name, classical, count):
    assert len(contingencies(cases(name), packaged(name, classical))) == count


def test_cases_without_a_packaged_file():
    assert packaged("two_area") is None
    assert packaged("wnaps", classical=True) is None
    assert packaged("no such case") is None


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "these.toml has no contingencies"),
        ("contingency = 3", "has no contingencies"),
        ("contingency = [1, 2]", "contingency 1 is not a table"),
        ("[contingency]\nfault = '16'", "has no contingencies"),
        ("title = 'a'\n" + GOOD, "these.toml: 'title' is not a known key; the keys are contingency"),
        ("contingencies = 'a'\n" + GOOD, "'contingencies' is not a known key; did you mean 'contingency'"),
        ("[[contingency]\n", "these.toml is not valid TOML"),
        ("fault,trip,clear\n16,16-21,6cyc\n", "is not valid TOML"),
        (b"\xff\xfe[\x00", "is not valid TOML"),
        ("a = " + "[" * 100_000, "is not valid TOML"),
        (GOOD * 20_000, "has more than 1000000 bytes"),
        (GOOD + GOOD.replace("clear", "cleared"), "contingency 2: 'cleared' is not a known key; did you mean 'clear'"),
        (
            GOOD + "colour = 'red'",
            "contingency 1: 'colour' is not a known key; the keys are fault, clear, impedance",
        ),
        ('[[contingency]]\ntrip = "16-21"\nclear = "6cyc"', "contingency 1: fault is missing; it must be a bus"),
        (GOOD + 'impedance = "1"', "impedance = '1' is not allowed; write R,X"),
        (GOOD + 'impedance = "-1,0"', "its resistance must be at least 0"),
        (GOOD + 'trip_machine = "77"', "There is no machine 77"),
        (GOOD + 'trip_machine = "9@now"', "'now' is not a time"),
        ('[[contingency]]\nname = "nothing"', "contingency 1: fault is missing; it must be a bus"),
        ('[[contingency]]\nfault = "16"', "contingency 1: clear is missing; it must be a clearing time"),
        (GOOD.replace('"16"', "true"), "contingency 1, fault = True: it must be a bus or a point on a circuit"),
        (GOOD.replace('"16"', "16.0"), "fault = 16.0: it must be"),
        (GOOD.replace('"16"', '["16"]'), r"fault = \['16'\]: it must be"),
        (GOOD.replace('"16"', "1" * 5000), "is not valid TOML: Exceeds the limit"),
        (GOOD.replace('"6cyc"', "6"), 'clear = 6: it must be a clearing time, such as "8.2cyc"'),
        (GOOD.replace('"6cyc"', "false"), "clear = False: it must be"),
        (GOOD.replace('"16-21"', "7"), "trip = 7: it must be a circuit or a list of circuits"),
        (GOOD.replace('"16-21"', '["16-21", 3]'), r"trip = .*: it must be a circuit or a list of circuits"),
        (GOOD.replace('"6cyc"', '"6"'), "contingency 1: '6' is not a time"),
        (GOOD.replace('"6cyc"', '"nan"'), "contingency 1: 'nan' is not a time"),
        (GOOD.replace('"6cyc"', '"inf s"'), "is not a time"),
        (GOOD.replace('"6cyc"', '"-6cyc"'), "contingency 1: '-6cyc' is not a time"),
        (GOOD.replace('"6cyc"', '"0cyc"'), "Contingency 1 .*is cleared after 0 s"),
        (GOOD.replace('"6cyc"', '"1e300s"'), "Contingency 1 .*after 1e.300 s"),
        (GOOD.replace('"16"', '"160"'), "Contingency 1 .*There is no bus 160"),
        (GOOD.replace('"16"', '"nowhere"'), "'nowhere' is not a location"),
        (GOOD.replace('"16"', '""'), "'' is not a location"),
        (GOOD.replace('"16-21"', '"16-22"'), "There is no branch 16-22"),
        (GOOD.replace('"16-21"', '"16-21#2"'), "has 1 circuit"),
        (GOOD.replace('"16-21"', '"16"'), "'16' is not a circuit"),
        (GOOD.replace('"16-21"', '"16-21@0.3"'), "is not a circuit"),
        (GOOD.replace('"16"', '"16-21@1.4"'), "The position 1.4 along 16-21"),
        (GOOD + GOOD.replace("6cyc", "100ms"), "Contingency 2 .*is the same as contingency 1"),
    ],
)
def test_a_mistake_is_a_sentence(read, text, words):
    with pytest.raises(StudyError, match=words) as error:
        read(text)
    assert "these.toml" in str(error.value)
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 500


def test_impedances_and_machine_trips_of_a_file(read):
    """A machine is tripped when the fault is cleared, or so long after it; without a fault at once."""
    rows = (
        GOOD + 'impedance = "0.01,0.05"\ntrip_machine = "9"',
        GOOD + 'trip_machine = ["9@0.5s", "8@12cyc"]',
        "[[contingency]]\ntrip_machine = 9",
        '[[contingency]]\ntrip = "16-21"',
    )
    first, second, third, fourth = read("\n".join(rows))
    assert first.impedance == 0.01 + 0.05j
    assert [(e.machine, e.at) for e in first.after] == [(9, 0.0)]
    assert [(e.machine, e.at) for e in second.events] == [(9, pytest.approx(1.5)), (8, pytest.approx(1.2))]
    assert (third.fault, [(e.machine, e.at) for e in third.after]) == (None, [(9, 0.0)])
    assert (fourth.fault, str(fourth.trip)) == (None, "('16-21',)")


def test_other_instants_make_another_contingency_only_under_a_control_with_instants_of_its_own(cases):
    """What counts otherwise is the time from the fault on."""
    gated = Controller("deviation:1", "vref:1", [], [], [], [[1.0]], gate=Gate(start=2.2))
    early, late = (Contingency("16", "6cyc", at=at, events=f"16-24@{at + 1}s") for at in (1.0, 2.0))
    other = replace(late, events="16-24@2s")
    assert len(contingencies(cases("ieee39"), [early, other])) == 2
    assert len(contingencies(cases("ieee39"), [early, late], gated)) == 2
    with pytest.raises(StudyError, match="is the same as contingency 1"):
        contingencies(cases("ieee39"), [early, late])


def test_without_a_fault_time_begins_with_the_first_event_or_is_that_of_a_gate(cases):
    two, gate = Contingency(trip="16-21", at="2s", events="16-24@2.5s"), Gate(start=2.2)
    timed = Controller("deviation:1", "vref:1", [], [], [], [[1.0]], gate=gate)
    for control, first in ((None, 0.0), (timed, 2.0)):
        moved, last = without_fault(two, cases("ieee39"), control)
        assert sorted(event.at for event in moved.events) == [first, first + 0.5]
        assert last == first + 0.5


def test_a_file_that_cannot_be_read(cases, tmp_path):
    for path in (tmp_path / "missing.toml", tmp_path, "x" * 5000, "a\0b"):
        with pytest.raises(StudyError, match="cannot be read"):
            contingencies(cases("ieee39"), path)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ((), "no contingencies to survive"),
        (7, "7 is not a list of contingencies"),
        (["16"], "Contingency 1 is '16'; write Contingency"),
        ([Contingency("16")], "has no clearing time"),
        ([Contingency()], "has no fault and no event"),
        ([Contingency("16", 0.0)], "is cleared after 0 s"),
        ([ONE, Contingency("16", "100ms", "16-21")], "is the same as contingency 1"),
    ],
)
def test_what_is_not_a_list_of_contingencies(cases, given, words):
    with pytest.raises(StudyError, match=words):
        contingencies(cases("ieee39"), given)


def _screen(*pairs):
    return Screen("any", pairs, Lines((), (), ()), Search(), 50.0, len(pairs), 0, 0.0)


def _pair(fault, cycles, machine, status="found"):
    one = Contingency(fault, trip=f"{fault}-2")
    return ClearingTime("any", one, status, cycles, None, machine, Search(), (), 0.0)


def test_a_screen_gives_the_worst_contingency_of_every_machine():
    found = _screen(
        _pair("9", None, 7, "unstable_at_zero"),
        _pair("1", 3.0, 5),
        _pair("3", 3.5, 5),
        _pair("4", 4.0, 6),
        _pair("5", None, None, "stable_at_limit"),
    )
    worst = from_screen(found, 50.0)
    assert worst == (Contingency("1", 1.2 * 3 / 50, "1-2"), Contingency("4", 1.2 * 4 / 50, "4-2"))
    assert from_screen(found, 50.0, count=1) == worst[:1]
    assert from_screen(found, 50.0, longer=2.0)[0].clear == 2 * 3 / 50
    assert from_screen(_screen(), 60.0) == ()
    assert "by default: 20 % longer than the critical ones" in BY_SCREEN
