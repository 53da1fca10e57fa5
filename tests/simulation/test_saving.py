"""Trajectories: what they hold, how they print, and the files they are written to."""

import numpy as np
import pytest

from stabctl._util.errors import StudyError
from stabctl.controllers import BangBang
from stabctl.dynamics import operating_point
from stabctl.model.tables import Storage
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.simulation import run


@pytest.fixture(scope="module")
def traced(cases):
    case = cases("two_area").with_storage([Storage(1, 5, 50.0), Storage(2, 6, 20.0)])
    return run(operating_point.solve(case), Contingency("7", 0.1, ["7-8"], at=0.1), 0.5, control=BangBang())


class TestTrajectory:
    def test_is_immutable(self, traced):
        with pytest.raises(ValueError, match="read-only"):
            traced.rows[0, 0] = 1
        with pytest.raises(AttributeError):
            traced.outcome = None

    def test_tables_and_files_hold_the_same(self, traced, tmp_path):
        import pandas as pd
        import xarray as xr

        frame = traced.df
        assert list(frame.columns) == [
            "time_s",
            *(f"speed_pu:{m}" for m in (1, 2, 3, 4)),
            *(f"angle_deg:{m}" for m in (1, 2, 3, 4)),
            *(f"efd_pu:{m}" for m in (1, 2, 3, 4)),
            *(f"v_pu:{b}" for b in range(1, 12)),
            "storage_mw:1@5",
            "storage_mw:2@6",
        ]
        assert len(frame) == traced.steps + 1
        again = pd.read_csv(traced.save(tmp_path / "run.csv"))
        assert np.abs(again.to_numpy() - frame.to_numpy()).max() < 1e-12
        assert list(traced.table("voltage:8,storage_energy,speed:2")) == [
            *("time_s", "v_pu:8", "storage_mwh:1@5", "storage_mwh:2@6", "speed_pu:2")
        ]
        for wrong, said in (("torque", "not a quantity"), ("voltage:99", "no bus 99"), (",", "No channel is named")):
            with pytest.raises(StudyError, match=said):
                traced.save(tmp_path / "wrong.csv", channels=wrong)
        assert not (tmp_path / "wrong.csv").exists()
        data = traced.dataset
        assert data["speed"].dims == ("time", "machine")
        assert data["voltage"].dims == ("time", "bus")
        assert {v.attrs["units"] for v in data.data_vars.values()} == {"pu", "rad", "MW", "MWh", "1"}
        with xr.open_dataset(traced.save(tmp_path / "run.nc"), engine="scipy") as stored:
            assert np.array_equal(stored["speed"], traced.arrays.speed)
            assert stored.attrs["outcome"] == "stable"
        relative = pd.read_csv(traced.save(tmp_path / "relative.csv", channels="angle,speed:1", angle_reference=3))
        own, third = traced.table("angle"), frame["angle_deg:3"]
        for m in (1, 2, 3, 4):
            assert np.abs(relative[f"angle_deg:{m}"] - own[f"angle_deg:{m}"] + third).max() < 1e-9
        assert not relative["angle_deg:3"].any()
        assert list(relative)[-1] == "speed_pu:1"
        for given in ({"channels": "angle"}, {"angle_reference": 3}):
            with pytest.raises(StudyError, match=r"belong to a \.csv file"):
                traced.save(tmp_path / "wrong.nc", **given)
        with pytest.raises(StudyError, match=r"must end in \.csv or \.nc"):
            traced.save(tmp_path / "run.mat")

    def test_prints_itself_in_a_sentence(self, traced):
        assert str(traced).startswith("two_area: All machines stayed in synchronism until 0.500 s; frequency 60.00 ")
        assert traced._repr_html_() == f"<p>{traced}</p>"
