"""Studies of plans: categories of contingencies, redispatch, remedies, criteria, sweeps, and edits of a case."""

from dataclasses import replace

import pandas as pd
from mixed import mixed_point, second
from recordings.answers import refused
from recordings.studies import GIVEN, recorded, second_point

import stabctl as st
from stabctl._util.schema import fields
from stabctl.assessment.redispatch import redispatch
from stabctl.clearing.templates import contingencies as categories
from stabctl.clearing.trial import Search
from stabctl.jobs.task import run_task
from stabctl.model import tables
from stabctl.sweep.job import Result
from stabctl.sweep.study_file import read as read_study
from stabctl.sweep.sweep import tasks as tasks_of


@recorded("categories of contingencies")
def _():
    case = st.read_psse(GIVEN / "five.raw", GIVEN / "five.dyr", missing="injection", missing_controls="fixed")
    found = {}
    for word in ("P1", "p2@8cyc", "P4", "P5@9cyc", "P6", "P7@70ms"):
        found[word] = [
            f"{c.label}; fault at {c.fault} at {c.at}, {c.impedance:.6f}, {c.clear}; before {[*map(str, c.events)]}; "
            f"out {c.trip}, {[*map(str, c.after)]}"
            for c in categories(case, word)
        ]
    wrong = ("P3", "P8", "P1@0cyc", "P1@x")
    return found | {word: refused(lambda _, word=word: categories(case, word), None) for word in wrong}


@recorded("power is shifted", slow=True, loose=1e-4)
def _():
    point, search, found = second_point(), Search(1.0, 100.0, 2.0), {}
    lost = [
        st.Contingency("2", clear="19cyc"),
        st.Contingency("5", clear="32cyc"),
        st.Contingency("2-3#1@0.3", clear="40cyc"),
        st.Contingency("4-5", clear="3cyc"),
    ]
    full = point.case.set({"machines.23.base": 81.0, "machines.24.base": 74.0}).initialize()
    others = point.case.set({"machines.22.base": 57.4, "machines.23.base": 81.0}).initialize()  # in which they are lost
    calls = {
        "one": lambda: redispatch(point, lost[:1], search),
        "several": lambda: redispatch(point, lost, search),
        "after another": lambda: redispatch(
            point, lost[:1], search, tried=[point.case.set("machines.24.p", 160.0).initialize()]
        ),
        "with a law": lambda: redispatch(point, lost[1:2], search, control=st.BangBang("20mHz")),
        "full": lambda: redispatch(full, [st.Contingency("5", clear="60cyc")], search),
        "nobody left": lambda: redispatch(point, lost[1:2], search, tried=[others]),
        "not lost": lambda: redispatch(point, lost[3:], search),
        "in vain": lambda: redispatch(point, [st.Contingency("2", clear="400cyc"), lost[1]], search),
    }
    for name, call in calls.items():
        try:
            found[name] = call()
        except st.StabctlError as error:
            found[name] = str(error)
    return found


@recorded("a study with remedies", slow=True, loose=1e-3)
def _(folder):
    faults = [
        st.Contingency("2", name="=first"),
        st.Contingency("5", trip="5-2"),
        st.Contingency("3-5@0.2", clear="4cyc"),
    ]
    options = {"observe": "1.5s", "resolution": "1cyc", "longest": 0.0, "limit": "40cyc", "workers": 1}
    options |= {"prices": GIVEN / "prices.toml"}
    found = second_point().study(
        "19cyc", faults=faults, worst=2, damping=0.12, voltages=(0.99, 1.02), remedies="redispatch", **options
    )
    base = st.load("two_area").initialize()
    stored = base.study("32cyc", faults=[st.Contingency("9", trip="8-9")], worst=0, remedies="storage", **options)
    judged = second_point().study("19cyc", faults=faults, worst=2, criteria=GIVEN / "criteria.toml", **options)
    tuned = second_point().study("17cyc", faults=faults[:1], worst=0, damping=0.12, remedies="stabilizers", **options)
    found.save(folder / "study.xlsx")
    found.save(folder / "study.csv")
    sheets = pd.read_excel(folder / "study.xlsx", sheet_name=None)
    (last,) = tuned.remedies
    return {
        "says": found.remarks(),
        "secure": found.secure,
        "remedies": found.remedies,
        "tables": {name: frame.head(3) for name, frame in found.tables().items()},
        "table": (folder / "study.csv").read_text(encoding="utf-8").splitlines(),
        "sheets": {name: [list(frame.columns), list(frame.shape)] for name, frame in sheets.items()},
        "cell": str(sheets["contingencies"].iloc[:, 0].tolist()),
        "contributions": found.contributions(found.modes.least_damped()[0]).df.head(3),
        "rows": [one.rows() for one in found.remedies],
        "stored": stored.remarks(),
        "ratings": [one.rows() for one in stored.remedies],
        "judged": [judged.remarks(), judged.tables()["violations"].head(4)],
        "tuned": [last.solves, last.price, last.verdict, last.after.lost, last.after.margin, last.before],
    }


RULES = """title = "of every kind"
source = "a test"
unverified = "all of it"

[[voltage]]
name = "returns"
below = 0.93
recover = "0.1s"
since = "clearing"

[[voltage]]
name = "slow return"
below = 0.6
recover = "40ms"
kv = [100, 120]

[[voltage]]
name = "after recovery"
below = 1.01
since = "recovery"
recovered = 0.98
longest = "20ms"

[[frequency]]
name = "total"
above = 50.02
longest = "60ms"
total = true

[[angle]]
name = "close"
separation = "20deg"

[[angle]]
name = "far"
separation = 2.9

[[swings]]
name = "decays"
must = "decay"
"""
NO_RULES = {
    "none": 'title = "x"',
    "both": 'title = "x"\n[[voltage]]\nname = "a"\nbelow = 0.9\nabove = 1.1',
    "neither": 'title = "x"\n[[frequency]]\nname = "a"',
    "recovery": 'title = "x"\n[[voltage]]\nname = "a"\nbelow = 0.9\nrecovered = 0.95',
    "recover": 'title = "x"\n[[voltage]]\nname = "a"\nabove = 1.1\nrecover = "1s"',
    "kv": 'title = "x"\n[[voltage]]\nname = "a"\nabove = 1.1\nkv = [110, 100]',
    "time": 'title = "x"\n[[voltage]]\nname = "a"\nabove = 1.1\nlongest = "5Hz"',
    "angle": 'title = "x"\n[[angle]]\nname = "a"\nseparation = "0deg"',
    "key": 'title = "x"\n[[angle]]\nname = "a"\nseparatin = "9deg"',
    "hertz": 'title = "x"\nfrequency_hz = 60\n[[swings]]\nname = "a"\nmust = "decay"',
    "area": 'title = "x"\n[[voltage]]\nname = "a"\nabove = 1.1\nareas = [7]\nkv = [100, 400]',
}


@recorded("criteria of every kind", loose=1e-5)
def _(folder):
    path = folder / "rules.toml"
    path.write_text(RULES.replace("separation = 2.9", 'separation = "2.9"'), encoding="utf-8")
    rules = refused(lambda _: st.criteria(path), None)
    path.write_text(RULES.replace("separation = 2.9", 'separation = "95deg"'), encoding="utf-8")
    fault, short = st.Contingency("2-3#1@0.3", clear="9cyc", trip="2-3#1", at=0.1), second_point()
    runs = {
        "run": short.simulate(fault, "1.4s"),
        "short": short.simulate(fault, "0.3s"),
        "lost": short.simulate(st.Contingency("5", clear="33cyc", at=0.1), "2s"),
        "long": short.simulate(fault, "4s"),
        "islands": mixed_point().simulate(["30-40#1@0.1s", "30-40#2@0.2s", "1002-1003#1@0.3s"], "1s"),
    }
    every = {name: run.judge(path) for name, run in runs.items()}
    found = {name: [str(one), [tuple(v)[:4] for v in one.violations], one.unstable] for name, one in every.items()}
    found |= {"a number": rules, "criteria": st.criteria(path), "table": every["lost"].df}
    for name, text in NO_RULES.items():
        path.write_text(text, encoding="utf-8")
        found[f"no rules, {name}"] = refused(lambda _: runs["short"].judge(path), None)
    found["not recorded"] = refused(lambda _: short.simulate(fault, "0.3s", record=False).judge("entso-e"), None)
    return found


GRID = """kind = "simulate"
case = "second"
fault = { text = "2-3#1@{}", from = 0.25, to = 0.75, count = 2 }
clear = "5cyc"
at_s = "60ms"
until_s = "0.4s"
fault_r_pu = 0.002
fault_x_pu = 0.004

[[job]]
trip = "2-3#1"

[job.set]
"pss.21.K" = [4.0, 9.0]
tgov = { "24" = { K = 14.5 } }

[[job]]
fault = "5"
clear = "34cyc"
until_s = 2
max_angle_rad = 2.0

[job.set]
"loads.2.p" = { from = 150, to = 160, step = 10.0 }

[[job]]
case = "two_area"
fault = "7"
storage = "30MW"
storage_energy_mwh = 0.01
lag_s = "20ms"
deadband_hz = "30mHz"

[[job]]
case = "two_area"
machines = "classical"
fault = "9"
storage = "30MW"
estimator = "frequency"
pmu_rate = 50
seed = 3.0
until_s = 1
"""
TIMES = """kind = "clearing-time"
case = "second"
fault = ["2", 5]
resolution = "1cyc"
observe_s = 1
longest_s = 0
limit = "40cyc"
scan = 0
coi = "machines"
"""
NO_SWEEP = {
    "job": "job = 3",
    "kind": 'kind = "run"',
    "no kind": 'case = "second"',
    "no case": 'kind = "simulate"\nclear = "3cyc"\ncase = "third"',
    "grid": GRID.replace("count = 2", "step = -0.1"),
    "grid's text": GRID.replace("2-3#1@{}", "2-3#1"),
    "both": GRID.replace("count = 2", "count = 2, step = 0.1"),
    "set": GRID.replace('"pss.21.K"', '"pss.22.K"'),
    "set a text": GRID.replace("seed = 3.0", 'set = "x"'),
    "classical": GRID.replace("seed = 3.0", 'set = {"pss.1.K" = 9}'),
    "late": GRID.replace('until_s = "0.4s"', 'until_s = "0.1s"'),
    "no bus": GRID.replace('fault = "9"', 'fault = "99"'),
    "trip": GRID.replace('trip = "2-3#1"', 'trip = "2-3#7"'),
    "storage": GRID.replace('storage = "30MW"\nest', 'storage = "30"\nest'),
    "no effect": TIMES.replace("scan = 0", "lag_s = 0.1"),
    "rate": GRID.replace("pmu_rate = 50", "pmu_rate = 61"),
    "unit": GRID.replace('"30mHz"', '"30s"'),
    "controller": GRID.replace("pmu_rate = 50", 'pmu_rate = 50\ncontroller = "none.toml"'),
    "limit": TIMES.replace("40cyc", "0.5cyc"),
    "key": TIMES.replace("scan", "scam"),
    "cycles": GRID.replace('"60ms"', '"3cyc"'),
}


OUTCOME = [f.column for f in fields(Result).values()]


@recorded("jobs of sweeps", loose=1e-4)
def _(folder):
    path, found = folder / "jobs.toml", {}
    for name, text in {"runs": GRID, "times": TIMES}.items():
        path.write_text(text, encoding="utf-8")
        for k, task in enumerate(tasks_of(read_study(path), path)):
            row = run_task(task)
            given = {key: value for key, value in task.job.given().items() if value not in (None, "", 0.0)}
            found[f"{name}, job {k}"] = [
                ", ".join(f"{key}={given[key]}" for key in ("case", "fault", "trip", "clear", "set") if key in given),
                row.about.status, row.about.message,
                {key: v for key, v in row.values.items() if key in OUTCOME and v is not None},
            ]  # fmt: skip
    for name, text in NO_SWEEP.items():
        path.write_text(text, encoding="utf-8")
        found[f"no sweep, {name}"] = refused(lambda _: tasks_of(read_study(path), path), None)
    found["comma"] = refused(lambda _: st.run_sweep(path, folder / "x.db", controllers=["a,b.toml"]), None)
    found["both"] = refused(lambda _: st.run_sweep(path, folder / "x.db", workers=1, scheduler="x"), None)
    return found


WRONG_CASES = {
    "row": lambda c: replace(c, buses=(*c.buses, 3)),
    "model": lambda c: replace(c, devices={**c.devices, "sexx": {}}),
    "no buses": lambda c: replace(c, buses=()),
    "name": lambda c: replace(c, name="a\nb"),
    "title": lambda c: replace(c, title="a\x07"),
    "no swing bus": lambda c: c.set("buses.3.kind", "pv"),
    "no machine": lambda c: c.set("buses.5.kind", "pv"),
    "scheduled": lambda c: c.set("buses.4.kind", "pq"),
    "no impedance": lambda c: c.set({"branches.5-2.r": 0.0, "branches.5-2.x": 0.0}),
    "one bus": lambda c: replace(c, branches=(*c.branches, c.branches[0]._replace(to_bus=1))),
    "shares": lambda c: c.set("loads.2.q_power", 0.7),
    "key": lambda c: replace(c, devices={**c.devices, "pss": {"x": c.devices["pss"][21]}}),
    "load": lambda c: with_rows(c, "cim", 4),
    "owner": lambda c: with_rows(c, "sexs", 29),
    "two": lambda c: with_rows(c, "sexs", 21),
    "exciter": lambda c: with_rows(c, "sexs", 23),
    "of a converter": lambda c: with_rows(c, "reec_b", 21),
    "stabilizer": lambda c: replace(c.without_device("ieeet1", 22), devices=moved(c, "pss", 21, 22, "ieeet1")),
    "limits": lambda c: c.set({"pss.21.Vmin": 0.3}),
    "storage": lambda c: stored(c, 0, machine=29),
    "small converter": lambda c: stored(c, 0, mva=3.0),
    "store": lambda c: replace(
        c, storage=(c.storage[0]._replace(storage_model="supercap_regc", energy=0.0, lag=0.0, ramp=0.0),)
    ),
    "characteristic": lambda c: stored(c, 1, storage_model="regc", lag=0.0, ramp=0.0),
    "two swing buses": lambda c: c.set("buses.4.kind", "swing"),
    "island": lambda c: replace(c, branches=c.branches[:-3]),
    "path": lambda c: c.set(3, 4),
    "no path": lambda c: c.set("pss", 4),
    "part of a path": lambda c: c.set("pss..K", 4),
    "unit": lambda c: c.set("storage.21.rating", "5kV"),
    "share of MVA": lambda c: c.set("machines.24.p", "31%mva").machine(24),
    "text": lambda c: c.set("machines.24.bus", "4 "),
    "no parameter": lambda c: c.with_device("sexs", 22, KX=3.0),
    "needs": lambda c: c.without_device("ieeet1", 22).with_device("sexs", 22),
    "another exciter": lambda c: c.with_device("sexs", 22, TR=0.0, KA=70.0, TA=0.03).devices["sexs"],
    "no device": lambda c: c.without_device("tgov", 22),
    "column of a load": lambda c: c.with_load(2, 30, q_powr=0.3),
    "two loads": lambda c: c.with_load(2, 30, id="n").with_load(2, 40),
    "parts": lambda c: c.with_load(2, 30, id="m").loads,
    "tripped": lambda c: c.trip_machine(24).buses[3],
    "the only one": lambda c: c.trip_machine(23),
    "classical": lambda c: replace(
        c, devices={"regc_a": {m.machine: tables.parameters("regc_a") for m in c.machines}}
    ).classical(),
    "fleet": lambda c: c.with_storage(["9MW"]),
    "place": lambda c: c.with_storage("x=9MW"),
    "no size": lambda c: c.with_storage("21=9MW,22"),
    "twice": lambda c: c.with_storage("21=9MW,21@1=5MW,21=3MW"),
    "large": lambda c: c.with_storage("2e9MW"),
    "energy": lambda c: c.with_storage("9MW", storage_model="supercap_regc"),
    "voltage": lambda c: c.with_storage("9MW", mva="0.8pu"),
    "mva": lambda c: c.with_storage("9MW", mva="50%", storage_model="regc"),
    "option": lambda c: c.with_storage("9MW", lagg="3ms"),
    "no branch": lambda c: st.Contingency("4-2", clear="3cyc").check(c),
    "no bus": lambda c: st.Contingency("4-9", clear="3cyc").check(c),
    "no circuit": lambda c: st.Contingency("2-3 ckt 9", clear="3cyc").check(c),
    "location": lambda c: st.Contingency("2-3-5-7", clear="3cyc").check(c),
    "at a circuit": lambda c: c.simulate(["2-3@0.4@1s"], "1s"),
    "spread": lambda c: st.replicate(c, 2, spread=12.0),
    "no converter": lambda c: replace(c, storage=()).short_circuit_ratio(),
    "no models": lambda c: replace(c, devices={}).short_circuit(),
    "typical": lambda c: c.with_typical_machines(),
}


def stored(case, k, **values):
    """The case with one storage device, some values of which are others."""
    return replace(case, storage=(case.storage[k]._replace(**values),))


def converters(case):
    """A converter in place of every machine."""
    return {m.machine: tables.parameters("regc_a") for m in case.machines}


def moved(case, model, old, new, without):
    """The devices with a row of a model also at another key, which loses a row of a further model."""
    rows_of = {name: dict(table) for name, table in case.devices.items()}
    rows_of[without].pop(new)
    rows_of.setdefault(model, {})[new] = rows_of[model][old]
    return rows_of


def with_rows(case, model, key):
    """The case with a row of a model at a key."""
    needed = {"TR": 0.01, "KA": 70.0, "TA": 0.02} if model == "sexs" else {}
    return replace(case, devices={**case.devices, model: {key: tables.parameters(model, **needed)}})


@recorded("wrong cases and edits")
def _():
    def told_of(change):
        try:
            found = change(second())
        except st.StabctlError as error:
            return str(error)
        except TypeError as error:
            return type(error).__name__
        return str(found)

    return {name: told_of(change) for name, change in WRONG_CASES.items()}
