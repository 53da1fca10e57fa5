"""Runs that between them meet every branch of the stepper: laws, controllers, converters, events, verdicts, records."""

import json
import os
import sys

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import cont2discrete

import stabctl as st
from stabctl.simulation.schedule import Schedule

st.register(Path(st.__file__).parents[1] / "tests" / "devices" / "wide_area.py")  # as written for this version

CASES = "wnaps", "wnaps_paper", "two_area", "ieee39"
FAULT = {
    "wnaps": st.Contingency("83", clear="4cyc", trip="83-33"),
    "wnaps_paper": st.Contingency("83", clear="5cyc", trip="83-33"),
    "two_area": st.Contingency("7", clear="9cyc", trip="7-8"),
    "ieee39": st.Contingency("16", clear="6cyc", trip="16-24"),
}
MVA = {"mva": "120%"}


@cache
def point(name: str, storage: str | None = None, power: float | None = None, **options: Any) -> st.OperatingPoint:
    """Operating point of a case, with storage, and with loads of which a share draws constant power."""
    case = st.load(name)
    if power is not None:
        shares = {"p_power": power, "q_power": power, "p_current": 1 - power, "q_current": 1 - power}
        case = replace(case, loads=tuple(load._replace(**shares) for load in case.loads))
    return (case.with_storage(storage, **options) if storage else case).initialize()


@cache
def motors() -> st.OperatingPoint:
    """The two-area system with motors."""
    return st.load("two_area").with_motors("40%").initialize()


@cache
def wide_area() -> st.OperatingPoint:
    """The two-area system with a stabilizer of a user's own file."""
    constants = {"bus": 0, "machine": 3, "Kv": 0.5, "Kw": 5.0}
    return st.load("two_area").with_device("wide_area", (1, 2), **constants).initialize()


def damper(states: int, machine: int, **how: Any) -> st.Controller:
    """A stable stabilizer with some states, from random numbers; its matrices are discrete where it has a rate."""
    rng = np.random.default_rng(states)
    A = -np.diag(np.linspace(1, 20, states)) + 0.1 * rng.standard_normal((states, states))
    B, C, D = rng.standard_normal((states, 1)), rng.standard_normal((1, states)), np.zeros((1, 1))
    if "rate" in how:
        A, B, C, D, _ = cont2discrete((A, B, C, D), 1 / how["rate"])
    return st.Controller((f"speed:{machine}",), (f"vs:{machine}",), A, B, C, D, limits=0.05, **how)


def proportional(seen: Any) -> float:
    """A law in Python."""
    return 5 * seen["speed:2"]


def of(at: st.OperatingPoint, events: Any = FAULT["two_area"], control: Any = None, **how: Any) -> st.Trajectory:
    """A run."""
    return at.simulate(events, control=control, **how)


def two_area(storage: str, control: Any, **options: Any) -> st.Trajectory:
    """The fault in the two-area system with storage."""
    return of(point("two_area", storage, **options), control=control)


def schedule() -> Schedule:
    """Orders for a second, and then a law."""
    return Schedule(np.sin(np.arange(240.0)).reshape(60, 4), start=0.2, law=st.BangBang())


def gate() -> st.Gate:
    """A gate with a window."""
    return st.Gate("voltage:7", low=0.8, start=0.3, end=4.0)


def write(answers: Iterable[tuple[str, object]]) -> None:
    """Print answers, and write them to the file that the command line names: name -> answer."""
    out = {}
    for name, answer in answers:
        out[name] = answer
        print(name, answer, flush=True)
    Path(sys.argv[1]).write_text(json.dumps(out, indent=1))


# the first eleven are also timed
RUNS: dict[str, Callable[[], st.Trajectory]] = {
    "wnaps": lambda: of(point("wnaps"), FAULT["wnaps"]),
    "two_area": lambda: of(point("two_area")),
    "ieee39": lambda: of(point("ieee39"), FAULT["ieee39"]),
    "wnaps, bang-bang": lambda: of(point("wnaps", "5%mva"), FAULT["wnaps"], st.BangBang()),
    "bang-bang": lambda: two_area("50MW", st.BangBang()),
    "regc": lambda: two_area("50MW", st.BangBang(), storage_model="regc", **MVA),
    "regfm": lambda: two_area("50MW", st.BangBang(), storage_model="regfm", **MVA),
    "regc_c_repc": lambda: two_area(
        "50MW", st.StorageLaw(slope=0.5, deadband=0.02), storage_model="regc_c_repc", **MVA
    ),
    "10 states": lambda: of(point("two_area"), control=damper(10, 2)),
    "10 states, sampled": lambda: of(
        point("two_area"), control=damper(10, 2, rate=60, delay=0.05, ramp=0.5, tracking=0.2)
    ),
    "10 states, gate": lambda: of(point("two_area"), control=damper(10, 2, gate=gate())),
    "full": lambda: two_area("200MW", st.BangBang(), energy=0.02),
    "lag, ramp": lambda: two_area("100MW", st.BangBang(), lag=0.05, ramp=500.0, energy=0.05, efficiency=0.8),
    "feedback": lambda: two_area("100MW", st.Feedback(1.0, 0.02)),
    "braking": lambda: two_area("100MW", st.Feedback(0.0, 0.05, braking=True, deadband=0.05)),
    "surface": lambda: two_area(
        "100MW",
        st.StorageLaw(groups=("1+2",), angle_gain=1.0, slope=0.2, arm_at=0.15, return_time=5.0),
        energy=1.0,
    ),
    "relay, surface": lambda: two_area(
        "100MW", st.StorageLaw(groups=("1+2",), angle_gain=1.0, max_acceleration=5.0), energy=1.0
    ),
    "no deadband": lambda: two_area("50MW", st.BangBang(deadband=0.0)),
    "sampled law": lambda: two_area("50MW", st.BangBang().sampled(60, "50ms")),
    "Python": lambda: of(
        point("two_area"),
        control=st.Controller.from_function(proportional, "speed:2", "vs:2", rate=60, limits=0.05),
    ),
    "relays of controllers": lambda: two_area("50MW", [*st.BangBang().controllers(point("two_area", "50MW").case)]),
    "constant power": lambda: of(point("two_area", power=0.8), st.Contingency("7", clear="6cyc", trip="7-8")),
    "collapse": lambda: of(
        point("two_area", power=0.9),
        st.Contingency("7", clear="12cyc", trip="7-8"),
        criterion=st.Criterion(max_angle=np.inf),
    ),
    "unstable": lambda: of(point("two_area"), st.Contingency("7", clear="15cyc", trip="7-8")),
    "islands": lambda: of(
        point("two_area", "50MW"),
        [st.Open("7-8", 0.1), st.Open("7-8#2", 0.1), st.Open("8-9", 0.3), st.Open("8-9#2", 0.3)],
        st.BangBang(),
    ),
    "trip": lambda: of(point("two_area", "50MW"), [st.TripMachine(1, 0.5)], st.BangBang(), until=5.0),
    "frequency": lambda: of(
        point("two_area", "50MW"),
        [st.TripMachine(1, 0.5)],
        criterion=st.Criterion(min_frequency=0.98, max_frequency=1.02, frequency_delay_s=0.1),
        until=5.0,
    ),
    "alone": lambda: of(point("two_area"), [st.Open("1-5", 0.1)], until=5.0),
    "alone, frequency": lambda: of(
        point("ieee39"),
        [st.Open("19-33", 0.1)],
        criterion=st.Criterion(max_frequency=1.02, frequency_delay_s=0.1),
        until=5.0,
    ),
    "low voltage": lambda: of(point("two_area", power=0.9), criterion=st.Criterion(low_voltage_s=0.05)),
    "runaway": lambda: of(
        point("ieee39"),
        [st.Open("19-33", 0.1)],
        criterion=st.Criterion(fastest=1.05, frequency_delay_s=0.0),
        until=5.0,
    ),
    "center of machines": lambda: of(
        point("two_area", "50MW", storage_model="regfm_b1", **MVA),
        control=st.BangBang(),
        criterion=st.Criterion(coi="machines"),
    ),
    "wnaps_paper": lambda: of(
        point("wnaps_paper", "5%mva", lag=0.05, characteristic="conductance"), FAULT["wnaps_paper"], st.BangBang()
    ),
    "every 50 ms": lambda: of(point("two_area"), every=0.05),
    "no record": lambda: of(point("two_area"), record=False),
    "unlocked": lambda: of(
        point("two_area", "50MW", storage_model="regc_c", converter="Te=0 wmin=-0.5", **MVA),
        "7:+900MW@0.1s",
        until=5.0,
        criterion=st.Criterion(frequency_delay_s=0.0),
    ),
    "regc_b": lambda: two_area("50MW", st.BangBang(), storage_model="regc_b", energy=0.05, **MVA),
    "motors": lambda: of(motors(), st.Contingency("7", clear="5cyc", trip="7-8")),
    "estimated": lambda: two_area("50MW", st.EstimatorControl(st.BangBang(0.1), "kalman", seed=3)),
    "schedule": lambda: two_area("50MW", schedule()),
    "resized": lambda: of(point("two_area", "50MW").resized([10.0, 80.0, 0.0, 30.0]), control=st.BangBang()),
    "own device": lambda: of(wide_area()),
    "shorter step": lambda: of(point("two_area", "50MW"), control=st.BangBang(), step="4ms", until="3s"),
}
TIMED = tuple(RUNS)[:11]
