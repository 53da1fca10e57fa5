"""A study file: options of stabctl study by name; those of the command line come first, mistakes have their place."""

import json

import pytest

QUICK = 'faults = "lines"\nworst = 0\nresolution = "0.5cyc"\nobserve = "3s"\nlimit = "20cyc"\n'
WORDS = "--faults", "lines", "--worst", 0, "--resolution", "0.5cyc", "--observe", "3s", "--limit", "20cyc"


def contingencies(out):
    found = json.loads(out)
    return found["required_cycles"], found["required_damping"], found["contingencies"]


@pytest.mark.slow
def test_a_file_gives_what_options_give(stabctl, tmp_path):
    file = tmp_path / "ours.toml"
    file.write_text(
        f'{QUICK}clear = "10cyc"\ndamping = "3%"\nset = ["machines.1.p=690", "loads.7.p=950"]\njson = true\n'
    )
    code, out, _ = stabctl("study", "two_area", file)
    given = "--clear", "10cyc", "--damping", "3%", "--set", "machines.1.p=690", "--set", "loads.7.p=950", "--json"
    same, expected, _ = stabctl("study", "two_area", *WORDS, *given)
    assert code == same == 1
    assert contingencies(out) == contingencies(expected)


def test_the_command_line_comes_first(stabctl, tmp_path):
    file = tmp_path / "ours.toml"
    file.write_text(f'{QUICK}clear = "10cyc"\n')
    code, out, _ = stabctl("study", "two_area", file, "--clear", "6cyc", "--json")
    assert (code, json.loads(out)["required_cycles"]) == (0, 6.0)


def test_files_beside_the_study_file_are_found(stabctl, tmp_path, monkeypatch):
    (tmp_path / "n-1.toml").write_text('[[contingency]]\nfault = "8"\ntrip = "7-8"\nclear = "5cyc"\nname = "ours"\n')
    (tmp_path / "study.toml").write_text('contingencies = "n-1.toml"\nworst = 0\nlimit = "10cyc"\n')
    monkeypatch.chdir("/")
    code, out, _ = stabctl("study", "two_area", tmp_path / "study.toml", "--json")
    (row,) = json.loads(out)["contingencies"]
    assert (code, row["name"], row["required_cycles"]) == (0, "ours", 5.0)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ('clar = "6cyc"', "'clar' is not a known key; did you mean 'clear'?"),
        ('clear = ["6cyc"]', "clear = ['6cyc'] is not allowed; give one value, not a list."),
        ("clear = true", "clear = True is not allowed; it must be a text or a number."),
        ('clear = "soon"', "clear = 'soon': 'soon' is not a time"),
        ("json = 1", "json = 1 is not allowed; it must be true or false."),
        ("worst = -1", "worst = -1: -1 is not in the range"),
        ("faults = {a = 1}", "it must be a text or a number"),
        ("clear = ", "is not valid TOML"),
    ],
)
def test_mistakes_are_told_with_file_key_and_value(stabctl, tmp_path, line, said):
    file = tmp_path / "ours.toml"
    file.write_text(line)
    code, _, err = stabctl("study", "two_area", file)
    assert code == 2
    assert str(file) in err
    assert said in err


def test_other_files_are_refused(stabctl, tmp_path):
    file = tmp_path / "ours.toml"
    file.write_text(QUICK)
    code, _, err = stabctl("study", "two_area", file, file)
    assert (code, "cannot be used together; give one .toml file" in err) == (2, True)
    code, _, err = stabctl("study", "two_area", "x.csv")
    assert (code, "x.csv is neither a DYR file, x.dyr, nor a study file, x.toml." in err) == (2, True)
    code, _, err = stabctl("study", "two_area", "x.dyr")
    assert (code, "dyr" in err.lower()) == (2, True)
