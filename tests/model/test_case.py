"""Cases: what is packaged, what can be made of them, how they refuse mistakes."""

from dataclasses import replace

import pytest

from stabctl import io
from stabctl._util.errors import CaseError, StabctlError, StudyError
from stabctl.dynamics import operating_point
from stabctl.model import powerflow

PACKAGED = ("ieee39", "two_area", "wnaps", "wnaps_paper")


def test_the_cases_of_the_paper_are_packaged():
    assert set(PACKAGED) <= set(io.packaged())


@pytest.mark.parametrize(
    ("name", "sizes"),
    [
        ("two_area", (4, 11, 12, 2, 0)),
        ("ieee39", (10, 39, 46, 19, 0)),
        ("wnaps", (34, 122, 171, 19, 2)),
        ("wnaps_paper", (34, 122, 171, 19, 2)),
    ],
)
def test_sizes(cases, name, sizes):
    c = cases(name)
    assert tuple(len(rows) for rows in (c.machines, c.buses, c.branches, c.loads, c.links)) == sizes


def test_overlay_changes_only_the_dispatch_of_colstrip_and_its_neighbors(cases):
    full, overlay = cases("wnaps"), cases("wnaps_paper")
    change = {m.machine: o.p - m.p for m, o in zip(full.machines, overlay.machines, strict=True) if o != m}
    assert set(change) == {7, 8, 9, 10, 11, 14}
    assert overlay.machine(14).p == 1409.5
    assert sum(change.values()) == pytest.approx(0, abs=0.01)
    assert replace(full, machines=overlay.machines, title=overlay.title, source=overlay.source, name=overlay.name) == (
        overlay
    )


@pytest.mark.parametrize("name", PACKAGED)
def test_classical_keeps_network_and_inertia_and_drops_every_control(cases, name):
    full = cases(name)
    plain = full.classical()
    assert set(plain.devices) == {"gencls"}
    assert (plain.buses, plain.branches, plain.machines, plain.loads) == (
        full.buses,
        full.branches,
        full.machines,
        full.loads,
    )
    for number, par in plain.devices["gencls"].items():
        machine = full.devices["genrou"][number]
        assert (par.H, par.x1d, par.ra) == (machine.H, machine.x1d, machine.ra)
    assert plain.classical().devices == plain.devices
    assert len(operating_point.solve(plain).s) > 0


def test_machine_that_does_not_exist_is_named_with_the_ones_that_do(cases):
    with pytest.raises(StudyError, match=r"There is no machine 9 in two_area; its machines are 1, 2, 3, 4\."):
        cases("two_area").machine(9)


def test_a_case_cannot_be_changed(cases):
    c = cases("two_area")
    with pytest.raises(AttributeError):
        c.name = "other"
    with pytest.raises(TypeError):
        c.devices["genrou"][1] = None


def test_a_case_made_in_python_is_checked_like_one_from_files(cases):
    c = cases("two_area")
    with pytest.raises(CaseError, match=r"machines.csv row 3, column base_mva: -1.0 is not allowed"):
        replace(c, machines=(c.machines[0], c.machines[1]._replace(base=-1.0), *c.machines[2:]))


def change(case, table, row, **values):
    """The case with one row of a table changed."""
    rows = list(getattr(case, table))
    rows[row] = rows[row]._replace(**values)
    return replace(case, **{table: tuple(rows)})


def test_negative_reactance_and_negative_load_are_legal_and_solve(cases):
    assert min(k.x for k in cases("wnaps").branches) == -0.001
    assert min(load.p for load in change(cases("two_area"), "loads", 0, p=-100.0).loads) == -100
    c = change(cases("two_area"), "loads", 0, p=1067.0)
    c = replace(c, loads=(*c.loads, c.loads[0]._replace(p=-100.0, q=-20.0)))
    assert powerflow.solve(c).iterations > 0
    assert c.check().findings == ()


def test_no_droop_is_legal(cases):
    assert min(p.K for p in cases("ieee39").devices["tgov"].values()) == 0


def test_storage_may_be_set_and_is_checked(cases):
    from stabctl.model.tables import Storage

    c = cases("two_area").with_storage([Storage(1, 5, 50.0)])
    assert c.storage[0].rating == 50
    for bad in (
        Storage(9, 5, 50.0),
        Storage(1, 99, 50.0),
        Storage(1, 5, -1.0),
        Storage(1, 5, 50.0, "heat"),
        Storage(1, 5, 50.0, efficiency=0.0),
        Storage(1, 5, 50.0, charge=1.5),
        Storage(1, 5, float("nan")),
        Storage(1, 5, "fifty"),
    ):
        with pytest.raises(CaseError, match=r"^storage\.csv row 2, column \w+: "):
            cases("two_area").with_storage([bad])


@pytest.mark.parametrize("value", [0.0, -60.0, float("nan"), float("inf"), "sixty"])
def test_base_quantities_must_be_positive_numbers(cases, value):
    with pytest.raises(StabctlError, match=r"^case\.toml, frequency_hz: .* must be a number from 1e-6 to 1e9\.$"):
        replace(cases("two_area"), frequency_hz=value)
