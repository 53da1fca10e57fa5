"""The optimal schedule: on two machines it is that of equal areas, elsewhere better than the law that it starts from.

A device at the smaller machine absorbs its full rating from clearing on, whatever the fault: no control makes the
machine stop earlier. With it the mechanical power is Pm - (M/M1) Pc, and the longest fault is that of equal areas up to
the unstable equilibrium with this power.
"""

import json
from dataclasses import replace

import numpy as np
import pytest
from records import gencls
from scipy.optimize import brentq

from stabctl._util.errors import StudyError
from stabctl.clearing.trial import Search, Trial
from stabctl.controllers import BangBang
from stabctl.design import _schedule_search, optimum
from stabctl.design._excursion import Plan, Scheduled, window
from stabctl.design._schedule_search import Bounds, ScheduleSearch
from stabctl.model.case import Case
from stabctl.model.network import BOLTED
from stabctl.model.tables import Branch, Bus, Machine, Storage
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.simulate import simulate
from stabctl.theory.minimum_time import by_shooting, stop_angle
from stabctl.theory.two_machine import Equivalent
from stabctl.view.pages.run_pages import optimum as optimum_page

BASE, LARGE, PC = 0.1, 10.0, 0.3  # MVA, inertia of machine 2 over that of machine 1, rating of the device in pu
EQ = Equivalent(4.0, 4.0 * LARGE, X=0.5, Pm1=0.8, base=BASE)
FAULT = Contingency("1", impedance=1.1j * BASE / BOLTED)  # takes no power
LATE = BangBang(deadband=2.0, min_voltage=0.0)  # starts from a law that is hardly better than none
OPTIONS = {"law": LATE, "window": "0.5s", "rate": 30, "observe": "1.2s", "longest": 0, "step": 1 / 120}


def _case(own=3e-3):
    x = own * EQ.X
    rows = {
        1: gencls.Par(mva=0, wb=0, H=4.0, D=0.0, ra=0.0, x1d=x),
        2: gencls.Par(mva=0, wb=0, H=4.0, D=0.0, ra=0.0, x1d=LARGE * x),
    }
    machines = Machine(1, 1, BASE, 0.8 * BASE, 1), Machine(2, 2, BASE * LARGE, 0.0, 2)
    buses, line = (Bus(1, "pv", 1.0), Bus(2, "swing", 1.0)), Branch(1, 2, 0.0, EQ.X * (1 - 2 * own))
    case = Case("two_machines", buses, (line,), machines, {"gencls": rows}, (), base_mva=BASE, frequency_hz=60.0)
    return case.with_storage({1: PC * BASE})


def _longest_fault():
    """Equal areas with the device absorbing from clearing on, cycles."""
    m, b = EQ.omib, EQ.omib.Pmax
    left = m.Pm - EQ.share * PC
    end = np.pi - np.arcsin(left / b)
    at = brentq(lambda d: m.Pm * (d - m.start) - b * (np.cos(d) - np.cos(end)) + left * (end - d), m.start, end - 0.1)
    return 60 * float(np.sqrt(2 * m.M * (at - m.start) / m.Pm))


def _stop(found):
    """When (s after clearing) the relative speed is first zero, and the relative angle there (rad)."""
    a, t = found.run.arrays, found.run.time - found.cleared
    w, d = a.speed[:, 0] - a.speed[:, 1], a.angle[:, 0] - a.angle[:, 1]
    i = np.flatnonzero((t > 1e-9) & (w <= 0))[0]
    return t[i - 1] + (t[i] - t[i - 1]) * w[i - 1] / (w[i - 1] - w[i]), d.max()


@pytest.fixture(scope="module")
def longest():
    return optimum(_case(), FAULT, resolution="0.02cyc", limit="20cyc", **OPTIONS)


@pytest.mark.slow
def test_on_two_machines_it_is_the_schedule_of_equal_areas(longest):
    assert longest.proof.stable
    assert longest.ended == "converged"
    assert longest.cycles == pytest.approx(_longest_fault(), rel=1e-3)  # -7.8e-4, of a grid of 1.3e-3
    assert longest.start.cycles < 0.97 * longest.cycles
    until = round(_stop(longest)[0] * longest.schedule.rate)
    assert np.all(longest.schedule.orders[longest.before :][: until + 1] > 0.99)
    assert "a local optimum" in str(longest).lower()
    assert "power ratings" in longest.binding[0]


@pytest.mark.slow
def test_on_two_machines_it_stops_the_machine_as_early_as_the_minimum_time_control():
    found = optimum(_case(1e-3), FAULT, resolution="0.25cyc", limit="14.5cyc", **OPTIONS | {"step": 1 / 240})
    problem = EQ.minimum_time_problem(found.cycles, -PC, PC)
    seconds, angle = _stop(found)
    assert (found.ended, found.cycles) == ("limit", 14.5)
    assert seconds == pytest.approx(by_shooting(problem).duration, rel=1e-3)  # -8.7e-4
    assert angle == pytest.approx(stop_angle(problem), rel=1e-3)  # -2.5e-4


def test_what_the_record_shows_is_what_was_played(longest):
    frame, seen = longest.df, longest.run.time - longest.cleared
    assert list(frame) == ["time_s", "absorbed_mw:1@1"]
    assert frame["absorbed_mw:1@1"].to_numpy() == pytest.approx(PC * BASE * longest.schedule.orders[:, 0])
    k = np.floor((seen - frame["time_s"][0]) * longest.schedule.rate + 1e-6).astype(int)
    inside = (k >= 0) & (k < len(frame))
    assert np.array_equal(longest.run.arrays.order[inside], longest.schedule.orders[k[inside]])
    assert longest.run.outcome.stable
    assert [one.cycles for one in longest.iterations] == sorted(one.cycles for one in longest.iterations)
    again = simulate(longest.run.point, longest.fault, 1.4, control=longest.schedule, step=1 / 120)
    rows = int(np.searchsorted(again.time, 1.3))
    assert np.array_equal(again.arrays.angle[:rows], longest.run.arrays.angle[:rows])


@pytest.mark.parametrize("at", [0.8, 1.2])
def test_the_fault_that_repeats_the_run_has_the_other_events_too(cases, at):
    """Before the fault and after it; the events after clearing keep their time from there."""
    base = cases("two_area").initialize(storage="50MW")
    fault = Contingency("7-8@0.4", events=f"7:+20MW@{at}s", after="9:+20MW@0.2s")
    options = {"window": "0.2s", "rate": 20, "observe": "1s", "longest": 0, "resolution": "1cyc"}
    found = optimum(base, fault, iterations=1, **options)
    again = base.simulate(found.fault, float(found.run.time[-1]), control=found.schedule)
    assert again.time == pytest.approx(found.run.time, abs=1e-9)
    assert again.arrays.angle == pytest.approx(found.run.arrays.angle, abs=1e-9)


def test_orders_that_are_worse_are_not_kept(monkeypatch):
    """Although the fault is survived with them, at every size of the trust region."""
    trial = Trial(_case().initialize(), FAULT, LATE, Search(1.0, observed_s=1.2, step=1 / 120))
    free = np.full(1, np.inf)
    search = ScheduleSearch(Scheduled(trial, LATE, 30, 0.5), Bounds(np.full(1, PC * BASE), -free, free), None)
    search.begin(5)
    kept = search.plan, search.run, search.window
    worse = replace(search.plan, orders=np.full_like(search.plan.orders, -0.5))
    run = search.scheduled.run(worse)
    assert run.outcome.stable
    assert window(search.scheduled, worse, run).excursion > search.excursion
    monkeypatch.setattr(_schedule_search, "improved", lambda *_: (worse.orders, 1.0, "optimal"))
    assert search._improve() == (0.0, "optimal")
    assert all(now is before for now, before in zip((search.plan, search.run, search.window), kept, strict=True))


@pytest.mark.parametrize("k", [0, 3, 40])
def test_other_events_keep_their_time_from_the_fault(cases, k):
    """Also one before it; the fault comes no earlier than that allows, and a frame begins at clearing."""
    point = cases("wscc9").initialize(storage="20MW")
    fault = Contingency("7", trip="5-7", at="1s", events=("8:+1MW@0.7s", "8:+1MW@1.2s"))
    scheduled = Scheduled(Trial(point, fault, LATE), LATE, 30, 0.5)
    before, after, rate = scheduled.frames(k)
    under = scheduled.under(Plan(k, before, rate, np.zeros((before + after, 3))))
    at = [e.at - under.at for e in under.events(k) if type(e).__name__ == "LoadStep"]
    assert at == pytest.approx([-0.3, 0.2])
    assert 0.3 <= under.at < 0.3 + 1 / rate + 1e-9
    assert (under.cleared(k) - under.control.start) * rate == pytest.approx(before)
    assert under.cleared(k) * rate == pytest.approx(round(under.cleared(k) * rate))


@pytest.mark.slow
def test_devices_that_are_idle_at_low_voltage_keep_the_limit_on_energy(cases):
    """Orders that they do not follow are 0 and take no energy."""
    options = {"rate": 20, "window": "1s", "resolution": "1cyc", "iterations": 2, "observe": "2s", "longest": 0}
    found = optimum(cases("two_area"), "7-8@0.4", storage="50MW", energy="5kWh", **options)
    k = np.searchsorted(found.run.time, found.cleared + found.time - 1e-9)
    assert found.run.arrays.order[k] == pytest.approx(found.schedule.orders, abs=1e-12)
    assert (found.schedule.orders[: found.before] == 0).any()
    energy = np.cumsum(found.df.filter(like="absorbed_mw").to_numpy(), axis=0) / found.schedule.rate / 3.6
    assert np.abs(energy).max() == pytest.approx(5, abs=1e-3)
    assert found.energy_kwh.max() == pytest.approx(5, abs=0.02)  # losses, and the delay of the devices
    assert "the energy of the devices" in found.binding


@pytest.mark.slow
def test_less_energy_gives_a_shorter_fault(longest):
    few = longest.energy_kwh[0] / 3
    found = optimum(_case(), FAULT, energy=f"{few}kWh", resolution="0.25cyc", limit="20cyc", **OPTIONS)
    assert found.start.cycles <= found.cycles < longest.cycles
    assert np.abs(found.bounds.energy(found.schedule.orders, found.schedule.rate)).max() <= few / 1e3 * (1 + 1e-6)
    assert "the energy of the devices" in found.binding


def test_the_page_says_what_the_programs_make_small(longest):
    """In rad, as `Iteration.excursion`: it is no angle that a machine has."""
    page = optimum_page(longest).html()
    assert "excursion (rad)" in page
    assert "a tenth of the mean over time of the sum of their squares, in rad" in page
    assert all(f"{one.excursion:.3f}</td>" in page for one in longest.iterations)
    assert longest.iterations[-1].excursion == pytest.approx(longest.peak[1], rel=0.5)


def test_the_figure_shows_swings_and_power(longest):
    figure = longest.plot()
    assert figure.axes[0].get_title() == f"{longest.case}, fault {longest.contingency.label}: {longest.cycles:g} cycles"
    tripped = replace(longest, contingency=replace(longest.contingency, trip="1-2#2"))
    assert "trip 1-2#2: " in tripped.plot().axes[0].get_title()
    assert [ax.get_ylabel() for ax in figure.axes] == ["angle from COI (deg)", "storage power absorbed (MW)"]
    assert longest.before > 0
    schedule = longest.schedule
    for ax in figure.axes:  # dashed where the law takes over
        (dashed,) = (line for line in ax.lines if line.get_linestyle() == "--" and len(set(line.get_xdata())) == 1)
        end = schedule.start + len(schedule.orders) / schedule.rate
        assert dashed.get_xdata()[0] == pytest.approx(end, abs=1e-9)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"storage": "none"}, "no storage to schedule"),
        ({"rate": 0}, "rate = 0 orders per second"),
        ({"window": "90s"}, "A schedule of 90 s"),
        ({"limit": "2cyc"}, "no clearing time to increase: fault 7, trip 5-7: stable up to the limit"),
        ({"energy": "5MW"}, "5MW"),
        ({"energy": "-5kWh"}, "energy = '-5kWh' is not allowed; give more than 0"),
        ({"law": None}, "law = None is not allowed; give a BangBang"),
        ({"iterations": 0}, "iterations = 0 is not"),
        ({"storage": [Storage(1, 4, 20.0, ramp=8.0)]}, r"ramp limit \(1@4\); set their ramp to 0"),
    ],
    ids=["storage", "rate", "window", "limit", "energy", "negative energy", "law", "iterations", "ramp"],
)
def test_what_is_not_possible_is_said(cases, options, words):
    with pytest.raises(StudyError, match=words):
        optimum(cases("wscc9"), Contingency("7", trip="5-7"), **{"storage": "20MW", **options})


def test_the_command_gives_the_schedule(stabctl, tmp_path):
    out = tmp_path / "orders.csv"
    case = ("wscc9", "--fault", 7, "--trip", "5-7", "--storage", "20MW")
    options = ("--window", "0.3s", "--rate", 15, "--iterations", 1)
    code, said, _ = stabctl("design", "optimum", *case, *options, "--out", out, "--json")
    found = json.loads(said)
    assert code == 0
    assert found["stable"]
    assert found["cycles"] >= found["law_cycles"] - 0.5
    assert len(found["orders"]) == len(found["time_s"]) == len(out.read_text().splitlines()) - 1
    assert np.abs(found["orders"]).max() <= 1


@pytest.mark.slow
@pytest.mark.parametrize(("gate", "least", "law"), [(0.8, 28.375, 26.0), (0.0, 35.5, 30.75)], ids=["gated", "free"])
def test_two_areas_hold_longer_than_with_any_law_known(cases, gate, least, law):
    found = optimum(cases("two_area"), "7-8@0.4", storage="50MW", law=BangBang(min_voltage=gate))
    assert found.start.cycles == law
    assert found.cycles >= least
    assert found.proof.stable


def test_few_orders_fill_fault_and_window(cases):
    """Less than one a fault: one begins with the fault, and the window has the length asked for at their rate."""
    case = cases("two_area").with_storage("50MW")
    options = {"window": "2s", "resolution": "1cyc", "iterations": 1, "observe": "3s", "longest": "3s"}
    found = optimum(case, "7", rate=3, **options)
    assert found.before == 1
    assert found.time[0] == pytest.approx(-found.seconds)
    assert found.time[-1] + 1 / found.schedule.rate == pytest.approx(2.0)


@pytest.mark.parametrize(("k", "longer"), [(6, 11), (11, 6), (7, 7), (4, 0), (5, 23)])
def test_orders_from_clearing_on_keep_their_time_and_the_first_and_last_are_repeated(k, longer):
    """Of a fault of another duration; frames fill the fault, so their length differs by a little."""
    trial = Trial(_case().initialize(), FAULT, LATE, Search(1.0, observed_s=1.2))
    scheduled = Scheduled(trial, LATE, 30, 0.5)
    before, after, rate = scheduled.frames(k)
    orders = np.linspace(-1, 1, 2 * (before + after)).reshape(-1, 2)
    found = scheduled.plan(longer, Plan(k, before, rate, orders))
    assert (found.k, found.before, found.rate) == (longer, *scheduled.frames(longer)[::2])
    assert len(found.orders) == sum(scheduled.frames(longer)[:2])
    edges = (np.arange(len(orders) + 1) - before) / rate  # s from clearing
    for n, order in enumerate(found.orders):
        middle = (n + 0.5 - found.before) / found.rate
        there = next((j for j in range(len(orders)) if edges[j] <= middle < edges[j + 1]), None)
        wanted = orders[0 if middle < edges[0] else -1] if there is None else orders[there]
        assert np.array_equal(order, wanted)
