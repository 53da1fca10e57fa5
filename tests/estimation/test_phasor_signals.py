"""Signals of PMUs at buses, lines and terminals: what they mean, when it is known, and what a lost report leaves."""

import numpy as np
import pytest
from uneven import BASE, HZ, uneven_point

import stabctl as st
from stabctl.dynamics.signals import OUTPUTS, chosen
from stabctl.estimation._signals import STREAM, PhasorSignals
from stabctl.estimation.pmu import Frame, Instrument, Pmu
from stabctl.simulation.setup import setup
from stabctl.simulation.simulation import Simulation

READ = {  # whether the controller belongs to the place
    "voltage:30": False, "voltage:40": True, "bus_angle:50": False, "bus_angle:10": True, "bus_frequency:30": False,
    "bus_frequency:20": True, "flow:20-30#2": False, "flow_q:30-40#2": True, "flow:40-30#2": False, "flow:10-30": True,
    "flow_q:30-10#2": False, "pe:3": True, "pe:7": False, "qe:12": True, "qe:5": False, "vt:5": True, "vt:7": False,
}  # fmt: skip
EVENTS = {
    "nothing": ([], None),
    "an open end": ([st.Open("30-40#2", 0.1, end=40)], None),
    "a fault": ([st.Fault("20-30#2@0.4", 0.1, 0.1 + 0.3j)], "20-30#2"),
}
MACHINES, LATE = [7, 3, 12, 5], 3


def parsed(label):
    kind, _, place = label.partition(":")
    return kind, place


def circuits(case):
    """Circuit as in a label, in both directions -> branch row and whether the from end is named first."""
    found = {}
    for i, k in enumerate(case.branches):
        same = [j for j in range(i) if {case.branches[j].from_bus, case.branches[j].to_bus} == {k.from_bus, k.to_bus}]
        more = f"#{len(same) + 1}" if same else ""
        found[f"{k.from_bus}-{k.to_bus}{more}"] = i, True
        found[f"{k.to_bus}-{k.from_bus}{more}"] = i, False
    return found


def into(k, near, far, from_end, state):
    """Current into a branch from one of its ends: transformer, pi-section, outer shunts; a fault, or an open end."""
    t, z, half = k.tap * np.exp(1j * np.deg2rad(k.phase)), complex(k.r, k.x), 0.5j * k.b
    Y = np.array([[1 / z + half, -1 / z], [-1 / z, 1 / z + half]])
    if state == "fault":  # at 0.4 of its length, of the impedance 0.1 + 0.3j; capacitance in both parts
        a = 0.4
        parts = [(a, 0, 2), (1 - a, 2, 1)]
        Y = np.zeros((3, 3), complex)
        for share, m, n in parts:
            y, c = 1 / (share * z), share * half
            Y[[m, m, n, n], [m, n, m, n]] += y + c, -y, -y, y + c
        Y[2, 2] += 1 / (0.1 + 0.3j)
        Y = Y[:2, :2] - Y[:2, 2:] @ Y[2:, :2] / Y[2, 2]
    of_from, of_to = complex(k.g_from, k.b_from), complex(k.g_to, k.b_to)
    if state == "open at to":
        seen = Y[0, 0] - Y[0, 1] * Y[1, 0] / Y[1, 1]
        Y = np.array([[seen, 0], [0, 0]])
        of_to = 0
    T = np.diag([1 / t, 1])
    Y = T.conj() @ Y @ T + np.diag([of_from, of_to])
    v = np.array([near, far] if from_end else [far, near])
    return (Y @ v)[0 if from_end else 1]


@pytest.mark.parametrize("name", EVENTS)
def test_every_signal_is_that_of_its_report(name):
    """Exact PMUs; voltages, angles and losses are drawn. Own signals are new, others come three frames late."""
    events, faulted = EVENTS[name]
    point, rng, pmu = uneven_point(), np.random.default_rng(3), Pmu.exact(latency="60ms", rate=50)
    case, rows = point.case, {b.bus: i for i, b in enumerate(point.case.buses)}
    simulations = [Simulation(setup(point)), Simulation(setup(point), events)]
    for s in simulations:
        s.advance(0.15)
    signals = list(zip(chosen(case, list(READ), OUTPUTS), READ.values(), strict=True))
    read = PhasorSignals(simulations, signals, pmu, (1, 2))
    inertia, told, phase = np.array([[3.0, 1.0, 7.0, 2.0]]), [], None
    last_machines = None
    for n in range(8):
        V = np.exp(rng.normal(0, 0.1, (2, 5)) + 1j * rng.normal(0, 0.4, (2, 5)))
        angle, none = rng.normal(0, 0.5, (2, 4)), np.zeros((2, 4))
        v, i = (rng.normal(size=(2, 4)) + 1j * rng.normal(size=(2, 4)) for _ in range(2))
        here = rng.random((2, 4)) < (1.0 if n == 0 else 0.6)
        read.frame(n / 50, V, Frame(v, i, none, none, here, none), angle, inertia)
        last_machines = [np.where(here, a, b) for a, b in zip((v, i), last_machines or (v, i), strict=True)]
        before, phase = (np.angle(V) if phase is None else phase), np.angle(V)
        frequency = np.angle(np.exp(1j * (phase - before))) * 50 / (2 * np.pi * HZ)
        coi = angle @ inertia[0] / inertia.sum()
        told.append((V, *last_machines, frequency, coi))
        for k, s in enumerate(simulations):
            values = read(k)
            assert len(s.switching.branches) == (k == 1 and bool(events))
            for j, (label, own) in enumerate(READ.items()):
                V, v, i, frequency, coi = (part[k] for part in told[n if own else max(n - LATE, 0)])
                kind, place = parsed(label)
                if kind in ("pe", "qe", "vt"):
                    row = MACHINES.index(int(place))
                    S = v[row] * i[row].conjugate() * BASE / case.machines[row].base
                    wanted = {"pe": S.real, "qe": S.imag, "vt": abs(v[row])}[kind]
                elif kind in ("flow", "flow_q"):
                    at, from_end = circuits(case)[place]
                    branch = case.branches[at]
                    state = "open at to" if name == "an open end" and k and at == 5 else ""
                    if faulted and k and at == circuits(case)[faulted][0]:
                        state = "fault"
                    both = V[rows[branch.from_bus]], V[rows[branch.to_bus]]
                    near, far = both if from_end else both[::-1]
                    S = near * into(branch, near, far, from_end, state).conjugate()
                    wanted = S.real if kind == "flow" else S.imag
                else:
                    bus = rows[int(place)]
                    wanted = {
                        "voltage": abs(V[bus]), "bus_frequency": 1 + frequency[bus],
                        "bus_angle": np.angle(V[bus] * np.exp(-1j * coi)),
                    }[kind]  # fmt: skip
                assert values[j] == pytest.approx(wanted, rel=1e-9, abs=1e-11), (label, k, n)


def test_a_lost_report_leaves_the_last_one_and_its_angle_of_the_coi():
    """The losses are those of the seed, of its third stream."""
    point, pmu = uneven_point(), Pmu.exact(loss=0.4)
    read = {"voltage:30": True, "bus_angle:10": True, "voltage:50": True}
    signals = list(zip(chosen(point.case, list(read), OUTPUTS), read.values(), strict=True))
    seen = PhasorSignals([Simulation(setup(point))], signals, pmu, (5,))
    meter = Instrument(pmu, [[5, STREAM]], len(read), HZ)
    rng, held, lost = np.random.default_rng(1), None, 0
    for n in range(30):
        V = np.exp(rng.normal(0, 0.1, (1, 5)) + 1j * rng.normal(0, 0.4, (1, 5)))
        angle, none = rng.normal(0, 0.5, (1, 4)), np.zeros((1, 4))
        seen.frame(n / 60, V, Frame(none, none, none, none, none == 0, none), angle, np.ones((1, 4)))
        here = meter.report(n / 60, V[:, :3], V[:, :3], none[:, :3]).received[0]
        now = np.array([abs(V[0, 3]), np.angle(V[0, 1] * np.exp(-1j * angle.mean())), abs(V[0, 4])])
        held = now if held is None else np.where(here, now, held)
        assert seen(0) == pytest.approx(held, abs=1e-12)
        lost += (~here).sum()
    assert lost > 20
