"""The packaged cases have a system base of 100 MVA: on another one every study gives the same MW, MWh and seconds."""

import numpy as np
import pytest
from systems import rebased

import stabctl as st
from stabctl.clearing.trial import Search, Trial
from stabctl.design import law_measurement
from stabctl.design.evidence import step_responses
from stabctl.dynamics import operating_point
from stabctl.placement._allocation import gramians
from stabctl.placement.sensitivity import sensitivity
from stabctl.theory.two_machine import equivalent

FAULT = st.Contingency("7-8@0.4", clear="6cyc", at="0.1s")
LAW = st.StorageLaw(return_time="2s", return_power=0.6, deadband="20mHz")


@pytest.fixture(scope="module")
def both(cases):
    """Two operating points of one system: two area with storage of little energy, on 100 and 37 MVA."""
    case = cases("two_area").with_storage("40MW", energy=0.02, efficiency=0.81, ramp=400.0)
    return [operating_point.solve(one) for one in (case, rebased(case, 37.0))]


def later(point):
    times = {"resolution": "1cyc", "limit": "20cyc", "observe": "1s", "longest": 0, "scan": 0, "step": None}
    search = Search.of(point.case, criterion=st.Criterion(), **times)
    return list(law_measurement.later(Trial(point, FAULT, LAW, search), 6, 0.5))


def run(point):
    return point.simulate(FAULT, until="2s", control=LAW)


def events(point):
    what = [st.LoadStep(8, 0.1, p=20.0, q=30.0), st.SwitchShunt(9, 0.2, g=10.0, b=40.0), st.LoadStep(7, 0.3, p=25.0)]
    return point.simulate([*what, st.Fault("8", 0.4, 0.4j * point.case.base_mva / 100)], until="0.5s").arrays.P


STUDIES = {
    "a run": lambda p: run(p).arrays.P,
    "storage": lambda p: run(p).arrays.storage,
    "energy": lambda p: run(p).arrays.energy,
    "orders": lambda p: run(p).arrays.order,
    "duty": lambda p: [*law_measurement.duty(run(p))],
    "what is left": later,
    "events": events,
    "short-circuit power": lambda p: p.short_circuit().mva,
    "sensitivities": lambda p: sensitivity(p).J,
    "accelerations": lambda p: sensitivity(p).acceleration,
    "gramians": lambda p: np.abs(gramians(p).W),  # the signs of coordinates are free
    "step responses": lambda p: step_responses(p, []).before[1],
    "the theory": lambda p: [equivalent(p.case, 1).critical().time],
    "the diagram": lambda p: p.one_line().loading,
    "a dispatch": lambda p: [s.rating for s in p.case.with_storage("5%dispatch").storage],
    "another rating": lambda p: p.resized([10.0, 20.0, 30.0, 40.0]).simulate(FAULT, until="1s", control=LAW).arrays.P,
}


@pytest.mark.parametrize("name", STUDIES)
def test_a_study_is_the_same_on_another_base(both, name):
    one, other = (np.asarray(STUDIES[name](point), float) for point in both)
    assert np.abs(one).max() > 1e-6
    assert np.abs(one - other).max() < 1e-6 * np.abs(one).max()
