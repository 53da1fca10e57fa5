"""What is said of a fleet is what its user finds in the system that is built, without candidates that stay empty."""

import pytest

import stabctl as st
from stabctl.controllers import BangBang
from stabctl.placement.place import place
from stabctl.placement.siting import Costs
from stabctl.simulation.contingency import Contingency

THREE = {
    "case.toml": "frequency_hz = 50",
    "buses.csv": "bus,kind,v_pu\n1,pv,1.02\n2,pq,1\n3,pv,1.01\n4,swing,1",
    "branches.csv": "from_bus,to_bus,r_pu,x_pu,b_pu\n1,2,0.001,0.02,0\n2,3,0.005,0.05,0.1\n2,3,0.005,0.05,0.1\n"
    "3,4,0.003,0.04,0.2\n2,4,0.003,0.06,0.2",
    "machines.csv": "machine,bus,base_mva,p_mw,storage_bus\n1,1,600,500,2\n2,3,500,200,3\n3,4,2000,0,4",
    "gencls.csv": "machine,H_s,D_pu,ra_pu,x1d_pu\n1,4,1,0,0.3\n2,4,1,0,0.3\n3,5,2,0,0.2",
    "loads.csv": "bus,p_mw,q_mvar\n2,200,50\n4,600,100",
}  # near its boundary orders switch many times a second, and survival depends on every last bit


@pytest.fixture(scope="module")
def three(tmp_path_factory):
    folder = tmp_path_factory.mktemp("three")
    for name, text in THREE.items():
        (folder / name).write_text(text + "\n")
    return st.load(folder)


@pytest.mark.slow
@pytest.mark.parametrize("cycles", [12.75, 13.0, 13.125])
def test_critical_times_are_those_of_the_system_that_is_built(three, cycles):
    faults = [Contingency("2", trip="2-4"), Contingency("1"), Contingency("2", trip="2-3")]
    wanted = [Contingency(c.fault, f"{cycles}cyc", c.trip) for c in faults]
    found = place(three, wanted, costs=Costs(mw=300e3, site=1e6, mwh=100e3))
    point = three.with_storage(found.storage()).initialize()
    assert 0 < len(found.sites) < len(three.machines)
    times = [point.clearing_time(one, control=BangBang(), longest=0).cycles for one in faults]
    assert [row.critical_cycles for row in found.contingencies] == times
    assert min(times) >= cycles - 1e-9


@pytest.mark.slow
def test_another_search_repeats_critical_times_on_a_grid_with_the_required_one(three):
    """About an eighth of a cycle: 12.8 / 102."""
    wanted = Contingency("2", "12.8cyc", "2-4")
    found = place(three, [wanted])
    point, grid = three.with_storage(found.storage()).initialize(), 12.8 / round(12.8 / 0.125)
    again = point.clearing_time(wanted, control=BangBang(), longest=0, resolution=f"{grid!r}cyc")
    assert again.cycles == pytest.approx(found.contingencies[0].critical_cycles, rel=1e-12)
