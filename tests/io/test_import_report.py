"""The import report says what is represented of a file, and whether the system starts in steady state."""

import json

import pytest
from psse_replay import DATA

import stabctl as st

THREE = DATA / "psid/GENROU/ThreeBusMulti.raw"
KEYS = [
    "conventions",
    "records",
    "supported",
    "complete",
    "unsupported",
    "corrections",
    "idle",
    "unusual",
    "mismatch_mw",
    "mismatch_mvar",
    "mismatch_bus",
]
KEYS += ["dv_pu", "dangle_deg", "dxdt", "violations", "drift_pu"]
GENROU = "102 'GENROU' 1 8.0 0.03 0.4 0.05 6.175 0.05 1.8 1.7 0.3 0.55 0.25 0.2 0.1 0.8 /\n"
GOVERNED = f"101 'GENCLS' 1 0.0 0.0 /\n{GENROU}102 'SEXS' 1 0.1 10 100 0.0005 -5 5 /\n"
FACTS = "0 /End of Owner data, Begin FACTS device data\n", "0 /End of Owner data\n'F1',103,0,1\n"


@pytest.fixture
def files(tmp_path):
    """Writes x.raw and x.dyr."""

    def write(dyr, *changes):
        text = THREE.read_text()
        for old, new in changes:
            assert old in text
            text = text.replace(old, new, 1)
        (tmp_path / "x.raw").write_text(text)
        (tmp_path / "x.dyr").write_text(dyr)
        return tmp_path / "x.raw"

    return write


def line_of(path, start):
    return next(k for k, text in enumerate(path.read_text().split("\n"), 1) if text.strip().startswith(start))


def test_a_whole_system_stands_still(files, stabctl):
    raw = files(GOVERNED)
    code, out, err = stabctl("import", raw, "--json")
    found = json.loads(out)
    assert (code, err) == (0, "")
    assert list(found) == KEYS
    assert (found["records"], found["supported"], found["complete"]) == (3, 3, True)
    assert found["unsupported"] == found["violations"] == []
    assert found["corrections"] == [
        f"{raw.with_suffix('.dyr')} line 3, SEXS of 102/1: TA = 0.0005 s is below 1 ms, where a lag is bypassed."
    ]
    assert found["mismatch_mw"] < 0.0014  # 0.00137
    assert found["mismatch_bus"] == 102
    assert found["dv_pu"] < 3e-7  # 2.4e-7
    assert found["dangle_deg"] < 5e-5  # 4.8e-5
    assert found["dxdt"] < 1e-13  # 4e-16
    assert found["drift_pu"] < 1e-7  # 1e-8


@pytest.mark.parametrize(("more", "said"), [("", 0), ("0 0", 0), ("0 7", 1)])
def test_further_constants_that_are_not_0_are_said(files, more, said):
    notes = st.load(files(GOVERNED.replace("-5 5 /", f"-5 5 {more} /"))).notes
    assert sum("SEXS of 102/1: 2 further constants are not used." in note for note in notes) == said


def test_a_file_that_is_cut_off_is_said_first(files, stabctl):
    """Half a file may still be a system: what is missing must not be left out in silence."""
    raw = files(GOVERNED)
    whole = raw.read_text()
    assert not [note for note in st.load(raw).notes if "cut off" in note]
    raw.write_text(whole[: whole.index("0 /End of Branch data")])
    assert (
        st.load(raw).notes[0]
        == f"{raw}: the file ends in its branch data without the record 0 behind them; is it cut off?"
    )
    raw.write_text(whole[: whole.index("0 /End of Branch data")] + "Q\n")
    assert not [note for note in st.load(raw).notes if "cut off" in note]


def test_a_file_in_the_place_of_another_is_told(files, stabctl, tmp_path):
    raw = files(GOVERNED)
    dyr = raw.with_suffix(".dyr")
    assert stabctl("powerflow", dyr)[2].startswith(
        f"stabctl: '{dyr}' is no case: give the RAW file, and the DYR file with"
    )
    assert stabctl("powerflow", raw, "--dyr", tmp_path)[::2] == (2, f"stabctl: {tmp_path}: it is no file.\n")


def test_a_second_stabilizer_of_a_machine_is_said(files):
    """Both act: the file with the tuned stabilizers behind that with the old ones is not what was tuned."""
    one = "102 'IEEEST' 1 1 0 0 0 0 0 0 0 0.1 0.1 0 0 1 1 5 0.1 -0.1 0 0 /\n"
    said = "IEEEST of 102/1: the machine has a stabilizer already; their outputs are added."
    assert not [note for note in st.load(files(GOVERNED + one)).notes if said in note]
    notes = [note for note in st.load(files(GOVERNED + one + one)).notes if said in note]
    assert len(notes) == 1
    assert "line 5" in notes[0]


LOST = (
    """0, 100.0, 33, 0, 1, 60.0
what a power flow of PSS/E would change or leave out

1,'A',230.,3,1,1,1,1.02,0.
2,'B',115.,2,1,1,1,1.0,0.
9,'C',230.,4,1,1,1,1.0,0.
0
2,'1',1,1,1,50.,10.
9,'1',1,1,1,500.,10.
9,'2',0,1,1,500.,10.
0
0
1,'1',50.,0.,,,1.02
2,'1',0.,40.,30.,-30.
9,'1',400.,0.,,,1.02
0
2,9,'1',.01,.1,.02
0
1,2,0,'1',1,1,1,0.,0.,2,'T',1
0.,.1,100.
1.,0.,0.,0.,0.,0.,{cod},0,1.1,.9,1.1,.9,33,{tab}
1.,0.
0
1,{isw},10.,5.
0
{dc}"""
    + "0\n" * 9
    + "2,{modsw},0,1,1.05,.95,0,100.,' ',40.\n0\nQ\n"
)


def lost(folder, **codes):
    """The report of a file with these codes."""
    codes = {"cod": 0, "tab": 0, "isw": 0, "modsw": 0, "dc": ""} | codes
    (folder / "lost.raw").write_text(LOST.format(**codes))
    return st.import_report(folder / "lost.raw", check=False)


@pytest.mark.parametrize(
    ("codes", "said"),
    [
        ({"cod": 1}, "tap changers (lost.raw line 19)"),
        ({"cod": -1}, ""),
        ({"cod": 3}, "phase shifters (lost.raw line 19)"),
        ({"modsw": 1}, "switched shunts (lost.raw line 35)"),
        ({"isw": 1}, "interchange of areas (lost.raw line 24)"),
    ],
)
def test_controls_of_the_power_flow_that_do_not_act_are_named(tmp_path, codes, said):
    report = lost(tmp_path, **codes)
    limit = "reactive limits that QG exceeds (lost.raw line 14)"
    assert list(report.idle) == [one for one in (said, limit) if one]
    assert all(one in str(report) for one in report.idle)
    assert report.complete


def test_an_impedance_correction_table_makes_an_import_incomplete(tmp_path):
    assert lost(tmp_path).complete
    report = lost(tmp_path, tab=4)
    assert [(one.kind, one.owner) for one in report.unsupported] == [("impedance correction table 4", "1-2")]
    assert not report.complete


@pytest.mark.parametrize(("mode", "also"), [(0, ""), (1, ", 1 DC line")])
def test_what_is_in_service_at_an_isolated_bus_is_named(tmp_path, mode, also):
    report = lost(tmp_path, dc=f"'D1',{mode},1.,10.,100.\n9,1\n2,1\n")
    (said,) = [one for one in report.corrections if "bus 9" in one]
    what = f"1 load, 1 generator, 1 branch{also}"
    assert said.endswith(f"bus 9 is isolated (type 4) and left out with what is at it, as in PSS/E: {what}.")


def test_what_is_not_supported_is_named_once_with_file_and_line(files, stabctl):
    raw = files(f"101 'GENCLS' 1 0 0 /\n{GENROU}103 'UFLSBL' 1 59 /\n\n102 'WTRLY0' 1 1 2 /\n", FACTS)
    code, out, _ = stabctl("import", raw, "--json", "--no-check")
    found = json.loads(out)
    assert code == 1
    assert (found["records"], found["supported"], found["complete"]) == (4, 2, False)
    assert [(u["kind"], u["file"], u["line"]) for u in found["unsupported"]] == [
        ("FACTS device", str(raw), line_of(raw, "'F1'")),
        ("UFLSBL", str(raw.with_suffix(".dyr")), 3),
        ("WTRLY0", str(raw.with_suffix(".dyr")), 5),
    ]
    assert all(found[key] is None for key in ("mismatch_mw", "dv_pu", "dxdt", "drift_pu"))
    with pytest.raises(st.StabctlError, match=r"no model for WTRLY0 of 102/1 \(line 5: "):
        st.load(raw)
    case = st.load(raw, missing_controls="fixed")
    for what in ("FACTS device", "UFLSBL", "WTRLY0"):
        assert sum(what in sentence for sentence in case.notes) == 1
    assert case.simulate(until=0.5).outcome.stable


def test_a_machine_without_a_model_is_named_and_replaced(files, stabctl):
    raw = files(GENROU)
    report = st.import_report(raw)
    assert [(u.kind, u.place.line) for u in report.unsupported] == [("generator", line_of(raw, "101,'1 '"))]
    assert "bus 102 is the swing bus instead" in report.corrections[0]
    assert "machine 101/1 has no model and is a constant-power injection" in report.corrections[1]
    assert report.start.drift < 1e-6
    code, _, err = stabctl("import", raw, "--out", raw.parent / "folder", "--no-check")
    assert code == 2
    assert "no model for machine 101/1; --missing injection" in err
    assert not (raw.parent / "folder").exists()
    code, _, err = stabctl("import", raw, "--missing", "injection")
    assert code == 2
    assert "change the case that is written; give --out too" in err


def test_every_limit_that_the_start_exceeds_is_listed(files, stabctl):
    lower = "102 'SEXS' 1 0.1 10 100 0.05 -5 1.5 /\n102 'TGOV1' 1 0.05 0.05 0.9 0 1 3 0 /\n"
    raw = files(f"101 'GENCLS' 1 0 0 /\n{GENROU}{lower}")
    report = st.import_report(raw)
    assert report.complete
    assert (stabctl("import", raw)[0], stabctl("import", raw, "--no-check")[0]) == (1, 0)
    found = {(v["device"], v["machine"], v["limit"], v["value"]) for v in report.plain()["violations"]}
    assert found == {("SEXS", "102/1", "Efdmax", 1.5), ("TGOV1", "102/1", "Vmax", 0.9)}
    assert report.start.rate > 0.01
    with pytest.raises(st.StabctlError, match=r"SEXS of machine 102/1 at bus 102 cannot be initialized: Efdmax = 1\.5"):
        report.case.initialize()


def test_a_load_flow_without_a_solution_is_reported(files, stabctl):
    raw = files(GOVERNED, ("250.000,    30.000", "2500.000,    30.000"))
    report = st.import_report(raw)
    assert (stabctl("import", raw)[0], stabctl("import", raw, "--no-check")[0]) == (1, 0)
    assert report.complete
    assert report.stored.mw > 2000
    assert report.plain()["dv_pu"] is None
    assert "did not converge" in str(report)


def test_the_folder_that_is_written_is_the_case(files, stabctl):
    raw, folder = files(GOVERNED), "folder"
    code, out, _ = stabctl("import", raw, "--out", raw.parent / folder)
    assert code == 0
    assert out.endswith(f"written: {raw.parent / folder}\n")
    assert st.load(raw.parent / folder) == st.load(raw)


def test_only_raw_files_are_imported(files, stabctl):
    raw = files(GOVERNED)
    for other in (raw.with_suffix(".dyr"), "two_area"):
        code, _, err = stabctl("import", other)
        assert (code, err) == (
            2,
            f"stabctl: {other} is not a file ending in .raw or .m, which comes first; a folder needs no import.\n",
        )


def test_the_dyr_file_beside_may_have_capital_letters(files):
    raw = files(GOVERNED)
    raw.with_suffix(".dyr").rename(raw.parent / "X.Dyr")
    assert st.import_report(raw, check=False).supported == 3
    assert st.load(raw).devices


def test_the_table_has_a_row_for_every_kind(files):
    report = st.import_report(files(GOVERNED), check=False)
    assert list(report.df.kind) == ["GENCLS", "GENROU", "SEXS"]
    assert list(report.df.role) == ["machine", "machine", "exciter"]
    assert report.df.mva.sum() == 300
    assert "3 of 3 records supported." in str(report)


def test_a_matpower_file_has_a_report(stabctl, tmp_path):
    path = DATA / "powermodels" / "case30.m"
    code, out, err = stabctl("import", path, "--json", "--out", tmp_path / "mine")
    found = json.loads(out)
    assert (code, found["complete"], found["records"]) == (0, True, 0)
    assert found["dv_pu"] < 1e-4  # 5.3e-6
    assert found["dangle_deg"] < 1e-3  # 1.0e-4
    assert found["corrections"] == [f"{path}: not represented: gencost."]
    assert st.load(tmp_path / "mine") == st.load(path)
    assert "There are no dynamic models, only power-flow data." in stabctl("import", path)[1]


def test_tables_of_a_matpower_file_that_are_not_modeled(stabctl):
    path = DATA / "powermodels" / "case7_tplgy.m"
    code, out, err = stabctl("import", path, "--json")
    assert code == 1
    found = {(u["kind"], u["line"]) for u in json.loads(out)["unsupported"]}
    assert found == {("mpc.storage", 60), ("mpc.switch", 66)}
    code, out, err = stabctl("import", path, "x.dyr")
    assert (code, out) == (2, "")
    assert "a DYR file belongs to a PSS/E file" in err
