"""Studies of linear models in other ways: the modes of a band, kept modes, one relay, margins, every signal."""

from dataclasses import replace
from functools import cache

import control
import numpy as np
from described import drawn
from mixed import mixed, mixed_point, second
from recordings.studies import dampers, recorded, second_point
from systems import KINDS, LIBRARY, PSS, small

import stabctl as st
from stabctl.smallsignal import analyze, areas, descriptor, opened
from stabctl.smallsignal.nonlinear import nonlinear
from stabctl.smallsignal.reduce import modal, reduce

LAG = control.tf([7.0], [0.3, 1.0])


@cache
def model():
    """A sparse model with a measured frequency among its outputs."""
    return descriptor(
        mixed_point(), ["vref:7", "order:1021@1002", "load_p:30"], ["speed:north", "flow:30-40", "frequency:1002"]
    )


@recorded("modes of a band", loose=1e-5)
def _():
    some = analyze(model(), (0.9, 1.7), (-0.04, 0.31))
    part = type("Part", (), {"low": 6.3, "high": 8.1})
    short = replace(some, incomplete=(part,), counted=some.counted + 2)
    return {
        "model": [str(model()), model().speeds(), model().angles()],
        "modes": [some.df, some.eigenvalues, [some.label(k) for k in range(len(some))], some.least_damped()],
        "shapes": [some.mode(k) for k in some.swings()],
        "proof": [some.proof(), some.certified, short.proof(), short.certified, str(short)],
        "residues": np.einsum("ym,mu->muy", some.observability(), some.controllability()),
        "wide": analyze(model(), (0.2, 9.0), (-0.1, 0.6)).df,
        "point": str(st.load("two_area").modes("0.3..2Hz", sparse=True, damping=(0.05, 0.5))),
    }


@recorded("kept modes", loose=1e-5)
def _():
    linear = second_point().linearize("vref:21, pref:24", "speed:north, voltage:2")
    modes = analyze(linear)
    kept = modes.swings()[1:3]
    of = ["genrou", "exst3.KA"], ["pss.24.K", "exdc2.KA"], "tgov.21.K"
    reduced = {
        "kept": modal(modes, kept),
        "without the rest": modal(modes, kept[:1], static=False),
        "reduced": reduce(linear, 7),
    }
    hz = np.array([0.0, 0.7, 1.9, 4.3])
    opens = [mixed(), opened(mixed(), ["20-30#1"]), opened(mixed(), ["20-30#1", "1002-1005"])]
    modes_of = [case.initialize().modes() for case in opens]
    return {
        **{name: [str(one), one.states, np.linalg.eigvals(one.A).real.sum(), one.D] for name, one in reduced.items()},
        "responses": {name: one.response(hz + 1e-3) for name, one in {"all": linear, **reduced}.items()},
        "areas": [areas(one, 4).groups for one in modes_of],
        "moved": [areas(modes_of[0], n).moved(areas(one, n)) for one in modes_of[1:] for n in (3, 4)],
        "sensitivities": [modes.sensitivity(one, mode=1.6) for one in of],
        "figure": drawn(modes.sensitivity(["pss", "genrou.24.H"], mode=modes.swings()[0]).plot()),
        "control": modes.to_control().D,
    }


@recorded("one relay", loose=1e-4)
def _():
    base = st.load("two_area").initialize(storage="90MW")
    relay = st.Controller.from_control(
        control.tf([1.0], [1.0]), "deviation:3", "order:3@11", rate=50, delay="180ms",
        relay=True, deadband=3e-5, limits=0.7, name="alone",
    )  # fmt: skip
    found = base.limit_cycles(relay)
    limited = st.Controller.from_control(
        900.0 * LAG, "deviation:1", "order:1@5", delay="210ms", limits=0.6, deadband=2e-5
    )
    second = base.limit_cycles(limited)
    return {"relay": found, "limited": second, "figures": [drawn(found.plot()), drawn(second.plot())]}


def washed(gain, machine, bus, delay):
    """A damper of storage at a machine."""
    path = control.tf([3.0, 0.0], [3.0, 1.0]) * control.tf([gain], [0.05, 1.0])
    return st.Controller.from_control(
        path, f"deviation:{machine}", f"order:{machine}@{bus}", delay=delay, name=f"at {machine}"
    )


@recorded("margins of continuous controllers", slow=True, loose=1e-4)
def _():
    base = st.load("two_area").initialize(storage="1=40MW,4=30MW")
    two = base.margins(washed(7000, 1, 5, "35ms"), washed(3100, 4, 10, 0.0))
    wrong = washed(-700, 1, 5, "60ms")
    return {
        "two": two,
        "one": base.margins(washed(5200, 1, 5, 0.0)).together,
        "wrong sign": str(base.margins(wrong)).splitlines(),
        "unstable": str(base.closed_loop(washed(31000, 1, 5, "60ms"), washed(3100, 4, 10, 0.0)).modes()),
        "proper": str(mixed_point().margins(dampers()[0].scaled(3.0))).splitlines(),
        "figure": drawn(two.plot()),
    }


@cache
def with_sensors():
    """A model of signals of every kind that the second island has."""
    inputs = "storage, order, vs:21, vref, pref, field, power, load_p:2, load_q, order_q:24@5"
    case = second().with_storage("21@2=17MW,24@5=11MW", storage_model="regc", energy="0.004MWh", mva="130%")
    outputs = (
        "speed:north, angle:22, coi_speed, rest_speed:24, deviation:21+22, angle_deviation:23, voltage:4, bus_angle:5,"
        " frequency:2, bus_frequency:5, rocof:2, efd:24, pm:21, pe:22, qe:23, vt:24, ifd:22, vs:24, absorbed:21@2,"
        " absorbed_q:24@5, charge:24@5, energy:21@2, state:speed GENROU 24, flow:5-2, flow_q:3-5, current:2-3#2"
    )
    return case.initialize(), inputs, outputs


def of_converters():
    """Set-points and current commands of converters, and two stabilizers that add up."""
    case = small(KINDS["sexs, pss, steam"])
    second_one = PSS._replace(K=-3.0, Tw=2.0, T1=0.2)
    sum_of = replace(case, devices={**case.devices, "pss": {1: PSS, "1#2": second_one, "1#3": PSS._replace(K=0.7)}})
    return {
        "plant": small(LIBRARY["repc_a, voltage"]).linearize("pset, vset", "pe:1, qe, vt:1, voltage:2"),
        "power": small(LIBRARY["reec_b, voltage"]).linearize("pset:1", "pe:1, qe:1, vt:1, current:1-2"),
        "alone": small(KINDS["converter"]).linearize("ipcmd, iqcmd", "pe:1, qe:1, frequency:2, coi_speed"),
        "sum": sum_of.linearize("vs, vref:1, pref:1", "vs:1, efd:1, speed:1, rocof:2, bus_frequency:2"),
    }


@recorded("every signal", loose=1e-5)
def _():
    others = of_converters()
    point, inputs, outputs = with_sensors()
    linear = point.linearize(inputs, outputs)
    moved = nonlinear(point, ["vref:21", "load_p:5"], ["frequency:2", "bus_angle:5", "current:2-3#2", "speed:north"])
    x = 1e-4 * np.cos(np.arange(moved.nstates))
    H = linear.response([0.4, 1.7])
    return {
        "says": [str(linear), linear.inputs, linear.outputs, [*linear.df]],
        "D": linear.D,
        **{f"from {name}": H[0][:, k] for k, name in enumerate(linear.inputs)},
        "fast": H[1].sum(axis=0),
        "all": point.linearize("load_q, vref, order", "absorbed, efd, flow, coi_speed, bus_angle").outputs,
        "others": {name: [str(one), one.inputs, one.outputs, one.D] for name, one in others.items()},
        "theirs": {name: one.response(0.9) for name, one in others.items()},
        "moved": [moved.output(0.0, x, [0.002, -0.003]), moved.dynamics(0.0, x, [0.002, -0.003]).sum()],
    }
