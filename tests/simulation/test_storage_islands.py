"""Islands that grid-forming storage supplies without a machine have a frequency and a synchronism of their own."""

import numpy as np
import pytest

import stabctl as st
from stabctl.model.tables import Storage
from stabctl.simulation.events import Clear, Fault

TRIPS = ["1@1s", "2@1s", "3@1s"]  # all machines of wscc9


def fleet(*droops, mw=(300.0, 150.0), model="regfm", energy=(0.0, 0.0)):
    """wscc9 with a device at bus 4 and another at bus 7."""
    where = zip((1, 2), (4, 7), mw, droops, energy, strict=True)
    rows = [Storage(n, bus, p, energy=E, storage_model=model, converter=f"mp={mp}") for n, bus, p, mp, E in where]
    return st.load("wscc9").with_storage(rows).initialize()


@pytest.mark.parametrize("coi", ["all", "machines"])
@pytest.mark.parametrize("droops", [(0.01, 0.01), (0.01, 0.03)])
def test_the_frequency_of_such_an_island_is_that_of_the_droop_of_its_storage(droops, coi):
    point = fleet(*droops)
    run = point.simulate(TRIPS, "6s", criterion=st.Criterion(coi=coi, max_frequency="60.5Hz"))
    assert run.outcome.kind == "stable"
    assert run.voltage.values[-1].min() > 0.95
    rows = point.system.unweighted.rows
    H = np.array([row.inertia for row in rows])
    assert pytest.approx([0.01 / (2 * mp) * mva / 100 for mp, mva in zip(droops, (300.0, 150.0), strict=True)]) == H
    speed = run.rows[:, [row.frequency for row in rows]]
    P = -run.storage.values[-1] / np.array([300.0, 150.0])
    assert speed[-1] == pytest.approx(1 - np.array(droops) * P, abs=1e-6)
    lowest = 60 * speed[run.time >= 1.0].min()
    assert f"; frequency {lowest:.2f} (storage device ESD 2@7) to 60.00 Hz (machine " in str(run.outcome)


def test_it_is_judged_as_that_of_other_islands():
    narrow = st.Criterion(min_frequency="59.5Hz", frequency_delay_s=0.5)
    ends = [fleet(*droops).simulate(TRIPS, "6s", criterion=narrow).outcome for droops in ((0.01, 0.01), (0.02, 0.02))]
    assert [end.kind for end in ends] == ["stable", "frequency_instability"]
    assert str(ends[1]).startswith("The frequency was outside 59.5 to 62 Hz for 0.5 s at 1.5")
    assert str(ends[1]).endswith(" it is 59.15 Hz.")
    brief = fleet(0.02, 0.02).simulate(TRIPS, "1.4s", criterion=narrow).outcome
    assert "until 1.400 s, outside 59.5 to 62 Hz for 0.39 s at most; frequency " in str(brief)


@pytest.mark.parametrize("seconds", [0.3, 1.5])
def test_so_is_its_synchronism(seconds):
    """In a fault at its bus a device is without load, and runs ahead of the other, which is not."""
    run = fleet(0.01, 0.01 if seconds < 1 else 0.03).simulate(
        [*TRIPS, Fault("4", 2.0), Clear("4", 2.0 + seconds)], "6s"
    )
    assert run.outcome.kind == ("stable" if seconds < 1 else "lost_synchronism")
    assert run.outcome.machine == (None if seconds < 1 else "ESD 2@7")


def test_a_clearing_time_is_that_of_the_storage_that_is_left():
    lost = st.Contingency("7", after=["1@0s", "2@0s", "3@0s"])
    forming, following = (
        st.load("wscc9").with_storage("200MW", storage_model=model).clearing_time(lost, limit="30cyc", longest=0)
        for model in ("regfm", "regc")
    )
    assert forming.cycles > 5
    assert "unstable even if cleared immediately" in str(following)


def test_a_part_of_the_network_that_storage_supplies_is_cut_off_with_it():
    opened = ["7-8@1s", "7-8#2@1s", "1-5@1s", "2-6@1s"]
    case = st.load("two_area").with_storage("1=900MW,2=900MW", storage_model="regfm")
    run = case.simulate(opened, "5s")
    assert "and buses 5, 6, 7 with storage devices ESD 1@5, ESD 2@6." in run.outcome.cut_off
    assert "blacked out" not in str(run.outcome)
    assert " Hz in the island of machine 3, 59.67 Hz in the island of storage device ESD 1@5" in str(run.outcome)
    assert run.voltage.sel(bus=[5, 6, 7]).values[-1].min() > 0.95
    steep = case.with_storage("1=900MW,2=900MW", storage_model="regfm", converter="mp=0.2")
    end = steep.simulate(opened, "5s").outcome
    assert end.kind == "frequency_instability"
    assert str(end).startswith(
        "The frequency of the island of storage devices ESD 1@5, ESD 2@6 was outside 57 to 62 Hz "
    )


def test_a_device_of_zero_size_supplies_nothing():
    run = fleet(0.01, 0.01).resized([0.0, 0.0]).simulate(TRIPS, "2s")
    assert str(run.outcome).startswith("The system is blacked out at 1.000 s: ")
    assert np.abs(run.voltage.values[-1]).max() == 0


@pytest.mark.parametrize("model", ["regfm", "regfm_b1"])
@pytest.mark.parametrize(("mw", "charge", "needs"), [(30, 0, "needs its power"), (-20, 1, "more power than it needs")])
def test_it_is_lost_when_the_store_is_empty_or_full(model, mw, charge, needs):
    """Bus 8 alone: 10 kWh in a store of 20 kWh, and a load or an infeed that it cannot carry for a second more."""
    opened = ["7-8@1s", "7-8#2@1s", "8-9@1s", "8-9#2@1s"]
    case = st.load("two_area").with_storage("1@8=50MW", storage_model=model, energy="20kWh")
    run = case.simulate([f"8:{mw:+}MW@0.5s", *opened], "6s")
    end, share = run.outcome, run.arrays.energy[:, 0] / 0.02
    assert (end.kind, end.bus, end.machine, end.stable) == ("voltage_collapse", 8, None, False)
    assert f"Storage device ESD 1@8 is {('empty', 'full')[charge]} at {end.time_s:.3f} s" in str(end)
    assert needs in str(end)
    assert np.interp(end.time_s, run.time, share) == pytest.approx(charge, abs=0.01)
    assert run.time[-1] == pytest.approx(end.time_s + 0.5, abs=0.02)


@pytest.mark.parametrize("model", ["regfm", "regfm_b1"])
def test_beside_another_device_an_empty_one_is_relieved(model):
    run = fleet(0.01, 0.01, mw=(600.0, 300.0), model=model, energy=(0.0, 0.05)).simulate(TRIPS, "6s")
    assert run.outcome.kind == "stable"
    P, share = run.storage.values[:, 1], run.arrays.energy[:, 1] / 0.05
    assert P.min() < -80
    assert abs(P[run.time > 5].mean()) < 1
    assert -0.1 < share.min() < 0.01
