"""Current commands of a converter are inputs of linear models."""

import numpy as np
import pytest
from systems import REGC, small

from stabctl import io
from stabctl._util.errors import StudyError
from stabctl.dynamics import operating_point
from stabctl.smallsignal import linearize


@pytest.mark.parametrize("name", ["ipcmd", "iqcmd"])
def test_a_current_command_drives_the_lag_of_its_regulator(name):
    point = operating_point.solve(small({"regc_a": REGC}))
    model = linearize(point, f"{name}:1", "voltage:1")
    assert np.abs(model.B[:, 0]).max() == pytest.approx(1 / REGC.Tg)
    assert (model.B[:, 0] != 0).sum() == 1
    assert linearize(point, name, "voltage:1").inputs == model.inputs
    assert "current REGC_A 1" in model.inputs[0]


def test_a_machine_has_no_current_command():
    with pytest.raises(StudyError, match="Unit 2 of two_area is not a converter"):
        linearize(operating_point.solve(io.load("two_area")), "ipcmd:2", "speed:2")
