"""Sizes with a tolerance: a fleet that survives need not survive with another size at one site."""

import json
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from stabctl._util.errors import StudyError
from stabctl.controllers import BangBang
from stabctl.placement.contingencies import Scenario, scaled
from stabctl.placement.place import lost, place
from stabctl.simulation.contingency import Contingency

AT_25 = Contingency("25", 8.25 / 60, "2-25")
AT_16 = Contingency("16", 10.625 / 60, "16-21")
NEAR_9 = Contingency("29", 4.75 / 60, "26-29")
SITES = ((1, 39), (6, 22))

placing = sys.modules["stabctl.placement.place"]  # the package has a function of this name


@pytest.fixture(scope="module")
def case(cases):
    return cases("ieee39").classical()


@pytest.fixture(scope="module")
def given(case):
    return place(case, [AT_16, AT_25], candidates=SITES)


@pytest.fixture(scope="module")
def held(case):
    return place(case, [AT_16, AT_25], candidates=SITES, tolerance="10%")


def survived(case, found, changed, multiple):
    """Which contingencies a fleet with another size at one site survives, through the public records alone."""
    fleet = [s._replace(rating=s.rating * multiple) if s.bus == changed else s for s in found.storage()]
    point = case.with_storage(fleet).initialize()
    wanted = [c.contingency for c in found.contingencies]
    runs = (point.simulate(replace(one, at=0.0), one.clear + 5.0, control=BangBang()) for one in wanted)
    return tuple(run.outcome.stable for run in runs)


@pytest.mark.slow
def test_a_fleet_that_one_larger_device_spoils_says_so(case, given):
    """Machine 6 with 10 % more loses what the smaller fleet survives."""
    rows = {(row.site, row.scale): row for row in given.evidence if row.site}
    sites = {f"{s.machine}@{s.bus}": s for s in given.sites}
    assert set(rows) == {(site, scale) for site in sites for scale in (0.9, 1.1)}
    for (site, scale), row in rows.items():
        assert row.stable == survived(case, given, sites[site].bus, scale)
        assert row.mw == pytest.approx(given.total_mw + (scale - 1) * sites[site].mw)
    assert [rows["6@22", 1.1].lost, rows["1@39", 1.1].lost, rows["1@39", 0.9].lost] == [1, 0, 2]
    text = " ".join(str(given).split())
    assert "With 10 % more at one site alone, the fleet is not sufficient for 1 of 2 sites: 6@22 loses 25 " in text
    assert "With 10 % less at one site alone, the fleet is not sufficient for 2 of 2 sites: 1@39 loses 16 trip" in text
    assert given.df.set_index("machine")[["lost_if_smaller", "lost_if_larger"]].values.tolist() == [[2, 0], [1, 1]]
    assert given.tolerance is None


@pytest.mark.slow
def test_with_the_tolerance_required_every_changed_fleet_survives(case, given, held):
    assert held.tolerance == 0.1
    assert held.total_mw > given.total_mw
    for s in held.sites:
        for multiple in (0.9, 1.1):
            assert survived(case, held, s.bus, multiple) == (True, True)
    assert not any(row.lost for row in held.evidence if row.site)
    assert "survives every contingency also if any one site has 10 % less or more." in str(held)
    assert held.smaller == ()
    assert [c.contingency for c in held.contingencies] == [c.contingency for c in given.contingencies]
    assert held.df[["lost_if_smaller", "lost_if_larger"]].to_numpy().sum() == 0


def test_what_is_lost_is_looked_for_on_both_sides(monkeypatch):
    """With devices of 60 and 20 MW: each smaller and each larger, all scenarios."""
    tried = []

    class Known:
        existing, scenarios = (), ("one", "other")

        def among(self, scenarios):
            tried.extend(scenarios)
            return self

        def lost(self, mw):
            return [True]

        def only(self, rows):
            return self

    monkeypatch.setattr(placing, "scaled", lambda scenarios, row, multiple: [(s, row, multiple) for s in scenarios])
    placing.lost(Known(), np.array([60.0, 0.0, 20.0]), 0.1)
    assert sorted(tried) == sorted((s, row, a) for s in ("one", "other") for row in (0, 2) for a in (0.9, 1.1))


@pytest.mark.slow
def test_a_tolerance_that_nothing_holds_is_an_error_not_a_claim(case):
    """The device needs 44.5 MW of the 48 that are allowed, so 10 % less cannot be made up for."""
    options = {"candidates": [(9, 29)], "cap": "48MW", "observe": 2.0}
    near = replace(NEAR_9, clear=4.7 / 60)
    assert place(case, [near], **options).total_mw == pytest.approx(44.5, abs=0.1)
    with pytest.raises(StudyError, match=r"also with any one site 10 % .* loses 29 trip 26-29 with 9@29 x0"):
        place(case, [near], tolerance=0.1, **options)


@pytest.mark.slow
def test_a_small_tolerance_costs_little(case):
    options = {"candidates": [(9, 29)], "observe": 2.0}
    alone = place(case, [NEAR_9], **options).total_mw
    assert place(case, [NEAR_9], tolerance="1%", **options).total_mw == pytest.approx(alone / 0.99, rel=2e-3)


def test_scenarios_with_another_size():
    scenario = Scenario(NEAR_9, 1, 2)
    assert scaled([scenario], 3, 1.1) == (Scenario(NEAR_9, 1, 2, (3, 1.1)),)


@pytest.mark.parametrize("wrong", [0, 1, -0.1, "5MW", "", float("nan")])
def test_a_tolerance_is_a_share(case, wrong):
    with pytest.raises(StudyError, match=r"tolerance|is not a number"):
        place(case, [NEAR_9], tolerance=wrong)


@pytest.mark.slow
def test_the_command(stabctl, tmp_path):
    file = tmp_path / "faults.toml"
    file.write_text('[[contingency]]\nfault = "29"\ntrip = "26-29"\nclear = "4.75cyc"\n')
    sites = tmp_path / "sites.csv"
    sites.write_text("bus,machine\n29,9\n")
    words = ("place", "ieee39", "--classical", "--contingencies", file, "--observe", 2, "--candidates", sites)
    code, out, err = stabctl(*words, "--tolerance", "5%", "--json", "--report", tmp_path)
    record = json.loads(out)
    assert (code, record["tolerance"]) == (0, 0.05)
    rows = {row["fleet"]: row["stable"] for row in record["evidence"]}
    assert (rows["9@29 x0.95"], rows["9@29 x1.05"]) == ([True], [True])
    page = (tmp_path / "ieee39_place.html").read_text(encoding="utf-8")
    assert "9@29 x0.95" in page
    assert "any one site has 5 % less or more" in page
    code, out, err = stabctl(*words, "--tolerance", "150%")
    assert (code, out) == (2, "")
    assert "The tolerance 1.5 is not allowed" in err


def test_every_built_site_must_hold_smaller_and_larger():
    """With the row of the existing device before those of the candidates; sites without a device are not tried."""

    class Asked(SimpleNamespace):
        def among(self, scenarios):
            return Asked(existing=self.existing, scenarios=tuple(scenarios))

        def lost(self, mw):
            return [k for k, one in enumerate(self.scenarios) if one.scaled in losing]

        def only(self, kept):
            return self.among(self.scenarios[k] for k in kept)

    changed = [(row, multiple) for row in (1, 3) for multiple in (0.9, 1.1)]
    for losing in (changed, changed[:1], changed[1:2], changed[2:]):
        given = Asked(existing=np.ones(1), scenarios=(Scenario(AT_16), Scenario(AT_25)))
        found = lost(given, np.array([20.0, 0.0, 30.0]), 0.1).scenarios
        wanted = {(one, size) for one in (AT_16, AT_25) for size in losing}
        assert {(one.contingency, one.scaled) for one in found} == wanted
        assert len(found) == len(wanted)
