"""Traces of other programs beside ours: each has its files and limits, and one that moves is told."""

import numpy as np
import pytest

from stabctl.simulation.channels import QUANTITIES
from stabctl.verification import traces, verify
from stabctl.verification.systems import systems

WITH = {name: system for name, system in systems().items() if system.run}


def test_every_file_has_a_system_with_a_limit_for_each_signal():
    assert {path.stem for path in traces.FOLDER.glob("*.csv")} == set(WITH)
    known = {quantity.column for quantity in QUANTITIES.values()}
    for name, system in WITH.items():
        columns = traces.read(name)
        time = columns.pop("time_s")
        assert 100 < len(time) < 250
        assert np.all(np.diff(time) > 0)
        kinds = {column.partition(":")[0] for column in columns}
        assert kinds <= known
        assert kinds == set(system.tolerance) & kinds
    assert sum(len(traces.read(name)) - 1 for name in WITH) >= 70  # 74


def test_a_trace_is_as_far_as_its_farthest_instant():
    one = traces.Trace("angle_deg:1", np.arange(3.0), np.array([0.0, 1, 2]), np.array([0.0, 1.5, 1.9]))
    assert one.worst == 1
    assert one.unit == "degrees"


def test_a_trace_that_moves_is_outside(monkeypatch):
    """The classical machine of OpenIPSL; its angle is within 0.01 degrees over ten seconds."""
    found = verify("openipsl_gencls")
    assert not found.outside
    assert {row.quantity for row in found.rows} == {"trace"}
    theirs = dict(traces.read("openipsl_gencls"))
    k = int(np.argmin(np.abs(theirs["time_s"] - 5)))
    theirs["angle_deg:1/1"] = theirs["angle_deg:1/1"] + 0.1 * (np.arange(len(theirs["time_s"])) == k)
    monkeypatch.setattr(traces, "read", lambda name: theirs)
    (moved,) = verify("openipsl_gencls").outside
    assert moved.object == f"angle_deg:1/1 at {theirs['time_s'][k]:.2f} s"
    assert moved.difference == pytest.approx(0.1, abs=0.015)
