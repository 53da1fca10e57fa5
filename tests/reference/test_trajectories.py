"""Every signal of every machine against the runs of an independent simulator (Heun, 1/480 s).

What is left, beside the interpolation between rows of 1 ms (about 1e-7 pu in speed):
- With exact switching instants: the reference switches half a step (1/960 s) early, both on and off; that moves every
  angle by some 1e-3 rad and every speed by an acceleration times 1/960 s.
- With its own convention: Heun's error at 1/480 s in the fast exciters (Efd), seen a little in the voltages. `two_area`
  has ten times the exciter gain per second and a stabilizer at its limit, hence the larger rest.
- `two_area` with the opened line's charging left as the reference leaves it; without that, 1e-3 pu in speed.
- Its jump of the loads below 0.5 pu takes no part here: bus 9 stays above 0.60 pu during the fault, bus 7 is at 0.
"""

import numpy as np
import pytest
from comparison import EARLY, differences, recorded, simulated

from stabctl.controllers import BangBang
from stabctl.dynamics import operating_point
from stabctl.model.tables import Storage
from stabctl.simulation.events import Clear, Fault, Open, SwitchShunt

CYCLE = 1 / 60


def assert_within(found, measured):
    """No signal differs by more than 1.5 times the measured value written here."""
    assert not {k: f"{v:.2e} > 1.5 * {measured[k]:.1e}" for k, v in found.items() if not v < 1.5 * measured[k]}


def wnaps_events(cycles, early):
    off = 1 + cycles * CYCLE - early
    return [Fault("83", 1 - early), Clear("83", off), Open("83-33", off)]


def two_area_events(cycles, early):
    """The charging of the opened line stays: half of it at bus 7, twice its half at bus 8."""
    off = 1 + cycles * CYCLE - early
    left = [SwitchShunt(7, off, b=9.625), SwitchShunt(8, off, b=19.25)]
    return [Fault("7", 1 - early), Clear("7", off), Open("7-8", off), *left]


# case, run, cycles, compared until (s), switchings early by (s), measured differences
RUNS = [
    ("wnaps", "stable_4_cycles", 4, 9.9, 0.0,
     {"speed": 4.6e-5, "angle": 2.3e-3, "terminal": 1.7e-3, "hv": 1.4e-3, "Efd": 4.3e-2, "Pm": 1.2e-4, "Pe": 2.6e-2}),
    ("wnaps", "stable_4_cycles", 4, 9.9, EARLY,
     {"speed": 7.6e-7, "angle": 8.6e-5, "terminal": 1.4e-5, "hv": 1.4e-5, "Efd": 2.9e-3, "Pm": 4.1e-6, "Pe": 9.1e-4}),
    ("wnaps", "unstable_6_cycles", 6, 2.0, 0.0,
     {"speed": 4.6e-5, "angle": 2.1e-3, "terminal": 1.7e-3, "hv": 1.4e-3, "Efd": 4.1e-2, "Pm": 1.6e-4, "Pe": 3.4e-2}),
    ("wnaps", "unstable_6_cycles", 6, 2.25, EARLY,
     {"speed": 1.0e-6, "angle": 7.8e-5, "terminal": 9.7e-5, "hv": 9.6e-5, "Efd": 1.5e-2, "Pm": 4.0e-6, "Pe": 2.0e-3}),
    ("two_area", "stable_8_cycles", 8, 9.9, 0.0,
     {"speed": 6.2e-5, "angle": 3.1e-3, "terminal": 2.1e-3, "hv": 2.0e-3, "Efd": 6.8e-2, "Pm": 7.7e-5, "Pe": 2.2e-2}),
    ("two_area", "stable_8_cycles", 8, 9.9, EARLY,
     {"speed": 6.4e-6, "angle": 2.1e-3, "terminal": 1.3e-4, "hv": 1.2e-4, "Efd": 2.2e-2, "Pm": 3.6e-5, "Pe": 2.8e-3}),
    ("two_area", "unstable_10_cycles", 10, 2.5, 0.0,
     {"speed": 6.2e-5, "angle": 3.9e-3, "terminal": 2.0e-3, "hv": 1.9e-3, "Efd": 8.6e-2, "Pm": 9.2e-5, "Pe": 2.1e-2}),
    ("two_area", "unstable_10_cycles", 10, 2.5, EARLY,
     {"speed": 1.7e-5, "angle": 3.0e-3, "terminal": 2.1e-4, "hv": 3.9e-4, "Efd": 3.7e-2, "Pm": 5.7e-5, "Pe": 9.0e-3}),
]  # fmt: skip


@pytest.mark.parametrize(("case", "name", "cycles", "until", "early", "measured"), RUNS)
def test_every_signal_of_every_machine(points, case, name, cycles, until, early, measured):
    events = (wnaps_events if case == "wnaps" else two_area_events)(cycles, early)
    run = simulated(points(case), events, until + 0.02)
    assert_within(differences(run, recorded(case, name), (1, 1 + cycles * CYCLE), until), measured)


def test_what_the_charging_of_the_opened_line_amounts_to(points):
    """Left away with the line, as it should be, it moves the speeds by 1e-3 pu over ten seconds."""
    plain = [e for e in two_area_events(8, EARLY) if not isinstance(e, SwitchShunt)]
    run = simulated(points("two_area"), plain, 9.92)
    found = differences(run, recorded("two_area", "stable_8_cycles"), (1, 1 + 8 * CYCLE), 9.9)
    assert 5e-4 < found["speed"] < 2e-3  # 9.8e-4


def test_loads_are_on_the_same_side_of_their_threshold_in_both_programs(points):
    run = simulated(points("two_area"), two_area_events(10, 0.0), 1.2)
    fault = (run.time >= 1) & (run.time < 1 + 10 * CYCLE)
    size = {bus: np.abs(run.arrays.V[fault, points("two_area").net.place[bus]]) for bus in (7, 9)}
    assert size[9].min() > 0.6  # 0.604
    assert size[7].max() < 1e-5


@pytest.fixture(scope="module")
def controlled(cases):
    """Our run of `TestStorage`."""
    case = cases("two_area")
    point = operating_point.solve(case.with_storage(Storage(m.machine, m.storage_bus, 50.0) for m in case.machines))
    return simulated(point, two_area_events(10, EARLY), 9.92, control=BangBang())


class TestStorage:
    """Bang-bang, 50 MW constant power at every high-voltage bus, ten cycles."""

    DATA = recorded("two_area", "storage_50mw_10_cycles")

    @pytest.fixture
    def both(self, controlled):
        """Their instants, their powers and ours (MW)."""
        t, theirs = self.DATA["t"], 100 * self.DATA["storage"]
        return t, theirs, controlled.arrays.storage[np.searchsorted(controlled.time, t + 1e-9) - 1]

    def test_orders_come_in_the_same_sequence_at_the_same_time(self, both):
        t, theirs, ours = both
        for a, b in zip(theirs.T, ours.T, strict=True):
            assert np.array_equal(*(np.sign(x[np.flatnonzero(np.diff(np.round(x), prepend=1))]) for x in (a, b)))
            switched = [t[np.flatnonzero(np.diff(np.round(x)))] for x in (a, b)]
            assert np.abs(switched[0] - switched[1]).max() < 0.0125  # 0.0083 s, a row of the reference

    def test_energies_agree(self, both):
        t, theirs, ours = both
        a, b = (np.trapezoid(x, t, axis=0) for x in (theirs, ours))
        assert np.abs(a - b).max() < 0.6  # 0.42 MW s, a row of the reference

    def test_every_signal_of_every_machine(self, controlled, both):
        """Orders given up to two rows apart move everything else; rows with different orders are left out."""
        _, theirs, ours = both
        apart = np.abs(theirs - ours).max(axis=1) > 1
        same = ~np.convolve(apart, np.ones(5), "same").astype(bool)
        assert same.mean() > 0.98  # 0.992
        found = differences(controlled, self.DATA, (1, 1 + 10 * CYCLE), 9.9, same)
        assert_within(
            found,
            {
                "speed": 2.3e-5,
                "angle": 7.7e-3,
                "terminal": 9.2e-4,
                "hv": 6.8e-4,
                "Efd": 5.1e-2,
                "Pm": 1.3e-4,
                "Pe": 0.13,
            },
        )
