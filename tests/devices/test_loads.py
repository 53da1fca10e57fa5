"""Load models: powers of voltage and frequency."""

import numpy as np
import pytest
from block_diagram import W, slopes
from records import cim, ieel, zip_load

from stabctl._util.errors import EquilibriumError

SHARES = {"a1": 0.4, "a2": 0.2, "a3": 0.4, "a4": 0.5, "a5": 0.25, "a6": 0.25, "a7": 2.0, "a8": -1.5, "n1": 1.8}
LOAD = ieel.prepare(ieel.Par(P0=2.0, Q0=0.8, V0=1.03, vlow=0.5, wb=377.0, **SHARES))


def drawn(par, v, df=0.0):
    """Complex power drawn at a voltage phasor."""
    re, im = ieel.current(ieel.State(0.0, df), (v.real, v.imag), par)
    return -v * np.conj(complex(re, im))


def test_it_draws_its_power_at_the_voltage_of_the_power_flow():
    assert drawn(LOAD, 1.03 * np.exp(0.3j)) == pytest.approx(2.0 + 0.8j, abs=1e-12)


@pytest.mark.parametrize("v", [0.7, 0.9, 1.1])
def test_power_over_voltage_and_frequency(v):
    def share(a, n, V):
        return sum(x * V**y for x, y in zip(a, n, strict=True))

    P = 2.0 * share((0.4, 0.2, 0.4), (1.8, 1, 0), v) / share((0.4, 0.2, 0.4), (1.8, 1, 0), 1.03)
    Q = 0.8 * share((0.5, 0.25, 0.25), (2, 1, 0), v) / share((0.5, 0.25, 0.25), (2, 1, 0), 1.03)
    assert drawn(LOAD, v * np.exp(-1j), df=0.01) == pytest.approx(P * 1.02 + 1j * Q * 0.985, abs=1e-12)


def test_powers_0_1_and_2_are_the_load_of_three_parts():
    par = ieel.prepare(LOAD._replace(a1=0.5, a2=0.3, a3=0.2, n1=2.0, n2=1.0, n3=0.0, V0=1.0, a7=0.0, a8=0.0))
    parts = zip_load.Par(Pp=0.4, Qp=0.2, Pc=0.6, Qc=0.2, Pz=1.0, Qz=0.4, vlow=0.5)
    for v in (0.2 + 0.1j, 0.9 - 0.2j, 1.1 + 0j):
        assert ieel.current(ieel.State(0.0, 0.0), (v.real, v.imag), par) == pytest.approx(
            zip_load.current((v.real, v.imag), parts), abs=1e-12
        )


def test_a_voltage_that_turns_faster_raises_the_frequency_by_as_much():
    """Turning 0.01 pu faster than the tracked angle, which it leads by 0.01 wb T at rest."""
    lead = 0.01 * 377.0 * ieel.module.T
    rates = ieel.derivatives(ieel.State(0.0, 0.01), (np.cos(lead), np.sin(lead)), LOAD)
    assert rates == pytest.approx((0.01 * 377.0, 0.0), abs=1e-12)
    still = ieel.derivatives(ieel.State(0.0, 0.0), (0.0, 1.0), LOAD._replace(a7=0.0, a8=0.0))
    assert still == (0.0, 0.0)


def test_a_record_without_shares_is_refused():
    names = "a1 a2 a3 a4 a5 a6".split()  # noqa: SIM905
    with pytest.raises(ValueError, match="a4"):
        ieel.from_record("IEELBL", dict.fromkeys(names, 0.0) | {"a1": 1.0})


def motor(seed, cages, kind):
    """A motor at random, drawing 0.7 pu of its MVA at 1.02 pu."""
    rng = np.random.default_rng(seed)
    r, x = rng.uniform(0.01, 0.05, 3), rng.uniform(0.05, 0.15, 3)
    second = {"R2": r[2], "X2": x[2]} if cages == 2 else {}
    given = {"P0": 0.7, "Q0": 0.3, "V0": 1.02, "wb": 377.0, "system": 100.0}
    rest = dict.fromkeys(cim.Par._fields[:11], 0.0) | given
    return cim.prepare(
        cim.Par(**rest, Ra=r[0], Xa=x[0], Xm=rng.uniform(2, 5), R1=r[1], X1=x[1], **second, Pmult=1.0, kind=kind)
    )


def admittance(p, slip, j):
    """Of the equivalent circuit, with the slip of every frequency; `j` is either root of -1."""
    one = p.R1 / slip + j * p.X1
    if p.R2 == 0:
        rotor = one
    elif p.kind == 1:
        rotor = 1 / (1 / one + 1 / (p.R2 / slip + j * p.X2))
    else:
        rotor = j * p.X1 + 1 / (slip / p.R1 + 1 / (p.R2 / slip + j * p.X2))
    return 1 / (p.Ra + j * p.Xa + 1 / (1 / (j * p.Xm) + 1 / rotor))


MOTORS = [(1, 1), (2, 1), (2, 2)]


@pytest.mark.parametrize(("cages", "kind"), MOTORS)
def test_a_motor_is_its_equivalent_circuit_at_every_frequency(cages, kind):
    """At constant speed, a frequency w adds w/wb to the slip that its rotor sees; 20 motors, 30 frequencies."""
    v = np.array([0.9, 0.48])
    for seed in range(20):
        p = motor(seed, cages, kind)
        x = np.array(cim.guess(complex(*v), p))
        used = 2 * cages

        def both(z, x=x, p=p, used=used):
            states = cim.State(*z[:used], *x[used:].astype(complex))
            return np.array([*cim.derivatives(states, z[used:], p)[:used], *cim.current(states, z[used:], p)])

        J = slopes(both, np.array([*x[:used], *v], complex))
        A, Bv, C, Dv = J[:used, :used], J[:used, used:], J[used:, :used], J[used:, used:]
        for w in W:
            found = C @ np.linalg.solve(1j * w * np.eye(used) - A, Bv) + Dv
            plus, minus = (p.mva * admittance(p, p.slip + 1j * w / (j * p.wb), j) - j * p.Bsh for j in (1j, -1j))
            a, b = (plus + minus) / 2, (plus - minus) / 2j
            assert found == pytest.approx(-np.array([[a, -b], [b, a]]), abs=1e-9 * abs(a))


@pytest.mark.parametrize(("cages", "kind"), MOTORS)
def test_a_motor_starts_at_rest_with_the_power_of_its_load(cages, kind):
    V = 1.02 * np.exp(0.4j)
    p = motor(3, cages, kind)._replace(D=0.5, E=2.0, A=0.2)
    p = cim.prepare(p)
    x = cim.guess(V, p)
    assert np.abs(cim.derivatives(x, (V.real, V.imag), p)).max() < 1e-10
    assert V * np.conj(-complex(*cim.current(x, (V.real, V.imag), p))) == pytest.approx(0.7 + 0.3j, abs=1e-10)


DIPPED = {  # the torque has a peak, a dip, and torque again at larger slips
    "behind": {"kind": 2, "R1": 0.09, "X1": 0.13, "R2": 0.006, "X2": 0.33, "Xm": 2.3},
    "beside": {"kind": 1, "R1": 0.3, "X1": 0.1, "R2": 0.01, "X2": 0.25, "Ra": 0.01, "Xa": 0.1, "Xm": 3.0},
    "low": {"kind": 1, "R1": 0.3, "X1": 0.1, "R2": 0.01, "X2": 0.3, "Ra": 0.01, "Xa": 0.1, "Xm": 3.0},
}


def test_a_motor_with_hardly_any_resistance_breaks_down_at_hardly_any_slip():
    p = cim.prepare(motor(0, 1, 1)._replace(P0=0.8, V0=1.0, Mbase=100.0, R1=1e-8))
    assert 0 < p.slip < p.pull_out < 1e-5


@pytest.mark.parametrize("name", DIPPED)
def test_two_cages_run_before_the_first_peak_of_their_torque(name):
    """By the equivalent circuit, at every slip: power and torque rise to the slip of the start and to that peak."""
    p = cim.prepare(motor(0, 1, 1)._replace(P0=0.8, V0=1.0, Mbase=100.0, **DIPPED[name]))
    slips = np.geomspace(1e-4, 1, 20_001)
    I = np.array([p.V0 * admittance(p, slip, 1j) for slip in (p.slip, *slips)])
    power = p.V0 * I.real * p.mva
    torque = p.V0 * I.real[1:] - p.Ra * np.abs(I[1:]) ** 2
    assert power[0] == pytest.approx(0.8, abs=1e-12)
    assert slips[np.argmax(power[1:] >= 0.8)] == pytest.approx(p.slip, rel=1e-3)
    peak = np.argmax(np.diff(torque) < 0)
    assert slips[peak] == pytest.approx(p.pull_out, rel=1e-3)
    assert torque[-1] > 0.9 * torque[peak] > 1.2 * torque[peak:].min()
    with pytest.raises(EquilibriumError, match=f"at its breakdown slip of {100 * p.pull_out:.2g} %"):
        cim.prepare(p._replace(P0=1.01 * power[1 + peak]))


def test_a_motor_that_cannot_draw_its_power_is_named():
    with pytest.raises(EquilibriumError, match="largest power, at its breakdown slip"):
        cim.prepare(motor(0, 1, 1)._replace(Mbase=10.0))
    with pytest.raises(EquilibriumError, match="positive power"):
        cim.prepare(motor(0, 1, 1)._replace(P0=-1.0))


def test_records_of_motors():
    values = dict.fromkeys(["S1", "S2", "VI"], 0.0) | {"D": 2.0}
    made, said = cim.from_record("CIM5BL", dict(values))
    assert (made["E"], made["D"], made["C0"], said) == (2.0, 1.0, 0.0, [])
    assert cim.from_record("CIM6BL", values | {"VI": 0.7})[1] == ["the trip below 0.7 pu is not modeled."]
    with pytest.raises(ValueError, match="saturation"):
        cim.from_record("CIM6AL", values | {"S2": 0.1})


@pytest.mark.parametrize(("cages", "kind"), MOTORS)
def test_the_fastest_eigenvalue_of_a_stopped_motor(cages, kind):
    """That of its linear model at slip 1, without stator resistance."""
    for seed in range(5):
        p = motor(seed, cages, kind)._replace(Ra=0.0)
        at = np.zeros(5, complex)
        at[4] = 1.0
        J = slopes(lambda z, p=p: cim.derivatives(cim.State(*z), (0.0, 0.0), p), at)[: 2 * cages, : 2 * cages]
        arrays = cim.Par(*(np.array([value]) for value in p))
        assert cim.elsewhere(arrays)[0] == pytest.approx(np.abs(np.linalg.eigvals(J)).max(), rel=1e-12)


def test_a_motor_stalls_beyond_the_slip_of_its_largest_torque_unless_it_reaccelerates():
    """One cage: R1 over the magnitude of the impedance seen from it, R and X of the stator behind it."""
    p = motor(4, 1, 1)
    stator = 1 / (1 / (p.Ra + 1j * p.Xa) + 1 / (1j * p.Xm))
    assert p.pull_out == pytest.approx(p.R1 / abs(stator + 1j * p.X1), rel=1e-4)  # 2e-6
    for size in (0.1, 0.9):  # of the voltage; at the slip 1.01 pull_out, the torque falls with its square
        steady = p._replace(V0=size * p.V0, slip=1.01 * p.pull_out)
        x, v = cim.guess(complex(steady.V0), steady), (steady.V0, 0.0)
        assert cim.stalled(x, v, p) == (size == 0.1) == (cim.derivatives(x, v, p).slip > 0)
        assert not cim.stalled(x._replace(slip=0.99 * p.pull_out), v, p)
