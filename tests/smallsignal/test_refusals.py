"""What linear models and modes refuse, and what they leave on the disk."""

import pytest
from click.testing import CliRunner

import stabctl as st
from stabctl.cli import app


@pytest.fixture(scope="module")
def base():
    return st.load("two_area").initialize()


def test_a_model_without_inputs_or_outputs_is_none_for_python_control(base):
    with pytest.raises(st.StabctlError, match="The linear model of two_area has no outputs"):
        base.linearize("vref:2").to_control()
    with pytest.raises(st.StabctlError, match="The linear model of two_area has no inputs"):
        base.linearize(outputs="speed:2").to_control()


@pytest.mark.parametrize("k", [99, -57, "a", 1.5, None])
def test_a_mode_that_is_none(base, k):
    with pytest.raises(st.StabctlError, match=r"There is no mode .*; give a number from 0 to 55"):
        base.modes().mode(k)


def test_a_model_is_written_whole_or_not_at_all(base, tmp_path):
    model = base.linearize("vref:2", "speed:2")
    with pytest.raises(st.StabctlError, match=r"There is no folder .*nowhere.*; create it first"):
        model.save(tmp_path / "nowhere" / "model.npz")
    for name in ("model.npz", "model.mat"):
        assert model.save(tmp_path / name).stat().st_size > 1000
    assert sorted(p.name for p in tmp_path.iterdir()) == ["model.mat", "model.npz"]


def test_short_help():
    found = CliRunner().invoke(app, ["simulate", "-h"])
    assert found.exit_code == 0
    assert "--fault" in found.output
