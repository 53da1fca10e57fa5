"""Ports: devices that fill them in place of a set-point."""

from dataclasses import replace

import numpy as np
import pytest
from systems import KINDS, registered, small

from stabctl._util.errors import EquilibriumError
from stabctl.dynamics import operating_point
from stabctl.simulation.events import LoadStep
from stabctl.simulation.simulation import run

STEP = [LoadStep(2, 0.1, 20.0)]
WITH_PSS = KINDS["sexs, pss, steam"]
FILLS_VREF = '''
"""Sets the voltage reference of its unit: reactive droop."""
from typing import Annotated, NamedTuple
from stabctl._util.jit import inline
from stabctl.devices.ports import PORT

NAME = "droop"
ROLE = "stabilizer"


class Par(NamedTuple):
    """Constants."""

    K: Annotated[float, "pu", "droop"]


class Input(NamedTuple):
    """Signals."""

    V0: Annotated[float, "pu", "voltage at no reactive power", PORT]
    Q: Annotated[float, "pu", "reactive power"]


class Output(NamedTuple):
    """Signal."""

    Vref: Annotated[float, "pu", "voltage reference"]


@inline
def output(u, p):
    """Voltage reference (pu)."""
    return Output(u.V0 - p.K * u.Q)
'''


@pytest.fixture
def droop(tmp_path):
    path = tmp_path / "droop.py"
    path.write_text(FILLS_VREF)
    with registered(path) as (device,):
        yield device


def test_a_device_that_fills_a_port_takes_the_place_of_its_set_point(droop):
    point = operating_point.solve(small({**WITH_PSS, "droop": droop.Par(0.05)}))
    plain = operating_point.solve(small(WITH_PSS))
    assert point.layout.setpoint(0, "Vref") is None
    Q = point.s[point.layout.signals[0, "Q"]]
    V0 = point.s[point.layout.setpoint(0, "V0")]
    vref = plain.s[plain.layout.setpoint(0, "Vref")]
    assert abs(Q) > 0.05
    assert V0 - 0.05 * Q == pytest.approx(vref, abs=1e-12)
    a, b = (run(p, [LoadStep(2, 0.1, 0.0, 50.0)], 5.0).arrays.V[-1, 0] for p in (point, plain))
    assert abs(a) < abs(b) - 1e-4


def test_without_effect_it_changes_nothing(droop):
    both = WITH_PSS, {**WITH_PSS, "droop": droop.Par(0.0)}
    a, b = (run(operating_point.solve(small(models)), STEP, 2.0) for models in both)
    assert np.abs(a.arrays.speed - b.arrays.speed).max() < 1e-12


def test_two_that_fill_one_port_are_refused(droop):
    case = small({**WITH_PSS, "droop": droop.Par(0.05)})
    case = replace(case, devices={**case.devices, "droop": {1: droop.Par(0.05), "1#2": droop.Par(0.05)}})
    with pytest.raises(
        EquilibriumError, match="droop and droop both provide Vref of machine 1 at bus 1 in small; keep"
    ):
        operating_point.solve(case)


def test_a_signal_that_nobody_gives_is_named(droop, tmp_path):
    path = tmp_path / "hungry.py"
    path.write_text(FILLS_VREF.replace("Q:", "gas:").replace("u.Q", "u.gas").replace('"droop"', '"hungry"'))
    with registered(path) as (device,), pytest.raises(EquilibriumError) as caught:
        operating_point.solve(small({**WITH_PSS, "hungry": device.Par(0.1)}))
    says = "hungry of machine 1 at bus 1 in small reads gas, which no device of its unit provides; use another model."
    assert str(caught.value) == says
