"""Generators at a reactive limit in RAW and MATPOWER files: what the stored voltages say of them."""

from math import degrees

import numpy as np
import pytest

import stabctl as st

RAW = """0, 100.0, 33, 0, 1, 60.0
three buses

1,'A',230.,3,1,1,1,{v[0]!r},{a[0]!r}
2,'B',230.,{kind},1,1,1,{v[1]!r},{a[1]!r}
3,'C',230.,1,1,1,1,{v[2]!r},{a[2]!r}
0 / END OF BUS DATA
3,'1',1,1,1,150.,60.
0 / END OF LOAD DATA
0 / END OF FIXED SHUNT DATA
1,'1',0.,0.,99.,-99.,1.02,0,100.,0.,.2
2,'1',50.,{half!r},30.,-5.,{held!r},0,100.,0.,.2
2,'2',30.,{half!r},30.,-5.,{held!r},0,100.,0.,.2
0 / END OF GENERATOR DATA
1,3,'1',.01,.1,.02
2,3,'1',.01,.1,.02
0 / END OF BRANCH DATA
0 / END OF TRANSFORMER DATA
Q
"""
MATPOWER = """mpc.version = '2';
mpc.baseMVA = 100;
mpc.bus = [
1 3 0 0 0 0 1 {v[0]!r} {a[0]!r} 230 1 1.1 .9;
2 {kind} 0 0 0 0 1 {v[1]!r} {a[1]!r} 230 1 1.1 .9;
3 1 150 60 0 0 1 {v[2]!r} {a[2]!r} 230 1 1.1 .9;
];
mpc.gen = [1 0 0 99 -99 1.02 100 1 200 0;
2 50 {half!r} 30 -5 {held!r} 100 1 200 0; 2 30 {half!r} 30 -5 {held!r} 100 1 200 0];
mpc.branch = [1 3 .01 .1 .02 0 0 0 0 0 1; 2 3 .01 .1 .02 0 0 0 0 0 1];
"""
FORMATS = pytest.mark.parametrize("text", [RAW, MATPOWER], ids=["raw", "m"])
FLAT = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)


def read(folder, text, produced, held=1.0, stored=FLAT, kind=2):
    """The case of a file in which two generators produce reactive power (Mvar) at bus 2."""
    path = folder / ("x.raw" if text is RAW else "x.m")
    v, a = stored
    path.write_text(text.format(v=v, a=a, half=produced / 2, held=held, kind=kind))
    return st.load(path)


def solution(folder, text, produced):
    """The voltages at which the generators at bus 2 produce this reactive power."""
    V = read(folder, text, produced, kind=1).power_flow().V
    return [float(v) for v in abs(V)], [degrees(a) for a in np.angle(V)]


@FORMATS
@pytest.mark.parametrize(
    ("produced", "off", "limited"),
    [(60.0, -0.02, True), (60.0, 0.02, False), (-10.0, 0.02, True), (-10.0, -0.02, False), (20.0, -0.02, False)],
)
def test_at_the_most_the_voltage_is_below_the_set_point_and_at_the_least_above(tmp_path, text, produced, off, limited):
    """A solved file is its own power flow where its generators are limited; elsewhere they hold the set-point."""
    stored = solution(tmp_path, text, produced)
    case = read(tmp_path, text, produced, stored[0][1] - off, stored)
    assert case.buses[1].kind == ("pq" if limited else "pv")
    assert any("reactive limit in the stored solution" in note for note in case.notes) is limited
    wanted = stored[0][1] - (0 if limited else off)
    assert abs(case.power_flow().V[1]) == pytest.approx(wanted, abs=1e-9)


@FORMATS
@pytest.mark.parametrize("off", [0.0, 1e-5, -9e-5, 1.1e-4])
def test_machines_hold_the_set_point_however_near_the_stored_voltage_is(tmp_path, text, off):
    """In a stiff network, a last digit of the voltage is much reactive power."""
    case = read(tmp_path, text, 20.0, 1.01, ((1.02, 1.01 + off, 1.0), FLAT[1]))
    assert abs(case.power_flow().V[1]) == pytest.approx(1.01, abs=1e-12)


@FORMATS
@pytest.mark.parametrize(("produced", "held"), [(60.0, 1.02), (-10.0, 0.98), (60.0, 0.98), (-10.0, 1.02)])
def test_a_file_that_was_not_solved_says_nothing_about_limits(tmp_path, text, produced, held):
    """With the voltages of a flat start, generators at a limit hold the set-point on either side of them."""
    case = read(tmp_path, text, produced, held)
    assert case.buses[1].kind == "pv"
    assert abs(case.power_flow().V[1]) == pytest.approx(held, abs=1e-9)
