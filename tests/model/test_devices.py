"""Device tables of every role: keys by machine or by load, several of a kind, converters in place of machines."""

from dataclasses import replace
from types import ModuleType
from typing import Annotated, NamedTuple

import pytest
from systems import CLASSICAL, PSS, ROUND, SEXS, STEAM, small

from stabctl import devices, io
from stabctl._util.errors import CaseError, StudyError
from stabctl._util.schema import FROM_CASE, POSITIVE
from stabctl.devices.device import Device
from stabctl.model import naming, tables
from stabctl.model.replicate import replicate
from stabctl.model.tables import Load


class Exponential(NamedTuple):
    """A load model, keyed by bus."""

    base: Annotated[float, "MVA", "system base", FROM_CASE]
    a: Annotated[float, "-", "exponent of p", POSITIVE]
    b: Annotated[float, "-", "exponent of q"] = 2.0

    def errors(self):
        """What cannot work."""
        if self.a == self.b:
            yield "b", f"must differ from a = {self.a:g}"


class Converter(NamedTuple):
    """A converter in place of a machine."""

    rate: Annotated[float, "1/s", "current controller", POSITIVE] = 50.0


class Filled(NamedTuple):
    """Parameters that all come from other tables."""

    p: Annotated[float, "pu", "power", FROM_CASE]


class Gensal(NamedTuple):
    """A machine with another inertia than H."""

    M: Annotated[float, "s", "starting time", POSITIVE]


@pytest.fixture(autouse=True)
def more_models(monkeypatch):
    """Models that the package does not have, found by their roles alone."""
    parts = {
        "exponential": ("load", Exponential),
        "other_load": ("load", Exponential),
        "svc": ("shunt", Converter),
        "regc": ("converter", Converter),
        "starting": ("machine", Gensal),
    }
    for name, (role, Par) in parts.items():
        added(monkeypatch, name, role, Par)
    yield
    monkeypatch.undo()
    forget()


def added(monkeypatch, name, role, Par):
    """Register a device that has parameters alone."""
    monkeypatch.setitem(devices._registered, name, Device(ModuleType(name), name, name, role, Par=Par))
    forget()


def forget():
    """Look at the devices again."""
    devices.every.cache_clear()
    devices.models.cache_clear()


A, B = Exponential(0.0, 1.5), Exponential(0.0, 0.5, 1.0)


def with_devices(case, **tables):
    """The case with more device tables."""
    return replace(case, devices={**case.devices, **tables})


@pytest.fixture
def loads():
    """Three loads, two of them at bus 2."""
    case = small({"gencls": CLASSICAL})
    return replace(case, loads=(*case.loads, Load(2, 10.0, 1.0), Load(1, 5.0, 1.0)))


def test_a_model_without_columns_of_its_own_has_no_table(monkeypatch):
    known = set(devices.models())
    added(monkeypatch, "filled", "load", Filled)
    assert "filled" in devices.every()
    assert set(devices.models()) == known


def test_columns_follow_from_the_role():
    assert list(tables.device_columns("exponential")) == ["bus", "a", "b"]
    assert list(tables.device_columns("regc")) == ["machine", "rate"]
    assert {"gencls", "genrou", "regc", "starting"} <= set(tables.of_role("machine", "converter"))


@pytest.mark.parametrize("rows", [{2: A}, {2: A, "2#2": B}, {"2#2": B}, {1: B, "2#2": A, 2: B}])
def test_load_models_belong_to_rows_of_loads(loads, rows, tmp_path):
    case = with_devices(loads, exponential=rows)
    again = io.load(io.write(case, tmp_path / "small"))
    assert again == case
    assert list(again.devices["exponential"]) == list(rows)
    assert case.set(f"exponential.{next(iter(rows))}.a", 3).devices["exponential"][next(iter(rows))].a == 3
    assert case.trip_machine(1).devices["exponential"] == case.classical().devices["exponential"] == rows
    three = replicate(case, 3)
    assert len(three.devices["exponential"]) == 3 * len(rows)
    assert {naming.moved(key, 20) for key in rows} <= set(three.devices["exponential"])


@pytest.mark.parametrize(
    ("tables", "says"),
    [
        (
            {"exponential": {3: A}},
            "exponential.csv row 2, column bus: there is no load at bus 3 in loads.csv; add it there",
        ),
        (
            {"exponential": {2: A, "2#3": A}},
            "exponential.csv row 3, column bus: there is no load at bus 2#3 in loads.csv",
        ),
        (
            {"exponential": {2: A}, "other_load": {1: A, 2: A}},
            "other_load.csv row 3, column bus: bus 2 has two models, in ",
        ),
        (
            {"exponential": {2: A._replace(a=2.0)}},
            "exponential.csv row 2, column b: b = 2 of bus 2 must differ from a = 2.",
        ),
        ({"exponential": {2: A._replace(a=0.0)}}, "column a: 0.0 is not allowed; it must be a number above 0"),
        ({"exponential": {"two": A}}, "'two' is not allowed; it must be a bus number, or 2#2 for the second device"),
        ({"pss": {"1#1": PSS}}, "'1#1' is not allowed; it must be a machine number"),
        (
            {"regc": {1: Converter()}},
            "regc.csv row 2, column machine: machine 1 has two models, in gencls.csv and regc.csv",
        ),
        (
            {"gencls": {2: CLASSICAL}},
            "machine 1 has no model; add a row for it to one of gencls.csv, ",
        ),
        ({"gencls": {2: CLASSICAL, 1: CLASSICAL, "1#2": CLASSICAL}}, "machine 1 appears twice (rows 3 and 4)"),
        ({"pss": {1: PSS}}, "machine 1 is modeled by gencls, which has no stabilizer; remove this row."),
        *(
            (
                {"gencls": {2: CLASSICAL}, "regc": {1: Converter()}, model: {1: par}},
                f"1 is modeled by regc, which has no {role}",
            )
            for model, role, par in (("sexs", "exciter", SEXS), ("pss", "stabilizer", PSS), ("tgov", "governor", STEAM))
        ),
        ({"nothing": {1: PSS}}, "there is no device model 'nothing'; choose one of gencls"),
        ({"pss": {1: SEXS}}, "is not a row; create it with Par(...)"),
    ],
)
def test_devices_that_fit_nothing_are_told(loads, tables, says):
    with pytest.raises(CaseError) as caught:
        with_devices(loads, **tables)
    assert says in str(caught.value)


def test_several_stabilizers_at_one_machine(tmp_path):
    case = with_devices(small({"genrou": ROUND, "sexs": SEXS, "pss": PSS}), pss={1: PSS, "1#2": PSS._replace(K=7.0)})
    folder = io.write(case, tmp_path / "small")
    assert io.load(folder) == case
    path = folder / "pss.csv"
    path.write_text(path.read_text().replace("\n1#2,", "\n1,"))
    assert io.load(folder) == case
    assert case.model(1, "stabilizer") == "pss"
    assert case.set("pss.1#2.K", 8).devices["pss"]["1#2"].K == 8
    assert list(replicate(case, 2).devices["pss"]) == [1, "1#2", 11, "11#2"]
    assert "pss" not in case.trip_machine(1).devices
    path.write_text(path.read_text() + path.read_text().splitlines()[1].replace("1,", "1#2,", 1) + "\n")
    with pytest.raises(CaseError, match=r"pss.csv row 4, column machine: machine 1#2 appears twice \(rows 3 and 4\)"):
        io.load(folder)


@pytest.mark.parametrize(("model", "par"), [("sexs", SEXS), ("gencls", CLASSICAL)])
def test_one_model_one_exciter_one_governor(model, par):
    case = small({"genrou": ROUND, "sexs": SEXS})
    with pytest.raises(CaseError, match=rf"{model}.csv row \d, column machine: machine 1 "):
        with_devices(case, **{model: {**case.devices[model], "1#2": par} if model == "sexs" else {1: par, 2: par}})


def test_shunts_may_be_at_any_bus(loads, tmp_path):
    case = with_devices(loads, svc={3: Converter(), "3#2": Converter(20.0)})
    assert io.load(io.write(case, tmp_path / "small")) == case
    assert list(replicate(case, 2).devices["svc"]) == [3, "3#2", 13, "13#2"]
    assert case.trip_machine(1).devices["svc"] == case.classical().devices["svc"] == case.devices["svc"]
    with pytest.raises(CaseError, match=r"svc.csv row 2, column bus: there is no bus 9 in buses.csv\."):
        with_devices(loads, svc={9: Converter()})


def test_a_converter_takes_the_place_of_a_machine():
    case = small({"gencls": CLASSICAL})
    two = case.devices["gencls"][2]
    mixed = with_devices(case, gencls={2: two}, regc={1: Converter()})
    assert (mixed.model(1, "machine"), mixed.model(1, "converter")) == (None, "regc")
    assert mixed.classical().devices == mixed.devices
    assert list(replicate(mixed, 2, spread=1.0).devices["regc"]) == [1, 11]
    assert [p.H for p in replicate(mixed, 2, spread=1.0).devices["gencls"].values()] == [two.H, 2 * two.H]


def test_a_machine_that_has_no_classical_equivalent_is_told():
    case = small({"gencls": CLASSICAL})
    with pytest.raises(StudyError, match="Machine 1 of small is a starting, which has no classical equivalent"):
        with_devices(case, gencls={2: case.devices["gencls"][2]}, starting={1: Gensal(8.0)}).classical()


def test_an_overlay_changes_devices_by_their_keys(loads, tmp_path):
    io.write(with_devices(loads, exponential={2: A, "2#2": B}), tmp_path / "whole")
    overlay = tmp_path / "changed"
    overlay.mkdir()
    (overlay / "case.toml").write_text('extends = "whole"\n')
    (overlay / "exponential.csv").write_text("bus,a\n2#2,3\n")
    assert io.load(overlay).devices["exponential"] == {2: A, "2#2": B._replace(a=3.0)}
    (overlay / "exponential.csv").write_text("bus,a\n2,3\n2,4\n")
    assert io.load(overlay).devices["exponential"] == {2: A._replace(a=3.0), "2#2": B._replace(a=4.0)}
    (overlay / "exponential.csv").write_text("bus,a\n1,3\n")
    with pytest.raises(
        CaseError,
        match=r"exponential.csv row 2, column bus: small has no bus 1 in exponential.csv; an overlay can only change",
    ):
        io.load(overlay)


@pytest.mark.parametrize(
    ("model", "control", "may"),
    [
        ("gencls", "exciter", False),
        ("gencls", "governor", True),
        ("genrou", "exciter", True),
        ("genrou", "plant control", False),
        ("regc_a", "plant control", True),
        ("regfm_a1", "governor", False),
    ],
)
def test_a_unit_may_have_the_controls_of_its_kind_unless_its_model_lists_some(model, control, may):
    assert tables.takes(model, control) is may
