"""Quantities as text: every unit of a kind means the same, numbers are SI, and nothing else passes."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stabctl._util import units
from stabctl._util.errors import StudyError


@pytest.mark.parametrize(
    ("read", "text", "value"),
    [
        (units.hertz, "0.5Hz", 0.5),
        (units.hertz, "100mHz", 0.1),
        (units.hertz, "100 mhz", 0.1),
        (units.megawatts, "50MW", 50.0),
        (units.megawatts, "0.2GW", 200.0),
        (units.megawatts, "300kW", 0.3),
        (units.megawatts, "-1e2 mw", -100.0),
        (units.megavars, "20Mvar", 20.0),
        (units.megavars, "20MVAr", 20.0),
        (units.megavars, "300kvar", 0.3),
        (units.megawatt_hours, "10MWh", 10.0),
        (units.megawatt_hours, "500kWh", 0.5),
        (units.radians, "180deg", math.pi),
        (units.radians, "3.5rad", 3.5),
        (units.radians, "-500mrad", -0.5),
    ],
)
def test_text_with_a_unit(read, text, value):
    assert read(text) == value
    assert read(value) == value


PER = {  # of each unit, what one of the first of its kind is
    "s": {"s": 1, "ms": 1000, "us": 1000000, "min": 1 / 60, "h": 1 / 3600},
    "Hz": {"Hz": 1, "mHz": 1000},
    "MW": {"MW": 1, "kW": 1000, "GW": 0.001},
    "Mvar": {"Mvar": 1, "MVAr": 1, "MVAR": 1, "kvar": 1000, "Gvar": 0.001},
    "MVA": {"MVA": 1, "kVA": 1000, "GVA": 0.001},
    "MWh": {"MWh": 1, "kWh": 1000, "GWh": 0.001},
    "MW/s": {"MW/s": 1, "kW/s": 1000, "MW/min": 60, "GW/s": 0.001},
    "kV": {"kV": 1, "V": 1000},
    "rad": {"rad": 1, "mrad": 1000, "deg": 57.29577951308232},
    "Hz/s": {"Hz/s": 1, "mHz/s": 1000},
    "-": {"-": 1, "%": 100},
}


def test_every_unit_is_what_its_prefix_says():
    assert {next(iter(kind.per)): dict(kind.per) for kind in units.KINDS} == {
        first: {unit: pytest.approx(per) for unit, per in table.items()} for first, table in PER.items()
    }
    assert len(units.KINDS) == len(PER)


@pytest.mark.parametrize(
    ("text", "value"), [("6cyc", 0.1), ("0.1s", 0.1), ("100ms", 0.1), ("6CYC", 0.1), ("1e-1 s", 0.1), (0.1, 0.1)]
)
def test_times(text, value):
    assert units.seconds(text, 60) == value
    assert units.seconds("5cyc", 50) == 0.1


@given(st.integers(0, 100_000), st.sampled_from([50.0, 60.0, 16.7]))
def test_cycles_are_exact(eighths, frequency):
    assert units.cycles(f"{eighths / 8!r}cyc", frequency) == eighths / 8
    assert units.cycles(eighths / 8 / 60, 60.0) == pytest.approx(eighths / 8, rel=1e-15)


@given(st.floats(-1e9, 1e9), st.sampled_from(units.KINDS), st.data())
def test_to_another_unit_and_back(x, kind, data):
    a, b = (data.draw(st.sampled_from([u for u in kind.per if u != "-"])) for _ in "ab")
    assert units.quantity(f"{units.quantity(f'{x!r}{a}', b)!r}{b}", a) == pytest.approx(x, rel=1e-15, abs=1e-300)


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("10", "pu", 10.0),
        ("0.1pu", "pu", 0.1),
        ("5%", "-", 0.05),
        ("0.05", "-", 0.05),
        ("100ms", "s", 0.1),
        ("0.1s", "ms", 100.0),
        ("90deg", "deg", 90.0),
        ("12", "pu s", 12.0),
        ("60MW/min", "MW/s", 1.0),
        (7, "s", 7.0),
    ],
)
def test_quantity_in_the_unit_of_a_column(text, unit, value):
    assert units.quantity(text, unit) == value


def test_ratings_keep_what_they_are_a_share_of():
    assert units.rating("5%MVA") == (5, "%mva")
    assert units.rating("5 %dispatch") == (5, "%dispatch")
    assert units.rating("2.5 mw") == units.rating("2500kW") == units.rating(2.5) == (2.5, "MW")


def test_bands():
    assert units.band("0.1..2Hz") == units.band("100mHz..2Hz") == units.band((0.1, "2Hz")) == (0.1, 2.0)
    assert units.band("100..2000mHz") == (0.1, 2.0)
    assert units.band(" 0 .. 1 Hz") == (0.0, 1.0)


@pytest.mark.parametrize(
    "text",
    ["", "6", "cyc", "1e999s", "-1s", "nan", "inf s", "6 cycl", "1.2.3s", "6%mva", "٣s", "1_0s", None, True, 1j, "6s6s"]
    + [math.nan, math.inf, 10**400, "9" * 5000, b"6s", [6]],
)
def test_what_is_no_time_is_refused_in_one_sentence(text):
    with pytest.raises(StudyError, match=r"^.{1,70} is not a time; write it as 6cyc, 0.1s or 100ms\.$"):
        units.seconds(text, 60)


@pytest.mark.parametrize(
    ("read", "text", "noun"),
    [
        (units.hertz, "0.5", "a frequency"),
        (units.hertz, "2MHz", "a frequency"),
        (units.megawatts, "50mW", "a power"),
        (units.megawatts, "5%mva", "a power"),
        (units.megawatt_hours, "10MW", "an energy"),
        (units.radians, "120", "an angle"),
        (units.rating, "5%", "a storage size"),
        (units.rating, "-5MW", "a storage size"),
        (units.rating, "5", "a storage size"),
        (units.band, "2Hz", "a band of frequencies"),
        (units.band, "1..2..3Hz", "a band of frequencies"),
        (units.band, 2.0, "a band of frequencies"),
    ],
)
def test_another_kind_of_quantity_is_refused(read, text, noun):
    with pytest.raises(StudyError, match=rf"^.* is not {noun}; write it as .*\.$"):
        read(text)


def test_a_band_rises():
    for text in ("2..1Hz", "1..1Hz", "-1..1Hz"):
        with pytest.raises(StudyError, match="the lower frequency first"):
            units.band(text)


def test_another_unit_than_that_of_the_column_is_refused():
    with pytest.raises(StudyError, match=r"^'5s' is not a power; write it as 50MW, 0.2GW or 300kW\.$"):
        units.quantity("5s", "MW")
