"""Exciters and stabilizers at random points, beside their diagrams written down a second time."""

import cmath
import math

import pytest
from pointwise import compare, held, pi


def lead(T1, T2, u, x):
    """Output of [(1+sT1)/(1+sT2)], its lagged input x."""
    return x + T1 / T2 * (u - x)


def saturation(p, E):
    """SE(E) E = B (E - A)^2 through both points."""
    ratio = math.sqrt(p.SE2 * p.E2 / (p.SE1 * p.E1))
    A = (ratio * p.E1 - p.E2) / (ratio - 1)
    return p.SE1 * p.E1 * ((E - A) / (p.E1 - A)) ** 2 if E > A else 0.0


def bridge(V, KC, Ifd):
    """Voltage behind a rectifier: V FEX(KC Ifd/V)."""
    if V <= 0:
        return 0.0
    load = KC * Ifd / V
    if load <= 0:
        return V
    if load <= 0.433:
        return V * (1 - 0.577 * load)
    if load < 0.75:
        return V * math.sqrt(0.75 - load**2)
    return V * 1.732 * (1 - load) if load <= 1 else 0.0


def compound(p, u, V, KI):
    """|KP Vt + j (KI + KP XL) It|, KP at the angle THETAP."""
    KP = p.KP * cmath.exp(1j * math.radians(getattr(p, "THETAP", 0.0)))
    I = complex(u.iq, -u.id) * cmath.exp(1j * u.delta)
    return abs(KP * V + 1j * (KI + KP * getattr(p, "XL", 0.0)) * I)


def error(p, x, u, feedback=0.0, filtered="vm"):
    """Control error, and the rate of the voltage filter."""
    measured = getattr(x, filtered)
    return u.Vref + u.Vs - measured - feedback, {filtered: (u.vt - measured) / p.TR}


def rotating(p, x, vr):
    """A DC exciter and its rate."""
    return {"Efd": x.efd, "efd": (vr - p.KE * x.efd - saturation(p, x.efd)) / p.TE}


def dc(p, x, u, _):
    """IEEET1 and all DC exciters of one regulator."""
    e, rates = error(p, x, u, p.KF / p.TF * (x.efd - x.vf))
    if "va" in x._fields:
        rates["va"] = (e - x.va) / p.TB
        e = lead(p.TC, p.TB, e, x.va)
    return rates | rotating(p, x, x.vr) | {"vr": (p.KA * e - x.vr) / p.TA, "vf": (x.efd - x.vf) / p.TF}


def ieeet2(p, x, u, _):
    e, rates = error(p, x, u, x.damping)
    damping = (p.KF / p.TF1 * (x.vr - x.vf) - x.damping) / p.TF2
    regulator = {"vr": (p.KA * e - x.vr) / p.TA, "vf": (x.vr - x.vf) / p.TF1, "damping": damping}
    return rates | rotating(p, x, x.vr) | regulator


def dc4b(p, x, u, _):
    e, rates = error(p, x, u, p.KF / p.TF * (x.efd - x.vf))
    fast = p.KP * e + p.KD / p.TD * (e - x.vd)
    low, high = p.VRmin / p.KA, p.VRmax / p.KA
    y = fast + x.vi
    rests = (y >= high and p.KI * e > 0) or (y <= low and p.KI * e < 0)
    return (
        rates
        | rotating(p, x, x.vr)
        | {
            "vi": 0.0 if rests else p.KI * e,
            "vd": (e - x.vd) / p.TD,
            "vr": (p.KA * u.vt * held(y, low, high) - x.vr) / p.TA,
            "vf": (x.efd - x.vf) / p.TF,
        }
    )


def alternator(p, x, u, vr):
    """An AC exciter driven by vr, what its field needs, and its rate."""
    field = p.KE * x.ve + saturation(p, x.ve) + p.KD * u.Ifd
    return field, {"Efd": bridge(x.ve, p.KC, u.Ifd), "ve": (vr - field) / p.TE}


def ac(p, x, u, _):
    """EXAC1, ESAC1A and EXAC2."""
    field, _ = alternator(p, x, u, 0.0)
    vr = x.vr
    if hasattr(p, "KB"):
        vr = p.KB * min(x.vr - p.KH * field, p.KL * (p.VLR - field))
    if hasattr(p, "VAmax"):
        vr = held(vr, p.VRmin, p.VRmax)
    e, rates = error(p, x, u, p.KF / p.TF * (field - x.vf))
    first = lead(p.TC, p.TB, e, x.va)
    return (
        rates
        | alternator(p, x, u, vr)[1]
        | {"va": (e - x.va) / p.TB, "vr": (p.KA * first - x.vr) / p.TA, "vf": (field - x.vf) / p.TF}
    )


def esac6a(p, x, u, _):
    e, rates = error(p, x, u)
    first = p.KA * lead(p.TK, p.TA, e, x.va)
    va = held(lead(p.TC, p.TB, first, x.vb), p.VAmin, p.VAmax)
    field, _ = alternator(p, x, u, 0.0)
    excess = field - p.VFELIM
    vh = held(p.KH * lead(p.TJ, p.TH, excess, x.vh), 0, p.VHmax)
    vr = held(va - vh, u.vt * p.VRmin, u.vt * p.VRmax)
    return (
        rates
        | alternator(p, x, u, vr)[1]
        | {"va": (e - x.va) / p.TA, "vb": (first - x.vb) / p.TB, "vh": (excess - x.vh) / p.TH}
    )


def ac8b(p, x, u, _):
    e, rates = error(p, x, u)
    fast = p.KPR * e + p.KDR / p.TDR * (e - x.vd)
    y = fast + x.vi
    rests = (y >= p.VPIDmax and p.KIR * e > 0) or (y <= p.VPIDmin and p.KIR * e < 0)
    field, found = alternator(p, x, u, held(x.vr, p.VRmin, p.VRmax))
    steep = (saturation(p, x.ve + 1e-6) - saturation(p, x.ve - 1e-6)) / 2e-6
    found["ve"] = min(found["ve"], 100 * (p.VFEmax - field) / max(p.KE + steep, 1.0))
    drive = p.KA * held(y, p.VPIDmin, p.VPIDmax)
    regulator = {"vi": 0.0 if rests else p.KIR * e, "vd": (e - x.vd) / p.TDR, "vr": (drive - x.vr) / p.TA}
    return rates | found | regulator


def sexs(p, x, u, _):
    e, rates = error(p, x, u)
    drive = p.KA * lead(p.TC, p.TB, e, x.va)
    return rates | {"va": (e - x.va) / p.TB, "Efd": x.efd, "efd": (drive - x.efd) / p.TA}


def scrx(p, x, u, _):
    e = u.Vref + u.Vs - u.vt
    efd = x.vr * (1.0 if p.switch else u.vt)
    return {
        "va": (e - x.va) / p.TB,
        "vr": (p.K * lead(p.TC, p.TB, e, x.va) - x.vr) / p.TE,
        "Efd": -p.resistor * u.Ifd if u.Ifd < 0 else efd,
    }


def exst1(p, x, u, _):
    e, rates = error(p, x, u, p.KF / p.TF * (x.vr - x.vf))
    e = held(e, p.VImin, p.VImax)
    return rates | {
        "va": (e - x.va) / p.TB,
        "vr": (p.KA * lead(p.TC, p.TB, e, x.va) - x.vr) / p.TA,
        "vf": (x.vr - x.vf) / p.TF,
        "Efd": held(x.vr, u.vt * p.VRmin - p.KC * u.Ifd, u.vt * p.VRmax - p.KC * u.Ifd),
    }


def esst1a(p, x, u, _):
    va = x.vr - max(0, p.KLR * (u.Ifd - p.ILR))
    e, rates = error(p, x, u, p.KF / p.TF * (va - x.vf))
    e = held(e, p.VImin, p.VImax)
    first = lead(p.TC, p.TB, e, x.va)
    return rates | {
        "va": (e - x.va) / p.TB,
        "vb": (first - x.vb) / p.TB1,
        "vr": (p.KA * lead(p.TC1, p.TB1, first, x.vb) - x.vr) / p.TA,
        "vf": (va - x.vf) / p.TF,
        "Efd": max(min(va, u.vt * p.VRmax - p.KC * u.Ifd), u.vt * p.VRmin),
    }


def esst3a(p, x, u, V):
    e, rates = error(p, x, u, filtered="vc")
    e = held(e, p.VImin, p.VImax)
    efd = x.vm * min(p.VBmax, bridge(compound(p, u, V, p.KI), p.KC, u.Ifd))
    return rates | {
        "va": (e - x.va) / p.TB,
        "vr": (p.KA * lead(p.TC, p.TB, e, x.va) - x.vr) / p.TA,
        "vm": (p.KM * (x.vr - min(p.VGmax, p.KG * efd)) - x.vm) / p.TM,
        "Efd": efd,
    }


def esst4b(p, x, u, V):
    """The inner loop is algebraic: Efd = VB VM(VA - KG Efd)."""
    e, rates = error(p, x, u, filtered="vc")
    y, d_vr = pi(p.KPR, p.KIR, e, x.vr, p.VRmin, p.VRmax)
    VB = min(p.VBmax, bridge(compound(p, u, V, p.KI), p.KC, u.Ifd))
    vm = held((p.KPM * x.va + x.vm) / (1 + p.KPM * p.KG * VB), p.VMmin, p.VMmax)
    _, d_vm = pi(p.KPM, p.KIM, x.va - p.KG * VB * vm, x.vm, p.VMmin, p.VMmax)
    return rates | {"vr": d_vr, "va": (y - x.va) / p.TA, "vm": d_vm, "Efd": VB * vm}


def exst3(p, x, u, V):
    e, rates = error(p, x, u)
    e = p.KJ * held(e, p.VImin, p.VImax)
    source = compound(p, u, V, p.KI)
    efd = held(x.vr * bridge(source, p.KC, u.Ifd), -p.Emax, p.Emax)
    inner = lead(p.TC, p.TB, e, x.va) - held(p.KG * efd, -p.VGmax, p.VGmax)
    return rates | {"va": (e - x.va) / p.TB, "vr": (p.KA * inner - x.vr) / p.TA, "Efd": efd}


def expic1(p, x, u, V):
    e, rates = error(p, x, u, x.damping)
    y, _ = pi(p.KA * p.TA1, p.KA, e, x.va, p.VAmin, p.VAmax)
    second = lead(p.TA3, p.TA2, y, x.vb)
    VB = bridge(compound(p, u, V, p.KI), p.KC, u.Ifd)
    drive = held(held(x.vr, p.VRmin, p.VRmax) * VB, p.Efdmin, p.Efdmax)
    return (
        rates
        | rotating(p, x, drive)
        | {
            "va": pi(p.KA * p.TA1, p.KA, e, x.va, p.VAmin, p.VAmax)[1],
            "vb": (y - x.vb) / p.TA2,
            "vr": (second - x.vr) / p.TA4,
            "vf": (x.efd - x.vf) / p.TF1,
            "damping": (p.KF / p.TF1 * (x.efd - x.vf) - x.damping) / p.TF2,
        }
    )


def st6b(p, x, u, _):
    e, rates = error(p, x, u)
    y, d_vi = pi(p.KPA, p.KIA, e, x.vi, p.VAmin, p.VAmax)
    va = y + p.KDA / p.TDA * (e - x.vd)
    vr = held(p.KFF * va + p.KM * (va - x.vg), p.VRmin, p.VRmax)
    efd = x.vm * min(vr, max(p.VRmin, p.KLR * (p.KCI * p.ILR - u.Ifd)))
    return rates | {"vi": d_vi, "vd": (e - x.vd) / p.TDA, "vg": (p.KG * efd - x.vg) / p.TG, "Efd": efd}


def st8c(p, x, u, V):
    e, rates = error(p, x, u, filtered="vc")
    y, d_xr = pi(p.KPR, p.KIR, e, x.xr, p.VPImin, p.VPImax)
    z, d_xa = pi(p.KPA, p.KIA, y - x.ifd, x.xa, p.VAmin, p.VAmax)
    source = compound(p, u, V, p.KI1) if p.SW1 else p.KP
    first = min(p.VB1max, bridge(source, p.KC1, u.Ifd))
    second = min(p.VB2max, bridge(p.KI2 * math.hypot(u.id, u.iq), p.KC2, u.Ifd))
    return rates | {
        "xr": d_xr,
        "xa": d_xa,
        "va": (p.KA * z - x.va) / p.TA,
        "ifd": (p.KF * u.Ifd - x.ifd) / p.TF,
        "Efd": first * x.va + second,
    }


def pss(p, x, u, _):
    first = p.K * (u.omega - x.washout)
    second = lead(p.T1, p.T2, first, x.lag1)
    return {
        "Vs": held(lead(p.T3, p.T4, second, x.lag2), p.Vmin, p.Vmax),
        "washout": (u.omega - x.washout) / p.Tw,
        "lag1": (first - x.lag1) / p.T2,
        "lag2": (second - x.lag2) / p.T4,
    }


def measured(u, code):
    """The signal of an input code."""
    return {0: 0.0, 1: u.omega - 1, 3: u.P, 5: u.vt}[code]


def ieeest(p, x, u, _):
    s = measured(u, p.code)
    rise = (s - x.f1 - p.A3 * x.df1) / p.A4
    more = (x.f1 - x.f2 - p.A1 * x.df2) / p.A2
    a = x.f2 + p.A5 * x.df2 + p.A6 * more
    b = lead(p.T1, p.T2, a, x.lag1)
    c = lead(p.T3, p.T4, b, x.lag2)
    on = p.VCL <= u.vt <= p.VCU
    return {
        "f1": x.df1,
        "df1": rise,
        "f2": x.df2,
        "df2": more,
        "lag1": (a - x.lag1) / p.T2,
        "lag2": (b - x.lag2) / p.T4,
        "washout": (c - x.washout) / p.T6,
        "Vs": held(p.KS * p.T5 / p.T6 * (c - x.washout), p.Lmin, p.Lmax) if on else 0.0,
    }


def st2cut(p, x, u, _):
    both = x.in1 + x.in2
    a = p.T3 / p.T4 * (both - x.washout)
    b = lead(p.T5, p.T6, a, x.lag1)
    c = lead(p.T7, p.T8, b, x.lag2)
    on = p.V0 + p.VCL <= u.vt <= p.V0 + p.VCU
    return {
        "in1": (p.K1 * measured(u, p.code1) - x.in1) / p.T1,
        "in2": (p.K2 * measured(u, p.code2) - x.in2) / p.T2,
        "washout": (both - x.washout) / p.T4,
        "lag1": (a - x.lag1) / p.T6,
        "lag2": (b - x.lag2) / p.T8,
        "lag3": (c - x.lag3) / p.T10,
        "Vs": held(lead(p.T9, p.T10, c, x.lag3), p.Lmin, p.Lmax) if on else 0.0,
    }


def stab2a(p, x, u, _):
    first = p.K2 * (-u.P - x.slow1)
    second = p.K2 * (first - x.slow2)
    third = p.K2 * (second - x.slow3)
    return {
        "slow1": (-u.P - x.slow1) / p.T2,
        "slow2": (first - x.slow2) / p.T2,
        "slow3": (second - x.slow3) / p.T2,
        "lagged": (third - x.lagged) / p.T3,
        "out1": (p.K5 * (p.K3 * x.lagged + p.K4 * third) - x.out1) / p.T5,
        "out2": (p.K5 * x.out1 - x.out2) / p.T5,
        "Vs": held(x.out2, -p.Hmax, p.Hmax),
    }


def pss2b(p, x, u, _):
    one, two = held(measured(u, p.code1), p.VS1min, p.VS1max), held(measured(u, p.code2), p.VS2min, p.VS2max)
    a, c = one - x.slow1, two - x.slow3
    b, d = a - x.slow2, p.KS2 * (c - x.slow4)
    wanted = {
        "slow1": (one - x.slow1) / p.TW1,
        "slow2": (a - x.slow2) / p.TW2,
        "in1": (b - x.in1) / p.T6,
        "slow3": (two - x.slow3) / p.TW3,
        "slow4": (c - x.slow4) / p.TW4,
        "in2": (d - x.in2) / p.T7,
    }
    s = x.in1 + p.KS3 * x.in2
    for k in range(8):
        state = getattr(x, f"r{k + 1}")
        used = k < p.M * p.N
        wanted[f"r{k + 1}"] = (s - state) / p.T9 if used else 0.0
        if used:
            s = lead(p.T8, p.T9, s, state) if k % p.M == 0 else state
    s = p.KS1 * (s - x.in2)
    for k, (T1, T2) in enumerate(((p.T1, p.T2), (p.T3, p.T4), (p.T10, p.T11)), 1):
        state = getattr(x, f"lag{k}")
        wanted[f"lag{k}"] = (s - state) / T2
        s = lead(T1, T2, s, state)
    return wanted | {"Vs": held(s, p.VSTmin, p.VSTmax)}


ITS = {"E1": (1.0, 1.4), "SE1": (0.05, 0.2), "E2": (1.8, 2.4), "SE2": (0.3, 0.6), "THETAP": (10.0, 40.0)}
ITS |= {"u.vt": (0.2, 1.4), "u.delta": (-3, 3), "x.efd": (-0.5, 3.0), "x.ve": (-0.2, 3.0), "u.Ifd": (-0.5, 3.0)}
ITS |= {
    "resistor": (0.2, 0.9),
    "switch": [0, 1],
    "SW1": [0, 1],
    "VFELIM": (0.2, 2.0),
    "VFEmax": (0.5, 3.0),
    "VLR": (1.0, 3.0),
}
ITS |= {"VHmax": (0.2, 0.6), "KA": (0.5, 3.0), "VCU": (0.7, 1.1), "VCL": (0.3, 0.6), "V0": (0.0, 0.3)}
ITS |= {"u.omega": (0.5, 1.5), "Hmax": (0.2, 0.6), "Lmax": (0.1, 0.4), "VSTmax": (0.1, 0.4), "u.P": (-1.0, 1.0)}
ITS |= {"VS1max": (0.1, 0.3), "VS1min": (-0.3, -0.1), "VS2max": (0.4, 0.8), "VS2min": (-0.8, -0.4)}
CODES = {"code1": [1, 3, 5], "code2": [0, 1, 3, 5], "code": [1, 3, 5], "M": [1, 2], "N": [1, 3, 4]}
MODELS = {
    **dict.fromkeys(("ieeet1", "ieeex1", "exdc2", "esdc1a", "esdc2a"), dc),
    **dict.fromkeys(("exac1", "esac1a", "exac2"), ac),
    **{f.__name__: f for f in (ieeet2, dc4b, esac6a, ac8b, sexs, scrx, exst1, esst1a, esst3a, esst4b, exst3, expic1)},
    **{f.__name__: f for f in (st6b, st8c, pss, ieeest, st2cut, stab2a, pss2b)},
}


@pytest.mark.parametrize("name", MODELS)
def test_an_exciter_or_stabilizer_is_its_diagram_within_and_beyond_every_limit(name):
    compare(name, MODELS[name], ITS | CODES)
