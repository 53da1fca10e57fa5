"""Conventions of machine equations: what they change, and by how much."""

import json

import numpy as np
import pytest
from systems import CLASSICAL, POLES, ROUND, SEXS, TYPE_J, small

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.model import conventions
from stabctl.model.conventions import KNOWN

MACHINES = {"genrou": ROUND, "genroe": ROUND, "gensal": POLES, "gensae": POLES, "gentpj1": TYPE_J}


@pytest.mark.parametrize("model", MACHINES)
def test_a_torque_damps_less_by_the_power(model):
    """d(Pm/omega) = dPm - Pm domega: a torque Pm with a damping D is a power Pm with D - Pm, at the operating point."""
    case = small({model: MACHINES[model], "sexs": SEXS}, p=240.0, base=400.0)
    own = case.devices[model][1]
    Pm = case.power_flow().S[0].real * case.base_mva / 400.0
    resistance = own.ra * abs(case.power_flow().S[0] * case.base_mva / 400.0 / 1.02) ** 2
    torque = case.set({f"{model}.1.torque": 1}).modes().eigenvalues
    power = case.set({f"{model}.1.D": own.D - Pm - resistance}).modes().eigenvalues
    assert max(np.abs(torque - one).min() for one in power) < 1e-6  # 2e-9
    assert max(np.abs(case.modes().eigenvalues - one).min() for one in power) > 1e-3


def test_conventions_change_the_machines_that_have_them_and_nothing_else():
    case = small({"genrou": ROUND, "sexs": SEXS})
    for name, values in KNOWN.items():
        changed = case.with_conventions(name)
        par = changed.devices["genrou"][1]
        assert (par.speed_factor, par.torque) == values
        assert par._replace(speed_factor=ROUND.speed_factor, torque=ROUND.torque) == case.devices["genrou"][1]
        assert {k: v for k, v in changed.devices.items() if k != "genrou"} == {
            k: v for k, v in case.devices.items() if k != "genrou"
        }
        assert changed.with_conventions(name) == changed
    classical = small({"gencls": CLASSICAL})
    assert classical.with_conventions("pst") == classical


def test_every_way_to_load_a_case_takes_conventions(stabctl):
    assert st.load("two_area", conventions="book") == st.load("two_area").with_conventions("book")
    own, book = (stabctl("modes", "two_area", "--classical", *more)[1] for more in ((), ("--conventions", "book")))
    assert own == book
    own, book = (stabctl("modes", "two_area", "--conventions", name)[1] for name in ("pst", "book"))
    assert own != book
    with pytest.raises(StudyError, match="The conventions 'kundur' are not known; choose one of pst, psse"):
        st.load("two_area", conventions="kundur")


def test_a_folder_may_name_its_conventions(tmp_path):
    folder = tmp_path / "mine"
    st.write(st.load("two_area"), folder)
    about = folder / "case.toml"
    before = about.read_text()
    about.write_text(before + 'conventions = "book"\n')
    assert st.load(folder) == st.load("two_area", conventions="book")
    assert st.load(folder, conventions="psse") == st.load("two_area", conventions="psse")
    (tmp_path / "over").mkdir()
    (tmp_path / "over" / "case.toml").write_text('extends = "mine"\n')
    assert st.load(tmp_path / "over").devices == st.load(folder).devices
    about.write_text(before + 'conventions = "kundur"\n')
    with pytest.raises(st.StabctlError, match=r"conventions: 'kundur' is not allowed; choose one of pst, psse"):
        st.load(folder)


def test_the_conventions_of_a_case_are_said():
    case = st.load("two_area")
    assert conventions.of(case).startswith("pst (power as mechanical input, speed in the stator voltage)")
    for name in KNOWN:
        assert name in conventions.of(case.with_conventions(name)).partition(" (")[0].split(" or ")
    assert conventions.of(case.set("genrou.1.torque", 1)).startswith("of several programs (power at some and torque")
    assert conventions.of(case.classical()) == ""


@pytest.mark.slow
@pytest.mark.parametrize(("name", "said"), [("psse", "psse (power as"), ("book", "andes or book (torque as")])
def test_results_say_the_conventions(name, said, stabctl, tmp_path):
    """JSON and pages; a case whose machines have no choice says nothing."""
    options = "--conventions", name, "--report", tmp_path, "--json"
    for command in (("modes", "two_area"), ("simulate", "two_area", "--until", "0.1s")):
        found = json.loads(stabctl(*command, *options)[1])
        assert found["conventions"].startswith(said)
        (page,) = tmp_path.glob(f"*_{command[0]}.html")
        assert f"Machine equations: {said}" in page.read_text(encoding="utf-8")
        assert json.loads(stabctl(*command, "--classical", "--json")[1])["conventions"] == ""
