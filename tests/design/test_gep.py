"""GEP(s) of one machine at an infinite bus against the constants K2, K3 and K6 of Heffron and Phillips."""

import numpy as np
import pytest

import stabctl as st
from stabctl.design import gep
from stabctl.model import tables
from stabctl.model.tables import Branch, Bus, Machine

XD, X1D, XQ, T1D, XE, KA, TR = 1.81, 0.30, 1.76, 8.0, 0.65, 200.0, 0.02
P, ET, EB = 0.9, 1.0, 0.995


@pytest.fixture(scope="module")
def single():
    """Reactances, exciter and operating point of Kundur's Example 12.3, without resistance, saturation and dampers."""
    return st.Case(
        "single",
        buses=(Bus(1, "pv", ET, 36.0), Bus(2, "swing", EB, 0.0)),
        branches=(Branch(1, 2, 0.0, XE, 0.0),),
        machines=(Machine(1, 1, 100.0, 90.0, storage_bus=1), Machine(2, 2, 1e5, -90.0, storage_bus=2)),
        devices={
            "gensal": {
                1: tables.parameters(
                    "gensal", H=3.5, D=0.0, ra=0.0, xl=0.16, xd=XD, x1d=X1D, x2=X1D, T1d=T1D, T2d=0.0, xq=XQ, T2q=0.02
                )
            },
            "gencls": {2: tables.parameters("gencls", H=1e5, D=0.0, ra=0.0, x1d=1e-3)},
            "sexs": {1: tables.parameters("sexs", TR=TR, KA=KA, TA=0.0, TB=0.0, TC=0.0, Efdmax=100.0, Efdmin=-100.0)},
        },
    )


def test_the_phase_is_that_of_the_closed_form(single):
    """K2 K3 KA / (1 + s T3 + K3 K6 KA / (1 + s TR)), T3 = K3 T'd0; found: within 2e-5 deg.

    Source: P. Kundur, Power System Stability and Control, 1994, section 12.4.
    """
    point = single.initialize()
    V, E = point.V
    current = (V - E) / (1j * XE)
    q_axis = np.angle(V + 1j * XQ * current)
    delta, eq = q_axis - np.angle(E), (V * np.exp(-1j * q_axis)).real
    K2 = abs(E) * np.sin(delta) / (X1D + XE)
    K3, K6 = (X1D + XE) / (XD + XE), eq / abs(V) * XE / (X1D + XE)
    hz = np.geomspace(0.1, 3, 20)
    s = 2j * np.pi * hz
    wanted = K2 * K3 * KA / (1 + s * K3 * T1D + K3 * K6 * KA / (1 + s * TR))
    for others in ("held", "free"):
        ratio = gep(point, 1, others=others).response(hz)[:, 0, 0] / wanted
        assert np.abs(np.rad2deg(np.angle(ratio))).max() < 1e-3
        assert np.abs(np.abs(ratio) - 1).max() < 1e-4
