"""Exciters and stabilizers are their block diagrams; limits are reached, and left without windup."""

from types import SimpleNamespace

import numpy as np
import pytest
from block_diagram import distance, evaluate, feedback, motion, one, opened, response, rest, s

from stabctl import devices
from stabctl._util.schema import fields

EFD = 2.0
IFD = 1.3
V = complex(1.0, 0.2)
I = complex(0.6, -0.5) * np.exp(0.8j)  # iq - j id at the rotor angle
TERMINALS = {
    "vt": abs(V), "ve": abs(V), "Ifd": IFD, "delta": 0.8, "iq": 0.6, "id": 0.5, "omega": 1.0, "P": 0.7, "Vs": 0.0,
}  # fmt: skip
SATURATION = {"E1": 1.5, "SE1": 0.1, "E2": 2.5, "SE2": 0.4}


def draw(name, rng, **given):
    """Parameters at random: time constants of 0.03 to 2, gains of 0.3 to 10."""
    made = dict(SATURATION)
    for field in fields(devices.every()[name].Par).values():
        low, high = (-1.5, 0.3) if field.unit.startswith("s") else (-0.5, 1.0)
        made.setdefault(field.name, float(10 ** rng.uniform(low, high)))
    known = devices.every()[name].Par._fields
    return devices.every()[name].Par(**{k: v for k, v in (made | given).items() if k in known})


def lag(T):
    return 1 / (1 + s * T)


def lead(T1, T2):
    return (1 + s * T1) / (1 + s * T2)


def rate(K, *lags):
    """sK/((1+sT)...)"""
    G = s * K
    for T in lags:
        G = G * lag(T)
    return G


def saturation_slope(E):
    """Slope of SE(E) E = B (E - A)^2 through the two points."""
    r = np.sqrt(2.5 * 0.4 / (1.5 * 0.1))
    A = (1.5 * r - 2.5) / (r - 1)
    return 2 * 1.5 * 0.1 / (1.5 - A) ** 2 * (E - A) if A < E else 0.0


def fex(IN):
    """Rectifier regulation and its slope."""
    if IN <= 0.433:
        return 1 - 0.577 * IN, -0.577
    if IN < 0.75:
        return np.sqrt(0.75 - IN**2), -IN / np.sqrt(0.75 - IN**2)
    return 1.732 * (1 - IN), -1.732


def supply(p, angle=0.0, XL=0.0):
    """VB and its slope by the field current."""
    KP = p.KP * np.exp(1j * np.radians(angle))
    VE = abs(KP * V + 1j * (p.KI + KP * XL) * I)
    f, slope = fex(p.KC * IFD / VE)
    return VE * f, p.KC * slope


def machine(p, E=EFD):
    """The field of a DC exciter."""
    return 1 / (s * p.TE + p.KE + saturation_slope(E))


def alternator(p, x, R, F):
    """An AC exciter: regulator R, all feedback F of its field."""
    q = p.KE + saturation_slope(x.ve)
    f, slope = fex(p.KC * IFD / x.ve)
    den = s * p.TE + q + F * q
    a, b = f - p.KC * IFD / x.ve * slope, p.KC * slope
    return {"Vref": a * R / den, "Ifd": b - a * p.KD * (1 + F) / den}


def regulator(p):
    return lead(p.TC, p.TB) * p.KA * lag(p.TA)


def pi(KP, KI):
    return KP + KI / s


def sexs(p, x, u):
    return {"Vref": regulator(p)}


def scrx(p, x, u):
    G = lead(p.TC, p.TB) * p.K * lag(p.TE)
    return {"Vref": abs(V) * G, "vt": x.vr - abs(V) * G}


def exst1(p, x, u):
    return {"Vref": feedback(regulator(p), rate(p.KF, p.TF))}


def ieeet1(p, x, u):
    return {"Vref": feedback(p.KA * lag(p.TA) * machine(p), rate(p.KF, p.TF))}


def ieeet2(p, x, u):
    return {"Vref": feedback(p.KA * lag(p.TA), rate(p.KF, p.TF1, p.TF2)) * machine(p)}


def ieeex1(p, x, u):
    return {"Vref": feedback(regulator(p) * machine(p), rate(p.KF, p.TF))}


def dc4b(p, x, u):
    G = (pi(p.KP, p.KI) + rate(p.KD, p.TD)) * p.KA
    power, H = lag(p.TA) * machine(p), rate(p.KF, p.TF)
    G, direct = G * abs(V) * power, x.vr / abs(V) * power
    return {"Vref": feedback(G, H), "vt": (direct - G * lag(p.TR)) / (1 + G * H)}


def exac1(p, x, u):
    return alternator(p, x, regulator(p), regulator(p) * rate(p.KF, p.TF))


def exac2(p, x, u):
    R = p.KB * regulator(p)
    return alternator(p, x, R, R * rate(p.KF, p.TF) + p.KB * p.KH)


def esac6a(p, x, u):
    limiter = p.KH * lead(p.TJ, p.TH) if p.VFELIM == 0 else 0
    return alternator(p, x, p.KA * lead(p.TK, p.TA) * lead(p.TC, p.TB), limiter)


def ac8b(p, x, u):
    return alternator(p, x, (pi(p.KPR, p.KIR) + rate(p.KDR, p.TDR)) * p.KA * lag(p.TA), 0)


def esst1a(p, x, u):
    R = regulator(p) * lead(p.TC1, p.TB1)
    return {
        "Vref": feedback(R, rate(p.KF, p.TF)),
        "Ifd": -p.KLR / (1 + R * rate(p.KF, p.TF)),
    }


def inner(p, R, M, angle, XL):
    """A source VB behind the regulator R and the inner regulator M, whose feedback of Efd is KG."""
    VB, slope = supply(p, angle, XL)
    return {"Vref": R * feedback(VB * M, p.KG), "Ifd": one(slope * EFD / VB) / (1 + VB * M * p.KG)}


def esst3a(p, x, u):
    return inner(p, regulator(p), p.KM * lag(p.TM), p.THETAP, p.XL)


def esst4b(p, x, u):
    return inner(p, pi(p.KPR, p.KIR) * lag(p.TA), pi(p.KPM, p.KIM), p.THETAP, p.XL)


def exst3(p, x, u):
    return inner(p, p.KJ * lead(p.TC, p.TB), p.KA * lag(p.TA), p.THETAP, p.XL)


def expic1(p, x, u):
    VB, slope = supply(p) if p.KP > 0 else (1.0, 0.0)
    field, H = machine(p) if p.TE > 0 else one(), rate(p.KF, p.TF1, p.TF2)
    G = p.KA * (1 + s * p.TA1) / s * lead(p.TA3, p.TA2) * lag(p.TA4) * VB * field
    return {"Vref": feedback(G, H), "Ifd": slope * x.vr * field / (1 + G * H)} if p.KP > 0 else {"Vref": feedback(G, H)}


def st6b(p, x, u):
    G = (p.KFF + p.KM) * (pi(p.KPA, p.KIA) + rate(p.KDA, p.TDA)) * abs(V)
    loop = 1 + abs(V) * p.KM * p.KG * lag(p.TG)
    return {"Vref": G / loop, "vt": (EFD / abs(V) - G) * lag(p.TR) / loop}


def st8c(p, x, u):
    f, slope = fex(p.KC1 * IFD / p.KP)
    current = p.KP * f * p.KA * lag(p.TA) * pi(p.KPA, p.KIA)
    second = p.KC2 * fex(p.KC2 * IFD / (p.KI2 * abs(I)))[1]
    return {
        "Vref": current * pi(p.KPR, p.KIR),
        "Ifd": x.va * p.KC1 * slope + second - current * p.KF * lag(p.TF),
    }


def st8c_fed(p, x, u):
    VB, _ = supply(SimpleNamespace(KP=p.KP, KI=p.KI1, KC=p.KC1), p.THETAP, p.XL)
    return {"Vref": VB * p.KA * lag(p.TA) * pi(p.KPA, p.KIA) * pi(p.KPR, p.KIR)}


AC = {"KC": 0.2, "KD": 0.4, "KE": 1.0}
SOURCE = {"KP": 4.0, "KI": 1.5, "KC": 0.3, "XL": 0.2, "THETAP": 25.0}
EXCITERS = {  # name -> device, its diagram, and parameters that are not drawn
    "sexs": ("sexs", sexs, {}),
    "scrx": ("scrx", scrx, {"switch": 0, "resistor": 0.0}),
    "exst1": ("exst1", exst1, {}),
    "ieeet1": ("ieeet1", ieeet1, {}),
    "ieeet2": ("ieeet2", ieeet2, {}),
    "ieeex1": ("ieeex1", ieeex1, {}),
    "exdc2": ("exdc2", ieeex1, {}),
    "esdc1a": ("esdc1a", ieeex1, {}),
    "esdc2a": ("esdc2a", ieeex1, {}),
    "dc4b": ("dc4b", dc4b, {}),
    "exac1": ("exac1", exac1, AC),
    "exac1, rectifier in its second mode": ("exac1", exac1, AC | {"KC": 1.0}),
    "exac1, rectifier in its third mode": ("exac1", exac1, AC | {"KC": 5.0}),
    "esac1a": ("esac1a", exac1, AC),
    "exac2": ("exac2", exac2, AC | {"KL": 10.0, "VLR": 1e6}),
    "esac6a": ("esac6a", esac6a, AC | {"VFELIM": 1e3}),
    "esac6a limiting its field current": ("esac6a", esac6a, AC | {"VFELIM": 0.0}),
    "ac8b": ("ac8b", ac8b, AC),
    "esst1a": ("esst1a", esst1a, {"KLR": 2.0, "ILR": 1.0}),
    "esst3a": ("esst3a", esst3a, SOURCE),
    "esst4b": ("esst4b", esst4b, SOURCE),
    "esst4b without integrals": ("esst4b", esst4b, SOURCE | {"KIR": 0.0, "KIM": 0.0}),
    "exst3": ("exst3", exst3, SOURCE),
    "expic1": ("expic1", expic1, SOURCE),
    "expic1, static": ("expic1", expic1, {"KP": 0.0, "KI": 0.0, "TE": 0.0}),
    "st6b": ("st6b", st6b, {"KLR": 100.0, "KCI": 10.0, "ILR": 10.0}),
    "st8c": ("st8c", st8c, {"KP": 3.0, "KC1": 0.2, "KI2": 1.0, "KC2": 0.05, "SW1": 0}),
    "st8c fed by the terminals": (
        "st8c",
        st8c_fed,
        {"KP": 4.0, "KI1": 1.5, "KC1": 0.3, "XL": 0.2, "THETAP": 25.0, "KI2": 0.0, "SW1": 1},
    ),
}


def second_order(a, b):
    return 1 + s * a + s * s * b


def pss(p, x, u):
    return {"omega": p.K * rate(p.Tw, p.Tw) * lead(p.T1, p.T2) * lead(p.T3, p.T4)}


def ieeest(p, x, u):
    G = second_order(p.A5, p.A6) / second_order(p.A1, p.A2) / second_order(p.A3, p.A4)
    G = G * lead(p.T1, p.T2) * lead(p.T3, p.T4) * p.KS * rate(p.T5, p.T6)
    return {{1: "omega", 3: "P", 5: "vt"}[p.code]: G}


def st2cut(p, x, u):
    G = rate(p.T3, p.T4) * lead(p.T5, p.T6) * lead(p.T7, p.T8) * lead(p.T9, p.T10)
    return {"omega": p.K1 * lag(p.T1) * G, "P": p.K2 * lag(p.T2) * G}


def stab2a(p, x, u):
    washout = p.K2 * rate(p.T2, p.T2)
    return {"P": -1 * washout * washout * washout * (p.K3 * lag(p.T3) + p.K4) * (p.K5 * lag(p.T5)) * (p.K5 * lag(p.T5))}


def pss2b(p, x, u):
    tracking = one()
    for k in range(p.M * p.N):
        tracking = tracking * lag(p.T9) * ((1 + s * p.T8) if k < p.N else 1)
    leads = p.KS1 * lead(p.T1, p.T2) * lead(p.T3, p.T4) * lead(p.T10, p.T11)
    second = rate(p.TW3, p.TW3) * rate(p.TW4, p.TW4) * p.KS2 * lag(p.T7)
    return {
        "omega": rate(p.TW1, p.TW1) * rate(p.TW2, p.TW2) * lag(p.T6) * tracking * leads,
        "P": second * (p.KS3 * tracking - 1) * leads,
    }


CUTS = {"VCU": 2.0, "VCL": 0.0}
STABILIZERS = {
    "pss": ("pss", pss, {}),
    "ieeest of speed": ("ieeest", ieeest, CUTS | {"code": 1}),
    "ieeest of power": ("ieeest", ieeest, CUTS | {"code": 3}),
    "ieeest of voltage, first order": (
        "ieeest",
        ieeest,
        CUTS | {"code": 5, "A2": 0.0, "A6": 0.0, "A3": 0.0, "A4": 0.0},
    ),
    "st2cut": ("st2cut", st2cut, {"VCU": 0.0, "VCL": 0.0, "code1": 1, "code2": 3}),
    "stab2a": ("stab2a", stab2a, {}),
    "pss2b, five lags": ("pss2b", pss2b, {"M": 5, "N": 1, "code1": 1, "code2": 3}),
    "pss2b, four stages of two lags": ("pss2b", pss2b, {"M": 2, "N": 4, "code1": 1, "code2": 3}),
    "pss2b without filter": ("pss2b", pss2b, {"M": 0, "N": 1, "code1": 1, "code2": 3}),
}


def still(name, given, seed, efd=EFD):
    """A device at random parameters with open limits, and its states and inputs at rest."""
    device = devices.every()[name]
    p = opened(device, draw(name, np.random.default_rng(seed), **given))
    u = {n: TERMINALS[n] for n in device.Input._fields if n in TERMINALS}
    x, u = rest(device, p, u, {"Efd": efd} if device.role == "exciter" else {}, (V.real, V.imag))
    return device, p, x, u


@pytest.mark.parametrize("seeds", [range(2), pytest.param(range(2, 20), marks=pytest.mark.slow)], ids=["2", "18"])
@pytest.mark.parametrize("name", EXCITERS | STABILIZERS)
def test_linearized_it_is_its_block_diagram(name, seeds):
    """At 20 sets of parameters, drawn at random, and 30 frequencies."""
    model, diagram, given = (EXCITERS | STABILIZERS)[name]
    for seed in seeds:
        device, p, x, u = still(model, given, seed)
        wanted = diagram(p, device.State(*x), u)
        if device.role == "exciter" and "vt" not in wanted:
            wanted["vt"] = -wanted["Vref"] * (lag(p.TR) if "TR" in p._fields else 1)
        if name in ("esst3a", "esst4b", "exst3", "expic1", "st8c fed by the terminals"):
            del wanted["vt"]  # it also moves the source
        output = "Efd" if device.role == "exciter" else "Vs"
        found = response(device, p, x, u, list(wanted), output, (V.real, V.imag))
        assert distance(found, list(wanted.values())) < 1e-9, seed


def test_every_model_of_an_exciter_or_stabilizer_has_a_diagram():
    known = {model for model, _, _ in (EXCITERS | STABILIZERS).values()}
    assert known == {n for n, m in devices.every().items() if m.role in ("exciter", "stabilizer")}


def driven(name, signal, given):
    """Time, and the states and outputs by name, while `signal` is 3 pu too high for 1 s, then 3 pu too low."""
    device = devices.every()[name]
    p = draw(name, np.random.default_rng(0), **given)
    p = device.prepared(p)
    u = {n: TERMINALS[n] for n in device.Input._fields if n in TERMINALS}
    x, u = rest(device, opened(device, p), u, {"Efd": EFD} if device.role == "exciter" else {}, (V.real, V.imag))
    rates, _ = evaluate(device, p, x, u, (V.real, V.imag))
    assert np.abs(rates).max() < 1e-8  # stationary within its limits too
    out = motion(device, p, x, lambda t: u | {signal: u[signal] + (3.0 if t < 1 else -3.0)}, 1.5, (V.real, V.imag))
    names = [*device.State._fields, *device.Output._fields]
    return np.arange(len(out)) * 2.5e-3, dict(zip(names, out.T, strict=True)), p


BARE = {
    "TR": 0.0,
    "TB": 0.0,
    "TC": 0.0,
    "KF": 0.0,
    "KE": 1.0,
    "TE": 0.3,
    "KA": 20.0,
    "TA": 0.05,
    "SE1": 0.0,
    "SE2": 0.0,
}
NO_AC = {"KC": 0.0, "KD": 0.0, "KL": 100.0, "VLR": 100.0, "KB": 1.0, "KH": 0.0, "VFELIM": 100.0}
QUICK = dict.fromkeys(("A1", "A2", "A3", "A4", "A5", "A6", "T4", "T5", "T6", "T7"), 0.0) | {
    "T2": 0.1,
    "T9": 0.02,
    "KS1": 10.0,
}
PID = {"KPR": 1.0, "KIR": 0.5, "KDR": 0.0, "VRmax": 9.0, "VRmin": -9.0, "VEmin": 0.0, "VFEmax": 99.0}
LIMITED = [  # device, input that is driven, parameters, the signal that is limited, and its limits
    ("sexs", "Vref", {"Efdmax": 4.0, "Efdmin": -1.0}, "efd", 4.0, -1.0),
    (
        "scrx",
        "Vref",
        {"K": 20.0, "TE": 0.05, "Emax": 4.0, "Emin": -1.0, "switch": 1, "resistor": 0.0},
        "Efd",
        4.0,
        -1.0,
    ),
    ("exst1", "Vref", {"VRmax": 4.0, "VRmin": -1.0, "KC": 0.0}, "Efd", 4 * abs(V), -abs(V)),
    ("exst1", "Vref", {"VRmax": 4.0, "VRmin": -1.0, "KC": 0.5}, "Efd", 4 * abs(V) - 0.5 * IFD, -abs(V) - 0.5 * IFD),
    ("exst1", "Vref", {"VImax": 0.2, "VImin": -0.2, "KC": 0.0, "TA": 0.0}, "Efd", 4.0, -4.0),
    ("ieeet1", "Vref", {"VRmax": 4.0, "VRmin": -1.0}, "vr", 4.0, -1.0),
    ("ieeet2", "Vref", {"VRmax": 4.0, "VRmin": -1.0}, "vr", 4.0, -1.0),
    ("ieeex1", "Vref", {"VRmax": 4.0, "VRmin": -1.0}, "vr", 4.0, -1.0),
    ("exdc2", "Vref", {"VRmax": 4.0, "VRmin": -1.0}, "vr", 4 * abs(V), -abs(V)),
    ("esdc1a", "Vref", {"VRmax": 4.0, "VRmin": -1.0}, "vr", 4.0, -1.0),
    ("esdc1a", "Vref", {"VRmax": 4.0, "VRmin": -9.0}, "efd", None, 0.0),
    ("esdc2a", "Vref", {"VRmax": 4.0, "VRmin": -1.0}, "vr", 4 * abs(V), -abs(V)),
    ("esdc2a", "Vref", {"VRmax": 4.0, "VRmin": -9.0}, "efd", None, 0.0),
    ("dc4b", "Vref", {"VRmax": 4.0, "VRmin": -9.0, "KD": 0.0, "VEmin": 0.5}, "efd", None, 0.5),
    ("dc4b", "Vref", {"VRmax": 4.0, "VRmin": -1.0, "KD": 0.0, "VEmin": -9.0, "TA": 0.02}, "vr", 4 * abs(V), -abs(V)),
    ("exac1", "Vref", NO_AC | {"VRmax": 4.0, "VRmin": -1.0}, "vr", 4.0, -1.0),
    ("exac1", "Vref", NO_AC | {"VRmax": 4.0, "VRmin": -9.0}, "ve", None, 0.0),
    ("esac1a", "Vref", NO_AC | {"VAmax": 4.0, "VAmin": -1.0}, "vr", 4.0, -1.0),
    ("esac1a", "Vref", NO_AC | {"VAmax": 9.0, "VAmin": -9.0, "VRmax": 4.0, "VRmin": -9.0, "TE": 0.01}, "ve", 4.0, 0.0),
    ("exac2", "Vref", NO_AC | {"VAmax": 4.0, "VAmin": -1.0}, "vr", 4.0, -1.0),
    ("exac2", "Vref", NO_AC | {"VRmax": 4.0, "VRmin": -9.0, "TE": 0.01}, "ve", 4.0, 0.0),
    ("exac2", "Vref", NO_AC | {"KL": 10.0, "VLR": 3.0, "TE": 0.05}, "ve", 30 / 11, 0.0),
    ("esac6a", "Vref", NO_AC | {"TA": 0.0, "VAmax": 4.0, "VAmin": -9.0, "TE": 0.01}, "ve", 4.0, 0.0),
    ("esac6a", "Vref", NO_AC | {"TA": 0.0, "VRmax": 4.0, "VRmin": -9.0, "TE": 0.01}, "ve", 4 * abs(V), 0.0),
    (
        "esac6a",
        "Vref",
        NO_AC | {"TA": 0.0, "VAmax": 9.0, "VFELIM": 2.5, "KH": 10.0, "VHmax": 3.0, "TH": 0.0, "TE": 0.01},
        "ve",
        6.0,
        0.0,
    ),
    ("ac8b", "Vref", NO_AC | PID | {"VRmax": 4.0, "VRmin": -1.0}, "vr", 4.0, -1.0),
    ("ac8b", "Vref", NO_AC | PID | {"VPIDmax": 0.2, "VPIDmin": 0.05, "TA": 0.0, "TE": 0.01}, "ve", 4.0, 1.0),
    ("ac8b", "Vref", NO_AC | PID | {"VFEmax": 4.0, "VEmin": 0.5, "TE": 0.05}, "ve", 4.0, 0.5),
    ("esst1a", "Vref", {"VAmax": 4.0, "VAmin": -1.0, "KLR": 0.0, "KC": 0.0, "TB1": 0.0}, "vr", 4.0, -1.0),
    (
        "esst1a",
        "Vref",
        {"VRmax": 4.0, "VRmin": -1.0, "KLR": 0.0, "KC": 0.5, "TB1": 0.0},
        "Efd",
        4 * abs(V) - 0.5 * IFD,
        -abs(V),
    ),
    ("esst1a", "Vref", {"VImax": 0.2, "VImin": -0.2, "KLR": 0.0, "KC": 0.0, "TB1": 0.0, "TA": 0.0}, "Efd", 4.0, -4.0),
    ("esst3a", "Vref", SOURCE | {"VRmax": 4.0, "VRmin": -1.0, "KG": 0.0}, "vr", 4.0, -1.0),
    ("esst3a", "Vref", SOURCE | {"VMmax": 4.0, "VMmin": -1.0, "KG": 0.0}, "vm", 4.0, -1.0),
    (
        "esst4b",
        "Vref",
        SOURCE
        | {"VMmax": 1.0, "VMmin": -0.5, "TA": 0.0, "KG": 0.5, "VRmax": 5.0, "VRmin": -5.0, "KIM": 50.0, "KIR": 50.0},
        "Efd",
        "VB",
        -0.5,
    ),
    (
        "esst4b",
        "Vref",
        SOURCE | {"VRmax": 2.0, "VRmin": -1.0, "KIM": 0.0, "KPM": 1.0, "KG": 0.0, "TA": 0.0},
        "Efd",
        "2 VB",
        -1.0,
    ),
    ("exst3", "Vref", SOURCE | {"VRmax": 4.0, "VRmin": -1.0, "KG": 0.0}, "vr", 4.0, -1.0),
    ("exst3", "Vref", SOURCE | {"Emax": 4.0, "KG": 0.0}, "Efd", 4.0, -4.0),
    (
        "expic1",
        "Vref",
        {"VAmax": 4.0, "VAmin": -1.0, "TA2": 0.0, "TA4": 0.0, "TE": 0.0, "KP": 0.0, "KI": 0.0},
        "Efd",
        4.0,
        -1.0,
    ),
    (
        "expic1",
        "Vref",
        {
            "VAmax": 5.0,
            "VAmin": -2.0,
            "VRmax": 4.0,
            "VRmin": -1.0,
            "TA2": 0.0,
            "TA4": 0.0,
            "TE": 0.0,
            "KP": 0.0,
            "KI": 0.0,
        },
        "Efd",
        4.0,
        -1.0,
    ),
    (
        "expic1",
        "Vref",
        {
            "VAmax": 5.0,
            "VAmin": -2.0,
            "Efdmax": 4.0,
            "Efdmin": -1.0,
            "TA2": 0.0,
            "TA4": 0.0,
            "TE": 0.0,
            "KP": 0.0,
            "KI": 0.0,
        },
        "Efd",
        4.0,
        -1.0,
    ),
    (
        "st6b",
        "Vref",
        {"VRmax": 4.0, "VRmin": -1.0, "KDA": 0.0, "KLR": 9.0, "KCI": 9.0, "ILR": 9.0},
        "Efd",
        4 * abs(V),
        -abs(V),
    ),
    (
        "st6b",
        "Vref",
        {"KG": 0.0, "VRmin": -1.0, "VAmax": 5.0, "VAmin": -5.0, "KDA": 0.0, "KLR": 1.0, "KCI": 1.0, "ILR": 4.3},
        "Efd",
        3 * abs(V),
        -abs(V),
    ),
    (
        "st6b",
        "Vref",
        {
            "VAmax": 4.0,
            "VAmin": -1.0,
            "KPA": 3.0,
            "KIA": 5.0,
            "KFF": 1.0,
            "KM": 0.0,
            "KDA": 0.0,
            "KLR": 9.0,
            "KCI": 9.0,
            "ILR": 9.0,
        },
        "Efd",
        4 * abs(V),
        -abs(V),
    ),
    ("st8c", "Vref", {"KP": 2.0, "KC1": 0.0, "KI2": 0.0, "SW1": 0, "VRmax": 2.0, "VRmin": -1.0}, "va", 2.0, -1.0),
    (
        "st8c",
        "Vref",
        {"KP": 2.0, "KC1": 0.0, "KI2": 0.0, "SW1": 0, "TA": 0.0, "VAmax": 0.2, "VAmin": -0.2},
        "Efd",
        8.0,
        -8.0,
    ),
    ("pss", "omega", {"Vmax": 0.1, "Vmin": -0.1}, "Vs", 0.1, -0.1),
    ("ieeest", "omega", QUICK | {"Lmax": 0.1, "Lmin": -0.1, "VCU": 0.0, "VCL": 0.0, "code": 1}, "Vs", 0.1, -0.1),
    ("st2cut", "omega", {"Lmax": 0.1, "Lmin": -0.1, "VCU": 0.0, "VCL": 0.0, "code1": 1, "code2": 0}, "Vs", 0.1, -0.1),
    ("stab2a", "P", QUICK | {"Hmax": 0.001}, "Vs", 0.001, -0.001),
    (
        "pss2b",
        "omega",
        QUICK | {"VSTmax": 0.1, "VSTmin": -0.1, "M": 5, "N": 1, "code1": 1, "code2": 3},
        "Vs",
        0.1,
        -0.1,
    ),
]


@pytest.mark.parametrize(
    ("name", "signal", "given", "what", "high", "low"), LIMITED, ids=lambda v: v if isinstance(v, str) else ""
)
def test_a_limit_is_reached_and_left_without_windup(name, signal, given, what, high, low):
    """The limits that are not given are far away. Driven the other way, the signal leaves its limit within 0.3 s."""
    device = devices.every()[name]
    far = {f: (-99.0 if f.endswith("min") else 99.0) for f in fields(device.Par) if f.endswith(("min", "max"))}
    bare = BARE if device.role == "exciter" else {}
    t, found, p = driven(name, signal, far | bare | given)
    if name == "esst4b":
        high, low = (value * supply(p, p.THETAP, p.XL)[0] for value in ({"VB": 1.0, "2 VB": 2.0}[high], low))
    y = found[what]
    after = y[(t > 1) & (t < 1.3)]
    if high is not None:
        assert y.max() == pytest.approx(high, abs=2e-3 if what == "ve" else 1e-7)
        assert after.min() < high - 1e-2 * (high - low)
    assert y.min() == pytest.approx(low, abs=1e-7)
