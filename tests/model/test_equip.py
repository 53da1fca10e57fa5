"""Devices added, exchanged and removed."""

import pytest

from stabctl import io
from stabctl._util.errors import CaseError, StudyError

PSS = {"K": 20, "Tw": "10s", "T1": 0.05, "T2": "20ms", "T3": 3.0, "T4": 5.4}


@pytest.fixture(scope="module")
def case():
    return io.load("two_area_thyristor")


def test_what_is_added_and_removed_leaves_the_case(case):
    added = case.with_device("pss", (2, 1), **PSS)
    assert list(added.devices["pss"]) == [2, 1]
    assert added.devices["pss"][2].T2 == 0.02
    assert added.without_device("pss") == case
    assert added.without_device("pss", 1) == case.with_device("pss", 2, **PSS)


def test_a_written_case_is_read_back(case, tmp_path):
    added = case.with_device("pss", 3, **PSS)
    io.write(added, tmp_path / "with")
    assert io.load(tmp_path / "with") == added


def test_the_same_as_set(case):
    one = case.with_device("pss", 2, **PSS)
    assert one.set("pss.2.K", 5) == case.with_device("pss", 2, **PSS | {"K": 5})
    assert one.with_device("pss", 2, **PSS | {"K": 5}) == one.set("pss.2.K", 5)


def test_an_exciter_replaces_an_exciter_and_no_other(case):
    changed = case.with_device("ieeet1", 2, TR=0.01, KA=40, TA=0.05, VRmax=6, VRmin=-6, KE=1, TE=0.5, KF=0.05)
    assert changed.model(2, "exciter") == "ieeet1"
    assert list(changed.devices["sexs"]) == [1, 3, 4]
    assert changed.devices["genrou"] == case.devices["genrou"]


def test_a_machine_replaces_a_machine(case):
    bare = case.without_device("sexs", 4)
    changed = bare.with_device("gencls", 4, H=6.0, D=0.0, ra=0.0, x1d=0.3)
    assert changed.model(4, "machine") == "gencls"
    assert 4 not in changed.devices["genrou"]


@pytest.mark.parametrize(
    ("model", "at", "values", "told"),
    [
        ("psss", 1, PSS, r"There is no model 'psss'; choose one of gencls"),
        (None, 1, PSS, r"There is no model None; choose"),
        ("pss", 9, PSS, r"two_area_thyristor has no machine 9; the nearest numbers are 2, 3, 4"),
        ("pss", "x", PSS, r"has no machine x; it has 1, 2, 3, 4"),
        ("pss", None, PSS, r"has no machine None; it has 1"),
        ("pss", 1, PSS | {"k": 3}, r"pss has no parameter 'k'; "),
        ("pss", 1, PSS | {"Tw": "10MW"}, r"pss.Tw: '10MW' is not a"),
        ("pss", 1, {"K": 3}, r"pss needs Tw, .*; see stabctl models pss"),
    ],
)
def test_complaints(case, model, at, values, told):
    with pytest.raises(StudyError, match=told):
        case.with_device(model, at, **values)


def test_of_several_loads_at_a_bus_one_is_meant():
    case = io.load("two_area").with_load(7, 50.0, 5.0, id="2").with_motors("40%")
    assert set(case.devices["cim"]) == {7, 9, "7#2"}
    assert set(case.without_device("cim", "7#2").devices["cim"]) == {7, 9}
    assert set(case.without_device("cim", 7).devices["cim"]) == {9, "7#2"}
    fewer = case.without_device("cim", ["7#2", 9])
    assert set(fewer.devices["cim"]) == {7}
    assert set(fewer.with_device("cim", "7#2", H=0.4).devices["cim"]) == {7, "7#2"}


def test_values_and_removals_that_make_no_case(case):
    with pytest.raises(CaseError, match=r"two_area_thyristor cannot have pss at 1: .*Tw"):
        case.with_device("pss", 1, **PSS | {"Tw": -1})
    with pytest.raises(CaseError, match=r"cannot have no genrou at 1: .*machine 1 has no model"):
        case.without_device("genrou", 1)
    with pytest.raises(StudyError, match="has no rows in pss"):
        case.without_device("pss")
    with pytest.raises(StudyError, match="has no machine 9"):
        case.without_device("sexs", 9)
    with pytest.raises(StudyError, match="has no pss at 4"):
        case.with_device("pss", 2, **PSS).without_device("pss", (2, 4))


def test_a_converter_replaces_a_machine_with_its_controls_and_back():
    case = io.load("two_area")
    changed = case.with_device("regfm_a1", 1)
    assert {model: list(rows) for model, rows in changed.devices.items() if 1 in rows} == {"regfm_a1": [1]}
    following = changed.with_device("regc_a", 1).with_device("reec_a", 1)
    back = following.with_device("gencls", 1, H=6.0, D=0.0, ra=0.0, x1d=0.3)
    assert [model for model, rows in back.devices.items() if 1 in rows] == ["gencls"]
