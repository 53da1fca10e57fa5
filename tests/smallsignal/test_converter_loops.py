"""Modes of converters are named by the control loop that takes part most."""

import numpy as np
import pytest
from systems import PLANT, REEC, REGC_C, doubled, small

from stabctl import devices
from stabctl.smallsignal.analysis import modes
from stabctl.smallsignal.modes import converter_loop

CONTROLLED = {
    "regc_c": REGC_C,
    "reec_b": REEC._replace(VFlag=0, QFlag=1, Kvi=4.0, Imax=1.2),
    "repc_a": PLANT._replace(Qmax=1.1, Qmin=0.9),
}


@pytest.fixture(scope="module")
def found():
    return modes(small(CONTROLLED))


def test_the_loop_with_most_participation_names_the_mode(found):
    """The pair of the phase-locked loop is near the roots of s^2 + Kppll s + Kipll; its angle and integral lead it."""
    names = [found.label(k) for k in range(len(found))]
    (k,) = (k for k, name in enumerate(names) if name == "PLL of REGC_C 1" and found.eigenvalues[k].imag > 0)
    own = [i for i, p in enumerate(found.linear.places) if p.name in ("theta_pll", "xpll")]
    assert found.shares[own, k].sum() > 0.5
    assert abs(found.eigenvalues[k]) == pytest.approx(np.sqrt(REGC_C.Kipll), rel=0.2)
    assert "current control of REGC_C 1" in names
    assert {n for n in names if "REPC_A" in n} == {"voltage control of REPC_A 1", "power control of REPC_A 1"}


def test_machines_keep_their_names(found):
    assert found.label(0).startswith("angle reference")
    assert all("GENCLS" not in found.label(k) or "of" not in found.label(k) for k in range(len(found)))


def test_a_plant_that_holds_reactive_power_is_named_so():
    held = CONTROLLED | {"reec_b": REEC._replace(Imax=1.2), "repc_a": PLANT._replace(RefFlag=0)}
    found = modes(small(held))
    assert "reactive power control of REPC_A 1" in {found.label(k) for k in range(len(found))}


def test_equal_converters_share_the_name():
    found = modes(doubled(small({"regc_c": REGC_C})))
    names = {found.label(k) for k in range(len(found))}
    assert "PLL of REGC_C 1, 101" in names


def test_every_state_of_a_loop_exists():
    for device in devices.every().values():
        states = [s for group in device.named_loops.values() for s in group]
        assert set(states) <= set(device.State._fields)
    kinds = {
        "regc_a",
        "regc_b",
        "regc_c",
        "reec_a",
        "reec_b",
        "reec_c",
        "reec_d",
        "repc_a",
        "wtdt_a",
        "dera1",
        "csvgn1",
    }
    assert kinds <= {name for name, d in devices.every().items() if d.named_loops or d.has("loops")}


def test_a_mode_mostly_of_machines_is_not_a_converters(found):
    share = np.array([1.0 if p.table == "gencls" else 0.0 for p in found.linear.places])
    assert converter_loop(found.linear, share / share.sum()) is None
