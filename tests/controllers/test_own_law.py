"""A compiled law of the user's: where its equations are, and mistakes in its file."""

from importlib import import_module, invalidate_caches

import pytest
from systems import OWN, registered

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.controllers.law import Law
from stabctl.simulation.control import acting

FAULT = st.Contingency("7-8@0.4", clear="6cyc")
GOOD = """
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from stabctl._util.jit import inline
from stabctl.controllers.law import Law
from stabctl.controllers.signals import Input, Output

NAME = "own"
ROLE = "controller"


class Par(NamedTuple):
    gain: Annotated[float, "1/pu", "gain"]


@inline
def step(u, v, p):
    return Output(p.gain * u.deviation)


@dataclass(frozen=True)
class Own(Law):
    gain: float = 500.0

    def par(self, device):
        return Par(self.gain)
"""


@pytest.fixture(scope="module")
def base(cases):
    return cases("two_area_thyristor").initialize(storage="50MW")


@pytest.fixture
def law(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)

    def made(old="", new="", **settings):
        name = f"own_law_{tmp_path.name}"
        (tmp_path / f"{name}.py").write_text(GOOD.replace(old, new, 1) if old else GOOD)
        invalidate_caches()
        return import_module(name).Own(**settings)

    return made


def test_an_extended_law_has_the_equations_of_the_law_that_it_extends(base, law):
    """Also where the class is in a script or a notebook, here in this file."""
    one = law()

    class Same(type(one)):
        pass

    a, b = (base.simulate(FAULT, until=2, control=c) for c in (one, Same()))
    assert (a.arrays.speed == b.arrays.speed).all()
    assert Same().device is one.device


@pytest.mark.slow
@pytest.mark.parametrize(
    "as_given", [lambda law: law, lambda law: law.sampled(60), lambda law: st.EstimatorControl(law, "ideal")]
)
def test_under_a_law_that_reads_the_time_a_clearing_time_is_that_of_single_runs(base, law, as_given):
    """Its relay acts only until 1.02 s; with the fault at 0 it would act all the time."""
    control = as_given(law("p.gain * u.deviation", "np.sign(u.deviation) if u.time < 1.02 else 0.0"))
    found = base.clearing_time(FAULT, control=control, resolution="1cyc", scan=0, longest=0)
    longest = round(found.cycles)
    runs = [base.simulate(FAULT.with_clear(k / 60), "6s", control=control) for k in (longest, longest + 1)]
    assert [run.outcome.stable for run in runs] == [True, False]


def test_only_laws_that_depend_on_the_instant_are_timed(law):
    """The storage law measures how long it has been armed; what it gives does not depend on the instant."""
    packaged = st.BangBang(), st.Feedback(10.0), st.StorageLaw(arm_at="0.2Hz")
    assert not any(acting(one).timed for one in (None, law(), *packaged, st.StorageLaw().sampled(60)))


def test_a_law_without_equations_is_refused(base):
    class Bare(Law):
        def par(self, device):
            return None

    with pytest.raises(StudyError, match=r"The law Bare has no equations, .* write the law to a file of its own"):
        base.simulate(FAULT, until=1, control=Bare())


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("return Output(p.gain * u.deviation)", "return p.gain * u.deviation", "step returns float instead of Output"),
        ("u.deviation", "u.devation", "line 21, step: 'Input' object has no attribute 'devation'"),
        ("@inline\n", "", "step is not compiled; write @inline"),
        ('ROLE = "controller"', "", "lacks ROLE"),
        ("p.gain * u.deviation", "np.mean([u.deviation])", "line 21, step cannot be compiled: return Output(np.mean"),
        (
            "    def par",
            "    def gains(self, device):\n        return 5.0\n\n    def par",
            "has gains 5.0; its method gains",
        ),
        (
            "p.gain * u.deviation",
            "np.sqrt(u.deviation)",
            r"The law Own() has no finite order at 1.000 s for ESD 3@11, 4@10",
        ),
    ],
)
def test_a_mistake_in_a_law_is_told(base, law, old, new, says):
    with pytest.raises(StudyError) as error:
        base.simulate(FAULT, until=4, control=law(old, new))
    assert says in str(error.value)
    assert "\n" not in str(error.value)


def test_what_cannot_be_compiled_in_a_device_is_told_with_its_line(tmp_path):
    file = tmp_path / "clipped.py"
    text = (OWN / "wide_area.py").read_text().replace("from typing", "import numpy as np\nfrom typing", 1)
    file.write_text(text.replace("(u.V - x.slow)", "np.clip(u.V - x.slow, -0.1, 0.1)"))
    with (
        registered(file),
        pytest.raises(StudyError, match=r"clipped\.py: line \d+, output cannot be compiled: .*np\.clip"),
    ):
        st.load("two_area").with_device("clipped", 1, bus=7, other=2, Kv=1.0).initialize()
