"""Shunts and stores of the user's, from files outside the package."""

from pathlib import Path

import numpy as np
import pytest
from systems import registered

import stabctl as st
from stabctl._util.errors import EquilibriumError, StudyError

FAULT = st.Contingency("7-8@0.4", clear="6cyc")

SUSCEPTANCE = Path(__file__).parents[1] / "recordings" / "given" / "susceptance.py"

STORE = '''
"""Store that draws a conductance as ordered."""

from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl.devices.ports import fixed

NAME = "STORE"
ROLE = "storage"


class Par(NamedTuple):
    G: Annotated[float, "pu", "conductance at full order"]


class Input(NamedTuple):
    order: Annotated[float, "-", "share of the conductance", fixed(0.0)]


class Output(NamedTuple):
    P: Annotated[float, "pu", "power"]


@inline
def current(u, v, p):
    return -p.G * u.order * v[0], -p.G * u.order * v[1]


@inline
def output(u, v, p):
    return Output(p.G * u.order * (v[0] * v[0] + v[1] * v[1]))
'''


def written(folder: Path, name: str, text: str) -> Path:
    path = folder / f"{name}.py"
    path.write_text(text)
    return path


@pytest.fixture
def shunted():
    with registered(SUSCEPTANCE):
        yield st.load("two_area")


def test_a_shunt_starts_at_rest_without_current_and_supports_its_bus(shunted):
    plain = shunted.initialize()
    base = shunted.with_device("susceptance", 8, K=20, T="20ms").initialize()
    place = next(k for k, p in enumerate(base.layout.states) if p.name == "b")
    assert base.s[place] == pytest.approx(0, abs=1e-9)
    assert np.abs(base.equations.at(base.s.copy()).rates).max() < 1e-9
    reference = next(k for k, p in enumerate(base.layout.setpoints) if p.name == "Vref" and p.unit < 0)
    bus = base.net.place[8]
    assert base.s[base.layout.first_setpoint + reference] == pytest.approx(abs(base.V[bus]), abs=1e-9)
    runs = [point.simulate(FAULT, until=2.0) for point in (plain, base)]
    without, held = (np.abs(run.arrays.V[run.time > 0.2, bus]).min() for run in runs)
    assert held > without + 0.02  # pu; measured 0.05


def test_its_susceptance_is_a_state_of_the_linear_model(shunted):
    found = shunted.with_device("susceptance", 8, K=20, T="20ms").linearize()
    assert "b susceptance 8" in found.states


def test_a_shunt_that_draws_current_initially_is_refused_by_name(shunted):
    says = "susceptance of bus 8 of two_area has no equilibrium with zero current after"
    with pytest.raises(EquilibriumError, match=says):
        shunted.with_device("susceptance", 8, K=0, T="20ms", offset=0.3).initialize()


def test_a_store_that_draws_current_at_rest_is_refused_also_beside_loads(tmp_path):
    with registered(written(tmp_path, "store", STORE.replace("p.G * u.order", "p.G * (u.order + 1.0)"))):
        case = st.load("two_area").with_device("store", 2, G=0.5)
        assert len(case.loads) == 2
        with pytest.raises(EquilibriumError, match=r"STORE of machine 2 at bus 2 draws 0\.505 pu of current at the"):
            case.initialize()


def test_a_store_at_a_machine_draws_what_its_order_says(tmp_path):
    with registered(written(tmp_path, "store", STORE)):
        base = st.load("two_area").with_device("store", 1, G=0.5).initialize()
        f = base.system.family("store")
        s = base.s.copy()
        s[f.w[0, -2]] = 1.0
        change = base.equations.at(s).currents - base.equations.at(base.s.copy()).currents
        expected = np.zeros(len(change), complex)
        expected[base.system.unit_bus[0]] = -0.5 * base.V[base.system.unit_bus[0]]
        assert change == pytest.approx(expected, abs=1e-12)


LOAD = """
from typing import Annotated, NamedTuple
from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE

NAME = "CONSTANT"
ROLE = "load"

class Par(NamedTuple):
    P0: Annotated[float, "pu", "active power", FROM_CASE]
    Q0: Annotated[float, "pu", "reactive power", FROM_CASE]
    V0: Annotated[float, "pu", "voltage", FROM_CASE]
    part: Annotated[float, "-", "part that it draws"] = 1.0

@inline
def current(v, p):
    g, b = p.part * p.P0 / p.V0**2, p.part * p.Q0 / p.V0**2
    return -(g * v[0] + b * v[1]), b * v[0] - g * v[1]
"""


def test_a_load_that_does_not_draw_its_power_of_the_power_flow_is_refused_by_name(tmp_path):
    """One that draws it moves nothing: without events every signal stays as it is."""
    with registered(written(tmp_path, "constant", LOAD)):
        case = st.load("two_area")
        run = case.with_device("constant", 7).initialize().simulate(until="2s")
        assert np.abs(run.arrays.speed - 1).max() < 1e-9
        for part, MW in ((1.1, "1063.7"), (-1.0, "-967")):
            says = f"With the model CONSTANT, the loads at bus 7 of two_area draw {MW} MW and .* instead of 967 MW"
            with pytest.raises(EquilibriumError, match=says):
                case.with_device("constant", 7, part=part).initialize()


def test_a_parameter_may_have_any_name(tmp_path):
    """Also one that an argument of `with_device` has."""
    for name in ("at", "model", "case"):
        with registered(written(tmp_path, f"load_{name}", LOAD.replace("part", name))):
            assert (
                st.load("two_area").with_device(f"load_{name}", 7, **{name: 0.9}).devices[f"load_{name}"][7][-1] == 0.9
            )


def test_a_link_model_of_ones_own_is_refused(tmp_path):
    path = written(tmp_path, "my_link", STORE.replace('"storage"', '"link"'))
    with pytest.raises(StudyError, match=r"my_link\.py: a link model of your own is not supported"):
        st.register(path)


def test_a_device_without_states_may_have_several_outputs_that_share_a_set_point(tmp_path):
    """Its group in the initialization has outputs but no eigenvalue."""
    text = STORE.replace("fixed(0.0)", "PORT").replace("import fixed", "import PORT").replace("STORE", "PAIR")
    text = text.replace('ROLE = "storage"', 'ROLE = "shunt"')
    text = text.replace('"power"]\n', '"power"]\n    share: Annotated[float, "-", "its order"]\n')
    text = text.replace("(v[0] * v[0] + v[1] * v[1]))", "(v[0] * v[0] + v[1] * v[1]), u.order)")
    with registered(written(tmp_path, "pair", text)):
        case = st.load("two_area")
        base = case.with_device("pair", 8, G=0.5).initialize()
        f = base.system.family("pair")
        assert base.s[f.w[0, -2]] == pytest.approx(0, abs=1e-9)
        assert base.fastest == pytest.approx(case.initialize().fastest, rel=1e-12)
