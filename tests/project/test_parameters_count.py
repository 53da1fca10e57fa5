"""Every optional parameter of a public function that computes changes what comes out, or is refused in a sentence.

The functions and their parameters are those of the reference: what is new there needs a value here, or a reason.
"""

import inspect
import re
import shutil
from functools import cache
from pathlib import Path

import control
import pytest
from described import CLOCKED, described, drawn
from test_reference import ROOT, parameters, reference

import stabctl as st
from stabctl import design
from stabctl.model.network import Switching
from stabctl.model.typical import Known

# ---------------------------------------------------------------------------------------------------- the systems


@cache
def wscc():
    return st.load("wscc9").initialize()


@cache
def area():
    return st.load("two_area").initialize()


@cache
def thyristor():
    return st.load("two_area_thyristor").initialize()


@cache
def classical():
    return st.load("two_area").classical().initialize(storage="50MW")


@cache
def run():
    return wscc().simulate(FAULT, "1.3s", **LAW)


@cache
def watched():
    return estimated(seeds=[1, 2])


@cache
def moving():
    return area().modes()


@cache
def damped():
    base = st.load("two_area_thyristor").initialize(storage="3@11=50MW")
    return design.pod(base, "deviation:3", "order:3@11", damping=0.05)


FAULT, LATER = st.Contingency("7", clear="5cyc"), st.Contingency("9", clear="5cyc")
SHORT = {"resolution": "2cyc", "observe": "1s", "longest": "2s", "scan": 0}
LAW = {"storage": "20MW", "control": st.BangBang()}
OF_SPEED = (("speed:1",), ("vref:1",), [], [], [], [[-20.0]])
IDLE = {"inputs": "speed:1", "outputs": "vref:1", "A": [], "B": [], "C": [], "D": []}
WITH_SPEED = dict(zip(("inputs", "outputs", "A", "B", "C", "D"), OF_SPEED, strict=True))
GAIN, LATE = st.Controller(*OF_SPEED), st.BangBang().sampled(30, "300ms")
ROWS = [st.Storage(1, 4, 50.0, storage_model="regc")]


class Given:
    """A value; what it is refused with, or cures; whether it only shows in what repeats it; what both calls need."""

    def __init__(self, value, refused="", cures="", says=False, **needed):
        self.value, self.refused, self.cures, self.says, self.needed = value, refused, cures, says, needed


class Instead(Given):
    """A value in place of another one, without which there is nothing to compare."""

    def __init__(self, before, value, **needed):
        super().__init__(value, **needed)
        self.before = before


# ------------------------------------------------------------------------------------------------------- the calls


def simulated(**given):
    found = wscc().simulate(**{"contingency": FAULT, "until": "1.5s", **LAW} | given)
    return kept(found)


def kept(run):
    """Of a run without rows, what is known."""
    return run if len(run.time) else [run.outcome, run.peak]


def happened(**given):
    return [simulated(contingency=(one := st.Contingency(**{"fault": "7", "clear": "5cyc"} | given))), one.name]


def cleared(**given):
    return wscc().clearing_time(**{"contingency": "7", **LAW, **SHORT} | given)


def estimated(**given):
    found = classical().estimate(**{"contingency": st.Contingency("7", clear="8cyc"), "until": "1.6s"} | given)
    return [kept(one) for one in found.runs] if not len(found.runs[0].time) else found


def controlled(**given):
    return estimated(control=st.EstimatorControl(**{"control": st.BangBang()} | given))


def measured(estimator="kalman", **given):
    found = controlled(pmu=st.Pmu(**given), estimator=estimator)
    return [found, [frame.rocof for frame in found.frames]]


def judged(contingency=FAULT, until="3s", base=None, **given):
    return (base or wscc()).simulate(contingency, until, criterion=st.Criterion(**given))


def stored(**given):
    return wscc().simulate(FAULT, "1.5s", storage=[st.Storage(2, 7, 40.0, **given)], control=st.BangBang())


def acting(control):
    return wscc().simulate(FAULT, "1.3s", control=control, storage="20MW")


def tuned(devices=None, **given):
    options = {"outages": "none", "levels": [1.0], "check_levels": [], "checks": 0, "starts": 1, "workers": 1}
    return design.tune(thyristor(), devices or some(), **options | {"damping": 0.03} | given)


def counting(seen, x):
    return x[0], x


def page(found, **given):
    """The name and the words of a page."""
    path = found.report("pages", **given)
    return path.name, re.sub(r"<(script|style).*?</\1>|<[^>]*>", " ", path.read_text("utf-8"), flags=re.DOTALL)


@cache
def sited():
    return area().place(st.Contingency("7-8@0.4", clear="22cyc"), candidates=[(1, 5)], observe="2s")


def swept(**given):
    """Rows of a sweep whose first run had an error."""
    Path("rows.db").unlink(missing_ok=True)
    st.run_sweep("jobs.toml", "rows.db", workers=1)
    st.run_sweep("jobs.toml", "rows.db", workers=1, **given)
    return st.read_sweep("rows.db").df.drop(columns=[*CLOCKED], errors="ignore")


def some(**given):
    return design.stabilizers(**{"machines": [1, 3], "stages": 1, "gain": 10, "fast": 100} | given)


SEARCH = {
    "storage": "40MW", "control": Given(None, resolution="0.125cyc"), "resolution": "1cyc", "limit": "4cyc",
    "observe": "1.5s", "longest": Given("1s", limit="12cyc"), "scan": 6, "step": "5ms",
    "criterion": st.Criterion(max_angle=1.0), "criteria": "strict.toml",
}  # fmt: skip


REGULATED = {
    "outputs": "vref", "speed": 0.3, "angle": 0.1, "effort": 2.0, "storage": "70MW", "limits": Given(0.5, says=True),
    "name": Given("a", says=True),
}  # fmt: skip
OF_FILES = {
    "dyr": "other.dyr",
    "missing": Given("injection", dyr="bare.dyr", cures="102"),
    "missing_controls": Given("fixed", dyr="unknown.dyr", cures="TGOV99"),
}
OPEN = Switching(faults=((4, 5 + 9j),))
OF_DEVICES = {
    "stages": 2, "gain": 5.0, "fast": 20.0, "washout": (5.0, 6.0), "lead": (0.02, 0.05), "lag": (0.1, 0.5),
    "limits": Given(0.05, says=True), "noise": Instead(1e-5, 1e-4, reserve=0.9, limits=0.1),
}  # fmt: skip
BARS = {"most": 1}
JUMP = {"bad": (st.BadPmu(2, 1.0, jump=0.3),)}


@cache
def table():
    """Name -> a call with the values given, and another value of every parameter."""
    return {
        "simulate": (
            simulated,
            {
                "contingency": LATER,
                "until": "1.3s",
                "storage": "40MW",
                "control": st.StorageLaw((), 2.0),
                "step": "5ms",
                "criterion": st.Criterion(max_angle=0.1),
                "record": False,
                "every": "0.1s",
            },
        ),
        "Contingency": (
            happened,
            {
                "fault": "9",
                "clear": "4cyc",
                "trip": "7-8",
                "at": "0.9s",
                "impedance": 0.1j,
                "events": "8:+20MW@0.2s",
                "after": "8:+20MW@0.1s",
                "name": Given("mine", says=True),
            },
        ),
        "Contingency.with_clear": (lambda **g: simulated(contingency=FAULT.with_clear("4cyc", **g)), {"at": "0.8s"}),
        "Contingency.check": (lambda **g: FAULT.check(wscc().case, **g), {"until": Given(1.0, refused="last event")}),
        "Fault": (
            lambda **g: simulated(contingency=[st.Fault("7", 0.2, **g), st.Clear("7", 0.25)]),
            {"impedance": 0.1j},
        ),
        "Open": (lambda **g: simulated(contingency=st.Open("7-8", 0.2, **g)), {"end": 7}),
        "LoadStep": (
            lambda **g: simulated(contingency=st.LoadStep(**{"bus": 8, "at": 0.2, "p": 5.0} | g)),
            {"p": 9.0, "q": 9.0, "id": Given("1", says=False)},
        ),
        "SwitchShunt": (
            lambda **g: simulated(contingency=st.SwitchShunt(**{"bus": 8, "at": 0.2, "g": 5.0} | g)),
            {"g": 9.0, "b": 9.0},
        ),
        "Criterion": (
            judged,
            {
                "max_angle": 0.1,
                "low_voltage_s": Given(0.01, base=wscc().case.with_load(5, v_low=0.98)),
                "slowest": 0.99999,
                "fastest": 1.0001,
                "min_frequency": Given(0.99999, frequency_delay_s=0.01, contingency="8:+20MW@0.1s"),
                "max_frequency": Given(1.00001, frequency_delay_s=0.01),
                "frequency_delay_s": Given(0.01, max_frequency=1.00001),
                "decay": Given(0.01, until="8s"),
                "coi": Given("machines", base=wscc().case.with_device("regfm_a1", 2, Pmax=2.0, ImaxF=3.0)),
            },
        ),
        "Storage": (
            stored,
            {
                "characteristic": "current",
                "energy": 0.001,
                "charge": Given(0.9, energy=0.001),
                "ramp": 2.0,
                "lag": 0.1,
                "efficiency": Given(0.5, energy=0.001),
                "mva": Given(60.0, storage_model="regc"),
                "storage_model": "regc",
                "converter": Given("Imax=1.3", storage_model="regc"),
            },
        ),
        "Trajectory.table": (
            lambda **g: run().table(**g),
            {"channels": "speed:2", "angle_reference": Given(2, channels="angle")},
        ),
        "Trajectory.save": (
            lambda **g: run().save("run.csv", **g).read_text()[:20000].split(","),
            {"channels": "speed:2", "angle_reference": Given(2, channels="angle")},
        ),
        "Trajectory.plot": (
            lambda others=(), **g: run().plot(*[g.pop("signal", "speed")], *others, **g),
            {"signal": "angle", "others": Given(["angle"], refused="one quantity"), "machines": [2]},
        ),
        "clearing_time": (cleared, SEARCH),
        "screen": (
            lambda **g: wscc().screen(**{"faults": ["7", "9"], **LAW, **SHORT} | g),
            SEARCH | {"below": Given("4cyc", resolution="1cyc"), "faults": ["5"], "buses": Given([7], faults="buses")},
        ),
        "Screen.plot": (lambda **g: wscc().screen(faults=["5", "7"], **SHORT).plot(**g), BARS),
        "study": (
            lambda **g: wscc().study(**{"faults": ["7", "9"], "remedies": "none", "worst": 2, **SHORT} | g),
            {
                "clear": "20cyc",
                "damping": 0.4,
                "voltages": (1.0, 1.01),
                "monitored": "watched.mon",
                "subsystems": Instead("areas.sub", "others.sub", monitored="north.mon"),
                "faults": ["5"],
                "worst": 1,
                "storage": "20MW",
                "control": Given(st.BangBang(), storage="20MW"),
                "criterion": st.Criterion(max_angle=1.0),
                "criteria": "strict.toml",
                "remedies": Given("redispatch", clear="8cyc", says=True),
                "prices": Given(st.Prices(redispatch_mwh=20.0), clear="8cyc", remedies="redispatch"),
                "search": {"resolution": "1cyc"},
            },
        ),
        "place": (
            lambda **g: area().place(
                **{"contingencies": st.Contingency("7-8@0.4", clear="22cyc"), "candidates": [(1, 5)], "observe": "2s"}
                | g
            ),
            {
                "cap": Given("40MW", refused="within the caps"),
                "costs": st.Costs(mw=2.0),
                "sites": Given(1, candidates=[(1, 5), (3, 11)]),
                "candidates": [(3, 11)],
                "outages": True,
                "tolerance": 0.2,
                "control": st.StorageLaw((), 2.0),
                "device": {"lag": "50ms"},
                "observe": "3s",
                "longest": "8s",
                "step": "5ms",
                "criterion": st.Criterion(max_angle=1.5),
                "criteria": Given("strict.toml", refused="within the caps"),
                "validate": "ideal",
            },
        ),
        "estimate": (
            estimated,
            {
                "contingency": "8-9@0.5s",
                "until": "1.3s",
                "storage": "70MW",
                "control": st.StorageLaw((), 2.0),
                "estimator": "kinematic",
                "pmu": st.Pmu(rate=30),
                "seeds": [2],
                "step": "5ms",
                "criterion": st.Criterion(max_angle=0.1),
                "record": False,
            },
        ),
        "EstimatorControl": (
            controlled,
            {
                "control": st.StorageLaw((), 2.0),
                "estimator": "kinematic",
                "pmu": st.Pmu(rate=30),
                "seed": 2,
                "engine": Given("filterpy", says=True),
                "process": st.ProcessNoise(walk=0.1),
                "inertia_factor": 1.3,
                "reactance_factor": 1.3,
                "check_pmus": Given(True, pmu=st.Pmu(**JUMP)),
            },
        ),
        "Pmu": (
            measured,
            {
                "rate": 30,
                "angle": 0.02,
                "magnitude": 0.02,
                "frequency": Given(0.05, estimator="frequency"),
                "rocof": 1.0,
                "clock": 1e-4,
                "latency": 0.1,
                "loss": 0.2,
                "burst": Given(4.0, loss=0.2),
                "outage": (1.1, 1.3),
                "missing": (2,),
                **JUMP,
                "filter_class": "P",
            },
        ),
        "Pmu.exact": (lambda **g: controlled(pmu=st.Pmu.exact(**g)), {"rate": 30, "options": {"latency": 0.2}}),
        "BadPmu": (
            lambda **g: measured(bad=(st.BadPmu(2, 1.0, **g),)),
            {
                "frozen": Given(True, jump=0.1),
                "drift": Given(1e-3, jump=0.1),
                "jump": Instead(0.1, 0.3),
                "ramp": Given(0.3, jump=0.1),
                "until": Given(1.2, jump=0.3),
            },
        ),
        "ProcessNoise": (
            lambda estimator="kalman", **g: controlled(process=st.ProcessNoise(**g), estimator=estimator),
            {"walk": 0.1, "share": 0.1, "jerk": Given(0.5, estimator="kinematic")},
        ),
        "Estimates.count_commands": (lambda **g: watched().count_commands(**g), {"before": 1.05}),
        "Estimates.plot": (lambda **g: watched().plot(**g), {"machines": [2], "seed": 2}),
        "BangBang": (lambda **g: acting(st.BangBang(**g)), {"deadband": 0.3, "min_voltage": 0.99}),
        "Feedback": (
            lambda **g: acting(st.Feedback(**{"speed_gain": 5.0} | g)),
            {"speed_gain": 9.0, "acceleration_gain": 1.0, "braking": True, "deadband": 0.1, "min_voltage": 0.99},
        ),
        "StorageLaw": (
            lambda **g: acting(st.StorageLaw(**g)),
            {
                "groups": ("1+2",),
                "angle_gain": 3.0,
                "slope": 1.0,
                "deadband": 0.3,
                "min_voltage": 0.99,
                "max_acceleration": 1.0,
                "arm_at": 0.5,
                "timeout": Given(0.01, arm_at=0.3),
                "return_time": 1.0,
                "return_power": Given(0.5, return_time=1.0),
            },
        ),
        "Controller": (
            lambda **g: [acting(one := st.Controller(**(IDLE if "law" in g else WITH_SPEED) | g)), one.name],
            {
                "name": Given("mine", says=True),
                "rate": 30,
                "delay": Given("0.1s", rate=30),
                "limits": 0.01,
                "deadband": 0.05,
                "relay": Given(True, limits=0.05, deadband=0.01),
                "ramp": Given(0.1, rate=30),
                "tracking": Given(0.1, limits=0.01, A=[[-1.0]], B=[[1.0]], C=[[-20.0]]),
                "gate": st.Gate(start=1.1),
                "law": Instead(lambda seen: -20 * seen["speed:1"], lambda seen: -9 * seen["speed:1"], rate=30, D=[]),
                "start": Given((1.0,), refused="states of a Python function"),
            },
        ),
        "Controller.from_control": (
            lambda **g: acting(
                st.Controller.from_control(
                    **{"system": control.tf([-20, -20], [0.1, 1]), "inputs": "speed:1", "outputs": "vref:1"} | g
                )
            ),
            {"inputs": "speed:2", "outputs": "vref:2", "rate": 30, "more": {"limits": 0.01}},
        ),
        "Controller.from_function": (
            lambda **g: acting(
                st.Controller.from_function(
                    counting if "start" in g else lambda seen: -20 * seen["speed:1"], "speed:1", "vref:1", **g
                )
            ),
            {"rate": 30, "more": {"limits": 0.01}, "start": Instead((0.0,), (0.1,))},
        ),
        "Controller.sampled": (
            lambda **g: acting(st.Controller(*OF_SPEED).sampled(30, **g)),
            {"delay": "0.1s"},
        ),
        "Gate": (
            lambda **g: acting(st.Controller(*OF_SPEED, gate=st.Gate(**g))),
            {
                "signal": Instead("voltage:7", "speed:2", low=0.9),
                "low": Instead(0.5, 0.99, signal="voltage:7"),
                "high": Instead(2.0, 0.9, signal="voltage:7"),
                "magnitude": Given(True, signal="deviation:1", low=0.0),
                "start": 1.1,
                "end": 1.1,
            },
        ),
        "modes": (
            lambda **g: area().modes(**g),
            {
                "band": (0.1, 1.0),
                "storage": ROWS,
                "damping": Given((0.0, 0.1), band=(0.1, 3.0), sparse=True),
                "sparse": True,
            },
        ),
        "linearize": (
            lambda **g: wscc().linearize(**{"outputs": "speed"} | g),
            {"inputs": "vref", "outputs": "angle", "storage": ROWS},
        ),
        "closed_loop": (
            lambda controllers=(), **g: [(one := wscc().closed_loop(*controllers, **g)).A, one.B, one.C],
            {"controllers": [st.Controller(*OF_SPEED)], "inputs": "vref", "outputs": "angle", "storage": ROWS},
        ),
        "ClosedLoop.modes": (lambda **g: wscc().closed_loop().modes(**g), {"band": (0.1, 1.5)}),
        "margins": (
            lambda controllers=(GAIN,), **g: wscc().margins(*controllers, **g),
            {"controllers": [st.Controller(*OF_SPEED, delay="50ms")], "storage": ROWS},
        ),
        "limit_cycles": (
            lambda controllers=(LATE,), **g: area().limit_cycles(*controllers, **{"storage": "200MW"} | g),
            {
                "controllers": [st.BangBang(0.2).sampled(30, "300ms")],
                "signals": "angle",
                "band": (1.0, 10.0),
                "storage": "150MW",
            },
        ),
        "Modes.residues": (
            lambda **g: wscc().closed_loop(inputs="vref", outputs="speed").modes().residues(**g),
            {"output": 1, "input": 1},
        ),
        "contributions": (lambda **g: moving().contributions(**g), {"mode": "1.26Hz"}),
        "sensitivity": (
            lambda **g: moving().sensitivity(**{"parameters": "pss"} | g),
            {"parameters": "pss.K", "mode": "1.26Hz"},
        ),
        "weak_grid": (
            lambda **g: area().case.with_device("regc_c", 3).weak_grid(3, **{"scr": (1.5, 3), "gain": (1, 4)} | g),
            {"scr": (1.5, 2), "gain": (1, 2), "x_over_r": 3.0, "voltage": 0.97},
        ),
        "short_circuit": (lambda **g: area().short_circuit(**g), {"trip": "7-8"}),
        "short_circuit_ratio": (
            lambda **g: area().case.with_device("regc_c", 3).short_circuit_ratio(**g),
            {"trip": "7-8"},
        ),
        "ShortCircuit.plot": (lambda **g: area().short_circuit().plot(**g), BARS),
        "ShortCircuitRatio.plot": (
            lambda **g: area().case.with_device("regc_c", 3).with_device("regc_c", 2).short_circuit_ratio().plot(**g),
            BARS,
        ),
        "initialize": (lambda **g: wscc().case.initialize(**g).modes(), {"storage": ROWS}),
        "solve": (lambda **g: wscc().case.power_flow(**g), {"limit": Given(1, refused="iteration")}),
        "check": (lambda **g: area().case.set("loads.7.p", 500).check(**g), {"balance": False}),
        "OperatingPoint.one_line": (
            lambda **g: wscc().case.one_line(**g),
            {"flow": wscc().case.set("loads.5.p", 200).power_flow()},
        ),
        "OperatingPoint.plot": (
            lambda results=(), **g: wscc().plot(*results, **g),
            {"results": [wscc().modes().mode(wscc().modes().swings()[0])]},
        ),
        "gep": (lambda **g: design.gep(wscc(), 1, **g).response([0.5, 1.3]), {"others": "free"}),
        "evidence": (lambda **g: design.evidence(damped(), **g), {"checks": ["7-8"]}),
        "outages": (lambda **g: [one.modes() for one in design.outages(st.load("wscc9"), **g)], {"storage": ROWS}),
        "pairs": (
            lambda **g: design.pairs(area(), **{"storage": "50MW"} | g),
            {
                "inputs": "speed",
                "outputs": "vref",
                "mode": "1.1Hz",
                "availability": {"flow": 0.5},
                "delay": 0.2,
                "ranges": {"order:1@5": 0.1},
                "storage": "1=50MW",
            },
        ),
        "lqr": (
            lambda **g: design.lqr(wscc(), **{"storage": "50MW"} | g),
            REGULATED | {"inputs": "angle, speed"},
        ),
        "lqg": (
            lambda **g: design.lqg(wscc(), **{"storage": "50MW"} | g),
            REGULATED
            | {"inputs": "bus_frequency", "rate": 30, "delay": 0.1, "disturbance": "30MW", "noise": 3.0, "order": 6},
        ),
        "pod": (
            lambda **g: design.pod(
                thyristor(),
                **{"storage": "3@11=50MW", "input": "deviation:3", "output": "order:3@11", "damping": 0.05} | g,
            ),
            {
                "input": "deviation:1",
                "output": Given("order:1@5", storage="50MW"),
                "damping": 0.04,
                "spread": 0.2,
                "mode": "1.1Hz",
                "order": 2,
                "rate": 60,
                "delay": 0.1,
                "washout": 5.0,
                "limits": Given(0.1, says=True),
                "storage": "3@11=70MW",
                "name": Given("a", says=True),
            },
        ),
        "pss": (
            lambda **g: design.pss(thyristor(), **{"machines": [1, 3], "damping": 0.05, "starts": 1} | g),
            {
                "machines": [1, 2],
                "damping": 0.1,
                "stages": 1,
                "gain": 5.0,
                "fast": 20.0,
                "washout": 5.0,
                "noise_filter": 0.05,
                "limits": 0.05,
                "sensitivity": 1.2,
                "starts": Given(5, damping=None),
                "seed": Given(1, starts=3),
            },
        ),
        "tune": (
            tuned,
            {
                "devices": [some(machines=[1])],
                "damping": 0.1,
                "outages": "all",
                "levels": [0.9],
                "contingencies": ["7-8"],
                "gains": [0.5, 2.0],
                "doubled": 0.1,
                "sensitivity": Given(1.05, damping=None),
                "disk_margin": 1.5,
                "together": Given(True, sensitivity=1.2),
                "one_out": True,
                "reserve": Given(0.9, devices=[some(noise=1e-4)]),
                "check_levels": [0.9],
                "checks": 1,
                "starts": Given(3, damping=None),
                "seed": Given(1, starts=4, damping=None),
            },
        ),
        "stabilizers": (
            lambda reserve=None, **g: tuned([some(**g)], reserve=reserve),
            OF_DEVICES | {"machines": [1], "model": "pss", "noise_filter": 0.05},
        ),
        "damper": (
            lambda reserve=None, **g: tuned(
                [design.damper(**{"input": "speed:1", "output": "vs:1", "stages": 1} | g)], reserve=reserve
            ),
            OF_DEVICES | {"delay": 0.05, "notch": (1.0, 3.0)},
        ),
        "pi": (
            lambda reserve=None, **g: tuned([design.pi(**{"input": "speed:1", "output": "vs:1"} | g)], reserve=reserve),
            {
                "gain": 5.0,
                "reset": (1.0, 2.0),
                "delay": 0.05,
                "limits": Given(0.05, says=True),
                "noise": Instead(1e-5, 1e-4, reserve=0.9, limits=0.1),
            },
        ),
        "optimum": (
            lambda **g: design.optimum(
                wscc(),
                **{
                    "contingency": "7",
                    "storage": "20MW",
                    "window": "0.3s",
                    "rate": 20,
                    "iterations": 1,
                    **without_scan(),
                }
                | g,
            ),
            {
                "storage": "40MW",
                "law": st.BangBang(deadband=0.3),
                "window": "0.5s",
                "rate": 30,
                "energy": 0.001,
                "resolution": "1cyc",
                "limit": Given("4cyc", refused="up to the limit"),
                "observe": "1.5s",
                "longest": "1s",
                "step": "5ms",
                "criterion": st.Criterion(max_angle=1.0),
                "iterations": 3,
            },
        ),
        "Case.set": (lambda **g: wscc().case.set("loads.5.p", **{"value": 100} | g).power_flow(), {"value": 150}),
        "Case.with_device": (
            lambda **g: tables(
                classical().case.with_device("gencls", 1, **{"H": 9.0, "x1d": 0.2, "D": 0, "ra": 0} | g)
            ),
            {"values": {"H": 5.0}},
        ),
        "Case.with_load": (
            lambda shares=None, **g: tables(wscc().case.with_load(**{"bus": 5} | g, **shares or {})),
            {"p": 50, "q": 5, "id": Given("2", says=True), "shares": {"p_power": 0.5}},
        ),
        "Case.with_motors": (
            lambda values=None, **g: tables(wscc().case.with_motors(0.3, **g, **values or {})),
            {"at": 5, "values": {"H": 0.9}},
        ),
        "Case.with_storage": (
            lambda options=None, **g: tables(wscc().case.with_storage("5%dispatch", **g, **options or {})),
            {"flow": wscc().case.set("loads.5.p", 200).power_flow(), "options": {"lag": 0.1}},
        ),
        "Case.without_device": (lambda **g: tables(wscc().case.without_device("ieeet1", **g)), {"at": 2}),
        "replicate": (
            lambda **g: st.replicate(wscc().case, 2, **g).initialize().modes(),
            {"tie_bus": 5, "x": 0.1, "spread": 0.2},
        ),
        "SiteOption": (
            lambda **g: area().place(
                st.Contingency("7-8@0.4", clear="22cyc"),
                observe="2s",
                costs=st.Costs(1.0, 1.0, 1.0),
                candidates=[st.SiteOption(**{"bus": 5, "machine": 1} | g)],
            ),
            {
                "bus": 11,
                "machine": 2,
                "cap": 300.0,
                "module": 10.0,
                "cost_per_mw": 3.0,
                "cost_per_mwh": 30.0,
                "cost_per_site": 3.0,
            },
        ),
        "Costs": (
            lambda **g: area().place(
                st.Contingency("7-8@0.4", clear="22cyc"), observe="2s", costs=st.Costs(**g), candidates=[(1, 5)]
            ),
            {"mw": 2.0, "site": 2.0, "mwh": 200.0},
        ),
        "Prices": (
            lambda **g: [
                st.Prices(**g).costs,
                wscc().study(
                    faults=["7", "9"], worst=2, clear="8cyc", remedies="redispatch", prices=st.Prices(**g), **SHORT
                ),
            ],
            {
                "storage_mw": 3.0,
                "storage_mwh": Given(3.0, storage_mw=1.0),
                "storage_site": Given(3.0, storage_mw=1.0),
                "redispatch_mwh": 20.0,
                "hours": Given(100.0, redispatch_mwh=20.0),
                "currency": Given("EUR", redispatch_mwh=20.0, says=True),
            },
        ),
        "Screen.report": (lambda **g: page(wscc().screen(faults=["5", "7"], **SHORT), **g), {"base": wscc()}),
        "Siting.report": (lambda **g: page(sited(), **g), {"base": area(), "name": "mine"}),
        "Siting.storage": (lambda **g: sited().storage(**g), {"options": {"lag": 0.1}}),
        "Design.report": (lambda **g: page(damped(), **g), {"checks": ["7-8"]}),
        **{
            f"OperatingPoint.{name}": (lambda name=name, **g: getattr(wscc(), name)(**g), {"switching": OPEN})
            for name in ("admittance", "admittances", "real_admittance")
        },
        "read_contingencies": (
            lambda **g: st.read_contingencies("statements.con", area().case, **g),
            {"subsystems": Instead("areas.sub", "others.sub")},
        ),
        "read_psse": (lambda **g: read(st.read_psse("three.raw", **{"dyr": "three.dyr"} | g)), OF_FILES),
        "load": (
            lambda name="three.raw", **g: read(st.load(name, **g)),
            OF_FILES
            | {
                "loads": "impedance",
                "machines": Given("typical", name="nine.m"),
                "frequency": Given(50, name="pair.m"),
                "conventions": "pst",
            },
        ),
        "read_matpower": (
            lambda **g: read(st.read_matpower("nine.m", **g)),
            {"frequency": 50, "machines": "typical"},
        ),
        "read_pst": (lambda **g: read(st.read_pst("pair.m", **g)), {"frequency": 50}),
        "import_report": (
            lambda raw="three.raw", **g: [(one := st.import_report(raw, **g)), read(one.case)],
            {
                "dyr": "other.dyr",
                "check": False,
                "loads": "impedance",
                "frequency": Given(50, raw="pair.m"),
                "conventions": "pst",
            },
        ),
        "Case.with_typical_machines": (
            lambda **g: tables(st.read_matpower("nine.m").with_typical_machines(**g)),
            {"known": {one.machine: Known("hydro", 500.0) for one in st.read_matpower("nine.m").machines}},
        ),
        "run_sweep": (swept, {"controllers": ["gain.toml"]}),
        "verify": (
            lambda **g: st.verify(**{"system": "wscc9_sauer_pai"} | g),
            {"system": "kundur_two_area_pss"},
        ),
    }


def without_scan():
    return {name: value for name, value in SHORT.items() if name != "scan"}


def read(case):
    """What a file says."""
    return [case.devices, case.loads, case.frequency_hz, case.notes]


def tables(case):
    """What a case has, and how it moves."""
    return [case.devices, case.loads, case.storage, case.initialize().modes()]


STRICT = """title = "Strict"
source = "this test"
unverified = ""

[[voltage]]
name = "high"
of = "nominal"
below = 0.98
recover = "0.1s"
buses = "loads"
"""
LONG = {"law", "LawLimits", "LawDesign.report"}  # 3 s a call and more: tests/design
MADE = {  # by functions, or from files
    "Case", "ClosedLoop", "Criteria", "DelayedModes", "Design", "Estimates", "ImportReport", "Judged", "Margins",
    "Modes", "OperatingPoint", "Regulator", "Remedy", "Screen", "Siting", "Study", "Trajectory", "Tuned",
    "Verification", "Design.of", "Regulator.of_cost",
}  # fmt: skip
SLOW = {
    *("Design.report", "evidence", "optimum", "tune", "pss", "lqg", "margins"),
    *("stabilizers", "damper", "pi", "place", "SiteOption", "Costs", "Siting.report", "Siting.storage"),
    *("Prices", "run_sweep", "Screen.report", "EstimatorControl", "ProcessNoise", "BadPmu", "Pmu"),
}
ELSEWHERE = {  # tested there
    ("verify", "folder"): "tests/verification",
    ("verify", "download_missing"): "tests/verification",
    ("run_sweep", "retry"): "tests/sweep",
    ("Prices", "stabilizer"): "tests/assessment",
    ("values", "within"): "tests/design",
    ("values", "together"): "tests/design",
}
SAME = {  # they do not change the result, and why
    "workers": "threads share the work",
    "progress": "told how far it is",
    "each": "told how far it is",
    "ranking": "told how far it is",
    "store": "keeps the parts of the result",
    "scheduler": "computers share the work",
    "ax": "where it is drawn",
}


@pytest.fixture(autouse=True)
def files(monkeypatch, tmp_path):
    """What parameters name, in the folder where the calls are made."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "strict.toml").write_text(STRICT)
    (tmp_path / "jobs.toml").write_text('kind = "simulate"\ncase = "wscc9"\nfault = "7"\nclear = "5cyc"\n')
    (tmp_path / "statements.con").write_text("SINGLE BRANCH IN SUBSYSTEM 'NORTH'\nEND\n")
    st.Controller(*OF_SPEED).save(tmp_path / "gain.toml")
    for name in ("three.raw", "three.dyr"):
        shutil.copy(ROOT / "docs" / "examples" / name, tmp_path)
    for name in ("nine.m", "pair.m"):
        shutil.copy(ROOT / "tests" / "recordings" / "given" / name, tmp_path)
    dyr = (tmp_path / "three.dyr").read_text()
    (tmp_path / "other.dyr").write_text(dyr.replace("8.0", "9.0"))
    (tmp_path / "bare.dyr").write_text(dyr.splitlines()[0])
    (tmp_path / "unknown.dyr").write_text(dyr.replace("TGOV1", "TGOV99"))
    (tmp_path / "watched.mon").write_text("MONITOR VOLTAGE RANGE ALL BUSES 1.0 1.01\nEND\n")
    (tmp_path / "north.mon").write_text("MONITOR VOLTAGE RANGE SUBSYSTEM 'NORTH' 1.05 1.09\nEND\n")
    for name, bus in (("areas", 7), ("others", 9)):
        (tmp_path / f"{name}.sub").write_text(f"SUBSYSTEM 'NORTH'\nBUS {bus}\nBUS 8\nEND\nEND\n")


def every():
    for name, one in reference().items():
        for p, of in parameters(one).items() if name not in MADE | LONG else ():
            optional = of.default is not of.empty or of.kind in (of.VAR_POSITIONAL, of.VAR_KEYWORD)
            if optional and p not in SAME and (name, p) not in ELSEWHERE:
                slow = [pytest.mark.slow] * (name in SLOW)
                yield pytest.param(name, p, marks=slow, id=f"{name}-{p}")


KNOWN: dict[str, object] = {}  # what came out of a call


def out(name, given):
    """What a call gives, in plain lists and mappings; a refusal is its sentence."""
    key = f"{name} {given}"
    if key not in KNOWN:
        try:
            result = table()[name][0](**given)
        except st.StabctlError as error:
            KNOWN[key] = f"refused: {error}"
        else:
            KNOWN[key] = drawn(result) if hasattr(result, "figure") else described(result)
    return KNOWN[key]


def without(value, names):
    """The same without what has one of these names, at any depth."""
    if isinstance(value, dict):
        return {key: without(inner, names) for key, inner in value.items() if key not in names}
    return [without(inner, names) for inner in value] if isinstance(value, list) else value


@pytest.mark.parametrize(("name", "parameter"), [*every()])
def test_a_parameter_counts(name, parameter):
    """What comes out differs, apart from what repeats the question."""
    given = table()[name][1][parameter]
    given = given if isinstance(given, Given) else Given(given)
    kind = inspect.signature(reference()[name]).parameters[parameter].kind
    more = given.value if kind is inspect.Parameter.VAR_KEYWORD else {parameter: given.value}
    needed = given.needed | ({parameter: given.before} if isinstance(given, Instead) else {})
    before, after = out(name, needed), out(name, needed | more)
    refused = str(after) if str(after).startswith("refused") else ""
    assert str(before).startswith("refused") == bool(given.cures), before
    assert given.cures in str(before)
    assert bool(refused) == bool(given.refused), after
    assert given.refused in refused
    echo = () if given.says else (parameter, "says", "html")
    assert without(after, echo) != without(before, echo)
