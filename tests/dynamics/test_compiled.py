"""One compilation serves every case and option, and plain Python gives the same."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import stabctl
from stabctl import io
from stabctl.controllers import BangBang, Feedback
from stabctl.dynamics import operating_point, perform
from stabctl.model.network import UNSWITCHED
from stabctl.model.tables import Storage
from stabctl.simulation import simulation, stepper
from stabctl.simulation.events import Clear, Fault, TripMachine
from stabctl.simulation.topology import stage
from stabctl.simulation.wired import wired

PACKAGE = Path(stabctl.__file__).parent


def everything(case):
    """A run of the case that meets every kind of table: with and without storage, law, record, trip."""
    number, bus = case.machines[0].machine, case.machines[0].storage_bus
    events = [Fault(str(bus), 0.01), Clear(str(bus), 0.02), TripMachine(number, 0.03)]
    for rows in ([], [Storage(number, bus, 10.0, "conductance", energy=1.0, lag=0.05, ramp=100.0)]):
        point = operating_point.solve(case.with_storage(rows))
        for control, record in ((None, True), (BangBang(), False), (Feedback(1.0), True)) if rows else ((None, True),):
            simulation.run(point, events, 0.05, control=control, record=record)


@pytest.mark.slow
def test_every_case_and_option_runs_on_one_compilation():
    for name in io.packaged():
        everything(io.load(name))
        everything(io.load(name).classical())
    assert len(stepper.advance.signatures()) == 1
    assert len(perform.evaluate.signatures()) == 1


def arrays(record):
    """Name and array of every array in a record and the records in it."""
    for name, part in record._asdict().items():
        if isinstance(part, np.ndarray):
            yield name, part
        elif hasattr(part, "_asdict"):
            yield from arrays(part)


@pytest.mark.parametrize("control", [None, BangBang()])
def test_tables_for_compiled_code_are_contiguous_and_writeable(points, control):
    """Others are another type to numba, and would be compiled for anew."""
    case = points("wnaps").case
    point = operating_point.solve(case.with_storage([Storage(1, case.machines[0].storage_bus, 10.0)]))
    made = wired(point, control)
    for record in (made.program, made.places, stage(point, UNSWITCHED).net, point.equations.program):
        for name, array in arrays(record):
            assert array.flags.c_contiguous, name
            assert array.flags.writeable, name


PLAIN = """
import sys
import numpy as np
import stabctl as st
case = st.load("two_area").with_storage([st.Storage(1, 5, 50.0)])
case = case.classical() if sys.argv[2] == "True" else case
result = case.simulate(st.Contingency("7-8", 0.05, at=0.05), 0.3, control=st.BangBang(0.01))
np.save(sys.argv[1], result.rows)
"""


@pytest.mark.slow
@pytest.mark.parametrize("classical", [False, True])
def test_plain_python_gives_the_same_and_meets_no_index_out_of_range(tmp_path, classical):
    """To the last bit with classical machines; NumPy's exp, log and arctan2 round otherwise than the C library's."""
    rows = []
    for disable in ("0", "1"):
        where, out = os.environ | {"NUMBA_DISABLE_JIT": disable}, tmp_path / f"{disable}.npy"
        subprocess.run([sys.executable, "-c", PLAIN, out, str(classical)], check=True, env=where)
        rows.append(np.load(out))
    assert np.abs(rows[0] - rows[1]).max() <= (0 if classical else 1e-10)  # 5.5e-13
