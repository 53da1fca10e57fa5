"""Equations of one's own that divide by zero: a sentence with the device, not another outcome."""

from pathlib import Path

import pytest
from systems import registered

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.devices import every

LATER = "0 * u.vt if u.vt.real < 0.5 else 1 + 0 * u.vt"  # zero during a fault nearby
ALWAYS = "u.vt - u.vt"


@pytest.fixture
def point(tmp_path):
    """The operating point of two_area with an exciter at machine 2 whose rates are divided by something."""

    def made(divisor):
        text = Path(every()["sexs"].file).read_text("utf-8")
        text = text.replace("from .shared", "from stabctl.devices.exciters.shared").replace('"SEXS"', '"DIVIDES"')
        text = text.replace("va=d_va", "va=d_va / none")
        (tmp_path / "divides.py").write_text(
            text.replace("    return Output(", f"    none = {divisor}\n    return Output(")
        )
        case = st.load("two_area").with_device(st.register(tmp_path / "divides.py"), 2, KA=50.0, TR=0.02, TA=0.05, TB=1)
        return case.initialize()

    with registered():
        yield made


def test_at_the_operating_point(point):
    with pytest.raises(StudyError) as raised:
        point(ALWAYS)
    assert str(raised.value) == "DIVIDES of machine 2 at bus 2 divides by zero; check its equations and its parameters."


def test_in_a_run_and_in_a_search(point):
    base = point(LATER)
    with pytest.raises(StudyError) as raised:
        base.simulate(st.Contingency("2", clear="6cyc", at="0.5s"), "2s")
    said = "lead-lag DIVIDES 2; check the equations of the device for a division by zero."
    assert str(raised.value) == f"Without a finite value at 0.500 s: {said}"
    with pytest.raises(StudyError, match="lead-lag DIVIDES 2"):
        base.clearing_time("2")
    assert base.simulate(st.Contingency("4", clear="3cyc"), "2s").outcome.stable
