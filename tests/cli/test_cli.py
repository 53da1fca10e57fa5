"""The command line: what it prints."""

import csv
import json
from typing import get_args

import numpy as np
import pytest

from stabctl.controllers import Controller, Gate
from stabctl.io import load, write


def test_cases_lists_all_packaged_ones(stabctl):
    code, out, _ = stabctl("cases", "--json")
    sizes = {
        c["name"]: (c["machines"], c["buses"], c["branches"], c["loads"], c["links"]) for c in json.loads(out)["cases"]
    }
    assert code == 0
    assert sizes["two_area"] == (4, 11, 12, 2, 0)
    assert sizes["wnaps"] == sizes["wnaps_paper"] == (34, 122, 171, 19, 2)
    assert "ieee39" in stabctl("cases")[1]


def test_powerflow_json_balances(stabctl):
    code, out, err = stabctl("powerflow", "two_area", "--json")
    record = json.loads(out)
    assert (code, err) == (0, "")
    assert record["converged"] is True
    assert record["iterations"] == 3
    assert [b["bus"] for b in record["buses"]] == list(range(1, 12))
    assert set(record["buses"][0]) == {"bus", "v_pu", "angle_deg", "p_gen_mw", "q_gen_mvar"}
    assert 2734 < sum(b["p_gen_mw"] for b in record["buses"]) < 2734 * 1.05  # loads plus losses
    assert "1.03000" in stabctl("powerflow", "two_area")[1]
    lost = sum(k["p_from_mw"] + k["p_to_mw"] for k in record["branches"])
    made = sum(b["p_gen_mw"] for b in record["buses"])
    assert lost == pytest.approx(made - 2734, abs=1e-6)  # two_area has no shunt conductance
    assert f"branch losses: {lost:.1f} MW" in stabctl("powerflow", "two_area", "--branches")[1]


def test_scr_prints_buses_and_converters(stabctl, tmp_path):
    case = load("two_area").with_storage("50MW")
    write(case, tmp_path / "mine")
    record = json.loads(stabctl("scr", tmp_path / "mine", "--trip", "7-8", "--json")[1])
    ratio = case.short_circuit_ratio(trip="7-8")
    assert [b["short_circuit_mva"] for b in record["buses"]] == case.short_circuit(trip="7-8").mva.tolist()
    assert [c["escr"] for c in record["converters"]] == ratio.equivalent.tolist()
    assert record["wscr"] == ratio.weighted
    shown = stabctl("scr", tmp_path / "mine", "--trip", "7-8")[1]
    assert f"{ratio.equivalent[0]:.2f}" in shown
    assert "weighted short-circuit ratio" in " ".join(shown.split())
    assert json.loads(stabctl("scr", "two_area", "--json")[1])["converters"] == []


@pytest.mark.slow
def test_modes_lists_sensitivities(stabctl):
    found = load("two_area").modes().sensitivity()
    record = json.loads(stabctl("modes", "two_area", "--sensitivity", "--json")[1])["sensitivity"]
    assert [row["damping_ratio"] for row in record["rows"]] == pytest.approx([r.damping_ratio for r in found.rows])
    assert record["left_out"][0] == {"path": "sexs.1.TB", "reason": "0 s bypasses its block"}
    shown = stabctl("modes", "two_area", "--sensitivity")[1]
    assert f"{found.rows[19].damping_ratio:+.2e}" in shown
    assert " ".join(str(found).split()) in " ".join(shown.split())


def test_weak_grid_prints_the_boundary(stabctl, tmp_path):
    case = load("two_area").with_device("regc_c", 3)
    write(case, tmp_path / "mine")
    words = "weak-grid", tmp_path / "mine", "--converter", "3", "--scr", "0.5,1.2,2.4", "--gain", "1,8"
    record = json.loads(stabctl(*words, "--plot", tmp_path / "map.png", "--json")[1])
    found = case.weak_grid(3, scr=(0.5, 1.2, 2.4), gain=(1, 8))
    assert record["boundary"] == [1.2, None]
    assert [p["damping_ratio"] for p in record["points"]][2:] == found.damping_ratio.ravel()[2:].tolist()
    assert record["points"][0]["damping_ratio"] is None
    assert (tmp_path / "map.png").stat().st_size > 5000
    assert "none" in stabctl(*words)[1]
    assert "--scr 'x' is not allowed" in stabctl("weak-grid", tmp_path / "mine", "--converter", "3", "--scr", "x")[2]


@pytest.mark.parametrize(("storage", "outcome"), [((), "lost_synchronism"), (("--storage", "50MW"), "stable")])
def test_the_papers_main_result(stabctl, storage, outcome):
    code, out, err = stabctl("simulate", "two_area", "--fault", "7-8@0.4", "--clear", "21cyc", *storage, "--json")
    record = json.loads(out)
    assert code == 0
    assert "Traceback" not in err
    assert record["outcome"] == outcome
    keys = {"outcome", "message", "machine", "time_s", "max_angle_from_coi_deg", "steps", "wall_s"}
    assert keys <= set(record)
    assert (record["machine"] is None) == (outcome == "stable")


@pytest.mark.slow
def test_table_out_and_plot(stabctl, tmp_path):
    table, picture = tmp_path / "run.csv", tmp_path / "run.png"
    words = ("--fault", "7", "--trip", "7-8", "--clear", "8cyc", "--storage-at", "1=50MW,4@9=20MW", "--until", 2)
    code, out, _ = stabctl("simulate", "two_area", *words, "--out", table, "--plot", picture)
    assert code == 0
    assert "stable" in out
    assert picture.read_bytes().startswith(b"\x89PNG")
    rows = list(csv.reader(table.open()))
    assert rows[0][0] == "time_s"
    assert {"speed_pu:1", "angle_deg:4", "v_pu:11", "storage_mw:1@5", "storage_mw:4@9"} <= set(rows[0])
    times = [float(r[0]) for r in rows[1:]]
    assert times[0] == 0
    assert times[-1] == 2
    assert len(times) == 241  # a row per step, and the end
    ends = [float(r[rows[0].index("storage_mw:4@9")]) for r in rows[1:]]
    assert max(map(abs, ends)) == pytest.approx(20, rel=1e-9)


def test_netcdf_carries_units(stabctl, tmp_path):
    import xarray as xr

    path = tmp_path / "run.nc"
    assert stabctl("simulate", "two_area", "--until", 0.1, "--out", path)[0] == 0
    with xr.open_dataset(path, engine="scipy") as data:
        assert data.speed.dims == ("time", "machine")
        assert data.speed.attrs["units"] == "pu"
        assert data.voltage.sizes["bus"] == 11
        assert data.attrs["outcome"] == "stable"


def test_clearing_time_json(stabctl):
    words = ("two_area", "--fault", "7", "--trip", "7-8")
    record = json.loads(stabctl("clearing-time", *words, "--json")[1])
    assert record["status"] == "found"
    assert record["cycles"] == 9.0  # the reference reads about 9
    assert record["seconds"] == pytest.approx(9 / 60)
    assert [r["stable"] for r in record["runs"] if r["cycles"] == 9] == [True]
    assert not any(r["stable"] for r in record["runs"] if r["cycles"] > 9)
    assert record["wall_s"] > 0
    limited = json.loads(stabctl("clearing-time", *words, "--limit", "6cyc", "--json")[1])
    assert (limited["cycles"], limited["status"]) == (None, "stable_at_limit")


@pytest.mark.parametrize("at", ["1s", "66cyc"])
def test_a_clearing_time_beside_a_gate_is_that_of_single_runs(stabctl, tmp_path, at):
    gate = Gate(start=1.02, end=1.4)
    Controller("deviation", "order", [], [], [], 200 * np.eye(4), gate=gate).save(tmp_path / "gated.toml")
    words = "--fault", "7", "--at", at, "--storage", "50MW", "--controller", tmp_path / "gated.toml"
    search = "--resolution", "1cyc", "--scan", "0cyc", "--longest", "0s"
    found = json.loads(stabctl("clearing-time", "two_area", *words, *search, "--json")[1])
    longest = round(found["cycles"])
    runs = [outcome(stabctl, *words, "--until", "6.1s", "--clear", f"{k}cyc") for k in (longest, longest + 1)]
    assert [run["outcome"] for run in runs] == ["stable", "lost_synchronism"]


def outcome(stabctl, *words):
    code, out, err = stabctl("simulate", "two_area", *words, "--json")
    assert code == 0, err
    record = json.loads(out)
    record.pop("wall_s")
    return record


def test_events_without_a_fault(stabctl, cases):
    from stabctl.simulation.simulate import simulate

    words = "--open", "7-8@1s", "--load-step", "7:+50MW@90cyc", "--load-step", "9:-50MW@2s", "--until", "3s"
    told = outcome(stabctl, *words)
    ran = simulate(cases("two_area"), ["7-8@1s", "7:+50MW@1.5s", "9:-50MW@2s"], 3.0)
    assert told["outcome"] == "stable"
    assert told["max_angle_from_coi_deg"] == ran.max_angle_from_coi_deg
    tripped = outcome(stabctl, "--trip-machine", "2@1s", "--fault", "7", "--trip", "7-8", "--clear", "6cyc")
    assert tripped["outcome"] != "stable"


def test_quantities_are_numbers_or_text(stabctl):
    words = "--fault", "7", "--trip", "7-8", "--clear", "10cyc", "--storage", "50MW"
    names = "--at", "--until", "--step", "--deadband", "--lag", "--max-angle"
    plain, text = (
        [word for pair in zip(names, values.split(), strict=True) for word in pair]
        for values in ("0.5 2 0.005 0.1 0.05 3.5", "30cyc 2s 5ms 100mHz 50ms 3.5rad")
    )
    assert outcome(stabctl, *words, *plain) == outcome(stabctl, *words, *text)
    degrees = outcome(stabctl, "--fault", "7", "--clear", "20cyc", "--max-angle", "120deg")
    assert "moved 120 degrees" in degrees["message"]


def test_settings_change_the_case(stabctl):
    words = "--set", "loads.7.p=1000", "--set", "loads.9.p=1.7GW", "--json"
    record = json.loads(stabctl("powerflow", "two_area", *words)[1])
    made = sum(b["p_gen_mw"] for b in record["buses"])
    lost = sum(k["p_from_mw"] + k["p_to_mw"] for k in record["branches"])
    assert made - lost == pytest.approx(2700, abs=1e-6)
    words = "clearing-time", "two_area", "--fault", "7", "--trip", "7-8", "--set", "genrou.4.H=5", "--json"
    assert json.loads(stabctl(*words)[1])["cycles"] == 9.375  # 9 without


def test_other_events_of_a_clearing_time_count_from_the_fault(stabctl):
    words = "clearing-time", "two_area", "--fault", "7", "--trip", "7-8", "--json"
    found = json.loads(stabctl(*words, "--longest", "0", "--trip-machine", "1@0s")[1])  # later machine 2 is lost anyway
    assert found["cycles"] == 4.375


def test_unusual_values_are_one_line_that_says_how_to_see_them(stabctl, tmp_path):
    """Packaged cases are silent; machines that are replaced have no unusual values."""
    assert stabctl("powerflow", "ieee39", "--verbose")[2] == ""
    words = "two_area", "--set", "genrou.1.H=1500", "--set", "genrou.2.T1d=7000", "--loads", "power"
    line = stabctl("powerflow", *words)[2]
    assert line == f"stabctl: 2 unusual values: stabctl check {' '.join(words)}\n"
    found = stabctl(*line.split("stabctl ")[1].split())[1].splitlines()
    assert found[0] == "two_area: 2 unusual values."
    every = stabctl("powerflow", *words, "--verbose")[2].splitlines()
    assert every == [f"stabctl: {sentence}" for sentence in found[1:]]
    assert stabctl("powerflow", *words[:3], "--classical")[2].count("genrou") == 1  # in the command only
    write(load("two_area").set("genrou.1.H", 1500), tmp_path / "mine")
    assert (
        stabctl("powerflow", tmp_path / "mine")[2] == f"stabctl: 1 unusual value: stabctl check {tmp_path / 'mine'}\n"
    )


def test_unusual_values_as_json(stabctl):
    code, out, err = stabctl("check", "two_area", "--set", "genrou.1.H=1500", "--json")
    (found,) = json.loads(out)["unusual"]
    assert (code, err) == (0, "")
    assert (found["table"], found["object"], found["quantity"], found["value"]) == ("genrou", "machine 1", "H", 1500)
    assert json.loads(stabctl("check", "two_area", "--json")[1]) == {"case": "two_area", "unusual": []}


def test_classical_machines_everywhere(stabctl):
    words = ("two_area", "--classical", "--fault", "7", "--trip", "7-8", "--json")
    assert json.loads(stabctl("simulate", *words, "--clear", "3cyc")[1])["outcome"] == "stable"
    assert json.loads(stabctl("clearing-time", *words)[1])["status"] == "found"
    assert json.loads(stabctl("powerflow", "two_area", "--classical", "--json")[1])["converged"]


def test_version(stabctl):
    from importlib.metadata import version

    assert stabctl("--version") == (0, f"stabctl {version('stabctl')}\n", "")


def test_help_names_every_command(stabctl):
    code, out, _ = stabctl("--help")
    assert code == 0
    assert all(name in out for name in ("cases", "powerflow", "simulate", "clearing-time"))


def test_a_short_time_step_names_its_cause(stabctl):
    code, out, _ = stabctl("simulate", "two_area", "--until", "0.01", "--set", "genrou.3.T2d=2e-5")
    step = load("two_area").set("genrou.3.T2d", 2e-5).simulate(until=0.01).step
    assert code == 0
    assert f"short time step {1000 * step:.3g} ms " in " ".join(out.split())
    assert "T2d = 2e-05 s of genrou" in out
    assert "short time step" not in stabctl("simulate", "two_area", "--until", "0.01")[1]


def test_every_value_that_is_read_in_its_own_way_has_a_name_in_the_help():
    from stabctl.cli import options

    read = {
        name: option
        for name, alias in vars(options).items()
        for option in get_args(alias)[1:]
        if getattr(option, "parser", None)
    }
    assert {"Observe"} <= read.keys()
    assert not [name for name, option in read.items() if not option.metavar]


@pytest.mark.slow
def test_design_tune_says_its_numbers(stabctl, tmp_path):
    """The JSON has the clearing times of every check, the worst network, and every parameter."""
    record = tmp_path / "k.dyr"
    given = ("two_area_thyristor", "--model", "ieeest", "--starts", "1", "--gains", "none", "--check-levels", "none")
    code, out, err = stabctl("design", "tune", *given, "--checks", "1", "--dyr-out", str(record), "--json")
    assert code == 0, err
    found = json.loads(out)
    (cycles,) = found["clearing_cycles"].values()
    assert set(cycles) == {"replaced", "before", "after"}
    assert cycles["replaced"] is None
    assert 0 < cycles["before"] < cycles["after"]
    assert found["worst"]["damping"] > 0.2
    assert len(found["parameters"]) == 4 * 5
    assert len(found["robustness"]) == 5
    assert record.read_text().count("'IEEEST'") == 4
    assert found["files"] == [str(record)]
