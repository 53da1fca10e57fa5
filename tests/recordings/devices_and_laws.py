"""Studies of controllers from elsewhere, of one's own devices, and of what is said of wrong ones."""

import tempfile
from dataclasses import replace
from pathlib import Path

import control
import numpy as np
from mixed import second, without_ramps
from recordings.answers import refused
from recordings.features import FAULT
from recordings.studies import GIVEN, dampers, recorded, second_point
from records import csvgn1
from systems import LIBRARY, OWN, REGC, SEXS, kind, registered, small

import stabctl as st
from stabctl import devices
from stabctl.smallsignal import analyze, areas, balanced, descriptor, feedback_locus, modal, opened, parameter_locus

LAG = control.tf([7.0], [0.3, 1.0])
S = control.tf([1.0, 0.0], [1.0])


def braking(seen):
    """A law of two inputs and two outputs."""
    return np.array([430.0, -270.0]) * seen["deviation"] + 0.02 * (seen.actual("speed:1024") - 1)


def filtered(seen, x):
    """A law with two states."""
    d = seen["deviation:1024"]
    return 210.0 * (d - x[0]) + 3.0 * x[1], [0.8 * x[0] + 0.2 * d, 0.95 * x[1] + d]


class Remembering:
    """A law that counts its calls in a run."""

    def __init__(self):
        self.calls = 0

    def __call__(self, seen):
        self.calls += 1
        return 100.0 * seen["deviation:1024"] + 1e-3 * min(self.calls - 1, 7) * (seen["deviation:1024"] != 0)


def matrix():
    """A transfer matrix of two inputs and two outputs."""
    num = [[[290.0, 10.0], [-35.0]], [[17.0], [140.0, 3.0]]]
    den = [[[0.1, 1.0], [1.0, 2.0]], [[0.4, 1.0], [0.05, 1.0]]]
    return control.tf(num, den)


@recorded("controllers from elsewhere", loose=1e-5)
def _():
    point, orders = without_ramps(), "order:1021@1002, order:1024@1005"
    make, of = st.Controller.from_function, st.Controller.from_control
    both = {
        "function": make(braking, "deviation:north, deviation:1024, speed:1024", orders, rate=50, name="function"),
        "states": make(filtered, "deviation:1024", "order:1024@1005", rate=25, start=[0, 0], delay="40ms", limits=0.3),
        "class": make(Remembering, "deviation:1024", "order:1024@1005", rate=100),
        "matrix": of(matrix(), "deviation:north, deviation:1024", orders, name="matrix", limits=(-0.6, 0.5)),
        "sampled": of(control.c2d(30.0 * LAG, 0.02), "deviation:1024", "order:1024@1005", ramp=2.0),
        "tustin": dampers()[0].sampled(100, "30ms"),
        "tracking": of(40.0 * LAG, "deviation:1024", "order:1024@1005", limits=0.05, tracking="0.2s"),
        "unstable": of(control.tf([-9.0], [1.0, -0.6]), "deviation:1024", "order:1024@1005", rate=20),
        "gate": replace(dampers()[0], gate=st.Gate("speed:1024", high=1.002, magnitude=False, end=0.4)),
    }
    found = {}
    for name, one in both.items():
        run = point.simulate(FAULT, "0.6s", control=one, every="30ms")
        found[name] = {"says": str(one), "run": str(run), "orders": run.values("storage_order")}
        if not isinstance(one.law, type):
            found[name]["modes"] = str(point.closed_loop(one).modes("0.2..3Hz"))
        found[name] |= {} if one.law else {"matrices": [one.A, one.D, one.rate, one.delay, str(one.to_control().dt)]}
    return found | {"warnings": [w for one in both.values() for w in one.warnings]}


@recorded("laws as controllers")
def _():
    case = second().set("name", "law")
    laws = {
        "relay": st.BangBang("30mHz", 0.6),
        "sampled": st.BangBang("50mHz").sampled(40, "75ms"),
        "slope": st.StorageLaw(((21, 22), (24,)), 1.7, slope="0.4Hz", deadband="20mHz"),
        "angle": st.StorageLaw(((21, 22),), 2.3, min_voltage=0.4),
        "feedback": st.Feedback(1.9, 0.0),
    }
    return {name: [law.controllers(case), str(law)] for name, law in laws.items()}


def law_of(**more):
    return st.Controller.from_control(LAG, "speed:24", "vs:24", **more)


CONTROLLERS = {
    "improper": lambda p: st.Controller.from_control(S, "speed:21", "vs:21"),
    "names": lambda p: st.Controller.from_control(LAG),
    "number": lambda p: st.Controller.from_control(3, "speed:21", "vs:21"),
    "dt": lambda p: st.Controller.from_control(control.tf([1.0], [1.0, 0.5], True), "speed:21", "vs:21"),
    "dt of no rate": lambda p: st.Controller.from_control(control.tf([1.0], [1.0, 0.5], 0.03), "speed:21", "vs:21"),
    "two rates": lambda p: st.Controller.from_control(control.tf([1.0], [1.0, 0.5], 0.02), "a:1", "b:1", rate=60),
    "frames": lambda p: law_of(rate=60, delay="20ms"),
    "shape": lambda p: st.Controller.from_control(LAG, "speed:21,speed:24", "vs:21"),
    "limits": lambda p: law_of(limits=(0.1, 0.2)),
    "limits of text": lambda p: law_of(limits=("low", 2)),
    "no limits": lambda p: law_of(limits=0),
    "delay": lambda p: law_of(delay="5cyc"),
    "long delay": lambda p: law_of(delay=70),
    "short delay": lambda p: law_of(delay=1e-8),
    "many frames": lambda p: law_of(delay=9.0, rate=1000),
    "ramp": lambda p: law_of(ramp=1.0),
    "deadband": lambda p: law_of(deadband=-1.0),
    "relay": lambda p: law_of(relay=True),
    "gate": lambda p: law_of(gate="voltage:7"),
    "never": lambda p: st.Gate("voltage:2"),
    "gate of nothing": lambda p: st.Gate(low=0.8),
    "gate of a number": lambda p: st.Gate(7, low=0.8),
    "gate of a text": lambda p: st.Gate("voltage:2", low="0.8"),
    "gate of its size": lambda p: st.Gate("voltage:2", low=0.8, magnitude=1),
    "matrix": lambda p: st.Controller("speed:1", "vs:1", [["a"]], [[1]], [[1]], [[0]]),
    "infinite": lambda p: st.Controller("speed:1", "vs:1", [[np.inf]], [[1]], [[1]], [[0]]),
    "twice": lambda p: st.Controller("speed:1, speed:1", "vs:1", [], [], [], [[1.0, 2.0]]),
    "no input": lambda p: st.Controller("", "vs:1", [], [], [], [[1.0]]),
    "rate": lambda p: law_of(rate=0),
    "sampled": lambda p: law_of().sampled(60.5),
    "sampled twice": lambda p: law_of(rate=50).sampled(60),
    "no function": lambda p: st.Controller.from_function(3, "speed:21", "vs:21"),
    "no states": lambda p: st.Controller.from_function(abs, "speed:21", "vs:21", start=0.0),
    "states": lambda p: st.Controller.from_function(filtered, "speed:21", "vs:21"),
    "too many states": lambda p: st.Controller.from_function(lambda seen: 0, "speed:21", "vs:21", start=[0.0]),
    "no rate": lambda p: st.Controller.from_function(braking, "speed:21", "vs:21", rate=None),
    "scaled": lambda p: function(lambda seen: 0.0).scaled(2.0),
    "to control": lambda p: function(lambda seen: 0.0).to_control(),
    "margins of a function": lambda p: p.margins(function(lambda seen: 0.0)),
    "unknown input": lambda p: unlimited().simulate(until=0.1, control=function(lambda seen: seen["speed:22"])),
    "complex output": lambda p: unlimited().simulate(until=0.1, control=function(lambda seen: 1j)),
    "two outputs": lambda p: unlimited().simulate(until=0.1, control=function(lambda seen: [1.0, 2.0])),
    "not at rest": lambda p: p.closed_loop(function(lambda seen: 0.01)),
    "braking": lambda p: st.Feedback(1.0, braking="eq14"),
    "arm": lambda p: st.StorageLaw((), 1.0, deadband="30mHz", arm_at="20mHz"),
    "groups": lambda p: st.StorageLaw(7, 1.0),
    "group": lambda p: st.StorageLaw(((7, "x"),), 1.0),
    "group twice": lambda p: st.StorageLaw(("21+22", "22+24"), 1.0),
    "group of a number": lambda p: st.StorageLaw((3.5,), 1.0),
    "law of none": lambda p: st.BangBang().controllers(3),
    "acceleration": lambda p: st.StorageLaw((), 1.0, max_acceleration=0.1).controllers(p.case),
    "feedback": lambda p: st.Feedback(1.0, 0.2).controllers(p.case),
    "sampled law": lambda p: st.BangBang().sampled(50).sampled(25),
    "signal": lambda p: p.linearize("vs:21", "speeed:21"),
    "signal of a number": lambda p: p.linearize(3),
    "signal twice": lambda p: p.linearize("vs:21, vs:north"),
    "of no machine": lambda p: p.linearize("", "deviation:21+22+23+24"),
    "of no bus": lambda p: p.linearize("", "voltage:9"),
    "of a word": lambda p: p.linearize("", "voltage:yard9"),
    "of no group": lambda p: p.linearize("", "deviation:21+x"),
    "of the system": lambda p: p.linearize("", "coi_speed:21"),
    "state": lambda p: p.linearize("", "state:speed GENRO 24"),
    "states of all": lambda p: p.linearize("", "state"),
    "with exciter": lambda p: p.linearize("field:21"),
    "with governor": lambda p: p.linearize("power:24"),
    "without exciter": lambda p: p.linearize("vref:23"),
    "without governor": lambda p: p.linearize("pref:22"),
    "no converter": lambda p: p.linearize("ipcmd:21"),
    "no set-point": lambda p: p.linearize("pset:21"),
    "no stabilizer": lambda p: p.linearize("", "vs:22"),
    "no storage": lambda p: replace(p.case, storage=()).linearize("order:21@2"),
    "no capacity": lambda p: p.case.with_storage("9MW", energy=0).linearize("", "charge"),
    "no rotor": lambda p: small({"regc_a": REGC}).linearize("", "speed:1"),
    "model": lambda p: p.constants("genro"),
    "resized": lambda p: p.resized([1.0]),
    "no case": lambda p: st.initialize(3),
}


def unlimited():
    """The second island without ramps of storage."""
    case = second()
    return replace(case, storage=tuple(one._replace(ramp=0.0) for one in case.storage))


def function(law, **more):
    """A controller of the second island from a function."""
    return st.Controller.from_function(law, "speed:24", "order:24@5", name="own", **more)


@recorded("wrong controllers and signals")
def _():
    return {name: refused(call, second_point()) for name, call in CONTROLLERS.items()}


def moved(table, row, name, change):
    """A point whose state is not what the power flow needs."""
    point = second_point()
    s = point.s.copy()
    s[[(k.table, k.row, k.name) for k in point.layout.states].index((table, row, name))] += change
    return replace(point, s=s)


def off_balance():
    point = second_point()
    s = point.s.copy()
    s[point.layout.nx + 2 * point.net.place[5]] += 1e-4
    return replace(point, s=s)


def apart():
    case = small({"regc_a": REGC})
    buses = (case.buses[0]._replace(kind="swing"), *case.buses[1:])
    return replace(case, buses=buses, branches=case.branches[:1])


def lower(**changed):
    """The second island with other parameters of its devices: genrou__24__H=1."""
    return second().set({name.replace("__", "."): value for name, value in changed.items()})


POINTS = {
    "a state moves": lambda p: moved("exdc2", 0, "va", 1e-3).linearize(),
    "a current": lambda p: off_balance().modes(),
    "a limit that holds it": lambda p: lower(pss__24__Vmax=0.0).linearize(),
    "full": lambda p: p.case.with_storage("9MW", energy="0.002MWh", charge=1.0).linearize(),
    "empty": lambda p: p.case.with_storage("9MW", energy="0.002MWh", charge=0.0).linearize(),
    "losses": lambda p: p.linearize("", "energy:24@5"),
    "field": lambda p: lower(exdc2__24__VRmax=1.3).initialize(),
    "low field": lambda p: lower(exdc2__24__VRmin=4.0).initialize(),
    "turbine": lambda p: lower(tgov__21__Pmax=0.4).initialize(),
    "low turbine": lambda p: lower(tgov__24__Pmin=0.81).initialize(),
    "stabilizer": lambda p: lower(pss__24__Vmin=0.01).initialize(),
    "rating": lambda p: replace(
        p.case, machines=(p.case.machines[0]._replace(base=9.0), *p.case.machines[1:])
    ).initialize(),
    "no voltage source": lambda p: replace(
        small({"regc_a": REGC}), devices={"regc_a": {1: REGC, 2: REGC}}
    ).initialize(),
    "an island of a converter": lambda p: apart().initialize(),
    "no devices": lambda p: replace(p.case, devices={}).initialize(),
    "two exciters": lambda p: two_exciters().initialize(),
    "load below its voltage": lambda p: low_load().initialize(),
    "motor": lambda p: p.case.with_motors("60%", at=5, X1=3.5).initialize(),
    "converter": lambda p: small({"regfm_b1": LIBRARY["regfm_b1"]["regfm_b1"]._replace(ImaxSS=0.6)}).initialize(),
    "mode of nothing": lambda p: p.modes().label(99),
    "mode of a word": lambda p: p.modes().sensitivity(mode="north against nobody"),
    "mode far away": lambda p: p.modes().sensitivity(mode="7Hz"),
    "zero mode": lambda p: p.modes().sensitivity(mode=0),
    "no table": lambda p: p.modes().sensitivity("sexs"),
    "no real parameter": lambda p: p.modes().sensitivity("genrou.speed_factor"),
    "numbers": lambda p: p.modes().sensitivity([3]),
    "of others": lambda p: p.modes().sensitivity(["genrou.24.H", 3]),
    "bands": lambda p: p.modes().within(2, 1),
    "keep": lambda p: modal(p.modes(), [999]),
    "keep nothing": lambda p: modal(p.modes(), []),
    "orders": lambda p: balanced(analyze(p.linearize("vref:21", "speed:24")), 99),
    "half an order": lambda p: balanced(analyze(p.linearize("vref:21", "speed:24")), 2.5),
    "nothing to reduce": lambda p: balanced(analyze(p.linearize()), 5),
    "dense band": lambda p: analyze(p.linearize(), (0.5, 2.0)),
    "band": lambda p: analyze(descriptor(p), (2.0, 1.0)),
    "ratios": lambda p: analyze(descriptor(p), (1.0, 2.0), (0.5, 0.1)),
    "locus": lambda p: parameter_locus(p.case, "pss", "K", [1.0], [21]),
    "locus of no table": lambda p: parameter_locus(p.case, "sexs", "K", [1, 2], [21]),
    "locus of no parameter": lambda p: parameter_locus(p.case, "pss", "KX", [1, 2], [21]),
    "locus of no machine": lambda p: parameter_locus(p.case, "pss", "K", [1, 2], [22]),
    "locus of other states": lambda p: parameter_locus(p.case, "pss", "T2", [0.1, 0.0], [21]),
    "algebraic loop": lambda p: feedback_locus(p.linearize("load_p:2", "voltage:2"), 0, 0, [0.0, limit_gain(p)]),
    "response": lambda p: p.linearize("vref:21", "speed:24").response("x"),
    "file": lambda p: p.linearize().save("model.txt"),
    "no folder": lambda p: p.linearize().save("nowhere/model.npz"),
    "areas": lambda p: areas(p.modes(), 2.5),
    "too many areas": lambda p: areas(p.modes(), 9),
    "of no area": lambda p: areas(p.modes(), 2).of(9),
    "opened": lambda p: opened(p.case, ["1-2"]),
    "scr": lambda p: st.weak_grid(p, 1, scr=[]),
    "x over r": lambda p: st.weak_grid(small({"regc_a": REGC}), 1, x_over_r=-1),
    "relays": lambda p: p.limit_cycles(law_of()),
    "low band": lambda p: p.limit_cycles(law_of(relay=True, limits=0.1), band=(0.0, 2.0)),
    "unstable loop": lambda p: p.margins(law_of().scaled(900.0)),
}


def too_small():
    """The rating of a machine is too small for its power."""
    case = second()
    return replace(case, machines=(case.machines[0]._replace(base=9.0), *case.machines[1:]))


def limit_gain(point):
    """The gain of an algebraic loop."""
    return 1 / point.linearize("load_p:2", "voltage:2").D[0, 0]


def two_exciters():
    case = second()
    return replace(case, devices={**case.devices, "sexs": {21: SEXS}})


def low_load():
    case = second()
    return replace(case, loads=tuple(load._replace(v_low=1.2) for load in case.loads))


MISTAKES = {  # what is written instead in a file that is right
    "no states": ("class State(", "class States("),
    "no function": ('ROLE = "stab', 'elsewhere = 3.0\nROLE = "stab'),
    "no rates": ("def derivatives", "def rates"),
    "misspelt": ("def derivatives", "def derivative"),
    "misspelt constant": ('ROLE = "stab', 'DEADBAND = ("Kv",)\nROLE = "stab'),
    "role": ('ROLE = "stabilizer"', 'ROLE = "stabiliser"'),
    "strange role": ('ROLE = "stabilizer"', 'ROLE = "xyz"'),
    "other role": ('ROLE = "stabilizer"', 'ROLE = "governor"'),
    "limit": ('ROLE = "stab', 'LIMITS = {"slaw": ("Vmin", "Vmax")}\nROLE = "stab'),
    "edge": ('ROLE = "stab', 'LIMITS = {"slow": ("Vmin", "Vmx")}\nROLE = "stab'),
    "one edge": ('ROLE = "stab', 'LIMITS = {"slow": ("Vmin",)}\nROLE = "stab'),
    "text": ('ROLE = "stab', 'UPPER = "Vmax"\nROLE = "stab'),
    "phasor": ('ROLE = "stab', 'PHASORS = (("slow", "fast"),)\nROLE = "stab'),
    "record": ('ROLE = "stab', 'DYR = {"WIDE": "bus other Kz"}\nROLE = "stab'),
    "argument": ("def output(x, u, p)", "def output(x, u, q)"),
    "no record": ("class State(NamedTuple)", "class State"),
}


@recorded("wrong devices")
def _():
    good, found = (OWN / "wide_area.py").read_text(encoding="utf-8"), {}
    sexs = Path(devices.every()["sexs"].file).read_text(encoding="utf-8")
    sexs = sexs.replace("from .", "from stabctl.devices.exciters.")
    texts = {name: good.replace(*change, 1) for name, change in MISTAKES.items()}
    texts["twice"] = sexs.replace(
        "@inline\ndef equations", "@inline\ndef output(x, u, p):\n    return Output(x.efd)\n\n\n@inline\ndef equations"
    )
    texts["without"] = sexs.replace("class State(", "class States(")
    texts["cannot be read"] = "import nothing_like_it\n"
    with tempfile.TemporaryDirectory() as there, registered():
        for name, text in texts.items():
            file = Path(there) / "wrong.py"
            file.write_text(text, encoding="utf-8")
            found[name] = refused(lambda _, file=file: devices.register(file), None)
    return found


@recorded("own devices", loose=1e-5)
def _():
    with kind("signals from elsewhere") as models:
        case = small(models)
        point = case.initialize()
        run = point.simulate([st.LoadStep(2, 0.1, 90.0)], "1s", every="50ms")
        one = devices.every()["wide_area"]
        found = {
            "run": run.values("speed"),
            "linear": point.linearize("vref:1", "vs:1, rocof:3, bus_frequency:3").response(0.8),
            "modes": point.modes(),
            "device": [repr(one), one.content is not None, one.role, one.fields("Par")],
            "wrong": {
                name: refused(lambda _, m=m: small(m).initialize(), None)
                for name, m in {
                    "bus": {**models, "wide_area": models["wide_area"]._replace(bus=9)},
                    "machine": {**models, "wide_area": models["wide_area"]._replace(other=7)},
                }.items()
            },
        }
    found["static var unit"] = static_var_unit()
    with registered(GIVEN / "susceptance.py"):
        found["shunt"] = shunt()
    return found


def shunt():
    """Two controlled shunts at buses of the second island, and what is said of one without an equilibrium."""
    par = devices.every()["susceptance"].Par
    case = second()
    two = replace(case, devices={**case.devices, "susceptance": {4: par(3.0, 0.2), 2: par(7.0, 0.07)}})
    run = two.simulate(FAULT_2, "0.5s", every="50ms")
    none = replace(case, devices={**case.devices, "susceptance": {4: par(3.0, 0.2), 2: par(0.0, 0.07, 0.3)}})
    return {
        "voltage": run.values("voltage"),
        "linear": two.linearize("load_p:2", "voltage:4, voltage:2").response(0.7),
        "states": two.linearize().states[-3:],
        "none": refused(lambda _: none.initialize(), None),
    }


FAULT_2 = replace(FAULT, fault="2-3#1@0.3", trip="2-3#1")


def static_var_unit():
    """A static var unit in place of a machine."""
    case = second()
    svc = csvgn1.Par(0, 0, 0, K=17.0, T1=0.03, T2=1.1, T3=0.15, T4=1.3, T5=0.02, Cbase=60.0)
    models = {k: {n: row for n, row in rows.items() if n != 24} for k, rows in case.devices.items()}
    machines = tuple(m._replace(p=0.0) if m.machine == 24 else m for m in case.machines)
    storage = tuple(s for s in case.storage if s.machine != 24)
    case = replace(case, machines=machines, storage=storage, devices={**models, "csvgn1": {24: svc}})
    run = case.simulate(FAULT_2, "0.5s", every="50ms")
    return {"run": str(run), "voltage": run.values("voltage"), "linear": case.linearize("vset", "qe").response(0.7)}


@recorded("points without models")
def _():
    return {name: refused(call, second_point()) for name, call in POINTS.items()}
