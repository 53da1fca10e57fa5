"""Signals between devices: sums, elsewhere, loops, dead buses; devices of one's own in other processes."""

import pickle
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from systems import KINDS, OWN, PSS, ROUND, SEXS, registered, small

from stabctl import devices
from stabctl._util import jit
from stabctl.dynamics import operating_point
from stabctl.errors import EquilibriumError, StudyError
from stabctl.model.case import Branch, Bus, Load
from stabctl.simulation.events import LoadStep, Open, TripMachine
from stabctl.simulation.simulation import run

ECHO = '''"""ECHO: a stabilizer that reads its own output."""

from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl.devices.ports import At

NAME = "ECHO"
ROLE = "stabilizer"


class Par(NamedTuple):
    """Constants."""

    machine: Annotated[int, "-", "machine"]


class Input(NamedTuple):
    """Signals."""

    far: Annotated[float, "pu", "signal", At("Vs", "machine")]


class Output(NamedTuple):
    """Signal."""

    Vs: Annotated[float, "pu", "signal"]


@inline
def output(far):
    """The same again (pu)."""
    return Output(far)
'''


@pytest.fixture
def wide():
    """The wide-area stabilizer, registered."""
    with registered(OWN / "wide_area.py"):
        yield devices.every()["wide_area"].Par


def test_a_tripped_unit_has_no_field_voltage_and_no_power_even_where_these_are_set_points():
    point = operating_point.solve(small(KINDS["bare"]))
    a = run(point, [TripMachine(1, 0.1)], until=0.2).arrays
    assert (a.Pm[0, 0], a.Efd[0, 0]) != (0.0, 0.0)
    assert (a.Pm[-1, 0], a.Efd[-1, 0], a.P[-1, 0]) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("load", "step"), [(Load(2, 200.0, 0.0, q_power=1.0), {"q": 50.0}), (Load(2, 0.0, 0.0, p_power=1.0), {"p": 50.0})]
)
def test_a_load_of_zero_power_steps_too(load, step):
    point = operating_point.solve(small(KINDS["classical"], load=load))
    a = run(point, [LoadStep(2, 0.1, **step)], until=0.2).arrays
    assert np.abs(a.V[-1] - a.V[0]).max() > 1e-3


def test_the_stabilizing_signal_of_two_stabilizers_is_their_sum(wide):
    case = small({"genrou": ROUND, "sexs": SEXS, "pss": PSS, "wide_area": wide(2, 0, 0.5)})
    both = operating_point.solve(case).linearize(outputs="vs:1")
    assert abs(both.C[0, list(both.states).index("slow wide-area stabilizer 1")]) > 0.1  # measured 0.5 x slope


def test_a_sensor_at_a_dead_bus_gives_numbers(wide):
    case = small({"genrou": ROUND, "sexs": SEXS})
    case = replace(
        case,
        buses=(*case.buses, Bus(4, "pq")),
        branches=(*case.branches, Branch(3, 4, 0.0, 0.05)),
        devices={**case.devices, "wide_area": {1: wide(4, 0, 0.0, 1.0)}},
    )
    result = run(operating_point.solve(case), [Open("3-4", 0.1)], until=0.5)
    assert result.outcome.stable
    assert np.isfinite(result.rows).all()


def test_a_device_that_waits_for_its_own_output_is_an_error(tmp_path):
    file = tmp_path / "echo_pss.py"
    file.write_text(ECHO)
    with registered(file):
        case = small({"genrou": ROUND, "sexs": SEXS, "echo_pss": devices.every()["echo_pss"].Par(0)})
        with pytest.raises(EquilibriumError, match="algebraic loop"):
            operating_point.solve(case)


@pytest.mark.parametrize("kind", ["case", "point"])
def test_devices_of_ones_own_are_known_where_a_pickle_is_read(tmp_path, wide, kind):
    case = small({"genrou": ROUND, "sexs": SEXS, "wide_area": wide(2, 0, 0.5)})
    file = tmp_path / "pickled"
    file.write_bytes(pickle.dumps(case if kind == "case" else operating_point.solve(case)))
    code = (
        "import pickle; from stabctl import devices; "
        f"pickle.load(open({str(file)!r}, 'rb')); print(devices.every().keys())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "wide_area" in done.stdout


def test_a_device_file_that_breaks_leaves_the_one_registered_before(tmp_path):
    file = tmp_path / "echo_pss.py"
    file.write_text(ECHO)
    with registered(file):
        before = sys.modules["stabctl_device_echo_pss"]
        file.write_text("1 / 0")
        with pytest.raises(StudyError, match="ZeroDivisionError"):
            devices.register(file)
        assert sys.modules["stabctl_device_echo_pss"] is before is devices.every()["echo_pss"]


def test_machine_code_is_another_when_a_file_or_a_constant_beside_the_device_changes(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "beside.py").write_text("GAIN = 2.0\n\n\ndef twice(x):\n    return 2 * x\n")
    texts = []
    for line in ("from beside import twice\n", "from beside import GAIN\n"):
        file = tmp_path / "echo_pss.py"
        file.write_text(line + ECHO)
        for before, after in (
            (("2 * x", "3 * x"), ("3 * x", "2 * x")) if "twice" in line else (("2.0", "3.0"), ("3.0", "2.0"))
        ):
            helper = tmp_path / "beside.py"
            helper.write_text(helper.read_text().replace(before, after))
            sys.modules.pop("beside", None)
            with registered(file):
                texts.append(jit.digest(jit.sources(devices.every()["echo_pss"])))
    assert texts[0] != texts[1]
    assert texts[2] != texts[3]


def test_set_points_of_a_machine_without_controls_are_inputs_and_outputs():
    model = operating_point.solve(small(KINDS["bare"])).linearize(inputs="power:1,field:1", outputs="pm:1,efd:1")
    assert model.D.tolist() == [[1.0, 0.0], [0.0, 1.0]]
    assert not model.C.any()


def test_a_converter_has_outputs_and_no_speed():
    point = operating_point.solve(small(KINDS["converter"]))
    assert point.linearize(outputs="pe:1,qe:1,vt:1").C.shape[0] == 3
    assert point.linearize(outputs="speed").C.shape[0] == 1
    with pytest.raises(StudyError, match="without a rotor"):
        point.linearize(outputs="speed:1")
