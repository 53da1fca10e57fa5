"""One contingency: what it holds, how it reads, what it says of itself, and what a case or a run refuses."""

import pytest

from stabctl._util.errors import StudyError
from stabctl.simulation.contingency import Contingency, timed_events
from stabctl.simulation.criterion import DEFAULT, Criterion, checked
from stabctl.simulation.events import Clear, Fault, LoadStep, Open, TripMachine, event


@pytest.fixture
def two_area(cases):
    return cases("two_area")


def test_a_fault_on_a_circuit_is_cleared_by_opening_it(two_area):
    one = Contingency("7-8@0.4", clear="21cyc", trip="7-8")
    assert one.timed(two_area) == (Fault("7-8@0.4", 1.0), Open("7-8", 1.35))
    assert one.timed(two_area) == Contingency("7-8@0.4", clear="0.35s").timed(two_area)
    assert str(one) == "fault 7-8@0.4, cleared after 21cyc by opening 7-8"


def test_a_fault_at_a_bus_goes_out_when_its_circuits_open(two_area):
    one = Contingency(7, 0.1, ["7-8", "8-9#2"], at="60cyc", impedance=0.01j)
    opened = Open("7-8", 1.1), Open("8-9#2", 1.1)
    assert one.timed(two_area) == (Fault("7", 1.0, 0.01j), Clear("7", 1.1), *opened)
    assert one.label == "7 trip 7-8, 8-9#2"
    assert str(one) == "fault 7 through 0.01j pu, cleared after 0.1 s by opening 7-8, 8-9#2"
    assert one.described(two_area) == str(one).replace("0.1 s", "0.1 s (6 cycles)")


@pytest.mark.parametrize(
    ("one", "label"),
    [
        (Contingency("7", 0.1), "7"),
        (Contingency("7", 0.1, "7-8, 8-9"), "7 trip 7-8, 8-9"),
        (Contingency(trip="7-8"), "trip 7-8"),
        (Contingency("7", 0.1, "7-8", name="west"), "west"),
        (Contingency(events="2@1s"), "2@1s"),
        (Contingency(), "no event"),
    ],
)
def test_a_label_is_the_name_or_the_fault_and_what_opens(one, label):
    assert one.label == label


@pytest.mark.parametrize("name", ["a\vb", "a\nb", "\x1b[1m", 7])
def test_a_name_is_one_line_of_text(name):
    """It reaches terminals and workbooks."""
    with pytest.raises(StudyError, match=r"name = .* is not allowed; give one line of text"):
        Contingency("7", 0.1, name=name)


def test_cycles_are_those_of_the_case(two_area):
    from dataclasses import replace

    fifty = replace(two_area, frequency_hz=50.0)
    assert Contingency("7", "6cyc").cleared(fifty) == pytest.approx(1.12)
    assert Contingency("7", "6cyc", at="20cyc").starts(fifty) == pytest.approx(0.4)
    assert Contingency("7", "6cyc", at="20cyc", events="2@30cyc").others(fifty) == (TripMachine(2, 0.6),)
    assert event("7-8@30cyc", 50.0) == Open("7-8", 0.6)


def test_events_after_clearing_have_their_times_as_given(two_area):
    """Only a case has a frequency, by which cycles are seconds."""
    from dataclasses import replace

    one = Contingency("8", "10cyc", "7-8", after=["8-9 @ 6 cyc", "2@0s", Open("8-9#2", "3cyc"), Open("5-6", 0.5)])
    later = "opening of 8-9 {0} later, machine 2, opening of 8-9#2 {1} later, opening of 5-6 0.5 s later"
    given, fifty = (later.format(*times) for times in (("6 cyc", "3cyc"), ("0.12 s", "0.06 s")))
    cleared = "fault 8, cleared after 10cyc by opening 7-8, then "
    assert one.label == f"8 trip 7-8, {given}"
    assert str(one) == repr(one) == cleared + given.replace(", ", ", then ")
    assert one.described(replace(two_area, frequency_hz=50.0)) == cleared + fifty.replace(", ", ", then ")


def test_circuits_open_without_a_fault(two_area):
    assert Contingency(trip="7-8, 8-9").timed(two_area) == (Open("7-8", 1.0), Open("8-9", 1.0))
    assert str(Contingency(trip="7-8")) == "opening 7-8"


def test_another_clearing_time_keeps_the_instant_unless_another_is_given(two_area):
    one = Contingency("7", clear="6cyc", at="2s")
    assert one.with_clear("3cyc").timed(two_area) == (Fault("7", 2.0), Clear("7", 2.05))
    assert one.with_clear("3cyc", at="5s").timed(two_area) == (Fault("7", 5.0), Clear("7", 5.05))


def test_other_events_are_records_or_text(two_area):
    texts = "7-8#2@1s", "2@120cyc", "7:+50MW-10Mvar@1.5s"
    records = Open("7-8#2", 1.0), TripMachine(2, 2.0), LoadStep(7, 1.5, 50.0, -10.0)
    assert Contingency(events=texts).timed(two_area) == records == Contingency(events=records).timed(two_area)
    assert Contingency(events="7-8@1s").timed(two_area) == (Open("7-8", 1.0),)
    assert str(Contingency("7", "6cyc", events=[TripMachine(2, 2.0)])) == (
        "fault 7, cleared after 6cyc, trip of machine 2 at 2 s"
    )


@pytest.mark.parametrize(
    ("kind", "text", "made"),
    [
        (Open, "7-8@1s", Open("7-8", 1.0)),
        (Open, " 7-8#2 @ 30cyc", Open("7-8#2", 0.5)),
        (TripMachine, "14@2s", TripMachine(14, 2.0)),
        (LoadStep, "7:+50MW@1s", LoadStep(7, 1.0, 50.0)),
        (LoadStep, "7:-5e1mw@1s", LoadStep(7, 1.0, -50.0)),
        (LoadStep, "7:+10Mvar@100ms", LoadStep(7, 0.1, 0.0, 10.0)),
    ],
)
def test_text_of_events(kind, text, made):
    assert event(text, 60.0, kind) == event(text, 60.0) == made


@pytest.mark.parametrize(
    "text", ["", "7-8", "7-8@0.4", "7-8@", "@1s", "7@1s@2s", "7:50@1s", "7:MW@1s", "x@1s", "7-8@-1s", "٧-٨@1s", "7:@1s"]
)
def test_texts_that_are_no_event(text):
    with pytest.raises(StudyError, match="write"):
        event(text, 60.0)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Contingency(["7"], 0.1), "is not a fault location"),
        (lambda: Contingency(True, 0.1), "is not a fault location"),
        (lambda: Contingency("7", "6"), "'6' is not a time; write it as 6cyc"),
        (lambda: Contingency("7", -0.1), "clear = -0.1 s is negative"),
        (lambda: Contingency("7", 0.1, at=None), "None is not a time"),
        (lambda: Contingency("7", 0.1, trip=7), "trip = 7 does not name circuits"),
        (lambda: Contingency("7", 0.1, trip=[7]), r"trip = \[7\] does not name circuits"),
        (lambda: Contingency("7", 0.1, impedance="0.1"), "impedance '0.1' is not a finite number"),
        (lambda: Contingency("7", 0.1, impedance=complex(0, float("nan"))), "is not a finite number; give it in pu"),
        (lambda: Contingency("7", 0.1, impedance=float("inf")), "inf is not a finite number"),
        (lambda: Contingency(events=3), "is not a list of events"),
        (lambda: Contingency(events=[3]), "3 is not an event"),
        (lambda: Contingency(events="7-8@0.4"), "is not an event"),
    ],
)
def test_what_is_no_contingency(make, says):
    with pytest.raises(StudyError, match=says) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_a_contingency_is_checked_in_one_place(two_area):
    Contingency("7", "6cyc", "7-8").check(two_area, until=1.2)
    for wrong, until, says in [
        (Contingency("99", "6cyc"), 5, "There is no bus 99"),
        (Contingency("7", "6cyc", "7-99"), 5, "There is no branch 7-99"),
        (Contingency("7"), 5, "The fault at 7 is never cleared"),
        (Contingency("7", "40cyc"), 0.8, "must end after its last event at 1.66667 s"),
        (Contingency("7", 0.0, "7-8", at=0.0), 1e-10, "must end after its last event at 0 s"),
        (Contingency("7", 0.1), float("nan"), "must end after its start"),
    ]:
        with pytest.raises(StudyError, match=says):
            wrong.check(two_area, until)


def test_a_schedule_takes_one_or_many(two_area):
    one, other = Contingency("7", "6cyc"), Open("8-9", 1.5)
    assert timed_events(two_area, None) == ()
    assert (
        timed_events(two_area, other)
        == timed_events(two_area, [other])
        == timed_events(two_area, "8-9@1.5s")
        == (other,)
    )
    assert timed_events(two_area, [one, other]) == (*one.timed(two_area), other)
    for wrong in (3, [3], Contingency, "7"):
        with pytest.raises(StudyError):
            timed_events(two_area, wrong)


def test_what_is_no_criterion():
    assert checked(Criterion(3), 60.0) == Criterion(3.0)
    assert checked(DEFAULT, 60.0) == DEFAULT
    given = checked(Criterion("180deg", "400ms", min_frequency="47.5Hz", max_frequency="1.04pu"), 50.0)
    assert given == (pytest.approx(3.14159265), 0.4, 0.5, 1.5, 0.95, 1.04, 1.0, 0.7, "all")
    for wrong in (
        3.5,
        Criterion,
        Criterion(0),
        Criterion(-1),
        Criterion(float("nan")),
        Criterion("3MW"),
        Criterion([3]),
        Criterion(min_frequency=57),
        Criterion(max_frequency="59Hz"),
        Criterion(min_frequency="57MW"),
        Criterion(coi="swing"),
    ):
        with pytest.raises(StudyError, match=r"criterion|is not an angle|frequency range|is not a number"):
            checked(wrong, 60.0)
