"""Storage fleets: everywhere, at chosen machines, from text, mappings and rows."""

import pytest

from stabctl import io
from stabctl._util.errors import StabctlError, StudyError
from stabctl.dynamics.operating_point import operating_point
from stabctl.model import fleet, powerflow
from stabctl.model.tables import Storage


@pytest.fixture(scope="module")
def paper():
    return io.load("wnaps_paper")


def test_percent_of_rating_and_of_dispatch(paper):
    flow = powerflow.solve(paper)
    by_rating = fleet.everywhere(paper, "5%mva")
    by_dispatch = fleet.everywhere(paper, "5%dispatch", flow)
    for m, S, a, b in zip(paper.machines, flow.S, by_rating, by_dispatch, strict=True):
        assert (a.machine, a.bus) == (b.machine, b.bus) == (m.machine, m.storage_bus)
        assert a.rating == pytest.approx(0.05 * m.base)
        assert b.rating == pytest.approx(0.05 * S.real * 100)
    assert by_dispatch[13].rating == pytest.approx(0.05 * 1409.5)
    assert by_dispatch[6].rating == pytest.approx(0.05 * 470.876, rel=1e-5)  # the swing machine: what it really makes


def test_chosen_devices(paper):
    first, second = fleet.chosen(paper, "14=50MW, 13@33=10%mva", lag=0.05)
    assert (first.machine, first.bus, first.rating, first.lag) == (14, 33, 50, 0.05)
    assert (second.machine, second.bus, second.rating) == (13, 33, 180)
    assert fleet.chosen(paper, {14: "50MW"}) == fleet.chosen(paper, "14=50MW")


@pytest.mark.parametrize(
    "text", ["14", "14=", "=5MW", "14=5", "99=5MW", "14@999=5MW", "14=-5MW", "14=5MW,,", "14=5MW,14@33=5MW"]
)
def test_what_is_no_device_is_refused(paper, text):
    with pytest.raises(StudyError):
        fleet.chosen(paper, text)


def test_a_case_takes_every_way_to_ask_for_storage(paper):
    rows = fleet.chosen(paper, "14=50MW,13@33=20MW", lag=0.05)
    for sizes in ("14=50MW, 13@33=20MW", {14: "50MW", "13@33": 20}, {"14": 50.0, "13@33": "20000kW"}):
        assert paper.with_storage(sizes, lag="50ms").storage == rows
    assert paper.with_storage(rows).storage == paper.with_storage(list(rows)).storage == rows
    assert paper.with_storage(rows[0]).storage == rows[:1]
    assert paper.with_storage("50MW").storage == paper.with_storage(50).storage == fleet.everywhere(paper, "0.05GW")
    assert paper.with_storage("50MW").with_storage("none").storage == paper.with_storage(()).storage == ()


@pytest.mark.parametrize("none", ["none", [], {}, ()])
def test_a_point_takes_no_storage_in_every_way_that_a_case_does(paper, none):
    point = paper.with_storage("50MW").initialize()
    assert point.case.with_storage(none).storage == ()
    assert operating_point(point, none).case.storage == ()
    assert operating_point(point).case.storage == point.case.storage


def test_options_are_columns_of_every_device(paper):
    (device,) = paper.with_storage(
        {14: "50MW"}, characteristic="current", energy="500kWh", charge="20%", ramp="600MW/min", efficiency=0.9
    ).storage
    assert device == Storage(14, 33, 50.0, "current", 0.5, 0.2, 10.0, 0.0, 0.9)


@pytest.mark.parametrize(
    ("sizes", "options", "says"),
    [
        ("50MW", {"energi": 5}, r"A storage device has no option 'energi'; did you mean energy\?"),
        ("50MW", {"rating": 5}, "has no option 'rating'"),
        ("50MW", {"lag": "5MW"}, "'5MW' is not a time"),
        ("50MW", {"lag": -1}, "must be a number of at least 0"),
        ("50MW", {"characteristic": "heat"}, "must be one of power, current, conductance"),
        ("50", {}, "is not a storage size; write it as 50MW"),
        ([50], {}, "is not a fleet of storage devices; give '50MW' at every machine"),
        (None, {}, "None is not a fleet of storage devices"),
        ({"x": "5MW"}, {}, "'x' does not describe a storage device"),
        ("14@999=5MW", {}, "wnaps_paper has no bus 999"),
        ("99=5MW", {}, "There is no machine 99 in wnaps_paper"),
    ],
)
def test_what_is_no_fleet_is_told_in_one_sentence(paper, sizes, options, says):
    with pytest.raises(StabctlError, match=says):
        paper.with_storage(sizes, **options)


@pytest.mark.parametrize(
    ("ends", "mva", "beyond"),
    [
        (("100%", "10000%"), (50, 5000), ("99.9%", "10001%")),
        (("0.1pu", "1pu"), (50 / (0.1 * 1.11), 50), ("0.099pu", "1.001pu")),  # a current of 1.11 pu at that voltage
    ],
)
def test_a_converter_may_be_as_small_or_large_as_is_said(paper, ends, mva, beyond):
    found = [paper.with_storage("14=50MW", mva=end, storage_model="regc").storage[0].mva for end in ends]
    assert found == pytest.approx(mva)
    for wrong in beyond:
        with pytest.raises(StudyError, match=r"a voltage from 0\.1pu to 1pu, or 60MVA"):
            paper.with_storage("14=50MW", mva=wrong, storage_model="regc")
