"""Storage fleets and the quantities planners write."""

import pytest

from stabctl import io
from stabctl.errors import StudyError
from stabctl.model import fleet, powerflow
from stabctl.units import seconds, size


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


@pytest.mark.parametrize(
    ("text", "value"), [("6cyc", 0.1), ("0.1s", 0.1), ("100ms", 0.1), ("6CYC", 0.1), ("1e-1 s", 0.1)]
)
def test_times(text, value):
    assert seconds(text, 60) == pytest.approx(value)
    assert seconds("5cyc", 50) == pytest.approx(0.1)


@pytest.mark.parametrize("text", ["", "6", "cyc", "1e999s", "-1s", "nan", "inf s", "6 cycl", "1.2.3s", "6%mva"])
def test_what_is_no_time_is_refused(text):
    with pytest.raises(StudyError, match="not a time"):
        seconds(text, 60)


def test_sizes():
    assert size("5%MVA") == (5, "%mva")
    assert size("2.5 mw") == (2.5, "mw")
    with pytest.raises(StudyError, match="not a storage size"):
        size("5%")
