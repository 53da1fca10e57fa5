"""Converters and their controls at random points, beside their diagrams written down a second time."""

import cmath
import math

import numpy as np
import pytest
from pointwise import compare, held, outside, pi


def left(most, used):
    """What a limit leaves beside a current in quadrature."""
    return math.sqrt(max(most * most - used * used, 0.0))


def dera1(p, x, u, V):
    vt, vm = abs(V), max(x.vm, 0.01)
    q = u.pfref * x.pf if p.PfFlag else u.Qref
    support = held(p.Kqv * outside((p.Vref0 or p.V0) - x.vm, p.dbd1, p.dbd2), p.Iqvmin, p.Iqvmax)
    ip, iq = x.pord / vm, x.qv + support
    if p.PqFlag:
        ip = held(ip, 0 if p.GenFlag else -p.Imax, p.Imax)
        iq = held(iq, -left(p.Imax, ip), left(p.Imax, ip))
    else:
        iq = held(iq, -p.Imax, p.Imax)
        ip = held(ip, 0 if p.GenFlag else -left(p.Imax, iq), left(p.Imax, iq))
    slow = outside(1 - x.ff, p.fdbd1, p.fdbd2)
    e = held(u.Pref - x.pm + (p.Ddn if slow < 0 else p.Dup) * slow, p.femin, p.femax)
    order, xp = pi(p.Kpg, p.Kig, e, x.xp, p.Pmin, p.Pmax)
    share = min(vt / p.vlow, 1)
    return {
        "P": vt * share * x.ip,
        "Q": vt * share * x.iq,
        "vt": vt,
        "vm": (vt - x.vm) / p.Trv,
        "pf": (u.Pref - x.pf) / p.Tp,
        "pm": (vt * share * x.ip - x.pm) / p.Tp,
        "ff": (u.f - x.ff) / p.Trf,
        "qv": (q / vm - x.qv) / p.Tiq,
        "xp": xp if p.FreqFlag else 0.0,
        "pord": held(((order if p.FreqFlag else u.Pref) - x.pord) / p.Tpord, p.dPmin, p.dPmax),
        "ip": min((ip - x.ip) / p.Tg, p.rrpwr),
        "iq": (iq - x.iq) / p.Tg,
        "into": p.mva * share * complex(x.ip, -x.iq) * V / vt,
    }


def csvgn1(p, x, u, V):
    vt = abs(V)
    e = p.K * (vt - u.Vref)
    first = x.x1 + p.T1 / p.T3 * (e - x.x1)
    second = x.x2 + p.T2 / p.T4 * (first - x.x2)
    rate = (first - x.x2) / p.T4
    beyond = (second >= p.Vmax and rate > 0) or (second <= p.Vmin and rate < 0)
    B = (p.Cbase - x.y * p.base) / p.base
    return {
        "P": 0.0,
        "Q": B * vt**2,
        "vt": vt,
        "x1": (e - x.x1) / p.T3,
        "x2": 0.0 if beyond else rate,
        "y": (held(second, p.Vmin, p.Vmax) - x.y) / p.T5,
        "into": -1j * p.mva * B * V,
    }


def electrical(p, x, u, _):
    """REEC_A, REEC_B, REEC_C and REEC_D."""
    names = p._fields
    storage, curves = "SOCmax" in names, "Vq1" in names
    pref = u.Pref * u.wg if "PFlag" in names and p.PFlag else u.Pref
    vm, q = max(x.vm, 0.01), u.pfref * x.pf if p.PfFlag else u.Qext
    qref = held(q, p.Qmin, p.Qmax)
    vref, d_vq = pi(p.Kqp, p.Kqi, qref - u.Q, x.vq, p.Vmin, p.Vmax)
    if not p.VFlag:
        vref = held(q + getattr(p, "Vref1", 0.0), p.Vmin, p.Vmax)
    support = held(p.Kqv * outside((p.Vref0 or p.V0) - x.vm, p.dbd1, p.dbd2), p.Iqvmin, p.Iqvmax)
    if "PFlag" in names and p.Vdip <= u.vt <= p.Vup:  # REEC_A and REEC_D: in a dip alone
        support = 0.0
    most_p = most_q = p.Imax
    if curves:
        points = range(1, 11 if "Vq10" in names else 5)
        Vq, Iq, Vp, Ip = ([getattr(p, f"{n}{k}") for k in points] for n in ("Vq", "Iq", "Vp", "Ip"))
        most_q, most_p = min(most_q, np.interp(x.vm, Vq, Iq)), min(most_p, np.interp(x.vm, Vp, Ip))
    pord = x.pord
    least, vc = -1 if storage else -getattr(p, "Ke", 0.0), x.vm
    if "Ke" in names:
        vref = vref if p.VFlag else held(q + p.Vbias, p.Vmin, p.Vmax)
        vc, pord = x.vc, x.pord + u.Paux
        if not p.Vblkl <= u.vt <= p.Vblkh:
            most_p = most_q = 0.0
    d_iv = 0.0

    def reactive(most):
        nonlocal d_iv
        y, d_iv = pi(p.Kvp, p.Kvi, vref - vc, x.iv, -most, most)
        return held((y if p.QFlag else x.iq) + support, -most, most)

    if p.PqFlag:
        ip = held(pord / vm, least * most_p, most_p)
        iq = reactive(min(most_q, left(p.Imax, ip)))
    else:
        iq = reactive(most_q)
        most_p = min(most_p, left(p.Imax, iq))
        ip = held(pord / vm, least * most_p, most_p)
    frozen = u.vt < p.Vdip or (p.Vup > 0 and u.vt > p.Vup)
    wanted = {
        "vm": (u.vt - x.vm) / p.Trv,
        "pf": (u.P - x.pf) / p.Tp,
        "vq": d_vq if p.QFlag and p.VFlag and not frozen else 0.0,
        "iv": d_iv if p.QFlag and not frozen else 0.0,
        "iq": 0.0 if p.QFlag or frozen else (qref / vm - x.iq) / p.Tiq,
        "pord": 0.0 if frozen else held((pref - x.pord) / p.Tpord, p.dPmin, p.dPmax),
    }
    if "Ke" in names:
        load = complex(p.Rc, p.Xc) * complex(u.P, -u.Q) / max(u.vt, 0.01)
        wanted["vc"] = ((abs(u.vt - load) if p.VcmpFlag else u.vt + p.Kc * u.Q) - x.vc) / p.Tr1
    if storage:
        wanted["soc"] = (p.P0 - u.P) / p.T
        if (x.soc <= p.SOCmin and ip > 0) or (x.soc >= p.SOCmax and ip < 0):
            ip = wanted["soc"] = 0.0
    return wanted | {"Ipcmd": ip, "Iqcmd": iq}


def repc_a(p, x, u, _):
    if not p.RefFlag:
        seen = u.Q
    elif p.VcFlag:
        seen = abs(u.V - complex(p.Rc, p.Xc) * complex(u.P, -u.Q) / u.V)
    else:
        seen = u.V + p.Kc * u.Q
    e = held(outside((u.Vset if p.RefFlag else u.Qset) - x.meas, p.dbd1, p.dbd2), p.emin, p.emax)
    q, d_xq = pi(p.Kp, p.Ki, e, x.xq, p.Qmin, p.Qmax)
    slow = outside(u.fset - u.f, p.fdbd1, p.fdbd2)
    ep = held(u.Pset - x.pf + (p.Ddn if slow < 0 else p.Dup) * slow, p.femin, p.femax)
    power, d_xp = pi(p.Kpg, p.Kig, ep, x.xp, p.Pmin, p.Pmax)
    return {
        "Pref": x.pg if p.FFlag else u.Pset,
        "Qext": x.xf + p.Tft / p.Tfv * (q - x.xf),
        "meas": (seen - x.meas) / p.Tfltr,
        "xq": 0.0 if u.V < p.Vfrz else d_xq,
        "xf": (q - x.xf) / p.Tfv,
        "pf": (u.P - x.pf) / p.Tp,
        "xp": d_xp if p.FFlag else 0.0,
        "pg": (power - x.pg) / p.Tg if p.FFlag else 0.0,
    }


def regc_a(p, x, u, V):
    vt = abs(V)
    most = p.Lvpl1 * np.interp(x.vfilt, [p.Zerox, p.Brkpt], [0, 1]) if p.Lvplsw else math.inf
    ip = min(x.ip, most) * np.interp(vt, [p.Lvpnt0, p.Lvpnt1], [0, 1])
    iq = max(x.iq - p.Khv * max(vt - p.Volim, 0), p.Iolim)
    share = min(vt / p.vlow, 1)
    return {
        "P": share * vt * ip,
        "Q": share * vt * iq,
        "vt": vt,
        "ip": min((min(u.Ipcmd, most) - x.ip) / p.Tg, p.Rrpwr),
        "iq": held((u.Iqcmd - x.iq) / p.Tg, p.Iqrmin, p.Iqrmax),
        "vfilt": (vt - x.vfilt) / p.Tfltr,
        "into": p.mva * share * complex(ip, -iq) * V / vt,
    }


def within(ip, iq, p):
    """Active and reactive current within Imax, one of them first."""
    if p.PqFlag:
        ip = held(ip, -p.Imax, p.Imax)
        return ip, held(iq, -left(p.Imax, ip), left(p.Imax, ip))
    iq = held(iq, -p.Imax, p.Imax)
    return held(ip, -left(p.Imax, iq), left(p.Imax, iq)), iq


def commands(p, x, u, vt):
    """Rates of the references of REGC_B and REGC_C, and the references."""
    ip, iq = within(u.Ipcmd, u.Iqcmd, p)
    by = max(x.vfilt, 0.01) if p.RateFlag else 1.0
    rate = (ip * by - x.ip) / p.Tg
    rates = {
        "ip": min(rate, p.Rrpwr) if u.Ipcmd >= 0 else max(rate, -p.Rrpwr),
        "iq": held((iq - x.iq) / p.Tg, p.Iqrmin, p.Iqrmax),
        "vfilt": (vt - x.vfilt) / p.Tfltr,
    }
    return rates, x.ip / by, x.iq


def regc_b(p, x, u, V):
    vt, Z = abs(V), complex(p.Re, p.Xe)
    rates, ip, iq = commands(p, x, u, vt)
    E = vt + Z * complex(ip, -iq)
    I = (complex(x.Ed, x.Eq) - vt) / Z
    a, b = within(I.real, -I.imag, p)
    share = min(vt / p.vlow, 1)
    return rates | {
        "P": share * vt * a,
        "Q": share * vt * b,
        "vt": vt,
        "Ed": (E.real - x.Ed) / p.Te,
        "Eq": (E.imag - x.Eq) / p.Te,
        "into": p.mva * share * complex(a, -b) * V / vt,
    }


def regc_c(p, x, u, V):
    vt, Z, frame = abs(V), complex(p.Re, p.Xe), cmath.exp(1j * x.theta_pll)
    v = V / frame
    rates, ip, iq = commands(p, x, u, vt)
    I = (complex(x.Ed, x.Eq) - v) / Z
    a, b = within(I.real, -I.imag, p)
    most = {"p": p.Imax, "q": p.Imax}
    if p.PqFlag:
        most["q"] = left(p.Imax, pi(p.Kip, p.Kii, ip - a, x.xp, -p.Imax, p.Imax)[0])
    else:
        most["p"] = left(p.Imax, pi(p.Kip, p.Kii, iq - b, x.xq, -p.Imax, p.Imax)[0])
    up, d_xp = pi(p.Kip, p.Kii, ip - a, x.xp, -most["p"], most["p"])
    uq, d_xq = pi(p.Kip, p.Kii, iq - b, x.xq, -most["q"], most["q"])
    E = v + Z * complex(up, -uq)
    dw, d_xpll = pi(p.Kppll, p.Kipll, v.imag, x.xpll, p.wmin, p.wmax)
    S = V * (complex(a, -b) * frame).conjugate()
    return rates | {
        "P": S.real,
        "Q": S.imag,
        "vt": vt,
        "wpll": 1 + dw / p.wb,
        "vq": v.imag,
        "theta_pll": dw,
        "xpll": d_xpll,
        "xp": d_xp,
        "xq": d_xq,
        "Ed": (E.real - x.Ed) / p.Te,
        "Eq": (E.imag - x.Eq) / p.Te,
        "into": p.mva * complex(a, -b) * frame,
    }


def beyond(K, KI, excess, x):
    """Output and rate of a controller that acts only beyond a limit."""
    return max(K * excess + x, 0.0), KI * excess if x > 0 or excess > 0 else 0.0


def delivered(p, E, angle, V):
    """Current behind RL + jXL within ImaxF, and the power."""
    I = (cmath.rect(E, angle) - V) / complex(p.RL, p.XL)
    I *= min(1.0, p.ImaxF / abs(I))
    S = V * I.conjugate()
    return I, {"P": S.real, "Q": S.imag, "vt": abs(V), "E": E, "into": p.mva * I}


def regfm_a1(p, x, u, V):
    over, d_pmax = beyond(p.kpp, p.kip, x.pf - p.Pmax, x.pmax)
    under, d_pmin = beyond(p.kpp, p.kip, p.Pmin - x.pf, x.pmin)
    omega = 1 + p.mp * (u.Pref - x.pf) - over + under
    over, d_qmax = beyond(p.kpq, p.kiq, x.qf - p.Qmax, x.qmax)
    under, d_qmin = beyond(p.kpq, p.kiq, p.Qmin - x.qf, x.qmin)
    wanted = u.Vref + p.mq * (u.Qref - x.qf) - over + under
    E, d_e = pi(p.kpv, p.kiv, wanted - x.vm, x.e, p.Emin, p.Emax)
    if not p.VFlag:
        E, d_e = held(wanted, p.Emin, p.Emax), 0.0
    _, out = delivered(p, E, x.delta, V)
    return out | {
        "omega": omega,
        "delta": p.wb * (omega - 1),
        "pf": (out["P"] - x.pf) / p.TPf,
        "qf": (out["Q"] - x.qf) / p.TQf,
        "vm": (abs(V) - x.vm) / p.TVf,
        "e": d_e,
        "pmax": d_pmax,
        "pmin": d_pmin,
        "qmax": d_qmax,
        "qmin": d_qmin,
    }


def regfm_b1(p, x, u, V):
    if p.PQFlag:
        idmax, iqmax = p.kf * p.ImaxSS, left(p.ImaxSS, x.idf)
    else:
        idmax, iqmax = left(p.ImaxSS, x.iqf), p.kf * p.ImaxSS
    _, d_over = beyond(0.0, p.kI, x.idf - idmax, x.over)
    _, d_under = beyond(0.0, p.kI if p.ESFlag else 0.0, -p.Ke * idmax - x.idf, x.under)
    widest = math.asin(p.XL * p.ImaxSS)
    ahead, behind = widest - x.over, (-widest if p.ESFlag else 0.0) + x.under
    low, high = (math.hypot(max(x.vm + k * iqmax * p.XL, 0), x.idf * p.XL) for k in (-1, 1))
    wanted = u.Vref - p.mq * x.iqf if p.VdrpFlag else u.Vref + p.mq * (u.Qref - x.qf)
    E, d_e = pi(p.kpv, p.kiv, wanted - x.vm, x.e, low, high)
    lead = x.delta - x.theta_pll
    I, out = delivered(p, E, x.theta_pll + max(min(lead, ahead), behind), V)
    local, v = I * cmath.exp(-1j * x.theta_pll), V * cmath.exp(-1j * x.theta_pll)
    dwpll, d_xpll = pi(p.kpPLL, p.kiPLL, v.imag, x.xpll, p.dwPLLmin, p.dwPLLmax)
    frozen = abs(V) < p.VPLLfrz
    turn = 0.0 if frozen else p.wb * dwpll
    seen = dwpll if p.wFlag else x.dw
    power = u.Pref - (x.wf / p.mp if p.FFlag else 0) - x.pf - p.D1 * x.dw - p.D2 * (x.dw - x.xd)
    slip = max(min(p.wb * x.dw - turn, 100 * (ahead - lead)), 100 * (behind - lead))
    return out | {
        "omega": 1 + x.dw,
        "delta": turn + slip,
        "dw": power / (2 * p.H),
        "xd": p.wD * (x.dw - x.xd),
        "wf": (seen - x.wf) / p.Tp,
        "pf": (out["P"] - x.pf) / p.TPf,
        "qf": (out["Q"] - x.qf) / p.TQf,
        "vm": (abs(V) - x.vm) / p.TVf,
        "idf": (local.real - x.idf) / p.TIf,
        "iqf": (-local.imag - x.iqf) / p.TIf,
        "e": d_e,
        "over": d_over,
        "under": d_under,
        "theta_pll": turn,
        "xpll": 0.0 if frozen else d_xpll,
    }


def wtdt_a(p, x, u, _):
    Ht, Hg = p.Htfrac * p.H, (1 - p.Htfrac) * p.H
    shaft = 2 * (2 * math.pi * p.Freq1) ** 2 * Ht * Hg / p.H * x.twist + p.Dshaft * (x.wt - x.wg)
    brake = u.P / x.wg + p.D * (x.wg - 1)
    return {
        "wg": x.wg,
        "wt": (p.Pm / x.wt - shaft) / (2 * Ht),
        "rate of wg": (shaft - brake) / (2 * Hg),
        "twist": x.wt - x.wg,
    }


CURVE = {f"{n}{k}": (0.1 + 0.3 * k - 0.1, 0.1 + 0.3 * k + 0.1) for n in ("Vq", "Vp") for k in range(1, 5)}
TEN = {f"{n}{k}": (0.12 * k - 0.05, 0.12 * k + 0.05) for n in ("Vq", "Vp") for k in range(1, 11)}
SETTINGS = {"dbd1": (-0.2, -0.05), "dbd2": (0.05, 0.3), "Vdip": (0.2, 0.5), "Vup": (0.9, 1.2), "Kqv": (0.5, 3.0)}
SETTINGS |= {"Vref0": [0.0, 0.8, 1.1], "V0": (0.9, 1.1), "Imax": (0.4, 1.2), "dPmax": (0.5, 5), "dPmin": (-5, -0.5)}
FREQUENCY = {"fdbd1": (-0.2, -0.05), "fdbd2": (0.05, 0.3), "femin": (-0.5, -0.1), "femax": (0.1, 0.6)}
FREQUENCY |= {"Ddn": (1.0, 3.0), "Dup": (0.3, 0.9)}
FORMING = {"mva": (0.3, 3.0), "wb": (314, 377), "XL": (0.1, 0.4), "ImaxF": (0.5, 3.0)}
RATES = {"mva": (0.3, 3.0), "Iqrmin": (-9, -3), "Iqrmax": (3, 6), "Rrpwr": (1.0, 5.0), "Imax": (0.4, 1.2)}
FRAME = {"x.theta_pll": (-3, 3), "wb": (314.0, 377.0), "kip": (0.1, 2.0), "x.xp": (-1, 1), "x.xq": (-1, 1)}
MODELS = {
    "dera1": (dera1, SETTINGS | FREQUENCY | {"mva": (0.3, 3), "rrpwr": (0.5, 4.0)}),
    "csvgn1": (csvgn1, {"mva": (0.3, 3), "base": (80, 200), "Cbase": (50, 90), "Rmin": (5, 20), "K": (1, 5)}),
    "reec_a": (electrical, SETTINGS | CURVE | {"Vref1": (-0.4, 0.4)}),
    "reec_b": (electrical, SETTINGS),
    "reec_c": (electrical, SETTINGS | CURVE | {"running": (1, 1), "SOCmin": (0.1, 0.4), "SOCmax": (0.6, 0.9)}),
    "reec_d": (electrical, SETTINGS | TEN | {"Vbias": (-0.4, 0.4), "Vblkl": (0.1, 0.3), "Vblkh": (1.1, 1.3)}),
    "repc_a": (repc_a, SETTINGS | FREQUENCY | {"Vfrz": (0.2, 0.6), "u.V": (0.1, 1.3)}),
    "regc_a": (
        regc_a,
        RATES
        | {"Zerox": (0.1, 0.5), "Brkpt": (0.6, 1.0), "Lvpnt0": (0.1, 0.4), "Lvpnt1": (0.5, 0.9), "Lvplsw": [0.0, 1.0]}
        | {"Iolim": (-0.6, 0.3), "Volim": (0.8, 1.2), "vlow": (0.1, 0.3)},
    ),
    "regc_b": (regc_b, RATES | {"vlow": (0.1, 0.3), "x.Eq": (-0.6, 0.6)}),
    "regc_c": (regc_c, RATES | FRAME | {"x.Eq": (-0.6, 0.6), "Kip": (0.2, 2), "wmin": (-0.4, -0.1)}),
    "regfm_a1": (regfm_a1, FORMING | {"Emin": (0.1, 0.5), "Emax": (0.6, 1.1), "x.delta": (-3, 3)}),
    "regfm_b1": (
        regfm_b1,
        FORMING | FRAME | {"x.vm": (0.1, 1.3), "x.delta": (-1, 1)} | {"x.over": (-0.05, 0.2), "x.under": (-0.05, 0.2)},
    ),
    "wtdt_a": (wtdt_a, {"turning": (1, 1), "x.wt": (0.5, 1.5), "x.wg": (0.5, 1.5)}),
}


@pytest.mark.parametrize("name", MODELS)
def test_a_converter_is_its_diagram_within_and_beyond_every_limit(name):
    reference, ranges = MODELS[name]
    compare(name, reference, ranges)
