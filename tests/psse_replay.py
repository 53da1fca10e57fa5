"""Events of PSS/E and their trajectories (tests/reference/import) beside runs of the same files."""

import csv
import gzip
import io
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from records import csvgn1, dera1, gencls

from stabctl.dynamics import operating_point
from stabctl.io import psse
from stabctl.io.psse import dyr
from stabctl.io.psse.dyr import kinds
from stabctl.model.tables import Machine
from stabctl.simulation import simulation
from stabctl.simulation.criterion import Criterion
from stabctl.simulation.events import LoadStep, Open

DATA = Path(__file__).parent / "reference" / "import"
TENTH = 1e-4  # s   step of the trace of CSVGN1
KEEP_ON = Criterion(max_angle=np.inf, low_voltage_s=0.0, frequency_delay_s=0.0)
LIMITS = {"angle": 0.05, "speed": 2e-5, "v": 2e-4, "efd": 2e-3, "pm": 1e-3, "bus_angle": 0.05, "p": 1e-3, "q": 1e-3}


class Replay(NamedTuple):
    """A row of cases.csv."""

    name: str
    raw: Path
    dyr: Path
    loads: str
    event: str
    at: float
    until: float
    trace: Path
    signals: tuple[str, ...]  # of the columns after the time; empty: not compared

    def missing(self) -> list[str]:
        """Kinds of its records that have no model."""
        return sorted({r.kind for r in dyr.read(self.dyr)} - set(kinds()))


@cache
def replays() -> dict[str, Replay]:
    """The rows of cases.csv by name."""
    found = {}
    with open(DATA / "cases.csv", newline="") as file:
        for r in csv.DictReader(file):
            paths = (DATA / r["raw"], DATA / r["dyr"], r["loads"], r["event"].strip())
            times = (float(r["t_event_s"]), float(r["duration_s"]), DATA / (r["trace"] + ".gz"))
            signals = tuple(text.strip() for text in r["signals"].split("|"))
            found[r["name"]] = Replay(r["name"], *paths, *times, signals)
    return found


def recorded(replay):
    """Times and columns of a trace, without the rows at the event itself."""
    rows = []
    with gzip.open(replay.trace, "rt") as file:
        for line in io.StringIO(file.read()):
            try:
                rows.append([float(x) for x in line.split(",") if x.strip()])
            except ValueError:
                continue  # a header
    data = np.array(rows)
    step = TENTH if replay.name == "CSVGN1" else 0.005
    t = np.round(data[:, 0], 4 if step == TENTH else 3) if "DEGOV" not in replay.name else data[:, 0]
    away = (np.abs(t - replay.at) > 1.2 * step) & (t <= replay.until)
    return t[away], data[away, 1:]


def with_unit(case, name):
    """The case with the device that the DYR file of a row lacks."""
    if name.startswith("DERA"):
        par = dera1.Par(mva=0, V0=0, bus=0, FreqFlag=int(name[-1]), Kqv=5.0, Imax=1.2)
        return replace(
            case,
            devices={"gencls": {101: gencls.Par(mva=0, wb=0, H=0.0, D=0.0, ra=0.0, x1d=1e-5)}, "dera1": {102: par}},
        )
    if name != "CSVGN1":
        return case
    par = csvgn1.Par(mva=0, base=0, ymin=0, K=20.0, T1=0.0, T2=1.0, T3=0.154833, T4=1.0, T5=0.005167, Cbase=60.0)
    buses = tuple(b._replace(kind="pv") if b.bus == 3 else b for b in case.buses)
    unit = Machine(3, 3, 500.0, 0.0, 3)
    return replace(case, buses=buses, machines=(*case.machines, unit), devices={**case.devices, "csvgn1": {3: par}})


def simulated(replay, step=0.005, **changes):
    """Our run of the same event."""
    files = (replay.raw,) if replay.name.startswith("DERA") else (replay.raw, replay.dyr)
    case = with_unit(psse.read_psse(*files, **changes), replay.name)
    if replay.loads == "current and admittance":  # of the active and of the reactive power
        loads = tuple(load._replace(p_power=0.0, q_power=0.0, p_current=1.0, v=0.0) for load in case.loads)
        case = replace(case, loads=loads)
    else:
        case = case.with_loads(replay.loads)
    point = operating_point.solve(case)
    event, at = replay.event, replay.at
    if event.startswith("trip line"):
        events = [Open(event.split()[2], at)]
    elif event.startswith("double circuit"):
        events = [Open("101-102 ckt 2", at)]
    elif event.startswith("load at bus 2"):
        events, step = [LoadStep(2, at, p=-55.0)], TENTH
    elif event.startswith("set SEXS Vref"):
        point = operating_point.solve(replace(case, frequency_hz=60.0))  # the angle of the trace turns at 60 Hz
        point.s[point.layout.setpoint(0, "Vref")] = 1.0472  # from the start on: the trace is compared from then
        return simulation.run(point, [], replay.until - at, step=step, criterion=KEEP_ON), at
    return simulation.run(point, events, replay.until, step=step, criterion=KEEP_ON), 0.0


def signal(run, text):
    """A signal of a run, in the unit of the traces."""
    name, _, place = text.partition(" ")
    case, a = run.point.case, run.arrays
    buses = {str(b.bus): i for i, b in enumerate(case.buses)}
    units = {case.machines[i].name: k for k, i in enumerate(run.point.rotors.unit)}
    machines = {m.name: i for i, m in enumerate(case.machines)}
    if name == "v":
        return np.abs(a.V[:, buses[place]])
    if name == "bus_angle":
        first, _, second = place.partition("-")
        V = a.V[:, buses[first]] * (a.V[:, buses[second]].conj() if second else 1)
        return np.rad2deg(np.unwrap(np.angle(V)))
    if name in ("p", "q"):
        layout = run.point.layout
        return (
            run.rows[:, layout.signals[machines[place], name.upper()]]
            * case.machines[machines[place]].base
            / case.base_mva
        )
    of = {"angle": lambda k: np.rad2deg(a.angle[:, k]), "speed": lambda k: a.speed[:, k], "efd": lambda k: a.Efd[:, k]}
    of |= {"speed_deviation": lambda k: a.speed[:, k] - 1, "pm": lambda k: a.Pm[:, k]}
    return of[name](units[place])


def differences(name, **options):
    """Signal -> largest difference from the trace over its whole length."""
    replay = replays()[name]
    run, start = simulated(replay, **options)
    assert run.outcome.stable, run.outcome.message
    t, data = recorded(replay)
    kept, found = t >= start, {}
    for column, text in zip(data.T, replay.signals, strict=False):
        if text:
            ours = np.interp(t[kept] - start, run.time, signal(run, text))
            found[text] = float(np.abs(ours - column[kept]).max())
    return found


def limit(text):
    """Largest difference that is allowed of a signal."""
    return LIMITS[text.split()[0].removesuffix("_deviation")]


if __name__ == "__main__":  # python tests/psse_replay.py GENROU ...: differences beside their limits
    import sys

    for name in sys.argv[1:] or replays():
        if replays()[name].missing():
            print(name, "has records without a model:", *replays()[name].missing())
            continue
        print(name, *(f"| {text}: {value:.2e} of {limit(text):.0e}" for text, value in differences(name).items()))
