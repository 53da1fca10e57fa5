"""The whole study on few candidates: what it finds, what it refuses, what costs change."""

from dataclasses import replace

import numpy as np
import pytest
from sitings import AT_10, AT_16, CANDIDATES, EASY, HOPELESS, NEAR_6, NEAR_9, study

import stabctl as st
from stabctl._util.errors import CaseError, StudyError
from stabctl.controllers import BangBang
from stabctl.estimation.estimator_control import EstimatorControl
from stabctl.estimation.pmu import Pmu
from stabctl.placement.place import place
from stabctl.placement.site_options import SiteOption
from stabctl.placement.siting import Costs
from stabctl.simulation.contingency import Contingency


@pytest.mark.slow
def test_every_site_is_where_it_helps(both):
    assert {9} <= {s.machine for s in both.sites} <= {1, 6, 9}
    assert both.total_mw < both.uniform_mw
    assert all(row.stable and row.margin_cycles >= -1e-9 for row in both.contingencies)
    assert [row.target_cycles for row in both.contingencies] == pytest.approx([4.75, 9.5])


@pytest.mark.slow
def test_twice_the_same(case, both):
    again = study(case, NEAR_9, NEAR_6, workers=1)
    assert replace(again, wall_s=0.0) == replace(both, wall_s=0.0)


@pytest.mark.slow
def test_existing_storage_is_kept_and_costs_nothing(case, both):
    """What is there at bus 29 need not be built, and the fleet survives together with it."""
    (alone,) = study(case, NEAR_9, candidates=CANDIDATES[2:]).sites
    half = case.with_storage({9: f"{alone.mw / 2!r}MW"})
    found = study(half, NEAR_9, candidates=CANDIDATES[2:])
    assert found.existing == half.storage
    assert found.total_mw == pytest.approx(alone.mw / 2, rel=2e-3)  # two devices at a bus are one of both sizes
    assert found.cost == found.total_mw
    assert "1 existing device with" in str(found)
    enough = study(case.with_storage({9: f"{1.01 * alone.mw!r}MW"}), NEAR_9)
    assert (enough.sites, enough.cost) == ((), 0)
    assert "even without further storage" in str(enough)
    assert "the system without further storage does not survive" in str(enough)


def test_where_nothing_is_curable(case):
    with pytest.raises(StudyError, match=r"No fleet within the caps survives any of the contingencies. 29 trip"):
        study(case, HOPELESS)
    with pytest.raises(StudyError, match=r"clearing time is 4\.2"):
        study(case, NEAR_9, cap="1MW")


def test_what_needs_no_storage_gets_none(case):
    found = study(case, EASY)
    assert found.sites == ()
    assert (found.total_mw, found.total_mwh, found.cost, found.uniform_mw, found.gap) == (0, 0, 0, 0, 0)
    assert found.contingencies[0].stable
    assert "0 sites with 0.0 MW and 0 kWh survive 1 contingency," in str(found)
    assert "survives every contingency even without storage" in str(found)


@pytest.mark.slow
def test_too_few_sites(case):
    with pytest.raises(StudyError, match="No fleet with at most 1 site within the caps"):
        study(case, NEAR_9, NEAR_6, sites=1)


@pytest.mark.slow
def test_caps_are_kept(case):
    held = study(case, AT_16, cap="180MW")
    assert max(s.mw for s in held.sites) <= 180  # 204.7 where 30 % of the MVA are allowed
    assert held.total_mw > 271
    dispatch = study(case, NEAR_9, cap="20%dispatch")
    sent = {m.machine: m.p for m in case.machines}
    assert all(s.mw <= 0.2 * sent[s.machine] * 1.001 for s in dispatch.sites)


def test_the_uniform_fleet_has_one_percentage_at_every_site_up_to_its_cap(case):
    """Also with two sites of one machine, and a cap that is reached."""
    places = [SiteOption(29, 9, cap=10.0), SiteOption(28, 9, cap=200.0), SiteOption(22, 6, cap=200.0)]
    found = study(case, NEAR_9, candidates=places)
    own = {m.machine: found.uniform_percent / 100 * m.base for m in case.machines}
    assert [c.uniform_mw for c in found.candidates] == pytest.approx([10.0, own[9], own[6]])
    assert found.uniform_mw == pytest.approx(10 + own[9] + own[6])
    share = f"({found.uniform_percent:.2f} % of the machine's MVA at every candidate site, up to its cap)"
    assert share in str(found)


@pytest.mark.slow
def test_some_caps_of_nothing(case):
    """A machine without dispatch has no room for storage then."""
    idle = tuple(m._replace(p=0.0) if m.machine == 6 else m for m in case.machines)
    moved = replace(case, machines=idle)
    found = study(moved, NEAR_9, cap="20%dispatch", costs=Costs(mwh=10.0))
    assert 6 not in {s.machine for s in found.sites}


@pytest.mark.slow
def test_the_bound_in_mw_is_that_of_what_a_mw_costs_where_it_is_built(case):
    """At the price of a site in place of that of the study; with other costs too there is none."""
    one = {"cap": 400.0, "machine": 9}
    plain, dear = (study(case, NEAR_9, candidates=[SiteOption(29, **one, cost_per_mw=price)]) for price in (None, 2.0))
    assert dear.cuts_cost == pytest.approx(2 * plain.cuts_cost, rel=1e-6)
    assert dear.cuts_mw == pytest.approx(plain.cuts_mw, rel=1e-6)
    assert 0.9 * plain.total_mw < plain.cuts_mw <= plain.total_mw * (1 + 1e-9)
    of_site = study(case, NEAR_9, candidates=[SiteOption(29, **one, cost_per_site=30.0)])
    assert of_site.cuts_cost > plain.cuts_cost
    assert of_site.cuts_mw is None


@pytest.mark.slow
@pytest.mark.parametrize("limit", [{"sites": 1}, {"costs": Costs(1.0, site=50.0)}, {"costs": Costs(1.0, mwh=1000.0)}])
def test_what_is_found_without_a_limit_or_cost_is_found_with_it(cases, limit):
    """They ended at 114 MW of machine 4, and said that the cuts allow no less."""
    case = cases("two_area").classical()
    found = place(case, [Contingency("7", clear="9cyc", trip="7-8")], observe="3s", **limit)
    assert [(s.machine, s.bus) for s in found.sites] == [(3, 11)]
    assert found.total_mw == pytest.approx(96.4, abs=0.3)
    assert found.cuts_cost <= found.cost


@pytest.mark.slow
def test_dear_sites_are_fewer(case):
    cheap, dear = study(case, AT_16, AT_10), study(case, AT_16, AT_10, costs=Costs(site=200.0))
    assert (len(cheap.sites), len(dear.sites)) == (2, 1)
    assert cheap.total_mw < dear.total_mw  # 301, 369
    assert dear.cost == pytest.approx(dear.total_mw + 200)
    assert dear.cost < cheap.total_mw + 400
    assert dear.cuts_mw is None


@pytest.mark.slow
def test_energy_has_its_price(case, both):
    """The cost is that of the fleet and the energies in the result, not of the energies of another fleet."""
    dear = study(case, NEAR_9, NEAR_6, costs=Costs(mw=0.0, mwh=1e3))
    assert dear.cost == pytest.approx(1e3 * dear.total_mwh, rel=1e-12)
    assert 0 < dear.cuts_cost <= dear.cost
    assert dear.cuts_mw is None
    assert dear.total_mwh <= 1.1 * both.total_mwh
    mixed = study(case, NEAR_9, NEAR_6, costs=Costs(1.0, 5.0, 1e3))
    assert mixed.cost == pytest.approx(mixed.total_mw + 5 * len(mixed.sites) + 1e3 * mixed.total_mwh, rel=1e-12)


def test_the_fleet_that_is_printed_survives(case, both):
    """Its sizes have two decimals; typed in again it survives, and its energies are those of its own simulations."""
    printed = {int(words[1]): words[2] for words in map(str.split, str(both).splitlines()[2 : 2 + len(both.sites)])}
    assert [f"{s.mw:.2f}" for s in both.sites] == list(printed.values())
    assert [round(s.mw, 2) for s in both.sites] == [s.mw for s in both.sites]
    sized = case.with_storage({machine: f"{mw}MW" for machine, mw in printed.items()}).initialize()
    drawn = []
    for one in (NEAR_9, NEAR_6):
        run = sized.simulate(replace(one, at=0.0), one.clear + 2.0, control=BangBang())
        assert run.outcome.stable
        drawn.append(np.ptp(run.arrays.energy, axis=0))
    found = {s.machine: s.mwh for s in both.sites}
    for machine, mwh in zip(printed, np.max(drawn, axis=0), strict=True):
        assert mwh <= found[machine] <= mwh + 1.01e-4
    assert both.cost == both.total_mw


def test_new_devices_are_checked_as_elsewhere(case):
    with pytest.raises(StudyError, match="a flywheel depends on its stored energy"):
        study(case, NEAR_9, candidates=CANDIDATES[2:], device={"storage_model": "flywheel"})
    with pytest.raises(CaseError, match="current applies only to ideal devices"):
        study(case, NEAR_9, candidates=CANDIDATES[2:], device={"storage_model": "regc", "characteristic": "current"})


def test_a_fleet_of_supercapacitors_survives_with_the_energy_that_it_was_given(case):
    device = {"storage_model": "supercap", "energy": 0.05}
    found = study(case, NEAR_9, candidates=CANDIDATES[2:], device=device)
    assert [s.energy for s in found.devices] == [0.05]
    assert 0 < found.total_mwh < 0.05
    run = case.simulate(NEAR_9, "3s", storage=found.storage(), control=st.BangBang())
    assert run.outcome.stable


def test_the_devices_have_the_properties_that_they_were_sized_with():
    """As if the sizes were typed in again beside the same properties; a run may still be asked for another one."""
    case, fault = st.load("two_area"), st.Contingency("7-8@0.4", clear="22cyc")
    device = {"characteristic": "conductance", "lag": "20ms", "efficiency": 0.9, "mva": "120%"}
    found = st.place(case, fault, candidates=[(1, 5)], observe="2s", device=device)
    (built,), (typed,) = found.storage(), case.with_storage({"1@5": f"{found.total_mw!r}MW"}, **device).storage
    assert built._replace(mva=typed.mva) == typed
    assert built.mva == pytest.approx(typed.mva)
    assert found.storage(lag=0.0) == (built._replace(lag=0.0),)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"cap": "30"}, "not a storage size"),
        ({"candidates": [SiteOption(29, 9, 5.0, 10.0)]}, "module of 10 MW at bus 29 is larger than its cap of 5 MW"),
        ({"cap": "0MW"}, "cap of 0MW is not allowed"),
        ({"cap": "1e300MW"}, "not realistic"),
        ({"costs": Costs(mw=-1.0)}, "cost of -1 per MW"),
        ({"costs": None}, "costs = None is not allowed"),
        ({"costs": Costs(mw="a")}, "are not costs"),
        ({"costs": Costs(site=np.nan)}, "cost of nan per site"),
        ({"costs": Costs(mw=0.0, site=1.0)}, "costs per MW and per MWh are both 0"),
        ({"sites": 0}, "sites = 0 is not allowed"),
        ({"sites": 1.5}, "sites = 1.5 is not allowed; give a whole number"),
        ({"sites": "2"}, "sites = '2' is not allowed"),
        ({"candidates": [(1.7, 29)]}, "machine: 1.7 is not allowed"),
        ({"observe": 0.0}, "observation window of 0 s"),
        ({"observe": np.nan}, "is not a time"),
        ({"step": 1.0}, "step 1 s is too long"),
        ({"candidates": [(9, 99)]}, "no bus 99"),
        ({"candidates": [(99, 29)]}, "no machine 99"),
        ({"candidates": []}, "no candidate"),
        ({"candidates": [(9, 29), (9, 29)]}, "listed twice"),
    ],
)
def test_what_is_refused(case, options, words):
    with pytest.raises(StudyError, match=words):
        study(case, NEAR_9, **options)


@pytest.mark.slow
def test_estimates_in_the_loop(case):
    """The evidence has the margins with a Kalman filter too."""
    control = EstimatorControl(BangBang(), "kalman", Pmu(), engine="batched")
    found = study(case, NEAR_9, candidates=((9, 29),), validate={"kalman": control})
    rows = {row.fleet: row for row in found.evidence}
    assert rows["kalman"].mw == rows["x1"].mw
    assert abs(rows["kalman"].critical_cycles[0] - rows["x1"].critical_cycles[0]) <= 0.25  # 4.625 of 4.75
    said = [one for one in found.remarks() if "With the control 'kalman', this fleet" in one]
    assert [("does not survive" in one) for one in said] == [row.lost > 0 for row in found.evidence if row.control]


def test_contingencies_come_from_a_file_the_package_or_a_screen(cases, monkeypatch):
    from stabctl.cli.place import _contingencies
    from stabctl.placement.contingencies import contingencies

    assert len(_contingencies(cases("ieee39"), "ieee39", None, classical=True)[0]) == 9
    case = cases("two_area_manual")
    screen, source = _contingencies(case, "two_area_manual", None, classical=False)
    found = contingencies(case, screen)
    assert 0 < len(found) <= 4  # machines
    assert all(len(one.trip) == 1 and one.clear > 0 for one in found)
    assert "20 % longer" in source
