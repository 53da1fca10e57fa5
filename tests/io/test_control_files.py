"""Controllers as files, and on the command line."""

import json

import control
import numpy as np
import pytest

import stabctl as st
from stabctl._util.errors import StudyError

S = control.tf("s")


def made(**more):
    gain = control.ss(40 * 3 * S / (1 + 3 * S) / (1 + 0.05 * S))
    return st.Controller.from_control(gain, "deviation:1", "order:1@5", name="pod", **more)


@pytest.mark.parametrize(
    "more",
    [
        {},
        {"rate": 60, "delay": "100ms", "limits": (-0.5, 1), "deadband": 0.01, "ramp": 2.0},
        {"tracking": "1s", "gate": st.Gate("voltage:7", low=0.8, end=5.0)},
        {"rate": 60, "relay": True, "limits": 1},
    ],
)
def test_a_file_gives_back_the_controller(tmp_path, more):
    one = made(**more)
    two = st.load_controller(one.save(tmp_path / "pod.toml"))
    for key, value in vars(one).items():
        assert np.array_equal(getattr(two, key), value), key


def test_a_static_gain_has_empty_matrices(tmp_path):
    one = st.Controller.from_control(control.ss([], [], [], [[2.0, 3.0]]), "speed:1, speed:2", "vs:1")
    two = st.load_controller(one.save(tmp_path / "k.toml"))
    assert two.B.shape == (0, 2)
    assert two.D.tolist() == [[2.0, 3.0]]


def test_a_static_gain_of_kinds_acts_on_all_their_signals(tmp_path):
    one = st.Controller("speed", "vs", [], [], [], 20 * np.eye(4))
    two = st.load_controller(one.save(tmp_path / "k.toml"))
    assert one.B.shape == two.B.shape == (0, 4)
    assert one.C.shape == two.C.shape == (4, 0)
    assert st.load("two_area_thyristor").closed_loop(two).controllers == (two,)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("rate = 60", 'rate = "fast"'), "rate = 'fast': it must be a number of frames"),
        (("rate = 60", "speed = 60"), "'speed' is not a known key"),
        (('inputs = ["deviation:1"]', ""), "inputs is missing"),
        (("D = [[0.0]]", "D = [[0.0], [1.0, 2.0]]"), "matrix D differ in length"),
        (("B = [[1.0], [0.0]]", "B = [[1.0]]"), "The matrix B of the controller is 1 x 1, but must be 2 x 1"),
        (("D = [[0.0]]", "D = [[nan]]"), "not finite"),
        (("rate = 60", "rate = 0"), "rate of 0 frames"),
        (("[", "]"), "is not valid TOML"),
        (("D = [[0.0]]", "D = [[0.0]]\n[gate]\nlowest = 0.8"), "'lowest' is not a known key; did you mean 'low'"),
        (("D = [[0.0]]", "D = [[0.0]]\n[gate]\nmagnitude = 1"), "magnitude = 1 is not allowed; give true or false"),
    ],
)
def test_mistakes_in_a_file(tmp_path, change, says):
    path = made().save(tmp_path / "pod.toml")
    path.write_text(("rate = 60\n" + path.read_text()).replace(*change))
    with pytest.raises(StudyError, match=says) as caught:
        st.load_controller(path)
    assert "pod.toml" in str(caught.value)


def test_a_python_function_cannot_be_saved(tmp_path):
    with pytest.raises(StudyError, match="is a Python function"):
        st.Controller.from_function(lambda seen: 0.0, "speed:1", "vs:1").save(tmp_path / "law.toml")


def test_commands_take_controllers(stabctl, tmp_path):
    path = str(made(rate=60, delay="100ms").save(tmp_path / "pod.toml"))
    case = ["two_area_thyristor", "--storage", "50MW", "--controller", path, "--json"]
    worst = [json.loads(stabctl("modes", *part)[1]) for part in (case, [*case[:3], "--json"])]
    ratios = [min(m["damping_ratio"] for m in found["modes"] if m["electromechanical"]) for found in worst]
    assert ratios[0] > ratios[1] + 3e-3
    fault = ["--fault", "7-8@0.4"]
    found = json.loads(stabctl("clearing-time", *case, *fault, "--resolution", "1cyc")[1])
    base = st.load("two_area_thyristor").initialize(storage="50MW")
    own = base.clearing_time(st.Contingency("7-8@0.4"), control=st.load_controller(path), resolution="1cyc")
    assert found["cycles"] == own.cycles
    assert json.loads(stabctl("simulate", *case, *fault, "--clear", "6cyc")[1])["stable"]
