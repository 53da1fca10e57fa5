"""Loss of synchronism of storage: of its phase-locked loop, and of its virtual angle."""

import numpy as np
import pytest
from systems import KINDS, small

import stabctl as st
from stabctl.model.tables import Storage
from stabctl.simulation.events import Clear, Fault, Open
from stabctl.simulation.setup import setup
from stabctl.simulation.simulation import Simulation

LOSS = "2:+600MW@0.1s"  # falls by 0.9 Hz/s


def with_esd(model, converter="", mw=40.0, p=300.0):
    case = small(KINDS["sexs, pss, steam"], p=p)
    return case.with_storage([Storage(1, 2, mw, storage_model=model, converter=converter)])


def fell(converter, mw=40.0, criterion=None):
    point = st.initialize(with_esd("regc_c", f"Te=0 {converter}", mw))
    return point.simulate(LOSS, "3s", criterion=criterion or st.Criterion(frequency_delay_s=0))


def test_a_loop_whose_frequency_is_limited_slips_and_the_limit_is_said():
    found = fell("wmin=-0.5").outcome
    assert (found.kind, found.machine, found.stable) == ("lost_synchronism", "ESD 1@2", False)
    assert str(found).startswith("Storage device ESD 1@2 lost synchronism at ")
    assert str(found).endswith(
        "s: the angle of its phase-locked loop moved 201 degrees relative to the center of inertia, "
        "its frequency at a limit of its range from 59.92 to 61.91 Hz."  # 60 - 0.5/(2 pi)
    )


def test_a_loop_with_room_follows_the_frequency():
    run = fell("wmin=-12")
    assert run.outcome.stable
    assert run.speed.min() < 1 - 1.5 / 60


def test_the_angle_of_the_verdict_is_measured_from_the_center_of_inertia():
    """At its limit the loop turns back by 0.5 rad/s, while the center of inertia turns back faster."""
    run = fell("wmin=-0.5")
    (row,) = run.point.system.unweighted.rows
    angle = run.rows[:, row.place] - run.rows[0, row.place]
    limited = (run.time > 0.6) & (run.time < 1.0)
    assert np.diff(angle[limited]) == pytest.approx(-0.5 / 120, rel=1e-9)
    moved, H = run.arrays.angle - run.arrays.angle[0], run.point.inertia
    away = np.abs(angle - moved @ H / H.sum())
    assert away[-1] > 3.5 > away[:-1].max()


def test_a_device_of_zero_size_is_not_judged():
    sized = st.initialize(with_esd("regc_c", "Te=0 wmin=-0.5")).resized([0.0])
    assert sized.simulate(LOSS, "3s", criterion=st.Criterion(frequency_delay_s=0)).outcome.stable


def held(seconds, order, **options):
    """A grid-forming device that gets an order through a fault at its own bus."""
    point = st.initialize(with_esd("regfm", p=0.0, **options))
    sim = Simulation(setup(point), [Fault("2", 0.2), Clear("2", 0.2 + seconds)])
    sim.advance(0.1)
    sim.orders[:] = order
    sim.advance(4.0)
    return sim.finish()


def test_a_virtual_angle_that_runs_ahead_in_a_long_fault_has_lost_synchronism():
    """Without voltage it turns by mp wb Pref, 3.8 rad/s."""
    found = held(1.2, -1.0).outcome
    assert (found.kind, found.machine) == ("lost_synchronism", "ESD 1@2")
    assert ": its virtual angle moved 201 degrees relative to the center of inertia." in str(found)
    assert 0.2 + 3.5 / 3.77 - 0.2 < found.time_s < 0.2 + 3.5 / 3.77 + 0.2  # 1.09 s
    for seconds, order in ((0.3, -1.0), (1.2, 0.0)):
        assert held(seconds, order).outcome.stable


def test_a_device_that_holds_an_island_alone_is_its_own_center():
    case = with_esd("regfm", mw=300.0, p=0.0)
    lines = [Open("2-3", 0.2), Open("2-3#2", 0.2), Open("1-2", 0.2)]
    run = Simulation(setup(st.initialize(case)), lines)
    run.advance(3.0)
    assert "lost synchronism" not in str(run.finish().outcome)


def test_clearing_times_name_the_device():
    """A law that acts without voltage turns the angle back by 3.8 rad/s while the fault is on."""
    point = st.initialize(with_esd("regfm", p=20.0))
    law = st.BangBang(deadband=0.001, min_voltage=0)
    found = point.clearing_time(st.Contingency("2"), control=law, limit="120cyc", longest=0, scan="0cyc")
    assert found.machine == "ESD 1@2"
    assert 3.5 / 3.77 < found.seconds < 3.5 / 3.77 + 0.25  # 1.125; the order begins beyond the deadband
    assert "; storage device ESD 1@2 loses synchronism first" in str(found)
