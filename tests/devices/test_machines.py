"""Laws of the machine models, evaluated in plain Python: limiting cases, saturation, infinite bus."""

import numpy as np
import pytest
from records import genroe, genrou, gensae, gensal, gentpj1, two_axis
from systems import CLASSICAL, POLES, ROUND, SALIENT, SATURATED, TWO_AXES, TYPE_J, small

from stabctl.devices.machines import stator
from stabctl.dynamics import operating_point
from stabctl.simulation import simulation
from stabctl.simulation.events import Clear, Fault

V = 0.98, 0.11


def evaluated(device, x, par, u=(2.0, 0.7), v=V):
    """Output, rates and current into the bus of a machine."""
    p = device.prepared(par)
    p = p._replace(mva=0.5, wb=377.0)
    given = {"x": x, "u": device.Input(*u), "v": v, "p": p, "i": device.internal(x, p)}

    def call(equation):
        code = equation.__code__
        return equation(*(given[name] for name in code.co_varnames[: code.co_argcount]))

    given["y"] = call(device.output)
    g, b = device.admittance(p)
    into = complex(*call(device.source)) - complex(g, b) * complex(*v)
    if device.has("current"):
        into += complex(*call(device.current))
    return given["y"], call(device.derivatives), into


def states(record, seed, omega=1.0):
    """States of a machine, arbitrary but for the speed."""
    return record(*np.random.default_rng(seed).uniform(0.3, 1.1, len(record._fields)))._replace(omega=omega)


MACHINES = {genrou: SATURATED, genroe: SATURATED, gensal: POLES, gensae: POLES, two_axis: TWO_AXES, gentpj1: TYPE_J}


@pytest.mark.parametrize("device", MACHINES, ids=lambda d: d.name)
def test_the_current_into_the_bus_is_that_of_the_stator(device):
    """P + jQ of the output is V times the conjugate of the current that the network sees."""
    y, _, into = evaluated(device, states(device.State, 1, 1.01), MACHINES[device])
    assert complex(y.P, y.Q) * 0.5 == pytest.approx(complex(*V) * into.conjugate(), abs=1e-13)


@pytest.mark.parametrize("device", MACHINES, ids=lambda d: d.name)
def test_the_air_gap_gives_power_to_the_terminals_and_the_resistance(device):
    """Te = P + ra I^2 at synchronous speed."""
    y, _, _ = evaluated(device, states(device.State, 2), MACHINES[device])
    assert pytest.approx(y.P + MACHINES[device].ra * (y.id**2 + y.iq**2), abs=1e-13) == y.Te


def test_the_speed_factor_multiplies_the_source_alone():
    x = states(genrou.State, 3, 1.02)
    without, factor = (evaluated(genrou, x, ROUND._replace(speed_factor=n), v=(0.0, 0.0))[2] for n in (0, 1))
    assert factor == pytest.approx(1.02 * without, rel=1e-14)


def test_two_axes_without_saliency_are_genrou_without_subtransients():
    """x'd = x'q = x'': the damper fluxes of GENROU act on nothing."""
    one = TWO_AXES._replace(x1q=TWO_AXES.x1d)
    par = SALIENT._replace(
        **{n: getattr(one, n) for n in set(one._fields) & set(ROUND._fields)}, x2=one.x1d, T2d=1.0, T2q=1.0
    )
    x = states(genrou.State, 4)
    a, b = evaluated(genrou, x, par), evaluated(two_axis, two_axis.State(x.delta, x.omega, x.eq, x.ed), one)
    assert b[0] == pytest.approx(a[0], abs=1e-14)
    assert (b[1].omega, b[1].eq, b[1].ed) == pytest.approx((a[1].omega, a[1].eq, a[1].ed), abs=1e-14)
    assert b[2] == pytest.approx(a[2], abs=1e-14)


@pytest.mark.parametrize(("device", "par"), [(genrou, ROUND), (gensal, POLES)], ids=["GENROU", "GENSAL"])
def test_zero_saturation_at_rated_flux_means_none(device, par):
    assert device.prepare(par._replace(S10=0.0, S12=0.4)).SB == 0
    assert device.prepare(par._replace(S10=0.1, S12=0.0)).SB == 0
    assert device.prepare(par._replace(S10=0.1, S12=0.4)).SB > 0


def iron(device, par, flux):
    """Extra field current at a flux (psi'' or E'q) without stator current: Ifd - E'q."""
    x = states(device.State, 5)._replace(eq=flux, kd=flux, kq=0.0, delta=0.0)
    x = x._replace(ed=0.0) if "ed" in x._fields else x
    return evaluated(device, x, par, v=(flux, 0.0))[0].Ifd - flux


@pytest.mark.parametrize("device", [genrou, genroe, gensal, gensae, gentpj1], ids=lambda d: d.name)
def test_saturation_passes_through_its_points(device):
    """Open circuit: the field current is 1 + S times the flux at 1.0 and at 1.2 pu."""
    par = MACHINES[device]._replace(S10=0.1, S12=0.4)
    assert iron(device, par, 1.0) == pytest.approx(0.1, abs=1e-12)
    assert iron(device, par, 1.2) == pytest.approx(0.4 * 1.2, abs=1e-12)
    if device in (genroe, gensae):
        assert iron(device, par, 1.1) / 1.1 == pytest.approx(0.1 * 1.1 ** (np.log(4) / np.log(1.2)), abs=1e-12)


def test_round_and_salient_exponential_machines_saturate_their_q_axis():
    """A flux on the q axis alone needs rotor current there, in the ratio of the air gaps."""
    par = MACHINES[genroe]._replace(S10=0.1, S12=0.4)
    x = genrou.State(0.0, 1.0, 0.0, 0.0, 1.2, 1.2)
    gap = (par.xq - par.xl) / (par.xd - par.xl)
    assert evaluated(genroe, x, par, v=(0.0, 1.2))[0].Ilq - 1.2 == pytest.approx(0.48 * gap, abs=1e-12)
    poles = POLES._replace(S10=0.1, S12=0.4)
    x, gap = gensal.State(0.0, 1.0, 0.0, 0.0, 1.2), (poles.xq - poles.xl) / (poles.xd - poles.xl)
    rates = [evaluated(d, x, poles, v=(0.0, 1.2))[1].kq * poles.T2q for d in (gensal, gensae)]
    assert rates == pytest.approx([-1.2, -1.2 - 0.48 * gap], abs=1e-12)


def test_gentpj1_at_rest_is_the_saturated_phasor_diagram():
    """Efd/Sd = vq + ra iq + Xds id, Xds = xl + (xd - xl)/Sd (Undrill, equations 1 and 11), S at the air-gap flux."""
    p = gentpj1.prepare(TYPE_J)._replace(mva=1.0)
    given = gentpj1.Internal(0.0, 1.0, 1.05, 0.45, 1.0)
    S, iq, id_ = gentpj1.module.stator(given, 0.85, 0.4, p)
    m = abs(complex(0.85, 0.4) + complex(p.ra, p.xl) * complex(iq, -id_)) + p.Kis * abs(complex(iq, id_))
    assert pytest.approx(p.SB * (m - p.SA) ** 2 / m, abs=1e-12) == S
    assert S > 0.2
    Sd, Sq = 1 + S, 1 + p.xq / p.xd * S
    x = gentpj1.State(
        0.0, 1.0, 1.05 + (p.x1d - p.x2d) / Sd * id_, 1.05, 0.45 + (p.x1q - p.x2q) / Sq * iq, 0.45
    )  # fmt: skip
    y, rates, _ = evaluated(gentpj1, x, TYPE_J, v=(0.85, 0.4))
    assert (rates.kd, rates.kq) == pytest.approx((0, 0), abs=1e-12)
    assert pytest.approx(Sd * (0.85 + p.ra * iq + p.xl * id_) + (p.xd - p.xl) * id_, abs=1e-12) == y.Ifd
    assert pytest.approx(Sq * (0.4 - p.ra * id_ + p.xl * iq) + (p.xq - p.xl) * iq, abs=1e-12) == y.Ilq


def test_the_saturation_of_gentpj1_has_the_exact_derivative():
    """Newton's method ends at the solution and at its derivative: complex step equals the implicit function."""
    p = gentpj1.prepare(TYPE_J)

    def S(psid):
        return gentpj1.module.stator(gentpj1.Internal(0.0, 1.0, psid, 0.45, 1.0), 0.85, 0.4, p)[0]

    h = 1e-5
    central = (8 * (S(1.05 + h) - S(1.05 - h)) - (S(1.05 + 2 * h) - S(1.05 - 2 * h))) / (12 * h)
    assert S(1.05 + 1e-30j).imag / 1e-30 == pytest.approx(central, rel=1e-9)


def test_saliency_vanishes_with_equal_reactances():
    assert stator.mean(0.01, 0.3, 0.3) == pytest.approx(((1 / 0.09010000 * 0.01), -0.3 / 0.0901), rel=1e-12)
    assert np.abs(evaluated(two_axis, states(two_axis.State, 6), TWO_AXES._replace(x1q=0.3))[2]) > 0.1


def test_an_infinite_bus_neither_moves_nor_turns():
    """H = 0: constant speed and angle through a fault, at which a machine of 4 s swings."""
    point = operating_point.solve(small({"gencls": CLASSICAL}).set("gencls.2.H", 0.0))
    run = simulation.run(point, [Fault("2", 0.1), Clear("2", 0.18)], 2.0)
    assert np.ptp(run.arrays.speed[:, 0]) > 1e-3
    assert np.ptp(run.arrays.speed[:, 1]) == 0
    place = point.rotors.angle[1]
    assert np.ptp(run.rows[:, place]) == 0
    modes = point.modes()
    assert [modes.label(k) for k in modes.swings()] == ["machine 1 against the rest"]
    assert modes.stable


def test_subtransients_cannot_be_left_out_by_their_time_constants():
    found = dict(ROUND._replace(T2q=0.0).errors())
    assert "two_axis" in found["T2q"]
    assert not dict(ROUND._replace(T2q=0.0, x1q=ROUND.x2).errors())
    assert "0.01 s" in dict(CLASSICAL._replace(H=1e-4).errors())["H"]
    assert not dict(CLASSICAL._replace(H=0.0).errors())
