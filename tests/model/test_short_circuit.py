"""Short-circuit power and ratios: by hand, against an impedance matrix computed apart, and laws."""

from dataclasses import replace

import numpy as np
import pytest
from records import gencls
from systems import CLASSICAL, REGC, TWO_AXES, TYPE_J, small
from uneven import uneven

import stabctl as st
from stabctl import devices
from stabctl._util.errors import StudyError
from stabctl.devices.machines.stator import Internal
from stabctl.model import network
from stabctl.model.tables import Branch, Bus, Machine


def line(*converters):
    """A classical machine of 200 MVA, x' = 0.2, behind a line of j0.15 on 100 MVA; converters at its end."""
    machines = (Machine(1, 1, 200.0, 0.0, 1), *(Machine(k, 2, mva, 0.0, 2) for k, mva in enumerate(converters, 2)))
    return st.Case(
        name="line",
        buses=(Bus(1, "swing", 1.0), Bus(2, "pv" if converters else "pq", 1.0)),
        branches=(Branch(1, 2, 0.0, 0.15),),
        machines=machines,
        devices={
            "gencls": {1: gencls.Par(0, 0, H=4.0, D=1.0, ra=0.0, x1d=0.2)},
            "regc_a": {m.machine: REGC for m in machines[1:]},
        },
    )


def test_two_buses_by_hand():
    """x' is 0.1 on 100 MVA: 1000 MVA at the machine, 100/0.25 = 400 MVA at the end of the line."""
    assert st.short_circuit(line()).mva == pytest.approx([1000.0, 400.0], rel=1e-12)
    alone = line(100.0).short_circuit_ratio()
    assert alone.df.iloc[0].tolist() == [
        "REGC_A 2",
        2,
        100.0,
        pytest.approx(400.0),
        pytest.approx(4.0),
        pytest.approx(4.0),
    ]
    both = line(100.0, 60.0).short_circuit_ratio()
    assert both.ratio == pytest.approx([4.0, 400 / 60])
    assert both.equivalent == pytest.approx([2.5, 2.5])
    assert both.weighted == pytest.approx(2.5)


@pytest.mark.parametrize("name", ["two_axis", "gentpj1"])
def test_an_unloaded_machine_feeds_by_its_d_axis(name):
    """As much as its own stator gives at 0 V: its flux, 1 pu, is on the d axis. x'q or x''q does not matter."""
    device, axis = devices.every()[name], "x1q" if name == "two_axis" else "x2q"
    par = TWO_AXES if name == "two_axis" else TYPE_J._replace(S10=0.0, S12=0.0)
    par = par._replace(mva=2.0, ra=0.0)
    known = {"x": device.State(*[0.0] * len(device.State._fields)), "i": Internal(0.0, 1.0, 1.0, 0.0, 1.0)}
    y = device.evaluate("output", known | {"v": (0.0, 0.0), "p": par})
    for xq in (0.3, 0.4):
        found = st.short_circuit(replace(line(), devices={name: {1: par._replace(**{axis: xq})}}))
        assert found.mva[0] == pytest.approx(200 * np.hypot(y.id, y.iq), rel=1e-12)


def test_ieee39_is_the_inverse_of_its_admittance_matrix():
    """The subtransient reactances of the machine tables, put to the buses here, and a dense inverse."""
    case = st.load("ieee39")
    net = network.build(case)
    Y = network.admittance(net).toarray()
    for model, reactance in (("genrou", "x2"), ("gencls", "x1d"), ("gensal", "x2")):
        for key, par in case.devices.get(model, {}).items():
            m = case.machine(int(key))
            z = complex(par.ra, getattr(par, reactance)) * case.base_mva / m.base
            Y[net.place[m.bus], net.place[m.bus]] += 1 / z
    wanted = case.base_mva / np.abs(np.diag(np.linalg.inv(Y)))
    found = case.short_circuit()
    assert found.mva == pytest.approx(wanted, rel=1e-10)
    assert found.df.short_circuit_mva.to_numpy() == pytest.approx(wanted, rel=1e-10)
    assert case.initialize().short_circuit().mva == pytest.approx(wanted, rel=1e-10)
    assert wanted.max() / wanted.min() > 2


def test_numbers_order_and_base_do_not_matter():
    case = small({"regc_a": REGC}).with_storage("50MW")
    wanted = case.short_circuit_ratio()
    turned = replace(case, buses=case.buses[::-1], branches=case.branches[::-1])
    larger = replace(
        case,
        base_mva=250.0,
        branches=tuple(b._replace(r=2.5 * b.r, x=2.5 * b.x, b=b.b / 2.5) for b in case.branches),
    )
    for other in (turned, larger):
        found = other.short_circuit_ratio()
        assert found.converters == wanted.converters
        assert found.equivalent == pytest.approx(wanted.equivalent, rel=1e-12)
        assert found.weighted == pytest.approx(wanted.weighted, rel=1e-12)
    assert (wanted.equivalent < wanted.ratio).all()


def test_an_open_circuit_weakens_and_a_cut_off_bus_has_none():
    case = small({"regc_a": REGC})
    S = [case.short_circuit(trip=trip).mva[0] for trip in (None, "2-3", "2-3, 2-3#2")]
    assert S[0] > S[1] > 100
    assert S[2] == 0
    cut = case.short_circuit_ratio(trip="2-3, 2-3#2")
    assert (cut.ratio[0], cut.equivalent[0]) == (0, 0)
    assert "0 MVA at bus" in str(case.short_circuit(trip="2-3, 2-3#2"))


def test_a_machine_feeds_and_a_converter_does_not():
    fed, not_fed = small({"gencls": CLASSICAL}), small({"regc_a": REGC})
    S = [case.short_circuit().mva[0] for case in (fed, not_fed)]
    assert S[0] - S[1] == pytest.approx(400.0 / 0.3, rel=1e-2)  # resistances turn the currents a little


def test_what_has_no_short_circuit_ratio():
    with pytest.raises(StudyError, match="two_area has no converter and no storage device"):
        st.load("two_area").short_circuit_ratio()
    with pytest.raises(StudyError, match="small has no dynamic models"):
        replace(small({"regc_a": REGC}), devices={}).short_circuit()


def test_figures_show_what_was_found():
    found = small({"regc_a": REGC}).with_storage("50MW")
    ratio = found.short_circuit_ratio()
    ax = ratio.plot()
    widths = sorted(bar.get_width() for bar in ax.patches)
    assert widths == pytest.approx(sorted([*ratio.ratio, *ratio.equivalent]))


def test_bars_have_the_names_of_their_buses():
    """The weakest first, and of the numbers of the case."""
    found = uneven().short_circuit()
    ax = found.plot(most=4)
    named = dict(zip(found.df.bus, found.df.short_circuit_mva, strict=True))
    shown = {text.get_text(): bar.get_width() for text, bar in zip(ax.get_yticklabels(), ax.patches, strict=True)}
    weakest = sorted(named, key=named.get)[:4]
    assert list(shown) == [f"bus {bus}" for bus in weakest]
    assert list(shown.values()) == pytest.approx([named[bus] for bus in weakest])
