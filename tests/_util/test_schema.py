"""Fields of records, what may stand in them, and what is said of what may not."""

from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple

import numpy as np
import pytest
from annotated_types import Interval, Lt

from stabctl._util.errors import StudyError
from stabctl._util.schema import FROM_CASE, NOT_NEGATIVE, POSITIVE, fields
from stabctl._util.validation import Invalid, checked, fault, guard


class Row(NamedTuple):
    number: Annotated[int, "-", "its number", POSITIVE]
    gain: Annotated[float, "pu", "a gain"]
    lag: Annotated[float, "s", "a lag", NOT_NEGATIVE] = 0.1
    share: Annotated[float, "-", "a share", Interval(ge=0, lt=1)] = 0.0
    kind: Annotated[Literal["a", "b"], "-", "its kind"] = "a"
    name: Annotated[str, "-", "its name"] = ""
    base: Annotated[float, "MVA", "system base", FROM_CASE] = 0.0


ROW = Row(1, 2.0)


def test_a_field_is_read_from_its_line():
    f = fields(Row)["lag"]
    assert (f.name, f.column, f.unit, f.meaning, f.default, f.kind) == ("lag", "lag_s", "s", "a lag", 0.1, float)
    assert fields(Row)["gain"].required
    assert "base" not in fields(Row)
    assert [f.expected() for f in fields(Row).values()] == [
        "a whole number above 0",
        "a number",
        "a number of at least 0",
        "a number of at least 0 and below 1",
        "one of a, b",
        "text",
    ]


def test_whole_numbers_and_numpy_numbers_become_floats():
    (row,) = checked(Row, [ROW._replace(gain=3, lag=np.float64(1.0))])
    assert (row, type(row)) == (ROW._replace(gain=3.0, lag=1.0), Row)
    assert type(row.gain) is type(row.lag) is float


@pytest.mark.parametrize(
    ("change", "wanted"),
    [
        ({"number": 0}, "a whole number above 0"),
        ({"number": 1.0}, "a whole number above 0"),
        ({"number": True}, "a whole number above 0"),
        ({"number": 10**400}, "a whole number above 0, and at most 1e+12 in size"),
        ({"gain": True}, "a number"),
        ({"gain": "2"}, "a number"),
        ({"gain": None}, "a number"),
        ({"gain": float("nan")}, "a finite number"),
        ({"gain": float("-inf")}, "a finite number"),
        ({"gain": -1e13}, "a number, and at most 1e+12 in size"),
        ({"gain": 10**400}, "a number, and at most 1e+12 in size"),
        ({"lag": -1e-300}, "a number of at least 0"),
        ({"lag": float("inf")}, "a finite number of at least 0"),
        ({"share": 1.0}, "a number of at least 0 and below 1"),
        ({"kind": "c"}, "one of a, b"),
        ({"kind": []}, "one of a, b"),
        ({"name": "two\nlines"}, "one line of text"),
        ({"name": "\ud800"}, "one line of text"),
        ({"name": 3}, "one line of text"),
    ],
)
def test_what_is_not_allowed_is_found_with_its_place(change, wanted):
    ((name, value),) = change.items()
    with pytest.raises(Invalid) as caught:
        checked(Row, [ROW, ROW, ROW._replace(**change)])
    assert (caught.value.row, caught.value.field.name, caught.value.expected) == (2, name, wanted)
    assert caught.value.value is value or caught.value.value == value
    assert fault(fields(Row)[name], value) == wanted


def test_what_is_filled_from_the_case_is_not_checked():
    assert checked(Row, [ROW._replace(base=None)])[0].base is None


@dataclass(frozen=True)
class Law:
    deadband: Annotated[float, "Hz", "speed deviation without action", NOT_NEGATIVE] = 0.1
    steps: Annotated[int | None, "-", "number of steps", POSITIVE] = None
    power: Annotated[float | None, "pu", "largest power", Lt(2)] = None
    note: str = ""

    def __post_init__(self):
        guard(self)


def test_a_dataclass_is_guarded_and_reads_text_with_a_unit():
    assert Law().deadband == 0.1
    assert Law("100mHz").deadband == Law("0.1 Hz").deadband == Law(0.1).deadband
    assert Law(np.float64(0.2), steps=3, power=1).steps == 3


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"deadband": -0.1}, "deadband = -0.1 Hz (speed deviation without action) must be a number of at least 0."),
        (
            {"deadband": "-1mHz"},
            "deadband = -0.001 Hz (speed deviation without action) must be a number of at least 0.",
        ),
        ({"deadband": "wide"}, "deadband: 'wide' is not a frequency; write it as 0.5Hz or 100mHz."),
        ({"deadband": "1MW"}, "deadband: '1MW' is not a frequency; write it as 0.5Hz or 100mHz."),
        ({"deadband": "0.1"}, "deadband: '0.1' is not a frequency; write it as 0.5Hz or 100mHz."),
        ({"deadband": True}, "deadband = True Hz (speed deviation without action) must be a number of at least 0."),
        ({"steps": 0}, "steps = 0 (number of steps) must be a whole number above 0."),
        ({"steps": 1.5}, "steps = 1.5 (number of steps) must be a whole number above 0."),
        ({"power": "1"}, "power = '1' (largest power) must be a number below 2."),
        ({"power": float("inf")}, "power = inf pu (largest power) must be a finite number below 2."),
    ],
)
def test_a_guard_names_field_value_and_what_is_allowed(given, says):
    with pytest.raises(StudyError) as caught:
        Law(**given)
    assert str(caught.value) == says
