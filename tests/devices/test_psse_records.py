"""PSS/E records of exciters and stabilizers: constants in their order, corrections, and codes that are refused."""

from types import SimpleNamespace

import numpy as np
import pytest
from block_diagram import evaluate
from records import esst1a, ieeest, ieeet1, pss, pss2b, scrx, sexs, st2cut
from systems import ROUND, small

from stabctl import devices
from stabctl._util.schema import hints
from stabctl.dynamics import operating_point

RECORDS = [(name, kind) for name, m in devices.every().items() for kind in m.dyr]


def names(device, kind):
    """Names of the constants of a record that are read."""
    return [n.removeprefix("+") for n in device.dyr[kind].split() if not n.startswith("_")]


def values(device, kind, text):
    return dict(zip(names(device, kind), map(float, text.split()), strict=True))


@pytest.mark.parametrize(("name", "kind"), RECORDS)
def test_a_record_fills_every_parameter(name, kind):
    """Without a function of its own, the names of a record are those of all parameters of its device."""
    device = devices.every()[name]
    constants = names(device, kind)
    assert len(set(constants)) == len(constants)
    given = {n for n, field in hints(device.Par).items() if field is not None}
    if not device.has("from_record"):
        assert set(constants) <= given
        network = {"ra", "x1d", "Re", "Xe"}  # the RAW file gives the source of a machine
        assert not {n for n in given - network - set(constants) if n not in device.Par._field_defaults}


def test_ratios_of_time_constants():
    par, said = sexs.from_record("SEXS", values(sexs, "SEXS", "0.4 5 20 1 -50 50"))
    assert par == sexs.Par(TR=0.0, KA=20.0, TA=1.0, TB=5.0, TC=2.0, Efdmax=50.0, Efdmin=-50.0)
    assert said == []
    par, _ = scrx.from_record("SCRX", values(scrx, "SCRX", "0.4 5 20 1 -50 50 1 0.5"))
    assert par == scrx.Par(K=20.0, TE=1.0, TB=5.0, TC=2.0, Emax=50.0, Emin=-50.0, switch=1, resistor=0.5)
    par, _ = pss.from_record("STAB1", values(pss, "STAB1", "6 1.5 13.3 0.0447 13.3 0.0447 0.2"))
    assert par == pytest.approx((6.0, 1.5, 13.3 * 0.0447, 0.0447, 13.3 * 0.0447, 0.0447, 0.2, -0.2))


IEEET1 = {
    "TR": 0.01, "KA": 20.0, "TA": 0.02, "VRmax": 10.0, "VRmin": -10.0, "KE": 1.0, "TE": 1.5, "KF": 0.04, "TF": 0.7,
    "E1": 1.65, "SE1": 0.12, "E2": 2.2, "SE2": 0.54,
}  # fmt: skip


def test_points_of_saturation_in_the_wrong_order_are_exchanged():
    wanted, none = ieeet1.from_record("IEEET1", IEEET1)
    assert none == []
    swapped = IEEET1 | {"E1": 2.2, "SE1": 0.54, "E2": 1.65, "SE2": 0.12}
    par, said = ieeet1.from_record("IEEET1", swapped)
    assert par == wanted
    assert said == ["E1 = 2.2 is above E2 = 1.65: the two points of saturation are exchanged."]


def test_saturation_at_the_first_point_alone_is_left_out():
    par, said = ieeet1.from_record("IEEET1", IEEET1 | {"SE2": 0.0})
    assert (par.SE1, par.SE2) == (0.0, 0.0)
    assert said == ["SE(E2) = 0 although SE(E1) = 0.12: saturation is left out."]


def test_a_ceiling_of_zero_is_computed_from_saturation():
    par, said = ieeet1.from_record("IEEET1", IEEET1 | {"VRmax": 0.0, "VRmin": 0.0})
    assert (par.VRmax, par.VRmin) == pytest.approx((1.54 * 2.2, -1.54 * 2.2))
    assert said == ["VRMAX = 0: computed from saturation as 3.388, VRMIN as its negative."]
    par, _ = ieeet1.from_record("IEEET1", IEEET1 | {"VRmax": 0.0, "KE": -0.05})
    assert par.VRmax == pytest.approx(0.54 * 2.2)
    with pytest.raises(ValueError, match="VRMAX = 0 cannot be computed"):
        ieeet1.from_record("IEEET1", IEEET1 | {"VRmax": 0.0, "KE": 0.0, "SE1": 0.0, "SE2": 0.0})


def test_an_exciter_constant_of_zero_starts_the_regulator_at_a_tenth_of_its_ceiling():
    par, said = ieeet1.from_record("IEEET1", IEEET1 | {"KE": 0.0})
    assert said == ["KE = 0: computed at the start so that the regulator is at a tenth of VRMAX."]
    point = operating_point.solve(small({"genrou": ROUND, "ieeet1": par}))
    f = point.system.family("ieeet1")
    k = dict(zip(ieeet1.Par._fields, f.k[0], strict=True))
    vr, efd = (point.s[f.w[0, 0] + ieeet1.State._fields.index(n)] for n in ("vr", "efd"))
    assert vr == pytest.approx(1.0, abs=1e-10)
    S = k["SB"] * max(efd - k["SA"], 0.0) ** 2 / efd
    assert k["KE"] == pytest.approx(10.0 / (10 * efd) - S, abs=1e-12)
    assert np.abs(point.equations.at(point.s.copy()).rates).max() < 1e-10
    assert point.case.devices["ieeet1"][1].KE == 0  # the case keeps what was given


def test_the_cutoff_of_st2cut_is_measured_from_the_voltage_at_the_start():
    par = st2cut.Par(
        K1=5.0, K2=0.0, T1=0.0, T2=0.0, T3=3.0, T4=3.0, T5=0.1, T6=0.03, T7=0.1, T8=0.03, T9=0.0, T10=0.0, VCU=0.05,
        VCL=-0.05,
    )  # fmt: skip
    par = st2cut.automatic(par, SimpleNamespace(vt=1.03))
    u = {"omega": 1.01, "P": 0.0}
    outputs = [evaluate(st2cut, par, [0.0] * 6, u | {"vt": vt})[1][0] for vt in (1.03, 1.075, 1.085, 0.985, 0.975)]
    assert outputs == pytest.approx([0.1, 0.1, 0.0, 0.1, 0.0])
    for bound, inside, outside in (("VCU", 0.5, 1.085), ("VCL", 1.5, 0.975)):  # the other one is 0: none
        one = par._replace(VCU=0.0, VCL=0.0)._replace(**{bound: getattr(par, bound)})
        outputs = [evaluate(st2cut, one, [0.0] * 6, u | {"vt": vt})[1][0] for vt in (1.03, inside, outside)]
        assert outputs == pytest.approx([0.1, 0.1, 0.0])


@pytest.mark.parametrize(("device", "field"), [("ieeest", "code"), ("st2cut", "code2"), ("pss2b", "code1")])
def test_an_input_code_that_gives_nothing_is_refused(device, field):
    """2 is the frequency of a bus in PSS/E, which is not represented."""
    par = {"ieeest": ieeest, "st2cut": st2cut, "pss2b": pss2b}[device].Par
    given = par(**{name: 1.0 for name in par._fields if name not in par._field_defaults})
    assert not list(given.errors())
    assert [name for name, _ in given._replace(**{field: 2}).errors()] == [field]


def test_codes_and_flags_that_are_not_supported_are_named():
    text = "2 0 0 0 0 0 0 0 0 0 0 0.02 1.65 1.65 100 0.1 -0.1 0 0"
    with pytest.raises(
        ValueError, match=r"ICS = 2 is not supported; the supported input codes are .*1 \(speed deviation"
    ):
        ieeest.from_record("IEEEST", values(ieeest, "IEEEST", text))
    with pytest.raises(ValueError, match=r"a remote bus \(7\) for ICS is not supported"):
        ieeest.from_record("IEEEST", values(ieeest, "IEEEST", "1 7" + text[3:]))
    par, _ = ieeest.from_record("IEEEST", values(ieeest, "IEEEST", "1" + text[1:]))
    assert (par.code, par.T4, par.T5, par.KS, par.Lmin) == (1, 0.02, 1.65, 100.0, -0.1)
    first = "1 0 3 0 5 1 2 2 0 2 0 2 0.2 1 0.5 0.1 20 0.15 0.025 0.15 0.02"
    par, _ = pss2b.from_record("PSS2A", values(pss2b, "PSS2A", f"{first} 0.1 -0.1"))
    more, _ = pss2b.from_record("PSS2B", values(pss2b, "PSS2B", f"{first} 0 0 999 -999 999 -999 0.1 -0.1"))
    assert par == more
    assert list(par._replace(M=5, N=2).errors()) == [("M", "times N = 2 is more than the 8 lags that are supported")]
    with pytest.raises(ValueError, match="VOS = 2 is not supported"):
        esst1a.from_record("ESST1A", values(esst1a, "ESST1A", "1 2" + 18 * " 1"))
    with pytest.raises(ValueError, match="CSWITCH = 2 is not supported"):
        scrx.from_record("SCRX", values(scrx, "SCRX", "0.4 5 20 1 -50 50 2 0.5"))
