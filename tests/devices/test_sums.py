"""What several devices give one input is their sum."""

from dataclasses import replace

import numpy as np
import pytest
from systems import KINDS, PSS, ROUND, SEXS, kind, small

from stabctl.dynamics import family, operating_point
from stabctl.simulation.events import LoadStep
from stabctl.simulation.simulation import run
from stabctl.smallsignal import linearize

STEP = [LoadStep(2, 0.1, 20.0)]
WITH_PSS = KINDS["sexs, pss, steam"]


def with_stabilizers(*rows, **tables):
    """The case of WITH_PSS with these PSS at machine 1, and with rows of other tables."""
    case = small(WITH_PSS)
    stabilizers = {f"1#{k + 1}" if k else 1: par for k, par in enumerate(rows)}
    return replace(case, devices={**case.devices, "pss": stabilizers, **tables})


def response(point, s=0.3 + 4j):
    """Transfer function from the voltage reference of machine 1 to its speed, field voltage and stabilizing signal."""
    m = linearize(point, ["vref:1"], ["speed:1", "efd:1", "vs:1"])
    return m.C @ np.linalg.solve(s * np.eye(len(m.A)) - m.A, m.B) + m.D


@pytest.mark.parametrize("n", [2, 3, 5])
def test_stabilizers_at_one_machine_add_up(n):
    """Some of equal gain are one of their sum, as long as none is limited."""
    many = operating_point.solve(with_stabilizers(*[PSS] * n))
    one = operating_point.solve(with_stabilizers(PSS._replace(K=n * PSS.K)))
    a, b = (run(point, STEP, 3.0) for point in (many, one))
    assert np.abs(a.arrays.speed - b.arrays.speed).max() < 1e-12
    assert np.ptp(b.rows[:, one.layout.signals[0, "Vs"]]) > 1e-4
    assert response(many) == pytest.approx(response(one), rel=1e-10)


def test_they_need_not_be_alike():
    """The signal is the sum of both outputs, each limited for itself."""
    other = PSS._replace(K=50.0, Tw=2.0, T1=0.2, Vmax=0.01, Vmin=-0.01)
    with kind("signals from elsewhere") as models:
        wide = models["wide_area"]
        point = operating_point.solve(with_stabilizers(PSS, other, wide_area={1: wide._replace(Kw=20.0)}))
    traced = run(point, [LoadStep(2, 0.1, 200.0)], 3.0)
    pss, remote = (point.system.family(name) for name in ("pss", "wide_area"))
    parts = [traced.rows[:, place] for place in (*pss.w[:, -1], *remote.w[:, -1])]
    whole = traced.rows[:, point.system.family("sexs").w[0, family.INPUTS + 1]]
    assert np.abs(sum(parts) - whole).max() < 1e-15
    assert [np.abs(part).max() for part in parts] > [1e-3] * 3
    assert np.abs(parts[1]).max() == 0.01
    assert traced.rows[:, point.layout.signals[0, "Vs"]] == pytest.approx(whole, abs=0)


def test_with_none_it_is_zero():
    point = operating_point.solve(small({"genrou": ROUND, "sexs": SEXS}))
    assert point.system.family("sexs").w[0, family.INPUTS + 1] == point.layout.zero


def test_the_sum_is_in_the_linear_model():
    with kind("signals from elsewhere") as models:
        case = small({"genrou": ROUND, "sexs": SEXS, "pss": PSS, "wide_area": models["wide_area"]._replace(Kv=0.5)})
        both = operating_point.solve(case).linearize(outputs="vs:1")
    assert abs(both.C[0, list(both.states).index("slow wide-area stabilizer 1")]) > 0.1  # 0.5
