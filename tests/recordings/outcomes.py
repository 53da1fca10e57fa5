"""Studies of how runs end, what forces their steps, and what simulations and estimates refuse."""

import tempfile
from dataclasses import replace
from pathlib import Path

import control
import numpy as np
import xarray as xr
from mixed import second
from recordings.answers import refused
from recordings.features import run_of_every_event
from recordings.studies import recorded, second_point
from systems import FORMING, REGC, REGC_C, ROUND, SEXS, small

import stabctl as st
from stabctl.simulation import steps
from stabctl.simulation.schedule import Schedule

OPENED = [st.Open("4-5", "0.1s")]


def fast(gain):
    """A law that is too fast, or that grows."""
    return st.Controller.from_control(
        control.tf([gain], [0.002, 1.0]), "deviation:24", "order:24@5", limits=0.9, name="fast"
    )


def unlimited():
    """The second island without ramps of storage."""
    case = second()
    return replace(case, storage=tuple(one._replace(ramp=0.0) for one in case.storage)).initialize()


@recorded("how runs end", loose=1e-4)
def _():
    point, free = second_point(), unlimited()
    weak = second().with_motors("75%", at=5, H=0.11, A=0.0, C0=1.0).with_motors("70%", at=2, H=0.6, A=0.0, C0=1.0)
    converters = small({"regc_a": REGC}).initialize()
    range_of = st.Criterion(min_frequency="49.7Hz", max_frequency="50.6Hz", frequency_delay_s="70ms")
    runs = {
        "alone": point.simulate(OPENED, "4s", every="0.2s"),
        "alone and slow": point.simulate(OPENED, "2s", every="0.2s", criterion=range_of),
        "one end": point.simulate([st.Open("2-3#1", 0.1, end=2)], "0.4s", every="0.1s"),
        "black": converters.simulate([st.Open("2-3", 0.1), st.Open("2-3#2", 0.13)], "0.6s"),
        "stalled": weak.simulate(st.Contingency("5", clear="21cyc", at=0.05), "0.9s", every="0.1s"),
        "one stalled": weak.simulate(st.Contingency("5", clear="13cyc", trip="3-5", at=0.05), "0.9s", every="0.1s"),
        "fast": free.simulate(FAULT_5, "0.12s", control=fast(9e6), every="20ms"),
        "wrong sign": free.simulate(FAULT_5, "0.14s", control=fast(-3e5), every="20ms"),
        "forming": small({"regfm_a1": FORMING}).simulate(st.Contingency("2", clear="30cyc", at=0.05), "1.2s"),
    }
    return {
        name: [run.outcome, str(run), run.unstable_machines, [] if name in GROWING else run.values("speed")]
        for name, run in runs.items()
    }


GROWING = "fast", "wrong sign"  # there a rounding error grows
FAULT_5 = st.Contingency("5", clear="3cyc", at=0.05)


@recorded("files of runs")
def _():
    run = run_of_every_event()
    with tempfile.TemporaryDirectory() as there:
        run.save(Path(there) / "run.nc")
        run.save(Path(there) / "run.csv", channels="speed:north, voltage:30")
        with xr.open_dataset(Path(there) / "run.nc", engine="scipy") as kept:
            names = {str(k): [list(v.dims), str(v.attrs.get("units", ""))] for k, v in kept.variables.items()}
            values = float(abs(kept["speed"]).sum())
        head = (Path(there) / "run.csv").read_text(encoding="utf-8").splitlines()[:2]
    return {"nc": names, "sum": values, "csv": head}


CAUSES = {
    "a time constant": lambda: small({"genrou": ROUND._replace(T2d=0.0013), "sexs": SEXS}),
    "a regulator": lambda: small({"genrou": ROUND, "sexs": SEXS._replace(TA=0.0021)}),
    "a converter": lambda: small({"regc_c": REGC_C}),
    "a machine": second,
}


@recorded("what forces a step")
def _():
    points = {name: case().initialize() for name, case in CAUSES.items()}
    return {
        **{name: [steps.forced_by(one), steps.checked(one, None)] for name, one in points.items()},
        "loop": [steps.forced_by(points["a machine"], 1e5), steps.checked(points["a machine"], None, 1e5)],
    }


EVENTS = {
    "step": lambda p: p.simulate(until=1, step=1e-9),
    "long step": lambda p: p.simulate(until=1, step="30ms"),
    "steps": lambda p: small({"genrou": ROUND, "sexs": SEXS._replace(TA=0.0021)}).simulate(until=1e9),
    "record": lambda p: p.simulate(until=1, record=3),
    "quantity": lambda p: p.simulate(until=0.1).values("speeds"),
    "angle": lambda p: p.simulate(until=0.1).table("angle", angle_reference=23.5),
    "file": lambda p: p.simulate(until=0.1).save("one.xls"),
    "early": lambda p: p.simulate([st.Fault("5", -0.1)], "1s"),
    "infinite": lambda p: p.simulate([st.Fault("5", 0.1, float("nan"))], "1s"),
    "negative": lambda p: p.simulate([st.Fault("5", 0.1, -0.1 + 0.2j)], "1s"),
    "tripped": lambda p: p.simulate([st.TripMachine(24, 0.1), st.TripMachine(24, 0.2)], "1s"),
    "load": lambda p: p.simulate([st.LoadStep(5, 0.1, p=3.0, id="q")], "1s"),
    "no bus": lambda p: p.simulate([st.SwitchShunt("2-3#1", 0.1, b=3.0)], "1s"),
    "faulted": lambda p: p.simulate([st.Fault("5", 0.1), st.Fault("5", 0.2)], "1s"),
    "line": lambda p: p.simulate([st.Fault("2-3#1@0.3", 0.1), st.Fault("2-3#1@0.4", 0.2)], "1s"),
    "clear": lambda p: p.simulate([st.Clear("5", 0.2)], "1s"),
    "end": lambda p: p.simulate([st.Open("2-3#1", 0.2, end=5)], "1s"),
    "order": lambda p: p.simulate(until=0.1, control=st.Feedback(float("nan"))),
    "schedule": lambda p: Schedule(np.array([[2.0, 0.0]])),
    "columns": lambda p: p.simulate(until=0.1, control=Schedule(np.array([[0.2]]))),
    "group": lambda p: p.simulate(until=0.1, control=st.StorageLaw(((99,),), 1.0)),
    "estimate of a class": lambda p: p.estimate(FAULT_5, control=st.BangBang),
    "seeds": lambda p: p.estimate(FAULT_5, seeds=[3, 3]),
    "two laws": lambda p: st.EstimatorControl([st.BangBang(), st.Feedback(1.0)]),
    "sampled": lambda p: st.EstimatorControl(st.BangBang().sampled(50)),
    "no law": lambda p: st.EstimatorControl(3),
    "pmu": lambda p: st.EstimatorControl(pmu=3),
    "noise": lambda p: st.EstimatorControl(process=3),
    "check": lambda p: st.EstimatorControl(check_pmus=2),
    "factor": lambda p: st.EstimatorControl(inertia_factor=-1.0),
    "factors": lambda p: st.EstimatorControl(reactance_factor=(1.0, "x")),
    "estimator": lambda p: st.EstimatorControl(estimator="kalmann"),
    "engine": lambda p: st.EstimatorControl(engine="fast"),
    "never": lambda p: st.BadPmu(3, 1.0, jump="4deg", until=0.5),
    "not bad": lambda p: st.BadPmu(3, 1.0),
    "outage": lambda p: st.Pmu(outage=(0.3, 0.2)),
    "one time": lambda p: st.Pmu(outage=0.3),
    "bad": lambda p: st.Pmu(bad=[3]),
    "missing": lambda p: p.estimate(FAULT_5, "1s", pmu=st.Pmu(missing=(99,))),
    "all missing": lambda p: p.estimate(FAULT_5, "1s", pmu=st.Pmu(missing=(21, 22, 23, 24))),
    "between": lambda p: p.estimate(FAULT_5, "0.4s", estimator="ideal", pmu=None).accuracy_between(0.3, 0.1),
    "signal of no PMU": lambda p: p.estimate(FAULT_5, "0.4s", control=reading("efd:24")),
    "angle of frequency": lambda p: p.estimate(FAULT_5, "0.4s", control=reading("angle:24"), estimator="frequency"),
}


def reading(signal):
    """A controller that reads a signal."""
    return st.Controller.from_control(control.tf([1.0], [0.1, 1.0]), signal, "vs:24", name="reading")


@recorded("wrong simulations and estimates")
def _():
    return {name: refused(call, second_point()) for name, call in EVENTS.items()}
