"""Critical clearing times of ANDES and TOPS: the rows of `stabctl/verification/published.csv` that are theirs.

python benchmarks/clearing_peers.py SYSTEM ...    # of systems.toml; prints the rows again

The case is written for the other program number by number; that program solves the power flow, initializes and
integrates. Synchronism is lost when a rotor moves by more than 3.5 rad from the center of inertia, as here. A time is
the longest on a grid of 1 ms after which this does not happen for some seconds; after one 1 ms longer it does. Machines
are classical. Faults have 1e-5j pu, as neither has bolted ones. TOPS has no switches: the admittance of a line is taken
from its network matrix. A time takes ANDES or TOPS half a minute.
"""

import sys
import tempfile
from collections.abc import Callable, Iterator

import andes
import numpy as np
import peer_andes
import peer_tops
import scipy.sparse as sp

from stabctl.model import location, powerflow
from stabctl.model.case import Case
from stabctl.verification.compare import published
from stabctl.verification.systems import folder_of, systems

GRID, FAR, ON, FAULT = 1e-3, 3.5, 0.1, 1e-5j  # s, rad, s, pu
ANDES_STEP, ANDES_LONGEST = 1 / 120, 5.0  # s, s after clearing
TOPS_STEP, TOPS_LONGEST = 1 / 240, 10.0


def last_stable(stable: Callable[[float], bool], guess: float) -> float:
    """The last stable point of the grid (s), the next one being unstable."""
    low, high, stride = 0, 0, 1
    k = max(1, round(guess / GRID))
    while not high or high - low > 1:
        if stable(k * GRID):
            low = k
            k = (low + high) // 2 if high else low + stride
        else:
            high = k
            k = (low + high) // 2 if low else max(high - stride, high // 2)
        stride *= 2
    return low * GRID


def apart(angle: np.ndarray, weight: np.ndarray) -> float:
    """Farthest that a rotor (time, rotors) moves from the center of inertia, rad."""
    from_center = angle - (angle @ weight / weight.sum())[:, None]
    return float(np.abs(from_center - from_center[0]).max())


def weights(case: Case) -> np.ndarray:
    """Inertia constant times rating (machines)."""
    return np.array([case.devices["gencls"][m.machine].H * m.base for m in case.machines])


def voltages(case: Case, opened: int | None) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]:
    """Voltages, and currents of the machines, each a voltage behind a reactance, with a branch open.

    By how far the rotors moved (rad).
    """
    flow, place = powerflow.solve(case), {b.bus: i for i, b in enumerate(case.buses)}
    Y = np.diag([complex(b.g, b.b) / case.base_mva for b in case.buses])
    for branch in (branch for i, branch in enumerate(case.branches) if i != opened):
        ends, series, tap = [place[branch.from_bus], place[branch.to_bus]], 1 / complex(branch.r, branch.x), branch.tap
        own = series + 0.5j * branch.b
        Y[np.ix_(ends, ends)] += [[own / tap**2, -series / tap], [-series / tap, own]]
    for k in case.loads:
        Y[place[k.bus], place[k.bus]] += complex(k.p, -k.q) / case.base_mva / abs(flow.V[place[k.bus]]) ** 2
    at = [place[m.bus] for m in case.machines]
    rows = case.devices["gencls"]
    y = np.array([m.base / case.base_mva / (1j * rows[m.machine].x1d) for m in case.machines])
    E = flow.V[at] + np.conj(flow.S / flow.V[at]) / y
    np.add.at(Y, (at, at), y)
    incidence = np.eye(len(Y))[:, at]

    def solved(moved: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        inner = E * np.exp(1j * moved)
        V = np.linalg.solve(Y, incidence @ (y * inner))
        return V, y * (inner - V[at])

    return solved


def in_andes(case: Case, at: int, line: int | None, folder: str) -> Callable[[float], bool]:
    """Whether the case stays in synchronism in ANDES, by the duration of the fault (s).

    Balances of power also hold with a voltage of zero, which Newton's method finds if it begins, after clearing, with
    the voltages before or during the fault. So it begins with the solution of the linear network; its equations stay.
    """
    near, places = voltages(case, line), [[b.bus for b in case.buses].index(m.bus) for m in case.machines]

    def stable(duration: float) -> bool:
        ss = peer_andes.network(case, folder)
        for m in case.machines:
            peer_andes.machine(ss, case, m.machine)
        ss.add("Fault", {"bus": at, "tf": ON, "tc": ON + duration, "xf": FAULT.imag, "rf": 0.0})
        if line is not None:
            ss.add("Toggle", {"model": "Line", "dev": f"L{line}", "t": ON + duration})
        ss.setup()
        for name, value in {"tstep": ANDES_STEP, "fixt": 1, "shrinkt": 0, "criteria": 0, "no_tqdm": 1}.items():
            setattr(ss.TDS.config, name, value)
        ss.Fault.config.restore = 0
        ss.PFlow.run()
        machines = ss.GENCLS
        begun: list[float] = []

        def begin(t: float, ss: andes.System) -> None:
            if t > ON + duration + 1e-9 and not begun:
                begun.append(t)
                delta, y = ss.dae.x[machines.delta.a], ss.dae.y
                V, current = near(delta - ss.dae.ts.x[0, machines.delta.a])
                y[ss.Bus.v.a], y[ss.Bus.a.a] = np.abs(V), np.angle(V)
                v, i = (1j * z * np.exp(-1j * delta) for z in (V[places], current))
                y[machines.vd.a], y[machines.vq.a], y[machines.Id.a], y[machines.Iq.a] = v.real, v.imag, i.real, i.imag
                y[machines.psid.a], y[machines.psiq.a] = v.imag, -v.real
                ss.vars_to_models()

        ss.TDS.callpert = begin
        for until in np.arange(1, ANDES_LONGEST + 1):
            ss.TDS.config.tf = ON + duration + until
            done = ss.TDS.run()
            if apart(ss.dae.ts.x[:, machines.delta.a], weights(case)) > FAR:
                return False
            if not done:
                raise RuntimeError(f"ANDES fails at {at} with {duration} s")
        return True

    return stable


def in_tops(case: Case, at: int, line: int | None, folder: str) -> Callable[[float], bool]:
    """The same in TOPS; `folder` is not used."""

    def stable(duration: float) -> bool:
        ps = peer_tops.system(case, governed=False)
        ps.init_dyn_sim()
        place = {name: i for i, name in enumerate(ps.buses["name"])}
        fault, opened = np.zeros((2, len(place), len(place)), complex)
        fault[place[f"B{at}"], place[f"B{at}"]] = 1 / FAULT
        if line is not None:
            k = case.branches[line]
            ends = [place[f"B{k.from_bus}"], place[f"B{k.to_bus}"]]
            y = 1 / complex(k.r, k.x)
            opened[np.ix_(ends, ends)] = -np.array([[y + 0.5j * k.b, -y], [-y, y + 0.5j * k.b]])
        angles, x, t = ps.gen["GEN"].state_idx_global["angle"], ps.x0.copy(), 0.0
        rows = [x[angles]]
        for until, change in ((duration, fault), (duration + TOPS_LONGEST, opened)):
            ps.y_bus_red_mod = sp.csr_matrix(change)
            steps = max(1, round((until - t) / TOPS_STEP))
            solver = peer_tops.SimpleRK4(ps.ode_fun, t, x, np.inf, max_step=(until - t) / steps)
            for n in range(steps):
                solver.step()
                rows.append(solver.x[angles].copy())
                if n % 60 == 59 and apart(np.array(rows), weights(case)) > FAR:
                    return False
            x, t = solver.x, until
        return apart(np.array(rows), weights(case)) <= FAR

    return stable


def rows(name: str, folder: str) -> Iterator[str]:
    """The rows of a system, found anew."""
    case = systems()[name].read(folder_of(None))
    program = in_tops if name.endswith("_tops") else in_andes
    for row in published():
        if row.system == name:
            bus, _, trip = row.object.partition(" trip ")
            line = location.circuit(case, location.read(case, trip))[0] if trip else None
            found = last_stable(program(case, int(bus), line, folder), row.value)
            yield f"{name},clearing time,{row.object},{found:.3f},,,"


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as generated:
        for system in sys.argv[1:]:
            for line in rows(system, generated):
                print(line, flush=True)
