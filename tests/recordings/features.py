"""Studies of what a case may have and what may happen to it: events, devices, loads, islands, criteria, PMUs."""

from dataclasses import replace
from functools import cache

import numpy as np
from described import drawn
from mixed import mixed, mixed_point, second
from recordings.studies import GIVEN, recorded, second_point
from systems import CLASSICAL, KINDS, LIBRARY, small

import stabctl as st
from stabctl.simulation.channels import QUANTITIES
from stabctl.view.figures import one_line, trajectory

FAULT = st.Contingency("1002-1003#1@0.3", clear="4cyc", trip="1002-1003#1", at=0.1)
SHORT = {"observe": 0.8, "longest": 0.0, "resolution": "2cyc", "limit": "24cyc"}


@cache
def run_of_every_event():
    """A fault that clears itself, one end of a line, a shunt, a load, a machine."""
    events = [
        st.Fault("20-30#2@0.25", "0.1s", 0.01 + 0.04j),
        st.Clear("20-30#2@0.25", "0.17s"),
        st.Open("30-40", "0.3s", end=40),
        st.SwitchShunt(30, "0.4s", g=3.0, b=17.0),
        st.LoadStep(1002, "25cyc", p="12MW", q="-5Mvar"),
        st.TripMachine(1022, "0.6s"),
    ]
    return mixed_point().simulate(events, "0.9s", every="20ms")


@recorded("every event")
def _():
    run = run_of_every_event()
    tables = {f"table of {name}": run.table(name) for name in QUANTITIES}
    return {
        "run": run,
        "some": run.table("voltage:30,speed:north,angle:7,storage:1021@1002", angle_reference=12),
        "speeds of two": drawn(run.plot("speed", machines=[7, "north"])),
        "angle": drawn(run.plot("angle")),
        "voltage": drawn(run.plot("voltage:30,voltage:1005")),
        "storage": drawn(trajectory.storage(run)),
        "overview": drawn(trajectory.overview(run)),
        **tables,
    }


@recorded("an island comes about")
def _():
    run = mixed_point().simulate(["30-40#1@0.1s", "30-40#2@0.2s", "1002-1003#1@0.3s"], "1s", every="40ms")
    return {"run": run, "power": run.table("electrical_power,storage_energy,voltage_angle:40")}


CRITERIA = {
    "usual": st.Criterion(),
    "near": st.Criterion(max_angle="40deg"),
    "machines": st.Criterion(coi="machines", max_angle="50deg"),
    "voltage": st.Criterion(low_voltage_s="20ms"),
    "frequency": st.Criterion(min_frequency="49.9Hz", max_frequency="50.1Hz", frequency_delay_s="50ms"),
    "speed": st.Criterion(slowest=0.99, fastest=1.01),
}


@recorded("ways to be lost", loose=1e-5)
def _():
    fault = replace(FAULT, clear="22cyc")
    runs = {name: mixed_point().simulate(fault, "1.2s", criterion=one) for name, one in CRITERIA.items()}
    return {
        "outcomes": {name: run.outcome for name, run in runs.items()},
        "lost": {name: run.unstable_machines for name, run in runs.items()},
        "figure": drawn(runs["near"].plot("angle")),
        "judged": [runs["usual"].judge(name) for name in (GIVEN / "criteria.toml", "entso-e")],
    }


@recorded("clearing times below and beyond", loose=1e-4)
def _():
    point, fault = second_point(), st.Contingency("2-3#1@0.3")
    found = {
        "limit": point.clearing_time(fault, **SHORT | {"limit": "3cyc", "resolution": "1cyc"}),
        "never": point.clearing_time(fault, **SHORT, criterion=st.Criterion(max_angle="20deg")),
        "scan": point.clearing_time(fault, **SHORT | {"scan": "4cyc"}),
        "criteria": point.clearing_time(fault, **SHORT, criteria=GIVEN / "criteria.toml"),
    }
    return found | {f"figure, {name}": drawn(one.plot()) for name, one in found.items() if len(one.runs) > 1}


@recorded("screens of several kinds", loose=1e-4)
def _():
    options = SHORT | {"workers": 1}
    return {
        "below": second_point().screen("12cyc", **options),
        "buses": second_point().screen(faults="buses", buses=[2, 5], **options),
        "categories": second_point().screen(faults="P4@7cyc, P7", **options),
        "others": second_point().screen(faults=["2-3", st.Contingency("5", trip="3-5", name="named")], **options),
    }


@recorded("loads")
def _():
    case = second()
    found = {
        "impedance": case.with_loads("impedance"),
        "current": case.with_loads("current"),
        "power": case.with_loads("power"),
        "level": case.with_load_level(0.93),
        "less": case.with_load(2, "140MW", id="m", q_power=0.4).with_load(4, 7.0),
        "motors": case.with_motors("30%", at=5, H=0.4, A=1.0, C0=0.0),
        "classical": case.classical(),
        "tripped": case.trip_machine(22),
        "set": case.set("genrou.21.H", 2.9),
    }
    return {name: ended(one) for name, one in found.items()}


def ended(case, **options):
    """What a fault ends in, some curves, and what is said of the case."""
    run = case.simulate(st.Contingency("2-3#1@0.3", clear="4cyc", at=0.05), "0.4s", every="50ms", **options)
    return {"case": str(case), "check": case.check(), "said": str(run), "voltage": run.values("voltage")}


@recorded("conventions")
def _():
    case = second()
    found = {name: case.with_conventions(name) for name in ("pst", "psse", "andes", "book")}
    return {name: {**ended(one), "devices": one.devices, "notes": one.notes} for name, one in found.items()}


@recorded("fleets")
def _():
    case = second().set("name", "fleet")
    sizes = {"all": "5%mva", "dispatch": "7%dispatch", "some": "21=12MW,24@5=9MW", "number": 6.0, "map": {21: "4MW"}}
    rows = {name: case.with_storage(size, lag="30ms", charge=0.4) for name, size in sizes.items()}
    return {name: one.storage for name, one in rows.items()} | {
        "regc": case.with_storage("9MW", storage_model="regc", mva="0.8pu", converter="Imax=1.3 Lvplsw=0").storage,
        "resized": case.initialize().resized([3.0, 8.0]).case.storage,
    }


@recorded("storage behind converters", slow=True, loose=1e-4)
def _():
    base, law = second(), st.BangBang(deadband="20mHz")
    found = {}
    for model in ("ideal", "regc", "regc_b", "regc_c", "regfm", "regfm_b1", "regc_repc", "supercap_regc", "flywheel"):
        case = base.with_storage("24=11MW", storage_model=model, energy="0.002MWh")
        found[model] = ended(case, control=law)
    return found


KIND = "genrou with speed factor", "gensae", "reec_b, voltage", "repc_a, voltage", "reec_a and wtdt_a"


@recorded("converters and machines", slow=True, loose=1e-4)
def _():
    found = {}
    for name in KIND:
        point = small(LIBRARY[name]).initialize()
        run = point.simulate(st.Contingency("2", clear="3cyc", at=0.05), "0.3s")
        found[name] = {"said": str(run), "power": run.values("electrical_power"), "modes": str(point.modes())}
    return found


@recorded("kinds of machines", loose=1e-5)
def _():
    found = {}
    for name in ("bare", "salient", "exst3 bus-fed", "ieeet1", "classical with governor"):
        point = small(KINDS[name]).initialize()
        run = point.simulate(st.Contingency("2", clear="3cyc", at=0.05), "0.3s", every="30ms")
        found[name] = {"said": str(run), "point": point.case.check(), "power": run.values("electrical_power")}
    return found


@recorded("PMUs that are bad", loose=1e-3, slow=True)
def _():
    base = st.load("two_area").initialize(storage="50MW")
    fault = st.Contingency("7", clear="8cyc", trip="7-8", at=0.5)
    wrong = {
        "jump": st.Pmu(bad=(st.BadPmu(3, "0.3s", jump="5deg"),)),
        "frozen": st.Pmu(bad=(st.BadPmu(2, 0.4, frozen=True, until="0.9s"),)),
        "missing": st.Pmu(missing=(4,), loss=0.05, burst=2.0, filter_class="P"),
        "outage": st.Pmu(outage=("0.6s", "0.8s"), filter_class="M", rate=50, latency="80ms"),
    }
    return {
        name: base.estimate(fault, "1.5s", control=st.EstimatorControl(pmu=pmu, check_pmus=name != "outage"))
        for name, pmu in wrong.items()
    }


@recorded("estimators", loose=1e-3)
def _():
    base = st.load("two_area").classical().initialize(storage="1=40MW,4=30MW")
    fault = st.Contingency("7", clear="6cyc", trip="7-8", at=0.2)
    found = {
        name: base.estimate(fault, "0.8s", estimator=name, seeds=[2], pmu=pmu)
        for name, pmu in (("ideal", None), ("frequency", st.Pmu(30, outage=("0.3s", "0.5s"))), ("kinematic", st.Pmu()))
    }
    return found | {"accuracy": found["kinematic"].accuracy_between(0.3, 0.7)}


@recorded("diagrams", loose=1e-2)
def _():
    point, case = second_point(), st.load("two_area")
    return {
        "line": second().one_line(),
        "case": drawn(case.plot()),
        "point": drawn(case.initialize(storage="40MW").plot()),
        "mode": drawn(one_line.plot(point, point.modes().mode(point.modes().swings()[0]))),
        "screen": drawn(one_line.plot(second(), point.screen(faults="buses", buses=[2, 5], workers=1, **SHORT))),
    }


@recorded("other systems")
def _():
    copies = st.replicate(st.load("wscc9"), 2, x=0.02, spread=0.03)
    typical = replace(second(), devices={}).with_typical_machines({})
    bare = replace(second(), devices={"gencls": {m.machine: CLASSICAL for m in second().machines}})
    return {
        "copies": copies.power_flow(),
        "typical": typical.devices,
        "classical": bare.initialize().modes(),
        "strength": second().short_circuit(trip="2-3"),
        "ratio": second().short_circuit_ratio(),
        "units": [st.Contingency("2-3@0.3", clear=t).cleared(second()) for t in ("3cyc", "70ms", "0.1s", 0.2)],
        "names": [str(mixed().machine(k)) for k in ("north", 1024)],
        "seen": np.array([m.p for m in mixed().machines]),
    }
