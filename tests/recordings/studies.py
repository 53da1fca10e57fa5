"""The studies whose results are recorded: commands with all they write, and results of Python with all they have."""

import json
import re
import shutil
import sys
from contextlib import redirect_stderr, redirect_stdout
from functools import cache
from io import StringIO
from pathlib import Path

import control
from described import CLOCKED, FIRST, LEAST, MANY, described, drawn, timeless
from mixed import mixed, mixed_point, second, without_ramps
from systems import REEC, REGC_C, small
from terminal import said

import stabctl as st
from stabctl import cli, design, smallsignal

GIVEN = Path(__file__).parent / "given"
ROWS = 60  # of a file that is kept whole
PROGRESS = re.compile(r"stabctl: .* after \d+ s")  # a line of a slow machine
ANGLES = "shape", "angle_deg"
LETTERS = 250  # lines of a page that are kept; of the others every seventh
STUDIES, SLOW, LOOSE = {}, set(), {}


def lines(text):
    """Lines of a text without computing times."""
    every = [line.rstrip() for line in timeless(said(text)).splitlines()]
    return [line for line in every if not PROGRESS.match(line)]


def called(*words):
    """Exit code and what is written to the terminal."""
    before, sys.argv = sys.argv, ["stabctl", *map(str, words)]
    out, err = StringIO(), StringIO()
    try:
        with redirect_stdout(out), redirect_stderr(err):
            cli.main()
    except SystemExit as stop:
        code = stop.code
    finally:
        sys.argv = before
    return code, out.getvalue(), err.getvalue()


def command(text, *files, as_json=True, page=False):
    """A study: the command's text, its JSON, the files and the page that it writes."""

    def study(folder):
        words = text.split(" ")
        code, out, err = called(*words, *(["--report", "page"] if page else []))
        found = {"exit": code, "out": lines(out), "err": lines(err)}
        if code not in (0, 1):
            raise AssertionError(f"{text}: {err}")
        if as_json:
            found["json"] = clockless(json.loads(called(*words, "--json")[1] or "null"))
        for name in files:
            written = lines((folder / name).read_text(encoding="utf-8"))
            found[name] = written if len(written) < ROWS else written[:: len(written) // 6]
        for html in sorted((folder / "page").glob("*.html")) if page else ():
            found[html.name] = words_of(html.read_text(encoding="utf-8"))
        if page:
            shutil.rmtree(folder / "page", ignore_errors=True)
        return found

    return study


def clockless(value):
    """JSON without computing times and what rounding decides, and with four entries of a long list."""
    if isinstance(value, dict):
        still = value.get("frequency_hz") == 0 or value.get("magnitude", 1.0) < LEAST  # no angles that mean something
        return {k: clockless(v) for k, v in value.items() if k not in (*CLOCKED, "key", *(ANGLES if still else ()))}
    if not isinstance(value, list):
        return value
    if value and isinstance(value[0], dict) and "damping_ratio" in value[0] and "parameter" in value[0]:
        value = value[:FIRST]  # the last sensitivities are zero, in any order
    if len(value) > MANY and all(isinstance(v, dict | list) for v in value):
        return {"number": len(value), "some": [clockless(value[k]) for k in (0, 1, len(value) // 2, -1)]}
    return [clockless(v) for v in value]


def words_of(html):
    """What a page says, also in its figures."""
    html = re.sub(r"<(script|style)\b.*?</\1>", "", html, flags=re.DOTALL)
    text = re.sub(r"<[^>]*>", "\n", html)
    said = [line for line in lines(text) if line.strip()]
    return [*said[:LETTERS], *said[LETTERS::7]]


def recorded(name, slow=False, loose=1e-6):
    """Register a study of Python: it may take a folder for its files, and returns a mapping of results."""

    def decorate(function):
        folders = function.__code__.co_argcount
        STUDIES[name] = lambda folder: {k: described(v) for k, v in function(*[Path(folder)] * folders).items()}
        LOOSE[name] = loose
        if slow:
            SLOW.add(name)
        return function

    return decorate


@cache
def run_of_two_islands():
    """Faults in both islands, a load step, a trip, storage with a law."""
    fault = st.Contingency(
        "1002-1003#1@0.3", clear="4cyc", trip="1002-1003#1", at=0.2, impedance=0.004 + 0.011j,
        events=["40:+13MW@0.7s", "5@0.9s", "30-40#2@1.1s"], after=["1005:-9MW@0.15s"],
    )  # fmt: skip
    return mixed_point().simulate(fault, until=2.0, control=st.StorageLaw((), 2.0, slope=0.01, deadband="30mHz"))


@recorded("power flow of two islands")
def _():
    flow = mixed_point().power_flow()
    return {"flow": flow, "check": mixed().check(), "figure": drawn(mixed_point().plot())}


@recorded("simulation of two islands")
def _():
    run = run_of_two_islands()
    return {"run": run, "figure": drawn(run.plot()), "judged": run.judge(GIVEN / "criteria.toml")}


@recorded("modes of two islands")
def _():
    modes = mixed_point().modes()
    return {
        "modes": modes,
        "figure": drawn(modes.plot()),
        "sensitivity": modes.sensitivity(),
        "areas": smallsignal.areas(modes),
        "linear": mixed_point().linearize(
            "order:1021@1002, vref:7, pref:1024", "speed:north, flow:30-40, voltage:1005"
        ),
    }


@recorded("short circuits of two islands")
def _():
    return {
        "power": mixed_point().short_circuit(),
        "figure": drawn(mixed_point().short_circuit().plot()),
    }


@recorded("clearing times of two islands", loose=1e-4)
def _():
    found = mixed_point().clearing_time(
        "1002-1003#1@0.3", control=st.BangBang(0.05), resolution="0.5cyc", observe=2.0, limit="30cyc"
    )
    return {"time": found, "figure": drawn(found.plot())}


@recorded("screen of two islands", loose=1e-4)
def _():
    found = mixed_point().screen(resolution="1cyc", observe=1.0, longest=0.0, limit="20cyc", workers=1)
    return {"screen": found, "figure": drawn(found.plot())}


def dampers():
    """Two controllers: one continuous, one sampled with a delay, each with a limit."""
    lead = control.tf([0.11, 1.0], [0.04, 1.0]) * control.tf([3.0, 0.0], [3.0, 1.0])
    one = st.Controller.from_control(
        7.0 * lead, "deviation:north", "order:1021@1002", limits=(-0.7, 0.8), name="first", deadband=1.3e-5
    )
    two = st.Controller.from_control(
        control.tf([29.0, 11.0], [1.0, 9.0]), "deviation:1024", "order:1024@1005",
        rate=50, delay="40ms", limits=0.4, name="second",
    )  # fmt: skip
    return one, two


@cache
def second_point():
    """The operating point of the second island by itself."""
    return second().initialize()


@recorded("controllers of two islands")
def _():
    point, both = without_ramps(), dampers()
    run = point.simulate(st.Contingency("1002-1003#1@0.3", clear="3cyc", at=0.1), until=1.5, control=list(both))
    closed = point.closed_loop(*both)
    pairs = design.pairs(
        point, "deviation:north, deviation:1024, flow:1002-1005", "order:1021@1002, vs:1024", mode=1.593
    )
    pod = design.pod(point, "deviation:north", "order:1021@1002", damping=0.13, mode=1.593)
    return {
        "controllers": both,
        "run": run,
        "modes": closed.modes(),
        "margins": point.margins(*both),
        "pairs": pairs,
        "figure of pairs": drawn(pairs.plot()),
        "pod": pod,
        "figure of pod": drawn(pod.plot()),
        "lqr": design.lqr(second_point(), "order", speed="80mHz", effort=0.7),
    }


@recorded("limit cycles")
def _():
    relays = [
        st.Controller.from_control(
            control.tf([gain], [1.0]), f"deviation:{k}", f"order:{k}@{bus}", rate=60, delay=delay, relay=True,
            deadband=band, limits=high, name=name,
        )
        for gain, k, bus, delay, band, high, name in (
            (1.0, 1, 5, "200ms", 2e-5, 1.0, "relay"),
            (1.0, 4, 10, "150ms", 3e-5, 0.8, "other"),
        )
    ]  # fmt: skip
    found = st.load("two_area").initialize(storage="90MW").limit_cycles(*relays)
    return {"found": found, "figure": drawn(found.plot())}


@recorded("estimates of two islands", loose=1e-4)
def _():
    fault = st.Contingency("1002-1003#1@0.3", clear="3cyc", trip="1002-1003#1", at=0.1)
    pmu = st.Pmu(50, loss=0.06)
    found = mixed_point().estimate(fault, "1.2s", estimator="kinematic", seeds=[3, 5], pmu=pmu)
    return {"found": found, "figure": drawn(found.plot())}


@recorded("estimates of a Kalman filter", slow=True, loose=1e-3)
def _():
    base = st.load("two_area").initialize(storage="1=40MW,4=30MW")
    fault = st.Contingency("7", clear="6cyc", trip="7-8", at=0.2)
    found = base.estimate(fault, "1.4s", estimator="kalman", seeds=[2, 7], pmu=st.Pmu(50, loss=0.06))
    return {"found": found, "figure": drawn(found.plot())}


@recorded("typical machines")
def _():
    case = st.read_matpower(GIVEN / "nine.m", machines="typical")
    return {"devices": case.devices, "point": case.initialize().power_flow(), "check": case.check()}


@recorded("one machine")
def _():
    found = theory()
    return {**found, **{f"figure of {k}": drawn(v.plot()) for k, v in found.items() if hasattr(v, "plot")}}


def theory():
    """Laws and areas of one machine with other numbers than those of the paper."""
    from stabctl.theory import equal_area, feedback_laws, omib, phase_plane

    machine = omib.OMIB()
    return {
        "machine": machine,
        "table": omib.table1(machine, (5, 9)),
        "area": equal_area.equal_area(machine, 1.13, 0.15),
        "critical": equal_area.critical_clearing(machine, 0.15),
        "portrait": phase_plane.portrait(machine, (5, 9), 1.1),
        "laws": feedback_laws.paper_laws(),
    }


@recorded("siting", slow=True, loose=1e-3)
def _():
    base = st.load("two_area").classical().initialize()
    wanted = [
        st.Contingency("7-8@0.4", clear="13cyc", name="first"),
        st.Contingency("9", clear="9cyc", trip="8-9", name="second"),
    ]
    found = st.place(base, wanted, candidates=GIVEN / "sites.csv", observe="2s", outages=False)
    return {"found": found, "figure": drawn(found.plot())}


@recorded("schedule", slow=True, loose=1e-3)
def _():
    base = st.load("two_area").classical().initialize(storage="1=40MW,4=30MW")
    found = design.optimum(base, st.Contingency("7", clear="9cyc", trip="7-8"), window="1.5s", rate=20, iterations=4)
    return {"found": found}


@recorded("law", slow=True, loose=1e-3)
def _():
    base = st.load("two_area").classical().initialize(storage="40MW")
    faults = [st.Contingency("7", clear="9cyc", trip="7-8"), st.Contingency("9", clear="8cyc", trip="8-9#2")]
    found = design.law(base, faults, observe="2s", resolution="1cyc", longest=0.0, workers=1)
    return {"found": found, "figure": drawn(found.plot())}


@recorded("stabilizers", slow=True, loose=1e-3)
def _():
    found = design.pss(st.load("two_area_thyristor"), [1, 3], damping=0.07, starts=1, stages=1)
    return {"found": found, "figure": drawn(found.plot())}


@recorded("remedies", slow=True, loose=1e-3)
def _():
    base = st.load("two_area_thyristor").initialize()
    found = st.study(
        base, "9cyc", faults=[st.Contingency("7-8@0.4"), st.Contingency("9", trip="8-9")], worst=1, observe="2s",
        resolution="1cyc", longest=0.0, prices=GIVEN / "prices.toml", workers=1,
    )  # fmt: skip
    return {"found": found}


@recorded("a converter in weak grids", slow=True, loose=1e-4)
def _():
    case = small({"regc_c": REGC_C, "reec_b": REEC})
    found = st.weak_grid(case, 1, scr=[1.3, 2.1, 3.4], gain=[0.6, 1.7])
    return {"found": found, "figure": drawn(found.plot())}


@recorded("files read")
def _():
    psse = st.read_psse(GIVEN / "five.raw", missing="injection", missing_controls="fixed")
    both = {
        "psse": psse,
        "matpower": st.read_matpower(GIVEN / "nine.m"),
        "pst": st.read_pst(GIVEN / "pair.m"),
    }
    tables = "buses", "branches", "machines", "loads", "links", "devices", "notes", "base_mva", "frequency_hz", "title"
    return {f"{name} {table}": getattr(case, table) for name, case in both.items() for table in tables} | {
        f"{name} flow": case.power_flow() for name, case in both.items()
    }


def sweep(folder):
    """Two studies, and what is shown of their results."""
    found = {}
    for name in "runs", "times":
        code, out, err = called("sweep", "run", f"{name}.toml", "--out", f"{name}.db", "--workers", 1)
        shown = command(f"sweep show {name}.db --csv {name}.csv", f"{name}.csv", page=True)(folder)
        shown[f"{name}.csv"] = [line.partition(",")[2].rsplit(",", 4)[0] for line in shown[f"{name}.csv"]]
        found[name] = {"exit": code, "out": lines(out), "err": lines(err), "shown": shown}
        (folder / f"{name}.db").unlink()
    return found


COMMANDS = {
    "powerflow": command("powerflow mixed --branches", page=True),
    "simulate": command(
        "simulate mixed --fault 20-30#1@0.35 --clear 70ms --at 0.3s --trip 30-40#2 --trip-machine 1024@0.8s"
        " --load-step 1002:+21MW@0.9s --until 1.5 --deadband 40mHz --criteria criteria.toml --every 5ms"
        " --out run.csv --fault-impedance 0.002,0.007",
        "run.csv",
        page=True,
    ),
    "simulate estimated": command(
        "simulate two_area --classical --fault 7 --trip 7-8 --clear 8cyc --storage 40MW --estimator frequency"
        " --until 2.5 --seed 4 --pmu-rate 50 --latency-ms 40 --loss 0.05",
    ),
    "modes": command("modes mixed --band 0.5 2.1 --areas 3 --sensitivity", page=True),
    "modes open": command("modes mixed --open 20-30#1 --band 0.2 1.4"),
    "clearing-time": command(
        "clearing-time mixed --fault 1002-1003#1@0.3 --resolution 0.5cyc --observe 1.5 --limit 35cyc", page=True
    ),
    "screen": command(
        "screen mixed --contingencies some.toml --resolution 1cyc --observe 1 --longest 0 --limit 30cyc --out s.csv",
        "s.csv",
        page=True,
    ),
    "screen statements": command(
        "screen two_area --contingencies grid.con --subsystems grid.sub --classical --resolution 2cyc --observe 1"
        " --longest 0 --limit 30cyc"
    ),
    "scr": command("scr mixed", page=True),
    "check": command("check mixed"),
    "linearize": command("linearize mixed --inputs storage,vref:7 --outputs speed,voltage:30,flow:30-40 --out m.npz"),
    "import psse": command("import five.raw five.dyr"),
    "import matpower": command("import nine.m"),
    "import pst": command("import pair.m --out pair"),
    "estimate": command("estimate two_area --classical --fault 7 --trip 7-8 --clear 7cyc --storage 40MW", page=True),
    "sweep run": sweep,
    "tables": command("tables storage", as_json=False),
    "models": command("models exst3", as_json=False),
    "equal area": command("swing equal-area --Pc 0.2"),
    "feedback": command("swing feedback"),
    "verify": command("verify wscc9_sauer_pai"),
    "study": command(
        "study mixed --contingencies some.toml --clear 5cyc --worst 2 --observe 1 --longest 0 --resolution 1cyc"
        " --remedies none",
        page=True,
    ),
    "errors": None,
}

MISTAKES = (
    "powerflow nowhere",
    "powerflow mixed --set loads.40.p=5000",
    "powerflow mixed --set genrou.7.h=3",
    "powerflow mixed --set genrou.8.H=3",
    "simulate mixed --fault 20-31 --clear 3cyc",
    "simulate mixed --fault 20-30#3 --clear 3cyc",
    "simulate mixed --fault 20-30@1.2 --clear 3cyc",
    "simulate mixed --fault 20 --clear 3cyc --until 1",
    "simulate mixed --storage-at 8=5MW",
    "simulate mixed --trip-machine 8@1s",
    "simulate mixed --load-step 20:5@1s",
    "simulate mixed --criteria nobody",
    "clearing-time mixed --fault 30 --resolution 0cyc",
    "modes mixed --band 2 1",
    "modes mixed --areas 99",
    "linearize mixed --inputs vref:5 --out m.csv",
    "linearize mixed --inputs order:9@9 --out m.csv",
    "screen mixed --contingencies criteria.toml",
    "study mixed --prices prices.toml --remedies none",
    "import five.raw nothing.dyr",
    "place two_area --candidates sites.csv --cap 5kW",
    "sweep run criteria.toml --out x.db",
    "simulate",
    "simulat mixed",
    "modes mixed --bands 1 2",
)


def errors(folder):
    """What is said of mistakes."""
    found = {}
    for text in MISTAKES:
        code, out, err = called(*text.split(" "))
        found[text] = {"exit": code, "said": lines(out + err)}
    return found


COMMANDS["errors"] = errors
STUDIES |= COMMANDS
SLOW |= {"modes", "import psse", "estimate", "study", "feedback", "sweep run"}
LOOSE |= dict.fromkeys(("clearing-time", "screen", "study", "estimate", "simulate estimated"), 1e-4)


def prepared(folder):
    """The files that the commands read, in this folder."""
    for file in filter(Path.is_file, GIVEN.iterdir()):
        shutil.copy(file, folder)
    st.write(mixed(), folder / "mixed")
    st.write(second(), folder / "second")
