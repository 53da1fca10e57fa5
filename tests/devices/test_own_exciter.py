"""An exciter of the user's, from a file outside the package, end to end; and a case folder runs no code."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from records import sexs
from systems import registered

import stabctl as st
from stabctl import devices
from stabctl._util.errors import CaseError

FAULT = st.Contingency("7-8@0.4", clear="6cyc")


def as_own(case):
    """The case with its SEXS exciters in the table of the user's."""
    record = devices.every()["my_exciter"].Par
    own = {n: record(*par) for n, par in case.devices["sexs"].items()}
    tables = {k: rows for k, rows in case.devices.items() if k != "sexs"}
    return replace(case, devices=tables | {"my_exciter": own})


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """SEXS under another name, as a user would write it."""
    text = Path(sexs.file).read_text().replace("from .shared", "from stabctl.devices.exciters.shared")
    path = tmp_path_factory.mktemp("mine") / "my_exciter.py"
    path.write_text(text.replace('NAME = "SEXS"', 'NAME = "MINE"'))
    return path


@pytest.fixture(autouse=True)
def mine(file):
    with registered(file):
        yield


@pytest.fixture(scope="module")
def plain():
    return st.load("two_area").initialize()


def test_it_starts_runs_and_linearizes_like_the_one_it_is_a_copy_of(plain):
    base = as_own(plain.case).initialize()
    assert np.abs(np.sort(base.s) - np.sort(plain.s)).max() < 1e-12
    a, b = (p.simulate(FAULT, storage="50MW", control=st.BangBang()) for p in (base, plain))
    assert np.abs(a.arrays.speed - b.arrays.speed).max() < 1e-9
    assert np.ptp(a.arrays.Efd) > 1
    s, t = (p.linearize("vref:2", "speed:2, efd:2") for p in (base, plain))
    assert np.abs(np.sort_complex(np.linalg.eigvals(s.A)) - np.sort_complex(np.linalg.eigvals(t.A))).max() < 1e-6
    assert s.inputs == ("reference MINE 2",)
    assert "field voltage MINE 2" in s.states
    assert s.response([0.5, 2.0]) == pytest.approx(t.response([0.5, 2.0]), rel=1e-9)


def test_its_parameters_are_checked_edited_written_and_read(plain, tmp_path):
    case = as_own(plain.case)
    st.write(case, tmp_path / "case")
    assert (tmp_path / "case" / "my_exciter.csv").is_file()
    again = st.load(tmp_path / "case")
    assert again.devices["my_exciter"] == case.devices["my_exciter"]
    assert case.set("my_exciter.2.KA", 150).devices["my_exciter"][2].KA == 150
    with pytest.raises(CaseError, match="KA"):
        case.set("my_exciter.2.KA", -1)


def test_its_limits_are_opened_and_named(plain):
    case = as_own(plain.case).set("my_exciter.2.Efdmax", 1.2)
    with pytest.raises(st.StabctlError, match=r"MINE of machine 2 at bus 2 cannot be initialized: Efdmax = 1\.2 pu"):
        case.initialize()


def test_opening_a_case_runs_no_code(plain, tmp_path):
    folder = st.write(plain.case, tmp_path / "case")
    (folder / "evil.py").write_text("open(__file__ + '.was_run', 'w')\n")
    (folder / "evil.csv").write_text("machine,K\n1,1\n")
    with pytest.raises(CaseError, match="evil"):
        st.load(folder)
    assert not (folder / "evil.py.was_run").exists()
