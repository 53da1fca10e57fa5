"""Studies of what is shown and asked: pages of results, the live page, theory, laws, help, wrong calls in Python."""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from asgi import ask
from described import described, drawn
from mixed import mixed_point, without_ramps
from packed import unpacked
from recordings.features import FAULT, run_of_every_event
from recordings.studies import STUDIES, called, dampers, lines, recorded

import stabctl as st
from stabctl import design
from stabctl.io.control_files import save_law
from stabctl.theory import minimum_time, omib, phase_plane, two_machine
from stabctl.view.live import answers, commands
from stabctl.view.live.app import app
from stabctl.view.live.state import Points, State

TOKEN = "token"
LOAD = commands.Source("st.load('two_area')", ("two_area",))
STATE = {"fault": "7-8@0.4", "clear": 9, "percent": 4.0, "signals": ["speed", "angle", "voltage", "storage"]}
ASKED = {
    "run": STATE | {"compare": True, "deadband": 70.0, "megawatts": {"2": 31.0}},
    "run of feedback": STATE | {"law": "feedback", "delay": 2, "level": 96.0, "signals": ["storage"]},
    "run that is lost": STATE | {"fault": "7", "trip": "7-8#2", "clear": 24.5, "percent": 0},
    "run of nothing": {"fault": "7-99"},
    "run of a wrong law": STATE | {"law": "none"},
    "run too early": STATE | {"clear": -1},
    "run of half a cycle": STATE | {"delay": 0.5},
    "run of text": STATE | {"clear": "6"},
    "run of a list": [1],
    "modes": {"level": 97, "gain": "pss.K", "factor": 1.7},
    "modes of no gain": {"gain": "pss.X"},
    "modes of a number": {"gain": 3},
    "theory": {"machine": 2, "clear": 5.5},
    "theory of text": {"machine": "2", "clear": 5},
    "theory of none": {"machine": None, "clear": 7, "level": 103},
    "save": {"state": {"clear": "no"}},
    "clearing": [],
    "nothing": {},
}


@cache
def points():
    return Points(st.load("two_area"))


@recorded("live page")
def _():
    pages = app(points(), LOAD, TOKEN, 8000)
    found = {name: answered(pages, name.split()[0], message) for name, message in ASKED.items()}
    status, content, headers = ask(pages, f"/{TOKEN}/case")
    kept = {k.decode(): v.decode() for k, v in headers.items()}
    other = {
        "host": {"host": "evil:8000"},
        "origin": {"origin": "http://evil"},
        "site": {"sec-fetch-site": "cross-site"},
    }
    refused = {name: ask(pages, f"/{TOKEN}/case", headers=one.items())[0] for name, one in other.items()}
    files = {name: ask(pages, f"/{TOKEN}/{name}")[0] for name in ("", "live.js", "../app.py", "none.js")}
    own = ask(pages, f"/{TOKEN}/case", headers=[("origin", "http://127.0.0.1:8000"), ("sec-fetch-site", "same-origin")])
    case = json.loads(content)
    kept.pop("content-length")  # of the positions' digits
    case["diagram"] = {name: np.shape(value) for name, value in case["diagram"].items()}  # positions are in "diagrams"
    return found | {"case": [status, *sorted(case), case], "headers": kept, "refused": refused, "files": files} | {
        "own": own[0], "token": ask(pages, "/other/case")[0],
    }  # fmt: skip


def answered(pages, path, message):
    """Status, header and curves of an answer."""
    status, content, _ = ask(pages, f"/{TOKEN}/{path}", message)
    if path != "run" or status != 200:
        text = content.decode()
        return [status, unclocked(json.loads(text)) if text.startswith("{") else text[:300]]
    head, arrays = unpacked(content)
    return [status, unclocked(head), {k: np.nan_to_num(v.astype(float)) for k, v in arrays.items()}]


def unclocked(head):
    """Without computing times; of long curves there are sums."""
    return {k: curve(v) for k, v in head.items() if not k.endswith("_ms") and k != "arrays"}


def curve(value):
    """Long lists of numbers, also within lists, as arrays."""
    if isinstance(value, list) and len(value) > 20 and all(isinstance(v, float) for v in value):
        return np.array(value)
    return [curve(v) for v in value] if isinstance(value, list) else value


@recorded("searches of the live page", slow=True)
def _():
    told, state = [], State("7-8@0.4", clear=9, percent=4.0)
    answers.critical(points(), state, LOAD, told.append)
    swept = []
    answers.landscape(Points(st.load("wscc9")), State("7"), LOAD, swept.append)
    return {"critical": [unclocked(one) for one in told][-3:], "landscape": [unclocked(one) for one in swept][-2:]}


@recorded("two machines and the shortest time", loose=1e-4)
def _():
    pair = two_machine.equivalent(st.load("two_area"), 2)
    problem = pair.minimum_time_problem(5)
    found = minimum_time.by_shooting(problem)
    return {
        "pair": pair,
        "problem": problem,
        "critical": pair.critical(0.1),
        "area": pair.equal_area(6.0, 0.05),
        "time": found,
        "mirrored": [problem.mirrored(), found.mirrored()],
        "figure": drawn(found.plot()),
        "edge": phase_plane.separatrix(omib.OMIB(), 31),
    }


@recorded("laws", loose=1e-5)
def _():
    one, two = dampers()
    laws = {
        "feedback": st.Feedback(2.0, 0.1, deadband="10mHz"),
        "braking": st.Feedback(0.0, 0.03, braking=True),
        "sampled": st.BangBang("40mHz").sampled(50, "40ms"),
        "storage": st.StorageLaw(((1021, 1022),), 1.5, slope=0.02, deadband="25mHz").sampled(25),
        "gated": [replace(one, gate=st.Gate("voltage:1002", low=0.7, start=0.1)), two],
        "reserve": st.EstimatorControl(st.BangBang(0.03), "ideal", st.Pmu.exact(50)),
    }
    points = {"gated": without_ramps()}
    runs = {
        name: points.get(name, mixed_point()).simulate(FAULT, "0.5s", control=law, every="20ms")
        for name, law in laws.items()
    }
    return {
        "laws": {name: str(law) for name, law in laws.items()},
        "orders": {name: run.values("storage_order") for name, run in runs.items()},
        "said": {name: str(run) for name, run in runs.items()},
    }


def saved(folder):
    """Files of controllers and laws, as written and as read again."""
    found, there = {}, Path(folder)
    for k, one in enumerate(dampers()):
        one.save(there / f"c{k}.toml")
    for k, law in enumerate([st.BangBang(0.03, 0.7), st.Feedback(1.0, 0.2, deadband=0.01), st.StorageLaw((), 2.0)]):
        save_law(law, there / f"l{k}.toml")
    for path in sorted([*there.glob("c?.toml"), *there.glob("l?.toml")]):
        found[path.name] = [lines(path.read_text(encoding="utf-8")), described(st.load_controller(path))]
    return found


def helped(folder):
    """The help of every command."""
    groups = {"": COMMANDS_OF, "design": ("pod", "pss", "tune", "law", "optimum", "lqr", "lqg")}
    groups["swing"], groups["sweep"] = ("table1", "equal-area", "feedback", "minimum-time"), ("run", "show")
    found = {"stabctl": lines(called("--help")[1])}
    for group, names in groups.items():
        for name in names:
            found[f"{group} {name}"] = lines(called(*group.split(), name, "--help")[1])
    return found


COMMANDS_OF = (
    "cases", "tables", "models", "import", "check", "powerflow", "scr", "simulate", "clearing-time", "screen", "study",
    "place", "estimate", "modes", "weak-grid", "verify", "live", "linearize", "design", "swing", "sweep",
)  # fmt: skip

WRONG = {
    "until": lambda p: p.simulate(until="-1s"),
    "every": lambda p: p.simulate(until=1, every=-1),
    "no events": lambda p: p.simulate("7-8", "1s"),
    "two laws": lambda p: p.simulate(until=1, control=[st.BangBang(), st.BangBang()]),
    "class": lambda p: p.simulate(until=1, control=st.BangBang),
    "angle": lambda p: p.simulate(until=1, criterion=st.Criterion(max_angle=0)),
    "coi": lambda p: p.simulate(until=1, criterion=st.Criterion(coi="some")),
    "angle text": lambda p: p.simulate(until=1, criterion=st.Criterion(max_angle="40Hz")),
    "impedance": lambda p: st.Contingency("7", impedance="0.1"),
    "negative": lambda p: st.Contingency("7", clear=-1),
    "early": lambda p: st.Contingency("7", clear=1, after=["9@-1s"]),
    "step": lambda p: st.LoadStep(7, 1.0),
    "place": lambda p: st.Contingency(7.5),
    "bus": lambda p: p.clearing_time("9999"),
    "grid": lambda p: p.clearing_time("30", limit="0.01cyc"),
    "grid 0": lambda p: p.clearing_time("30", resolution=0),
    "scan": lambda p: p.clearing_time("30", scan=-1),
    "faults": lambda p: p.screen(faults="P9"),
    "category": lambda p: p.screen(faults="P4@x"),
    "bus of a screen": lambda p: p.screen(buses=3),
    "machine": lambda p: p.case.machine(9),
    "name": lambda p: p.case.machine("south"),
    "set": lambda p: p.case.set("sexs.7.KX", 3),
    "set table": lambda p: p.case.set("sexx.7.KA", 3),
    "set value": lambda p: p.case.set("genrou.7.H", -3),
    "motors": lambda p: p.case.with_motors(1.2),
    "no load": lambda p: p.case.with_motors(0.2, at=20),
    "level": lambda p: p.case.with_load_level(0),
    "loads": lambda p: p.case.with_loads("voltage"),
    "conventions": lambda p: p.case.with_conventions("eu"),
    "device": lambda p: p.case.with_device("regc_x", 7),
    "no device": lambda p: p.case.without_device("tgov", 12),
    "storage": lambda p: p.case.with_storage("5"),
    "storage model": lambda p: p.case.with_storage("5MW", storage_model="regx"),
    "converter": lambda p: p.case.with_storage("5MW", storage_model="regc", converter="Imx=1"),
    "channel": lambda p: run_of_every_event().table("speeds"),
    "channel of": lambda p: run_of_every_event().table("voltage:31"),
    "reference": lambda p: run_of_every_event().table("angle", angle_reference=99),
    "plot": lambda p: run_of_every_event().plot("speed", "angle"),
    "rate": lambda p: st.Pmu(61),
    "loss": lambda p: st.Pmu(loss=0.7, burst=2.0),
    "jump": lambda p: st.BadPmu(3, 1.0, jump="400deg"),
    "seeds": lambda p: p.estimate(FAULT, seeds=[]),
    "ends": lambda p: p.estimate(FAULT, "0.1s"),
    "gate": lambda p: st.Gate("voltage:7", low=2, high=1),
    "starts": lambda p: design.tune(p, starts=0),
    "devices": lambda p: design.tune(p, [3]),
    "damping": lambda p: design.tune(p, damping=2.0),
    "model": lambda p: design.stabilizers(model="pss9"),
    "stages": lambda p: design.stabilizers(model="pss", stages=3),
    "filter": lambda p: design.stabilizers(model="pss", noise_filter="20ms"),
    "gain": lambda p: design.stabilizers(gain=0),
    "law": lambda p: design.law(p, []),
    "schedule": lambda p: design.optimum(p, "30", rate=0),
    "window": lambda p: design.optimum(p, "30", window=99),
    "iterations": lambda p: design.optimum(p, "30", iterations=0),
    "pod": lambda p: design.pod(p, "deviation:99", "order"),
    "order": lambda p: design.lqg(p, order=0),
    "noise": lambda p: design.lqg(p, noise=0),
    "power": lambda p: design.lqg(p, disturbance=0),
    "sites": lambda p: p.place(["30"], sites=0),
    "tolerance": lambda p: p.place([st.Contingency("30", clear="3cyc")], tolerance=2),
    "contingencies": lambda p: p.place([]),
    "clear": lambda p: p.place(["30"]),
    "copies": lambda p: st.replicate(p.case, 0),
    "weak grid": lambda p: p.weak_grid(7),
    "areas": lambda p: st.design.pairs(p, "speed:99"),
    "band": lambda p: p.modes("2..1Hz"),
    "inputs": lambda p: p.linearize("orders", "speed"),
    "criteria": lambda p: st.criteria("wecc"),
    "case": lambda p: st.load("two_areas"),
    "results": lambda p: st.read_sweep("none.db"),
    "controller": lambda p: st.load_controller("none.toml"),
    "study": lambda p: st.study(p, "0cyc"),
    "shift": lambda p: st.replicate(p.case, 2, x=-1),
}


@recorded("wrong calls")
def _():
    return {name: refused(call, mixed_point()) for name, call in WRONG.items()}


def refused(call, point):
    """What is said of a wrong call; nothing if it is accepted."""
    try:
        call(point)
    except st.StabctlError as error:
        return str(error)
    except Exception as error:
        return type(error).__name__
    return None


STUDIES |= {"saved controllers": saved, "help": helped}
