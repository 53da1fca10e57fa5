"""What a siting says of its fleet: margins, larger fleets, what is lost; and its command."""

import json
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from sitings import CANDIDATES, HOPELESS, NEAR_9, study

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.cli.place import _record
from stabctl.controllers import BangBang
from stabctl.placement import evidence
from stabctl.placement._simulated import CriticalTime
from stabctl.placement.contingencies import Scenario
from stabctl.placement.siting import Evidence
from stabctl.view.pages import siting_page

KEYS = {"sites", "total_mw", "uniform_mw", "cuts_mw", "contingencies", "simulations", "wall_s"}


@pytest.mark.slow
def test_what_no_fleet_cures_is_left_out_and_said(case):
    found = study(case, NEAR_9, HOPELESS)
    assert [row.contingency for row in found.contingencies] == [NEAR_9]
    (out,) = found.infeasible
    assert out.contingency == HOPELESS
    assert out.alone_cycles == pytest.approx(4.25, abs=0.2)
    assert out.tried > 20
    assert "Not survived: 29 trip 26-29 at 30.00 cycles: none of" in str(found)
    assert "29 trip 26-29               30.000      lost  with every fleet tried" in str(found)
    assert found.clearing_times.stable.tolist() == [True, False]
    (lost,) = _record(found)["lost"]
    assert (lost["fault"], lost["fleets_tried"]) == ("29", out.tried)
    assert found.clearing_times.target_cycles.tolist() == pytest.approx([4.75, 30.0])


@pytest.mark.slow
def test_a_command_that_leaves_one_out_ends_with_1(stabctl, tmp_path):
    file = tmp_path / "two.toml"
    rows = (f'[[contingency]]\nfault = "29"\ntrip = "26-29"\nclear = "{t}"\n' for t in ("3cyc", "30cyc"))
    file.write_text("".join(rows))
    code, out, err = stabctl("place", "ieee39", "--classical", "--contingencies", file, "--observe", 2)
    assert (code, err) == (1, "")
    assert "survive 1 contingency of 2" in out
    assert "lost  with every fleet tried" in out


def test_a_fleet_lessened_by_caps_has_its_true_multiple():
    """Of 1.1 times 180 and 20 MW, 180 and 22 MW are left under a cap of 180 MW: 1.01 times 200 MW."""
    mw = np.array([180.0, 20.0])
    assert evidence._multiple(np.minimum(1.1 * mw, 180.0), mw, 1.1) == pytest.approx(1.01)
    assert evidence._multiple(1.1 * mw, mw, 1.1) == 1.1


@pytest.mark.parametrize(("cap", "scales"), [(20.0, [1.0]), (np.inf, [1.0, 1.1]), (20.6, [1.0, 1.03])])
def test_a_fleet_at_its_caps_is_no_larger_fleet(cap, scales):
    """A fleet that is lost with half the step, or under a controller, is shown once if caps allow no larger one."""

    class Lost(SimpleNamespace):
        def fleet(self, mw):
            return np.minimum(mw, cap)

        def longer(self):
            return self

        def refined(self):
            return self

        def all_survived(self, mw):
            return False

        def lost(self, mw):
            return [0]

        def each(self, ask):
            return [ask(0)]

        def among(self, scenarios):
            return self

        def critical_time(self, mw, k, control=None):
            return CriticalTime(1.0, False, None)

        def site(self, i):
            return "1@2"

    trials = Lost(existing=np.zeros(0), scenarios=(Scenario(NEAR_9),), cap=np.array([cap]))
    rows = evidence.table(trials, np.array([20.0]), [CriticalTime(1.0, True, None)], {"Kalman": None}, 0.1)
    for kind in ("longer", "refined", "control"):
        found = [row for row in rows if getattr(row, kind)]
        assert [row.scale for row in found] == pytest.approx(scales)
        assert [row.mw for row in found] == pytest.approx([20 * scale for scale in scales])


def test_a_fleet_that_is_lost_later_says_so():
    """With the same step: half of it hides the loss. The swings grow before, as the search for a clearing time says."""
    case, fault = st.load("two_area"), st.Contingency("7", trip="7-8", clear="10.5cyc")
    converter = {"storage_model": "regc", "mva": "0.8pu"}
    found = st.place(case, [fault], candidates=[(3, 11)], device=converter, observe="4s")
    later = [row for row in found.evidence if row.longer]
    for row in later:
        point = case.with_storage({"3@11": f"{row.mw!r}MW"}, **converter).initialize()
        ran = point.simulate(fault, until=1 + 10.5 / 60 + 8, control=st.BangBang())
        assert row.lost == (not ran.outcome.stable)
    assert [row.lost for row in later] == [1, 0]
    assert [row.lost for row in found.evidence if row.refined] == [0]
    point = case.with_storage({"3@11": f"{found.total_mw!r}MW"}, **converter).initialize()
    end = point.clearing_time(fault, control=st.BangBang(), observe="4s", longest=0).swings
    assert found.contingencies[0].growing
    assert end.growing
    said = str(found)
    assert "With twice the observation window, this fleet does not survive 7 trip 7-8; use a longer" in said
    assert "The swings after 7 trip 7-8 grow within the 4 s observed; with a longer observation window," in said


@pytest.mark.slow
def test_a_fleet_that_is_lost_with_half_the_step_says_so(both):
    """Also where a larger fleet survives."""
    rows = (Evidence(1.0, (), (True, False), refined=True), Evidence(1.1, (), (True, True), scale=1.0526, refined=True))
    own, larger, *_ = replace(both, evidence=rows, history=()).reservations()
    assert "observation window, this fleet does not survive 22 trip 21-22;" in own
    assert "observation window, this fleet, enlarged to 1.053 times its MW, survives every contingency." in larger


def test_a_contingency_that_is_always_unstable_has_no_margin(both):
    lost = both.contingencies[0]._replace(critical_cycles=None, stable=False)
    assert lost.margin_cycles is None
    assert replace(both, contingencies=(lost,)).clearing_times.margin_cycles.isna().all()


@pytest.mark.slow
def test_what_is_stable_up_to_the_limit_has_no_critical_time():
    """As a clearing time with the fleet says, and a margin there is none."""
    case = st.load("wscc9").classical()
    weak, near = (
        st.Contingency("7", clear="9cyc", trip="5-7", impedance=0.5j),
        st.Contingency("7", clear="6.5cyc", trip="5-7"),
    )
    found = st.place(case, [near, weak], observe="2s", candidates=[(2, 7)])
    point = case.with_storage(found.storage()).initialize()
    for row in found.contingencies:
        own = point.clearing_time(row.contingency, control=st.BangBang(), observe="2s", longest=0)
        assert (row.longest_cycles == 60) == (own.status == "stable_at_limit") == (row.critical_cycles is None)
    assert found.contingencies[1].critical == "60 or more"
    assert "60 or more" in str(found)
    assert found.clearing_times.critical_cycles.isna().tolist() == [False, True]
    assert found.clearing_times.margin_cycles.isna().tolist() == [False, True]
    assert found.clearing_times.stable.all()
    assert "<td>60 or more</td>" in siting_page.page(replace(found, candidates=(), history=())).html()


def test_the_clearing_time_of_a_hopeless_fault_is_that_with_the_existing_devices():
    """Of the fleet alone nothing acts: existing devices follow their law."""
    case, fault = st.load("two_area"), st.Contingency("7", trip="7-8", clear="25cyc")
    stored = case.with_storage("1=20MW,4=60MW")
    for one, law, without in ((case, None, "storage"), (stored, st.BangBang(), "further storage")):
        alone = one.clearing_time(fault, control=law, observe="2s", longest=0)
        with pytest.raises(StudyError) as refused:
            st.place(one, [fault], cap="1MW", candidates=[(1, 5)], observe="2s")
        said = re.search(r"\(without ([a-z ]+) its critical clearing time is ([0-9.]+) cycles\)", str(refused.value))
        assert said
        assert said[1] == without
        assert float(said[2]) == pytest.approx(alone.cycles, abs=0.126)  # 0 and 0


@pytest.mark.slow
def test_the_mva_of_converters_and_the_largest_current_are_those_of_the_fleet(case):
    """The current limit is reached where the voltage is low, and not with MVA for the gate of the law."""
    equal, more = (
        study(case, NEAR_9, candidates=CANDIDATES[2:], device={"storage_model": "regc", "mva": mva})
        for mva in (0.0, "0.8pu")
    )
    (limited,), (free,) = equal.sites, more.sites
    assert (limited.mva, limited.limit) == (limited.mw, 1.11)
    assert limited.limited
    assert free.mva == pytest.approx(free.mw / (0.8 * 1.11))
    assert (free.limited, free.set_by[:12]) == (False, "power rating")
    assert 0.8 < free.current / free.limit < 1  # 0.99
    sized = case.with_storage(more.storage()).initialize()
    run = sized.simulate(replace(NEAR_9, at=0.0), NEAR_9.clear + 2.0, control=BangBang())
    current = np.hypot(run.arrays.storage[:, 0], 0) / free.mva / np.abs(run.arrays.V[:, sized.net.place[29]])
    assert run.arrays.storage_current.max() == pytest.approx(free.current, rel=1e-9)
    assert current.max() == pytest.approx(free.current, rel=1e-3)
    assert free.worst == NEAR_9.label


@pytest.mark.parametrize(("survived", "says"), [(True, "survives every contingency."), (False, "does not survive")])
def test_what_the_fleet_does_under_another_controller_is_said(both, survived, says):
    row = next(row for row in both.evidence if row.refined)
    row = row._replace(refined=False, scale=1.0, control="mine", stable=(survived, True))
    found = replace(both, evidence=(row,))
    (said,) = [one for one in found.remarks() if "mine" in one]
    assert said.startswith(f"With the control 'mine', this fleet {says}")
    assert "window" not in said


@pytest.mark.slow
def test_json(stabctl, tmp_path):
    file = tmp_path / "one.toml"
    file.write_text('[[contingency]]\nfault = "29"\ntrip = "26-29"\nclear = "4.75cyc"\n')
    words = ("place", "ieee39", "--classical", "--contingencies", file, "--observe", 2, "--sites", 1)
    code, out, err = stabctl(*words, "--json", "--report", tmp_path / "pages")
    record = json.loads(out)
    assert (code, err) == (0, "")
    assert (tmp_path / "pages" / "ieee39_place.html").is_file()
    assert KEYS <= set(record)
    assert set(record["sites"][0]) == {"bus", "machine", "mw", "mwh", "mva", "current", "limit", "voltage", "worst"}
    (row,) = record["contingencies"]
    assert {"fault", "trip", "target_cycles", "critical_cycles", "stable"} <= set(row)
    assert (row["fault"], row["trip"], row["stable"]) == ("29", ["26-29"], True)
    assert (record["sites"][0]["machine"], record["sites"][0]["bus"]) == (9, 29)
    assert record["total_mw"] == sum(s["mw"] for s in record["sites"]) < record["uniform_mw"]
    assert record["cuts_mw"] <= record["total_mw"] * (1 + 1e-9)


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("--contingencies", "missing.toml"), "missing.toml' cannot be read"),
        (("--contingencies", "/"), "cannot be read"),
        (("--cap", "30"), "'30' is not a storage size"),
        (("--sites", "0"), "sites = 0 is not allowed"),
        (("--cost-mw", "-1"), "cost of -1"),
        (("--cost-site", "nan"), "cost of nan"),
        (("--observe", "-1"), "observation window of -1 s"),
        (("--lag", "-1"), "--lag -1 s"),
        (("--deadband", "nan"), "deadband"),
        (("--max-angle", "0"), "--max-angle 0"),
        (("--workers", "0"), "--workers"),
        (("--validate", "crystal-ball"), "--validate"),
    ],
)
def test_a_mistake_is_one_line(stabctl, words, complaint):
    code, out, err = stabctl("place", "ieee39", "--classical", *words)
    assert (code, out) == (2, "")
    assert len(err.splitlines()) == 1
    assert complaint in err
