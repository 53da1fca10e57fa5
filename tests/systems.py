"""Small systems for the laws: one machine of every kind against a large classical one.

machine 1 -- bus 1 --- bus 2 (load) === bus 3 -- machine 2 (swing, GENCLS, ten times as large)
"""

import re
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from library import EXCITERS, STABILIZERS
from records import (
    cim,
    degov,
    degov1,
    dera1,
    exdc2,
    exponential,
    exst3,
    gast,
    gencls,
    genrou,
    gensal,
    gentpj1,
    ggov1,
    hygov,
    ieeeg1,
    ieeeg3,
    ieeet1,
    ieel,
    ieesgo,
    pidgov,
    pss,
    reec_a,
    reec_b,
    reec_c,
    reec_d,
    regc_a,
    regc_b,
    regc_c,
    regfm_a1,
    regfm_b1,
    repc_a,
    sexs,
    tgov,
    tgov1,
    two_axis,
    wpidhy,
    wtdt_a,
)

from stabctl import devices
from stabctl._util.schema import fields
from stabctl.devices.storage import DEVICES
from stabctl.model.case import Case
from stabctl.model.tables import Branch, Bus, Load, Machine

OWN = Path(__file__).parent / "devices"  # devices as a user would write them

ROUND = genrou.Par(
    mva=0, wb=0, H=4.0, D=0.5, ra=0.003, xl=0.15, xd=1.8, x1d=0.3, x2=0.22, T1d=7.0, T2d=0.03, xq=1.7, x1q=0.5,
    T1q=0.4, T2q=0.05,
)  # fmt: skip
SATURATED = ROUND._replace(S10=0.1, S12=0.4)
SALIENT = ROUND._replace(xd=1.1, xq=0.7, x1q=0.7, T1q=0.5)
POLES = gensal.Par(
    mva=0, wb=0, H=4.0, D=0.5, ra=0.003, xl=0.15, xd=1.1, x1d=0.3, x2=0.22, T1d=6.0, T2d=0.04, xq=0.7, T2q=0.08,
    S10=0.1, S12=0.4,
)  # fmt: skip
TWO_AXES = two_axis.Par(mva=0, wb=0, H=4.0, D=0.5, ra=0.003, xd=1.1, x1d=0.3, T1d=6.0, xq=0.9, x1q=0.5, T1q=0.5)
TYPE_J = gentpj1.Par(
    mva=0, wb=0, H=4.0, D=0.5, ra=0.003, xl=0.15, xd=1.8, x1d=0.3, x2d=0.22, T1d=7.0, T2d=0.03, xq=1.7, x1q=0.5,
    x2q=0.25, T1q=0.4, T2q=0.05, S10=0.1, S12=0.4, Kis=0.1,
)  # fmt: skip
CLASSICAL = gencls.Par(mva=0, wb=0, H=4.0, D=1.0, ra=0.002, x1d=0.3)
SEXS = sexs.Par(0.01, 200.0, 0.05)
EXST3 = exst3.Par(TR=0.01, KA=200.0, TA=0.02, TB=10.0, TC=1.0, VRmax=5.0, VRmin=-5.0, VImax=0.1, VImin=-0.1, KP=1.2)
EXDC2 = exdc2.Par(
    TR=0.02, KA=40.0, TA=0.05, TB=1.0, TC=0.5, VRmax=6.0, VRmin=-6.0, KE=1.0, TE=0.5, KF=0.05, TF=1.0, E1=1.2,
    SE1=0.05, E2=2.4, SE2=0.3,
)  # fmt: skip
IEEET1 = ieeet1.Par(
    TR=0.02, KA=40.0, TA=0.05, VRmax=6.0, VRmin=-6.0, KE=1.0, TE=0.5, KF=0.05, TF=1.0, E1=1.2, SE1=0.05, E2=2.4, SE2=0.3
)
PSS = pss.Par(K=5.0, Tw=10.0, T1=0.05, T2=0.02, T3=0.1, T4=0.03)
EXPONENTIAL = exponential.Par(P0=0, Q0=0, V0=1.0, vlow=0.7, a=1.3, b=3.0)
VARIED = ieel.Par(
    P0=0, Q0=0, V0=0, vlow=0, wb=0, a1=0.4, a2=0.2, a3=0.4, a4=0.5, a5=0.25, a6=0.25, a7=2.0, a8=-1.5, n1=1.8
)
MOTOR = cim.Par(*(0,) * 11, 0.01, 0.09, 4.2, 0.035, 0.09)
DER = dera1.Par(mva=0, V0=0, bus=0, Ddn=20.0, Dup=20.0, fdbd1=0.0, fdbd2=0.0)
REGC = regc_a.Par(0, 0.02)
REGC_B = regc_b.Par(0)
REGC_C = regc_c.Par(0, 0)
FORMING = regfm_a1.Par(0, 0)
VIRTUAL = regfm_b1.Par(0, 0)
REEC = reec_b.Par(0, Kqv=2.0, Imax=1.5)
PLANT = repc_a.Par(RefFlag=1, FFlag=1, Kp=2.0, Ki=1.0, Ddn=20.0, Dup=20.0)
STEAM = tgov.Par(K=20.0, Ts=0.1, Tc=0.5, T3=0.0, T4=1.25, T5=5.0)
GAS = ggov1.Par()
HYDRO = tgov.Par(K=20.0, Ts=0.5, Tc=5.0, T3=1.0, T4=-1.0, T5=0.5)

GOVERNORS = {  # of machines at 0.3 to 0.85 pu, whose limits a large step of the speed reaches
    tgov1: tgov1.Par(R=0.05, T1=0.3, T2=1.0, T3=5.0, Dt=0.0, Vmax=0.9, Vmin=0.3),
    gast: gast.Par(R=0.05, T1=0.4, T2=0.1, T3=3.0, AT=1.0, KT=2.0, Vmax=0.9, Vmin=0.3),
    ieeeg1: ieeeg1.Par(K=20.0, T1=0.2, T2=0.0, T3=0.1, T4=0.3, K1=0.3, T5=5.0, K3=0.7, Pmax=0.9, Pmin=0.3),
    hygov: hygov.Par(R=0.05, r=0.3, Tr=5.0, Tf=0.05, Tg=0.2, Tw=1.0, VELM=0.1, Gmax=0.85, Gmin=0.3),
    ieesgo: ieesgo.Par(T1=0.1, T2=0.0, T3=0.2, T4=0.1, T5=0.4, T6=0.2, K1=20.0, K2=0.7, K3=0.2, Pmax=0.9, Pmin=0.3),
    ieeeg3: ieeeg3.Par(
        TG=0.2, TP=0.05, sigma=0.05, delta=0.3, TR=5.0, TW=1.0, Umax=0.15, Umin=-0.15, Pmax=0.9, Pmin=0.3,
    ),
    degov: degov.Par(T1=0.02, T2=0.01, T3=0.1, K=10.0, T4=0.5, T5=0.1, T6=0.05, TD=0.1, Tmax=0.9, Tmin=0.3),
    degov1: degov1.Par(
        M=0, T1=0.02, T2=0.01, T3=0.1, K=10.0, T4=0.5, T5=0.1, T6=0.05, TD=0.1, DROOP=0.05, TE=0.1, Tmax=0.9,
        Tmin=0.3,
    ),
    pidgov: pidgov.Par(
        feedback=1, Rperm=0.05, Treg=0.05, Kp=4.0, Ki=1.0, Kd=0.2, Ta=0.1, Tb=0.3, Dturb=0.0, G0=0.1, G1=0.5, P1=0.3,
        G2=0.75, P2=0.55, P3=1.0, Atw=1.0, Tw=1.0, Gmax=0.9, Gmin=0.3, Velmax=0.1, Velmin=-0.1,
    ),
    wpidhy: wpidhy.Par(
        Treg=0.05, Reg=-0.05, Kp=2.0, Ki=0.05, Kd=1.0, Ta=0.05, Tb=0.05, Tw=1.0, D=0.0, G0=0.1, G1=0.5, P1=0.3,
        G2=0.75, P2=0.55, P3=1.0, Velmax=0.1, Velmin=-0.1, Gatmax=0.9, Gatmin=0.3,
    ),
}  # fmt: skip


def table(name):
    """Table of a device whose name, here, may go on after it: "scrx with a constant source"."""
    return re.split(r"\W", name)[0]


KINDS = {  # name -> devices of machine 1 and load 2; between them every model, and every branch of its equations
    "classical": {"gencls": CLASSICAL},
    "classical with governor": {"gencls": CLASSICAL, "tgov": STEAM},
    "bare": {"genrou": ROUND},
    "saturated": {"genrou": SATURATED, "sexs": SEXS},
    "salient": {"genrou": SALIENT, "sexs": SEXS, "tgov": HYDRO},
    "gensal": {"gensal": POLES, "sexs": SEXS, "tgov": HYDRO},
    "exponential load": {"gencls": CLASSICAL, "exponential": EXPONENTIAL},
    "converter": {"regc_a": REGC},
    "open rotor circuit": {"genrou": ROUND._replace(x1q=ROUND.xq, T1q=0.0), "exst3": EXST3},
    "sexs, pss, steam": {"genrou": ROUND, "sexs": SEXS, "pss": PSS, "tgov": STEAM},
    "sexs with TB, TC": {"genrou": ROUND, "sexs": SEXS._replace(TB=10.0, TC=1.0), "pss": PSS},
    "sexs bypassed": {"genrou": ROUND, "sexs": SEXS._replace(TR=0.0, TA=0.0, KA=15.0)},
    "exst3 bus-fed": {"genrou": ROUND, "exst3": EXST3, "pss": PSS, "tgov": HYDRO},
    "exst3 inner feedback": {
        "genrou": ROUND,
        "exst3": EXST3._replace(TR=0.0, KA=50.0, TA=0.2, VImax=0.2, KG=0.1, KJ=2.0),
    },
    "exdc2": {"genrou": SATURATED, "exdc2": EXDC2, "pss": PSS},
    "exdc2 bypassed": {"genrou": ROUND, "exdc2": EXDC2._replace(TR=0.0, TA=0.0, TB=0.0, KA=20.0, SE2=0.0)},
    "ieeet1": {"genrou": SATURATED, "ieeet1": IEEET1, "tgov": STEAM},
    "pss bypassed": {"genrou": ROUND, "sexs": SEXS, "pss": PSS._replace(T2=0.0, T4=0.0)},
    "governor bypassed": {"genrou": ROUND, "sexs": SEXS, "tgov": STEAM._replace(Ts=0.0, Tc=0.0, T5=0.0)},
}

LIBRARY = {  # the same for devices of the library, whose tests are slow ones: each of them compiles its devices
    "genrou with speed factor": {"genrou": SATURATED._replace(speed_factor=1), "sexs": SEXS},
    "genroe": {"genroe": SATURATED, "sexs": SEXS},
    "gensae": {"gensae": POLES, "sexs": SEXS},
    "gentpj1": {"gentpj1": TYPE_J, "sexs": SEXS},
    "gentpj1 without saturation": {"gentpj1": TYPE_J._replace(S10=0.0, x1q=TYPE_J.xq, T1q=0.0)},
    **{device.name.lower(): {"genrou": ROUND, device.table: par} for device, par in GOVERNORS.items()},
    "ggov1": {"genrou": ROUND, "ggov1": GAS},
    "ggov1, diesel engine": {
        "gencls": CLASSICAL,
        "ggov1": GAS._replace(select=-2, fuel=1, Teng=0.05, Dm=0.5, Vmin=0.0, Kdgov=0.5, Tdgov=0.1),
    },
    "ggov1 with a load controller": {"gencls": CLASSICAL, "ggov1": GAS._replace(Kimw=0.01, Dm=-0.5, db=0.0)},
    "degov1 with power": {"gencls": CLASSICAL, "degov1": GOVERNORS[degov1]._replace(M=1)},
    "pidgov with power": {"gencls": CLASSICAL, "pidgov": GOVERNORS[pidgov]._replace(feedback=0)},
    "reec_b, currents": {"regc_a": REGC, "reec_b": REEC._replace(PqFlag=1)},
    "reec_b, voltage": {"regc_a": REGC, "reec_b": REEC._replace(QFlag=1, Kvp=1.0, Kvi=4.0, PfFlag=1)},
    "repc_a, voltage": {
        "regc_a": REGC,
        "reec_b": REEC._replace(VFlag=0, QFlag=1, Kvi=4.0),
        "repc_a": PLANT._replace(Qmax=1.1, Qmin=0.9),
    },
    "repc_a, reactive power": {"regc_a": REGC, "reec_b": REEC, "repc_a": PLANT._replace(RefFlag=0, FFlag=0)},
    "repc_a, compensation": {"regc_a": REGC, "reec_b": REEC, "repc_a": PLANT._replace(VcFlag=1, Rc=0.01, Xc=0.05)},
    "reec_a and wtdt_a": {
        "regc_a": REGC,
        "reec_a": reec_a.Par(0, PFlag=1, Imax=1.5, Kqv=2.0),
        "wtdt_a": wtdt_a.Par(0, 0, 4.0, D=1.0),
    },
    "reec_a, active current first": {
        "regc_a": REGC,
        "reec_a": reec_a.Par(0, PqFlag=1, QFlag=1, Kvi=4.0, Imax=1.5),
        "repc_a": PLANT,
    },
    "reec_c": {"regc_a": REGC, "reec_c": reec_c.Par(0, 0, 0, Imax=1.5)},
    "reec_d": {"regc_a": REGC, "reec_d": reec_d.Par(0, PFlag=1, Imax=1.5, Kqv=2.0)},
    "reec_d, compensated voltage": {
        "regc_a": REGC,
        "reec_d": reec_d.Par(0, VcmpFlag=1, Rc=0.01, Xc=0.05, QFlag=1, Kvi=4.0, PqFlag=1, Imax=1.5),
    },
    "wtdt_a of one mass": {"regc_a": REGC, "reec_b": REEC, "wtdt_a": wtdt_a.Par(0, 0, 4.0, D=1.0, Htfrac=0.0)},
    "cim of one cage": {"gencls": CLASSICAL, "cim": MOTOR},
    "cim of two cages": {"gencls": CLASSICAL, "cim": MOTOR._replace(R2=0.05, X2=0.06, A=0.5, C0=0.3, D=0.2, E=1.5)},
    "cim of two cages behind X1": {"gencls": CLASSICAL, "cim": MOTOR._replace(R2=0.02, X2=0.1, kind=2)},
    "regc_b": {"regc_b": REGC_B, "reec_b": REEC._replace(Imax=1.2)},
    "regc_b, power and active current first": {"regc_b": REGC_B._replace(RateFlag=1, PqFlag=1, Re=0.01, Te=0.0)},
    "regc_c": {"regc_c": REGC_C, "reec_b": REEC._replace(Imax=1.2)},
    "regc_c, power and active current first": {"regc_c": REGC_C._replace(RateFlag=1, PqFlag=1, Re=0.01, Te=0.0)},
    "regfm_a1": {"regfm_a1": FORMING},
    "regfm_a1 without a voltage controller": {"regfm_a1": FORMING._replace(VFlag=0, RL=0.01)},
    "regfm_b1": {"regfm_b1": VIRTUAL},
    "regfm_b1, reactive current first": {
        "regfm_b1": VIRTUAL._replace(PQFlag=0, VdrpFlag=1, wFlag=1, Tp=0.02, TPf=0.0, RL=0.01, kpv=0.1, ESFlag=0)
    },
    "dera1": {"dera1": DER},
    "dera1, active current first": {"dera1": DER._replace(PqFlag=1, PfFlag=0, FreqFlag=0, Kqv=2.0, dbd1=0.0, dbd2=0.0)},
    "ieel": {"gencls": CLASSICAL, "ieel": VARIED},
    "ieel of voltage": {"gencls": CLASSICAL, "ieel": VARIED._replace(a7=0.0, a8=0.0)},
    "two axes": {"two_axis": TWO_AXES, "sexs": SEXS, "tgov": STEAM},
    **{name: {"genrou": SATURATED, table(name): par} for name, par in EXCITERS.items()},
    **{name: {"genrou": ROUND, "sexs": SEXS, table(name): par} for name, par in STABILIZERS.items()},
}

OWN_KINDS = {  # name -> devices of machine 1, and a device of the user's: its table and constants
    "signals from elsewhere": ({"genrou": ROUND, "exdc2": EXDC2, "pss": PSS}, "wide_area", (3, 2, 0.1, 2.0, 3.0)),
}
# a unit without active power (test_psse, test_converter_controls), sensors of controllers (tests/controllers), and
# storage behind converters (test_storage_converters)
APART = {"csvgn1", "line_power", "line_current", "bus_angle", "rocof", *DEVICES} - {"esd"}
ALL_KINDS = (*KINDS, *OWN_KINDS, *LIBRARY)


def one_of(first, *others):
    """Parameters of a test, of which all but the first are slow ones."""
    return [first, *(pytest.param(other, marks=pytest.mark.slow) for other in others)]


def each(names=ALL_KINDS):
    """Parameters of a test of kinds, of which those of the library are slow ones."""
    return [pytest.param(name, marks=pytest.mark.slow) if name in LIBRARY else name for name in names]


def small(models, p=300.0, load=None, base=400.0, v=1.02, links=()):
    """Machine 1 with these devices, `p` MW, against the large classical machine 2; a load model stands at bus 2."""
    tables = {k: {2 if devices.every()[k].role == "load" else 1: par} for k, par in models.items()}
    tables["gencls"] = tables.get("gencls", {}) | {2: gencls.Par(mva=0, wb=0, H=5.0, D=2.0, ra=0.0, x1d=0.2)}
    return Case(
        name="small",
        buses=(Bus(1, "pv", v), Bus(2, "pq"), Bus(3, "swing", 1.0)),
        branches=(Branch(1, 2, 0.001, 0.02), Branch(2, 3, 0.005, 0.05, 0.1), Branch(2, 3, 0.005, 0.05, 0.1)),
        machines=(Machine(1, 1, base, p, 2), Machine(2, 3, 4000.0, 0.0, 3)),
        devices=tables,
        loads=(load or Load(2, 200.0, 50.0),),
        links=tuple(links),
    )


@contextmanager
def registered(*paths):
    """Devices of these files are known for a while; their modules."""
    before = dict(devices._registered)
    try:
        names = [devices.register(path) for path in paths]
        yield [devices.every()[name] for name in names]
    finally:
        devices._registered.clear()
        devices._registered.update(before)
        devices.every.cache_clear()
        devices.models.cache_clear()


@contextmanager
def kind(name):
    """Devices of a kind of ALL_KINDS, all of them known for a while."""
    if name not in OWN_KINDS:
        yield (KINDS | LIBRARY)[name]
        return
    others, table, values = OWN_KINDS[name]
    with registered(OWN / f"{table}.py") as (device,):
        filled = [0.0] * sum(field not in fields(device.Par) for field in device.Par._fields)
        yield {**others, table: device.Par(*filled, *values)}


def doubled(case):
    """The same system with machine 1 split into two equal ones, 1 and 101, at its bus."""
    one, *others = case.machines
    half = one._replace(base=one.base / 2, p=one.p / 2)
    devices = {k: {**rows, 101: rows[1]} if 1 in rows else rows for k, rows in case.devices.items()}
    return replace(case, machines=(half, half._replace(machine=101), *others), devices=devices)


def rebased(case, base):
    """The same system with its per-unit network on another system base (MVA)."""
    k = base / case.base_mva
    branches = tuple(b._replace(r=b.r * k, x=b.x * k, b=b.b / k) for b in case.branches)
    return replace(case, base_mva=base, branches=branches)


def with_shares(case, **shares):
    """The same case, its loads of these shares (`p_current=1` ...)."""
    return replace(case, loads=tuple(load._replace(**shares) for load in case.loads))
