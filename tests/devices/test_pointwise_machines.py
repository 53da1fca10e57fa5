"""Machines, storage, loads and sensors at random points, beside their equations written down a second time."""

import cmath
import math

import numpy as np
import pytest
from pointwise import compare, held
from records import bus_angle, bus_frequency, hvdc, line_current, line_power, rocof, zip_load

from stabctl.model.tables import Load


def iron(S10, S12, flux, exponential):
    """Saturation S times the flux, through S10 at 1 pu and S12 at 1.2 pu."""
    if exponential:
        return S10 * flux ** (1 + math.log(S12 / S10) / math.log(1.2))
    ratio = math.sqrt(1.2 * S12 / S10)
    A = (ratio - 1.2) / (ratio - 1)
    return S10 * ((flux - A) / (1 - A)) ** 2 if flux > A else 0.0


def stator(p, x, E, V, id_iq, w=1.0):
    """Outputs of a stator with these currents, and the current into the network."""
    id_, iq = id_iq
    v, I = V * cmath.exp(-1j * x.delta), complex(iq, -id_)
    S = v * I.conjugate()
    into = p.mva * I * cmath.exp(1j * x.delta)
    return {
        "id": id_, "iq": iq, "P": S.real, "Q": S.imag, "vt": abs(V), "ve": abs(v - (w - 1) * E), "into": into,
    }  # fmt: skip


def rotor(p, x, u, Te):
    """The swing equation; the governor gives a power or a torque, the stator a torque."""
    Tm = u.Pm * (1 if p.torque else 1 / x.omega)
    return {"delta": p.wb * (x.omega - 1), "omega": (Tm - Te - p.D * (x.omega - 1)) / (2 * p.H)}


def subtransient(p, x, psi, V, w=1.0):
    """Stator behind ra + j x'' with the flux psi = psi''d + j psi''q, and its torque."""
    I = (w * psi - V * cmath.exp(-1j * x.delta)) / complex(p.ra, p.x2)
    id_, iq = -I.imag, I.real
    Te = psi.real * iq - psi.imag * id_
    return id_, iq, stator(p, x, psi, V, (id_, iq), w) | {"Te": Te}


def round_rotor(p, x, u, V, exponential=False):
    """GENROU, with quadratic, and GENROE, with exponential saturation."""
    w = 1 + p.speed_factor * (x.omega - 1)
    psid = (x.eq * (p.x2 - p.xl) + x.kd * (p.x1d - p.x2)) / (p.x1d - p.xl)
    psiq = (x.ed * (p.x2 - p.xl) + x.kq * (p.x1q - p.x2)) / (p.x1q - p.xl)
    psi = complex(psid, psiq)
    id_, iq, out = subtransient(p, x, psi, V, w)
    S = iron(p.S10, p.S12, abs(psi), exponential) / abs(psi)
    dd, dq = x.eq - x.kd - (p.x1d - p.xl) * id_, x.ed - x.kq - (p.x1q - p.xl) * iq
    gap = (p.xq - p.xl) / (p.xd - p.xl)
    Ifd = x.eq + (p.xd - p.x1d) * (id_ + (p.x1d - p.x2) / (p.x1d - p.xl) ** 2 * dd) + S * psid
    Ilq = x.ed + (p.xq - p.x1q) * (iq + (p.x1q - p.x2) / (p.x1q - p.xl) ** 2 * dq) + S * psiq * gap
    rates = {"eq": (u.Efd - Ifd) / p.T1d, "kd": dd / p.T2d, "ed": -Ilq / p.T1q, "kq": dq / p.T2q}
    return out | rotor(p, x, u, out["Te"]) | rates | {"Ifd": Ifd, "Ilq": Ilq}


def salient(p, x, u, V, exponential=False):
    """GENSAL saturates along E'q, GENSAE along psi'' on both axes."""
    psi = complex((x.eq * (p.x2 - p.xl) + x.kd * (p.x1d - p.x2)) / (p.x1d - p.xl), x.kq)
    id_, iq, out = subtransient(p, x, psi, V)
    dd = x.eq - x.kd - (p.x1d - p.xl) * id_
    if exponential:
        S = iron(p.S10, p.S12, abs(psi), True) / abs(psi)
        extra, across = S * psi.real, S * psi.imag * (p.xq - p.xl) / (p.xd - p.xl)
    else:
        extra, across = iron(p.S10, p.S12, x.eq, False), 0.0
    Ifd = x.eq + (p.xd - p.x1d) * (id_ + (p.x1d - p.x2) / (p.x1d - p.xl) ** 2 * dd) + extra
    rates = {
        "eq": (u.Efd - Ifd) / p.T1d,
        "kd": dd / p.T2d,
        "kq": (-x.kq - (p.xq - p.x2) * iq - across) / p.T2q,
    }
    return out | rotor(p, x, u, out["Te"]) | rates | {"Ifd": Ifd, "Ilq": 0.0}


def two_axis(p, x, u, V):
    """Sauer and Pai: E'q = vq + ra iq + x'd id, E'd = vd + ra id - x'q iq; the state ed is -E'd."""
    v = V * cmath.exp(-1j * x.delta)
    vq, vd = v.real, -v.imag
    iq, id_ = np.linalg.solve([[p.ra, p.x1d], [-p.x1q, p.ra]], [x.eq - vq, -x.ed - vd])
    Te = -x.ed * id_ + x.eq * iq + (p.x1q - p.x1d) * id_ * iq
    Ifd, Ilq = x.eq + (p.xd - p.x1d) * id_, x.ed + (p.xq - p.x1q) * iq
    return stator(p, x, 0, V, (id_, iq)) | {
        "Te": Te,
        "delta": p.wb * (x.omega - 1),
        "omega": (u.Pm - Te - p.D * (x.omega - 1)) / (2 * p.H),
        "eq": (u.Efd - Ifd) / p.T1d,
        "ed": -Ilq / p.T1q,
        "Ifd": Ifd,
        "Ilq": Ilq,
    }


def gencls(p, x, u, V):
    I = (u.Efd - V * cmath.exp(-1j * x.delta)) / complex(p.ra, p.x1d)
    Te = u.Efd * I.real
    return stator(p, x, 0, V, (-I.imag, I.real)) | {
        "Te": Te,
        "delta": p.wb * (x.omega - 1),
        "omega": (u.Pm - Te - p.D * (x.omega - 1)) / (2 * p.H),
        "Ifd": u.Efd,
        "Ilq": 0.0,
    }


def esd(p, x, u, V):
    """The ideal device: absorbs positive power; a full one gives only, an empty one takes only."""
    m, vt = max(abs(V), p.vlow), abs(V)

    def allowed(share):
        blocked = (x.energy >= p.capacity and share > 0) or (x.energy <= p.floor and share < 0)
        return 0.0 if blocked else held(share, -1, 1)

    active = allowed(x.share)
    left = math.sqrt(max(p.Smax**2 - active**2, 0))
    full = p.Pp / m**2 + p.Pc / m + p.Pg
    S = complex(active, held(x.reactive, -left, left)) * full * vt**2
    return {
        "P": S.real,
        "Q": S.imag,
        "charge": x.energy / p.capacity,
        "share": (allowed(u.order) - x.share) / p.Tlag,
        "reactive": (held(u.order_q, -p.Smax, p.Smax) - x.reactive) / p.Tlag,
        "energy": S.real * p.efficiency if S.real > 0 else S.real / p.efficiency,
        "into": -(S / V).conjugate(),
    }


MACHINE = {"ra": (0.002, 0.02), "xl": (0.05, 0.1), "x2": (0.12, 0.2), "x1d": (0.22, 0.4), "x1q": (0.42, 0.7)}
MACHINE |= {"xd": (1.4, 2.0), "xq": (0.8, 1.3), "S10": (0.05, 0.15), "S12": (0.3, 0.5), "mva": (0.3, 3.0)}
MACHINE |= {"wb": (314.0, 377.0), "D": (0.1, 2.0), "H": (1.0, 6.0), "x.omega": (0.9, 1.1), "x.delta": (-3, 3)}
MACHINE |= {"speed_factor": [0, 1], "torque": [0, 1], "x.eq": (0.4, 1.6)}
STORE = {"floor": (0.05, 0.2), "capacity": (0.6, 0.9), "x.energy": (-0.1, 1.1), "Smax": (0.6, 1.3), "vlow": (0.3, 0.6)}
STORE |= {f"{where}.{n}": (-1.5, 1.5) for where, n in (("x", "share"), ("x", "reactive"), ("u", "order"))}
STORE |= {"u.order_q": (-1.5, 1.5), "efficiency": (0.7, 0.95)}
MODELS = {
    "genrou": (round_rotor, MACHINE),
    "genroe": (lambda *given: round_rotor(*given, exponential=True), MACHINE),
    "gensal": (salient, MACHINE),
    "gensae": (lambda *given: salient(*given, exponential=True), MACHINE),
    "two_axis": (two_axis, MACHINE),
    "gencls": (gencls, MACHINE),
    "esd": (esd, STORE),
}


@pytest.mark.parametrize("name", MODELS)
def test_a_machine_or_store_is_its_equations(name):
    compare(name, *MODELS[name])


@pytest.mark.parametrize("seed", range(20))
def test_loads_links_and_sensors_are_their_phasors(seed):
    rng = np.random.default_rng(seed)
    V, W = (rng.uniform(0.2, 1.3) * cmath.exp(1j * rng.uniform(-3, 3)) for _ in range(2))
    v, w = (V.real, V.imag), (W.real, W.imag)
    p = zip_load.Par(*rng.uniform(-1, 1, 6), vlow=0.6)
    m = max(abs(V), 0.6)
    S = (complex(p.Pp, p.Qp) / m**2 + complex(p.Pc, p.Qc) / m + complex(p.Pz, p.Qz)) * abs(V) ** 2
    assert complex(*zip_load.current(v, p)) == pytest.approx(-(S / V).conjugate())
    dc = hvdc.Par(0.7, 0.6, 0.5)
    a, b, c, d = hvdc.current(v, w, dc)
    assert V * complex(a, b).conjugate() == pytest.approx(-0.7 * abs(V) * min(abs(V) / 0.5, 1))
    assert W * complex(c, d).conjugate() == pytest.approx(0.6 * abs(W) * min(abs(W) / 0.5, 1))
    line = line_power.Par(*rng.uniform(-2, 2, 4))
    I = complex(line.g, line.b) * V + complex(line.gm, line.bm) * W
    assert complex(*line_power.output(v, w, line)) == pytest.approx(V * I.conjugate())
    assert line_current.output(v, w, line)[0] == pytest.approx(abs(I))
    ahead = cmath.phase(V * cmath.exp(-0.4j))
    assert bus_angle.output(bus_angle.Input(0.4), v)[0] == pytest.approx(ahead)
    sensor = bus_frequency.Par(314.0, 0.03)
    assert bus_frequency.output(bus_frequency.State(0.4), v, sensor)[0] == pytest.approx(1 + ahead / 0.03 / 314)
    assert bus_frequency.derivatives(bus_frequency.State(0.4), v, sensor)[0] == pytest.approx(ahead / 0.03)
    change = (1.02 - 0.99) / 0.07
    rates = rocof.Par(50.0, 0.07)
    y, d = rocof.equations(rocof.State(0.99), rocof.Input(1.02), rates)
    assert (y.rate, d.f) == pytest.approx((50 * change, change))


def test_rows_of_loads_become_parts_at_their_voltage():
    """P (0.5 + 0.3 V/1.04 + 0.2 (V/1.04)^2) with the voltage of the row; shares of q of their own."""
    load = Load(1, 80.0, 30.0, 0.5, 0.1, 0.3, 0.6, v=1.04)
    for V in (0.9, 1.1):
        r = V / 1.04
        wanted = complex(80 * (0.5 + 0.3 * r + 0.2 * r * r), 30 * (0.1 + 0.6 * r + 0.3 * r * r))
        assert zip_load.module.drawn(load, V) == pytest.approx(wanted)
        par = zip_load.from_case(load, 80.0, 30.0, 1.04)
        assert V * -complex(*zip_load.current((V, 0.0), par)).conjugate() == pytest.approx(wanted)
