"""What must be survived: files of contingencies, their mistakes, and those a screen supplies."""

import pytest

from stabctl.clearing import ClearingTime, Screen, Search
from stabctl.clearing.lines import Lines
from stabctl.errors import StudyError
from stabctl.placement.contingency import Contingency, checked, from_screen, load, packaged
from stabctl.simulation import contingency as simulated

GOOD = '[[contingency]]\nfault = "16"\ntrip = "16-21"\nclear = "6cyc"\n'


@pytest.fixture
def read(cases, tmp_path):
    """Contingencies of ieee39 from the text or bytes of a file."""

    def made(text):
        path = tmp_path / "these.toml"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return load(path, cases("ieee39"))

    return made


def test_a_file_is_read_in_the_cycles_of_the_case(read):
    assert read(GOOD) == (Contingency("16", ("16-21",), pytest.approx(0.1)),)
    more = (
        GOOD + '[[contingency]]\nfault = 29\nclear = "80ms"\n' + GOOD.replace("16", "26", 1).replace("16-21", "26-29")
    )
    bare, two = read(more)[1:]
    assert bare == Contingency("29", (), pytest.approx(0.08))
    assert two.name == "26 trip 26-29"
    several = read(GOOD.replace('"16-21"', '["16-21", "16-24"]'))[0]
    assert several.trip == ("16-21", "16-24")
    along = read('[[contingency]]\nfault = "16-21@0.4"\nclear = "0.1s"\n')[0]
    assert (along.name, along.trip) == ("16-21@0.4", ())


def test_a_byte_order_mark_does_no_harm(read):
    assert read(b"\xef\xbb\xbf" + GOOD.encode()) == read(GOOD)


@pytest.mark.parametrize(
    ("name", "classical", "count"), [("ieee39", True, 9), ("ieee39", False, 9), ("wnaps", False, 8)]
)
def test_the_packaged_files_are_possible(cases, name, classical, count):
    assert len(load(packaged(name, classical), cases(name))) == count


def test_where_none_is_packaged():
    assert packaged("two_area") is None
    assert packaged("wnaps", classical=True) is None
    assert packaged("no such case") is None


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "these.toml holds no contingencies"),
        ("contingency = 3", "holds no contingencies"),
        ("contingency = [1, 2]", "holds no contingencies"),
        ("[contingency]\nfault = '16'", "holds no contingencies"),
        ("title = 'a'\n" + GOOD, "these.toml: the key 'title' is not known"),
        ("[[contingency]\n", "these.toml is not TOML"),
        ("fault,trip,clear\n16,16-21,6cyc\n", "is not TOML"),
        (b"\xff\xfe[\x00", "is not TOML"),
        ("a = " + "[" * 100_000, "is not TOML"),
        (GOOD * 20_000, "has more than 1000000 bytes"),
        (GOOD + GOOD.replace("clear", "cleared"), "contingency 2: the key 'cleared' is not known"),
        ('[[contingency]]\ntrip = "16-21"\nclear = "6cyc"', "contingency 1: fault is missing"),
        ('[[contingency]]\nfault = "16"', "contingency 1: clear is missing"),
        (GOOD.replace('"16"', "true"), "contingency 1: fault = True is not a text"),
        (GOOD.replace('"16"', "16.0"), "fault = 16.0 is not a text"),
        (GOOD.replace('"16"', '["16"]'), r"fault = \['16'\] is not a text"),
        (GOOD.replace('"6cyc"', "6"), "clear = 6 is not a text"),
        (GOOD.replace('"6cyc"', "false"), "clear = False is not a text"),
        (GOOD.replace('"16-21"', "7"), "trip = 7 is not a text"),
        (GOOD.replace('"16-21"', '["16-21", 3]'), "does not name circuits"),
        (GOOD.replace('"6cyc"', '"6"'), "contingency 1: '6' is not a time"),
        (GOOD.replace('"6cyc"', '"nan"'), "contingency 1: 'nan' is not a time"),
        (GOOD.replace('"6cyc"', '"inf s"'), "is not a time"),
        (GOOD.replace('"6cyc"', '"-6cyc"'), "contingency 1: '-6cyc' is not a time"),
        (GOOD.replace('"6cyc"', '"0cyc"'), "Contingency 1 .*is cleared after 0 s"),
        (GOOD.replace('"6cyc"', '"1e300s"'), "Contingency 1 .*after 1e.300 s"),
        (GOOD.replace('"16"', '"160"'), "Contingency 1 .*There is no bus 160"),
        (GOOD.replace('"16"', '"nowhere"'), "'nowhere' is not a place"),
        (GOOD.replace('"16"', '""'), "'' is not a place"),
        (GOOD.replace('"16-21"', '"16-22"'), "There is no branch 16-22"),
        (GOOD.replace('"16-21"', '"16-21#2"'), "has 1 circuit"),
        (GOOD.replace('"16-21"', '"16"'), "'16' does not name a circuit"),
        (GOOD.replace('"16-21"', '"16-21@0.3"'), "does not name a circuit"),
        (GOOD.replace('"16"', '"16-21@1.4"'), "The place 1.4 along 16-21"),
        (GOOD + GOOD, "Contingency 2 .*is listed twice"),
    ],
)
def test_a_mistake_is_a_sentence(read, text, words):
    with pytest.raises(StudyError, match=words) as error:
        read(text)
    assert "these.toml" in str(error.value)
    assert len(str(error.value)) < 500


def test_what_is_not_a_file_is_said(cases, tmp_path):
    for path in (tmp_path / "missing.toml", tmp_path, "x" * 5000, "a\0b"):
        with pytest.raises(StudyError, match="cannot be read"):
            load(path, cases("ieee39"))


def test_nothing_to_survive_is_said(cases):
    with pytest.raises(StudyError, match="no contingency"):
        checked((), cases("ieee39"))
    with pytest.raises(StudyError, match="nan s"):
        checked([Contingency("16", (), float("nan"))], cases("ieee39"))


def _screen(*pairs):
    return Screen("any", pairs, Lines((), (), ()), Search(), 50.0, len(pairs), 0, 0.0)


def _pair(fault, cycles, machine, status="found"):
    one = simulated.Contingency(fault, trip=f"{fault}-2")
    return ClearingTime("any", one, status, cycles, None, machine, Search(), (), 0.0)


def test_a_screen_supplies_the_worst_of_every_machine():
    found = _screen(
        _pair("9", None, 7, "unstable_at_zero"),
        _pair("1", 3.0, 5),
        _pair("3", 3.5, 5),
        _pair("4", 4.0, 6),
        _pair("5", None, None, "stable_at_limit"),
    )
    worst = from_screen(found, 50.0)
    assert worst == (Contingency("1", ("1-2",), 1.2 * 3 / 50), Contingency("4", ("4-2",), 1.2 * 4 / 50))
    assert from_screen(found, 50.0, count=1) == worst[:1]
    assert from_screen(found, 50.0, longer=2.0)[0].clear == 2 * 3 / 50
    assert from_screen(_screen(), 60.0) == ()
