"""Systems whose voltages need Newton's method at many stages: every recorded row solves the network."""

import numpy as np
import pytest
from hard import hard

import stabctl as st
from stabctl.dynamics import operating_point
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.simulation import run

FAULTS = {"wscc9": "8", "two_area, constant power": "8", "wnaps, constant power": "100"}
SYSTEMS = dict(hard())


def miss(traced, every):
    """Largest difference (pu) of the recorded voltages from those with the currents of all devices, in some rows."""
    point, starts, found = traced.point, np.array([c.at for c in traced.happened.changes]), []
    for k in range(0, len(traced.time) - 1, every):
        switching = traced.happened.changes[np.searchsorted(starts, traced.time[k] + 1e-9, "right") - 1].switching
        row = traced.rows[k, : point.layout.size].copy()
        V = np.linalg.solve(point.admittance(switching).toarray(), point.equations.at(row).currents)
        found.append(np.abs(V - traced.arrays.V[k]).max())
    return max(found)


@pytest.mark.parametrize("name", SYSTEMS)
def test_voltages_solve_the_network_at_every_instant(name):
    """After a fault of five cycles that opens nothing."""
    point = operating_point.solve(SYSTEMS[name])
    traced = run(point, Contingency(FAULTS.get(name, "16"), 5 / 60, at=0.1), 2.0)
    assert traced.newton_stages > 5
    assert miss(traced, 7) < 2e-7  # 1e-7 by fixed-point iteration


def test_they_do_where_orders_follow_the_accelerations_that_they_cause():
    """Orders and voltages are solved for together; the iteration fails at 1.19 s, before the voltages collapse."""
    point = st.load("wscc9").initialize(storage="50MW")
    traced = point.simulate(st.Contingency("8", clear="7.3cyc", trip="8-9"), 1.9, control=st.Feedback(1.0, 0.01))
    assert (traced.outcome.kind, traced.newton_stages > 100) == ("voltage_collapse", True)
    assert miss(traced, 1) < 2e-7  # 4e-8
