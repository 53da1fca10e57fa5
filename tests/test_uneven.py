"""Every number that is shown of a system without symmetry (`uneven`), computed a second time from its tables."""

import json
import re

import numpy as np
import pytest
from packed import unpacked
from scipy.linalg import eig
from uneven import BASE, HZ, uneven, uneven_point

import stabctl as st
from stabctl.controllers import BangBang
from stabctl.design.law_measurement import duty
from stabctl.dynamics import outputs, signals
from stabctl.dynamics.signals import OUTPUTS
from stabctl.model import naming, powerflow
from stabctl.theory.two_machine import equivalent, reduced_network
from stabctl.view.live import answers, page
from stabctl.view.live.commands import Source
from stabctl.view.live.state import Points, State

CASE = uneven()
ROW = {b.bus: i for i, b in enumerate(CASE.buses)}
MVA = np.array([m.base for m in CASE.machines])
H = np.array([next(t[m.machine].H for t in CASE.devices.values() if m.machine in t) for m in CASE.machines])


def ends(k, Vf, Vt):
    """MVA into a branch at its from and at its to end: ideal transformer t:1, then a pi-section, shunts outside."""
    t = k.tap * np.exp(1j * np.deg2rad(k.phase))
    inner = Vf / t
    through = (inner - Vt) / (k.r + 1j * k.x)
    out = (through + 0.5j * k.b * inner) / t.conjugate()  # power is the same on both sides of the ratio
    Sf = Vf * out.conjugate() + abs(Vf) ** 2 * (k.g_from - 1j * k.b_from)
    St = Vt * (0.5j * k.b * Vt - through).conjugate() + abs(Vt) ** 2 * (k.g_to - 1j * k.b_to)
    return BASE * Sf, BASE * St


def taken(V, left_out=()):
    """MVA that branches, other than some rows, and bus shunts take from every bus."""
    S = np.array([abs(V[ROW[b.bus]]) ** 2 * (b.g - 1j * b.b) for b in CASE.buses], complex)
    for i, k in enumerate(CASE.branches):
        if i not in left_out:
            for bus, power in zip((k.from_bus, k.to_bus), ends(k, V[ROW[k.from_bus]], V[ROW[k.to_bus]]), strict=True):
                S[ROW[bus]] += power
    return S


def loads(V, V0):
    """MVA that loads and the link take from every bus at voltages V; V0 are those of the power flow."""
    S = np.zeros(len(V), complex)
    for load in CASE.loads:
        m, m0 = abs(V[ROW[load.bus]]), abs(V0[ROW[load.bus]])
        ratio = m / (load.v or m0)
        P, Q = (
            amount * (power + current * ratio + (1 - power - current) * ratio**2)
            for amount, power, current in (
                (load.p, load.p_power, load.p_current),
                (load.q, load.q_power, load.q_current),
            )
        )
        S[ROW[load.bus]] += complex(P, Q)
    (dc,) = CASE.links
    for bus, power in ((dc.from_bus, dc.p), (dc.to_bus, dc.loss - dc.p)):
        S[ROW[bus]] += power * abs(V[ROW[bus]]) / abs(V0[ROW[bus]])
    return S


@pytest.fixture(scope="module")
def flow():
    return powerflow.solve(CASE)


def test_every_branch_and_bus_of_the_power_flow(flow):
    V, made = flow.V, np.zeros(len(CASE.buses), complex)
    for m, S in zip(CASE.machines, flow.S, strict=True):
        made[ROW[m.bus]] += BASE * S
    assert made == pytest.approx(taken(V) + loads(V, V), abs=1e-7)
    found = flow.branches
    for k, (_, row) in zip(CASE.branches, found.iterrows(), strict=True):
        a, b = ends(k, V[ROW[k.from_bus]], V[ROW[k.to_bus]])
        assert row.tolist() == pytest.approx(
            [k.from_bus, k.to_bus, a.real, a.imag, b.real, b.imag, a.real + b.real], abs=1e-9
        )
    shown, drawn = flow.df, loads(V, V)
    assert shown.to_numpy() == pytest.approx(
        np.array([abs(V), np.angle(V, deg=True), made.real, made.imag, drawn.real, drawn.imag]).T, abs=1e-7
    )
    assert list(shown.index) == [b.bus for b in CASE.buses]
    assert f"{made.real.sum():.1f} MW generated" in str(flow)
    low, high = abs(V).argmin(), abs(V).argmax()
    assert f"from {abs(V[low]):.3f} pu (bus {CASE.buses[low].bus}) to {abs(V[high]):.3f} pu (bus 10)" in str(flow)


def test_machines_share_what_the_tables_leave_open(flow):
    """Active power as scheduled but at the swing bus; reactive power: its share, and the rest by MVA."""
    S = BASE * flow.S
    assert S.real[[0, 1, 3]] == pytest.approx([150.0, 61.0, 43.0], abs=1e-7)
    assert S.imag[3] == pytest.approx(9.0, abs=1e-7)
    rest = S.imag[:2] - [12.0, -7.0]
    assert abs(rest).min() > 1.0
    assert rest[0] / rest[1] == pytest.approx(310 / 190, rel=1e-9)


def test_the_tables_of_the_command(flow, stabctl, tmp_path):
    st.write(CASE, tmp_path / "uneven")
    read = json.loads(stabctl("powerflow", tmp_path / "uneven", "--json")[1])
    table = [list(row.values()) for row in read["buses"]]
    shown = flow.df.reset_index()[["bus", "v_pu", "angle_deg", "p_gen_mw", "q_gen_mvar"]]
    assert np.array(table) == pytest.approx(shown.to_numpy(), abs=1e-7)
    assert [row.pop("circuit") for row in read["branches"]] == list(flow.branches.index)
    lines = [list(row.values()) for row in read["branches"]]
    assert np.array(lines) == pytest.approx(flow.branches.drop(columns="loss_mw").to_numpy(), abs=1e-7)
    out = stabctl("powerflow", tmp_path / "uneven", "--branches")[1]
    printed = [
        [float(cell) for i, cell in enumerate(line.split("\t")) if cell and (i != 2 or "-" not in cell[1:])]
        for line in out.splitlines()
        if re.match(r"[\d-]+\S*\t", line)
    ]
    buses, branches = printed[: len(CASE.buses)], printed[len(CASE.buses) :]
    for row, wanted in zip(buses, table, strict=True):
        assert row == pytest.approx(wanted if len(row) > 3 else wanted[:3], abs=6e-3)
        assert (len(row) > 3) == any(m.bus == row[0] for m in CASE.machines)
    assert np.array(branches) == pytest.approx(flow.branches.to_numpy(), abs=6e-3)
    assert f"branch losses: {flow.branches.loss_mw.sum():.1f} MW" in out


def test_every_machine_starts_at_its_phasor_diagram():
    point = uneven_point()
    V = point.V
    for i, m in enumerate(CASE.machines):
        v, S = V[ROW[m.bus]], BASE * point.flow.S[i] / m.base
        I = (S / v).conjugate()
        signals = {name: point.s[place] for (unit, name), place in point.layout.signals.items() if unit == i}
        assert [signals[n] for n in ("P", "Q", "vt")] == pytest.approx([S.real, S.imag, abs(v)], abs=1e-9)
        angle = point.rotor_angle[i]
        assert complex(signals["iq"], -signals["id"]) == pytest.approx(I * np.exp(-1j * angle), abs=1e-9)
        classical = m.machine in CASE.devices["gencls"]
        p = CASE.devices["gencls" if classical else "genrou"][m.machine]
        E = v + complex(p.ra, p.x1d if classical else p.xq) * I
        if classical:
            assert [angle, signals["Efd"]] == pytest.approx([np.angle(E), abs(E)], abs=1e-9)
        elif not p.S12:
            assert angle == pytest.approx(np.angle(E), abs=1e-9)
            assert signals["Efd"] == pytest.approx(abs(E) + (p.xd - p.xq) * signals["id"], abs=1e-9)
        assert signals["Pm"] == pytest.approx(S.real + p.ra * abs(I) ** 2, abs=1e-9)
    assert point.inertia == pytest.approx(H * MVA / BASE)


@pytest.fixture(scope="module")
def run():
    """A fault of five cycles at a bus, orders of a law to three kinds of storage."""
    fault = st.Contingency("50", clear="5cyc", at=0.2, impedance=0.05 + 0.1j)
    return uneven_point().simulate(fault, until=2.0, step="2ms", control=BangBang(0.05))


def of_units(run, name):
    return np.array([run.rows[:, run.point.layout.signals[i, name]] for i in range(len(CASE.machines))]).T


def test_power_balances_at_every_bus_and_instant(run):
    """What machines give, less loads, link, storage and the fault, goes into the branches; charge and energy follow."""
    V0 = run.point.V
    S = MVA * (of_units(run, "P") + 1j * of_units(run, "Q"))
    assert run.electrical_power.to_numpy() == pytest.approx(S.real, abs=1e-9)
    for k in range(0, len(run.time), 7):
        V, on = run.arrays.V[k], 0.2 < run.time[k] < 0.3 - 1e-9
        given = -loads(V, V0)
        for m, power in zip(CASE.machines, S[k], strict=True):
            given[ROW[m.bus]] += power
        for device, power in zip(CASE.storage, run.storage.to_numpy()[k], strict=True):
            given[ROW[device.bus]] -= power
        if abs(run.time[k] - 0.2) < 1e-9 or abs(run.time[k] - 0.3) < 1e-9:
            continue
        if on:
            given[ROW[50]] -= BASE * abs(V[ROW[50]]) ** 2 / (0.05 - 0.1j)
        low = [ROW[d.bus] for d in (*CASE.loads, *CASE.storage) if abs(V[ROW[d.bus]]) < 0.61]
        assert np.delete(given - taken(V), low) == pytest.approx(0, abs=2e-4), run.time[k]
    assert run.voltage.to_numpy() == pytest.approx(np.abs(run.arrays.V))


def test_every_rotor_obeys_the_swing_equation_in_its_own_units(run):
    """d delta/dt = 2 pi 50 (omega - 1), 2H d omega/dt = Pm/omega - Te - D (omega - 1), without 1/omega if classical."""
    t, speed, angle = run.time, run.speed.to_numpy(), run.angle.to_numpy()
    moved = 2 * np.pi * HZ * np.trapezoid(speed - 1, t, axis=0)
    assert angle[-1] - angle[0] == pytest.approx(moved, abs=2e-5)
    Pm, Te = of_units(run, "Pm"), of_units(run, "Te")
    assert run.dataset["mechanical_power"].to_numpy() == pytest.approx(Pm)
    late = t > 0.31
    for i, m in enumerate(CASE.machines):
        classical = m.machine in CASE.devices["gencls"]
        D = CASE.devices["gencls" if classical else "genrou"][m.machine].D
        torque = Pm[:, i] / (1 if classical else speed[:, i]) - Te[:, i] - D * (speed[:, i] - 1)
        change = 2 * H[i] * (speed[late][-1, i] - speed[late][0, i])
        assert change == pytest.approx(np.trapezoid(torque[late], t[late]), abs=2e-6)
        assert np.abs(torque).max() > 0.01


def test_storage_draws_what_is_ordered_and_keeps_what_its_efficiency_leaves(run):
    power, energy, order = (run.dataset[n].to_numpy() for n in ("storage", "storage_energy", "storage_order"))
    volts = run.voltage.to_numpy()
    for j, d in enumerate(CASE.storage):
        way, m = np.sqrt(d.efficiency), volts[:, ROW[d.bus]]
        gain = np.where(power[:, j] > 0, way * power[:, j], power[:, j] / way)
        assert energy[0, j] == pytest.approx(d.energy * d.charge)
        stored = np.r_[0, np.cumsum(np.diff(run.time) * (gain[1:] + gain[:-1]) / 2)] / 3600
        assert energy[:, j] - energy[0, j] == pytest.approx(stored, abs=3e-6 * d.rating)
        exponent = {"power": 0, "current": 1, "conductance": 2}[d.characteristic]
        full = np.where(m > 0.5, d.rating * m**exponent, 0)
        assert (np.abs(power[:, j]) <= full + 1e-6)[m > 0.5].all()
        rise = np.abs(np.diff(order[:, j])) / np.diff(run.time) * d.rating
        if d.ramp:
            assert rise.max() == pytest.approx(d.ramp, rel=1e-6)
        if not d.lag:
            assert power[:, j][m > 0.5] == pytest.approx((order[:, j] * full)[m > 0.5], abs=1e-6)
        assert np.abs(power[:, j]).max() > 0.5 * d.rating


def test_tables_and_sentences_of_a_run(run):
    speed, angle = run.speed.to_numpy(), run.angle.to_numpy()
    shares = H * MVA / (H * MVA).sum()
    change = angle - angle[0]
    swing = change - (change @ shares)[:, None]
    assert np.rad2deg(np.abs(swing).max()) == pytest.approx(run.max_angle_from_coi_deg, rel=1e-3)
    assert f"Largest change of angle {run.max_angle_from_coi_deg:.1f} degrees" in str(run)
    frame, relative = run.df, run.table(angle_reference=12)
    names = [m.machine for m in CASE.machines]
    assert frame.time_s.to_numpy() == pytest.approx(run.time)
    for i, name in enumerate(names):
        assert frame[f"speed_pu:{name}"].to_numpy() == pytest.approx(speed[:, i])
        assert frame[f"angle_deg:{name}"].to_numpy() == pytest.approx(np.degrees(angle[:, i]))
        own = np.degrees(angle[:, i] - angle[:, names.index(12)])
        assert relative[f"angle_deg:{name}"].to_numpy() == pytest.approx(own)
    for b in CASE.buses:
        assert frame[f"v_pu:{b.bus}"].to_numpy() == pytest.approx(np.abs(run.arrays.V[:, ROW[b.bus]]))
    for j, d in enumerate(CASE.storage):
        assert frame[f"storage_mw:{d.machine}@{d.bus}"].to_numpy() == pytest.approx(run.storage.to_numpy()[:, j])
    wide = [min(speed.min(), 1), max(speed.max(), 1)]
    assert 0.9 < wide[0] < wide[1] < 1.1
    assert run.arrays.coi_speed == pytest.approx(speed @ shares)
    assert run.arrays.swing == pytest.approx(swing, abs=1e-12)


def test_the_duty_of_storage_is_in_hertz_and_kilowatt_hours(run):
    found, volts = duty(run), run.voltage.to_numpy()
    coi = run.speed.to_numpy() @ (H * MVA) / (H * MVA).sum()
    assert found.coi_hz == pytest.approx(HZ * np.abs(coi - coi[0]).max())
    assert found.energy_kwh == pytest.approx(1e3 * np.ptp(run.dataset["storage_energy"].to_numpy(), axis=0).sum())
    assert found.voltage == pytest.approx(volts[run.time >= 1.5].mean(axis=0).min())


def test_the_curves_and_frames_of_the_page():
    """Angles against the center of inertia in degrees, speeds in Hz, voltages at the buses of storage, every 50 ms."""
    points, state = Points(uneven(())), State("50", clear=5.0, signals=("speed", "angle", "voltage"))
    head, found = unpacked(answers.run_answer(points, state, Source("st.load('uneven')", ("uneven",))))
    run = points.bare(state).simulate(state.contingency, 10.0)
    angle = np.rad2deg(run.angle.to_numpy())
    relative = angle - (angle @ (H * MVA) / (H * MVA).sum())[:, None]
    volts = run.voltage.to_numpy()
    assert found["speed"] == pytest.approx(HZ * run.speed.to_numpy(), abs=1e-3)
    assert found["angle"] == pytest.approx(relative, abs=0.02)
    assert np.ptp(relative, axis=0).min() > 1
    assert found["voltage"] == pytest.approx(volts[:, [ROW[m.storage_bus] for m in CASE.machines]], abs=1e-4)
    frames = [int(np.argmin(np.abs(run.time - t))) for t in found["frame"]]
    assert run.time[frames] == pytest.approx(found["frame"], abs=1e-6)
    assert found["frame"][:-1] == pytest.approx(np.arange(0, 10, 0.05)[: len(frames) - 1], abs=0.011)
    assert len(frames) > 195
    assert found["frame.angle"] == pytest.approx(relative[frames], abs=0.02)
    assert found["frame.voltage"] == pytest.approx(volts[frames], abs=1e-4)
    assert (head["at"], head["cleared"], head["until"]) == (1.0, pytest.approx(1.1), 10.0)
    assert head["runs"][""]["stable"] is bool(run.outcome.stable)


def test_what_the_page_knows_of_the_case(flow):
    about = page.about(Points(uneven(())))
    for (name, a, b, transformer, mva), k in zip(about["branches"], CASE.branches, strict=True):
        sizes = np.abs(ends(k, flow.V[ROW[k.from_bus]], flow.V[ROW[k.to_bus]]))
        assert (a, b, mva) == (ROW[k.from_bus], ROW[k.to_bus], pytest.approx(sizes.max(), rel=1e-9))
        assert name.startswith(f"{k.from_bus}-{k.to_bus}")
        assert transformer
    assert about["machines"] == [
        [str(m.machine), ROW[m.bus], m.base, m.machine, ROW[m.storage_bus]] for m in CASE.machines
    ]
    assert about["buses"] == [[b.bus, b.name, b.rated] for b in CASE.buses]
    assert about["hz"] == HZ
    assert about["diagram"]["voltage"] == pytest.approx(np.abs(flow.V), abs=1e-4)
    assert about["rotors"] == [0, 1, 2, 3]


@pytest.mark.parametrize("factor", [1.0, 1.5])
def test_modes_are_eigenvectors_of_the_state_matrix(factor):
    """Frequency, damping, shares |v w| of the states, and speeds relative to the largest, in Python and on the page."""
    case = uneven(()).set({"pss.7.K": factor * 5.0, "pss.3.K": factor * 3.0})
    model = case.initialize().linearize()
    values, left, right = eig(model.A, left=True)
    shown = answers.modes_answer(uneven(()), "pss.K", factor)["modes"]
    modes = case.modes()
    assert len(shown) == (values.imag >= -1e-9).sum()
    for (real, hz, damping, swing, label, shares, shape), k in zip(
        shown, np.flatnonzero(modes.eigenvalues.imag >= 0), strict=True
    ):
        s = complex(real, 2 * np.pi * hz)
        assert s == pytest.approx(modes.eigenvalues[k], abs=1e-9)
        i = int(np.abs(values - s).argmin())
        assert values[i] == pytest.approx(s, abs=1e-6 * max(1, abs(s)))
        assert damping == pytest.approx(-real / abs(s) if s else 1.0)
        assert (swing, label) == (k in modes.swings(), modes.label(int(k)))
        if not swing:
            continue
        part = np.abs(left[:, i].conj() * right[:, i])
        wanted = dict(zip(model.states, part / part.sum(), strict=True))
        assert dict(shares) == pytest.approx({n: wanted[n] for n, _ in shares}, abs=1e-6)
        assert {n for n, _ in shares} == {n for n, v in sorted(wanted.items(), key=lambda t: -t[1])[:10] if v > 0.01}
        of_machines = ("GENROU 7", "GENROU 3", "GENCLS 12", "GENCLS 5")
        speeds = right[[model.states.index(f"speed {name}") for name in of_machines], i]
        speeds = speeds / speeds[np.abs(speeds).argmax()]
        found = np.zeros(4, complex)
        for unit, size, angle in shape:
            found[unit] = size * np.exp(1j * np.deg2rad(angle))
        assert found == pytest.approx(np.where(np.abs(speeds) > 0.02, speeds, 0), abs=1e-6)


def test_the_theory_on_the_page_is_that_of_two_machines():
    """Equal areas of the equivalent of machine 7: angles in degrees, areas closed by quadrature, speeds in Hz."""
    pair = equivalent(CASE, 7)
    Pf, Pm, Pmax = pair.Pfault, pair.Pm1, 1 / pair.X
    M = 2 * pair.H1 * pair.HCOI / (pair.H1 + pair.HCOI) / (2 * np.pi * HZ)
    shares = H * MVA / BASE
    assert (pair.H1, pair.HCOI) == (pytest.approx(shares[0]), pytest.approx(shares[1:].sum()))
    found = answers.equal_area_answer(CASE, 7, 4.0)
    start, stop = np.arcsin(Pm / Pmax), np.pi - np.arcsin(Pm / Pmax)
    T = 4.0 / HZ
    clearing = start + (Pm - Pf) / M * T**2 / 2
    assert (found["Pm"], found["Pmax"]) == (pytest.approx(Pm), pytest.approx(Pmax))
    assert np.deg2rad(found["unstable"]) == pytest.approx(stop)
    assert np.deg2rad(found["marks"][:2]) == pytest.approx([start, clearing])
    end = np.deg2rad(found["marks"][2])
    braking = Pmax * (np.cos(clearing) - np.cos(end)) - Pm * (end - clearing)
    assert braking == pytest.approx((Pm - Pf) * (clearing - start), rel=1e-9)
    angle, speed = np.deg2rad(found["curve"][0]), 2 * np.pi * np.array(found["curve"][1])
    at = found["cleared"]
    assert angle[at] == pytest.approx(clearing, abs=1e-6)
    assert speed[at] == pytest.approx((Pm - Pf) / M * T, rel=1e-6)
    energy = M / 2 * speed[at:] ** 2 - Pm * angle[at:] - Pmax * np.cos(angle[at:])
    assert np.ptp(energy) < 1e-6 * abs(energy[0])
    edge, rate = np.deg2rad(found["separatrix"][0]), 2 * np.pi * np.array(found["separatrix"][1])
    on_edge = M / 2 * rate**2 - Pm * edge - Pmax * np.cos(edge)
    assert on_edge == pytest.approx(-Pm * stop - Pmax * np.cos(stop), abs=1e-9)
    delta = start + (Pm - Pf) / M * (found["critical"] / HZ) ** 2 / 2
    braking = Pmax * (np.cos(delta) - np.cos(stop)) - Pm * (stop - delta)
    assert braking == pytest.approx((Pm - Pf) * (delta - start), rel=1e-9)
    assert found["stable"] is (found["critical"] > 4)
    held, share = pair.critical(0.2), pair.HCOI / (pair.H1 + pair.HCOI)
    braking = Pmax * (np.cos(held.angle) - np.cos(stop)) + (0.2 * share - Pm) * (stop - held.angle)
    assert braking == pytest.approx((Pm - Pf) * (held.angle - start), rel=1e-9)


def test_every_signal_that_can_be_read(flow):
    """Flows and currents into each circuit from the bus named first; speeds and angles against others, by inertia."""
    point = uneven_point()
    s = point.s + 1e-2 * np.sin(np.arange(len(point.s)))  # nothing is at rest

    def read(text):
        (signal,) = signals.chosen(CASE, [text], OUTPUTS)
        return outputs.value(point, signal)(s)

    V = s[point.layout.voltages].view(complex)
    speed, angle, inertia = s[point.rotors.speed], s[point.rotors.angle], H * MVA
    names = naming.keys(CASE, "branches")
    for name, k in zip(names, CASE.branches, strict=True):
        both = ends(k, V[ROW[k.from_bus]], V[ROW[k.to_bus]])
        turned = re.sub(r"(\d+)-(\d+)", r"\2-\1", name)
        for text, S, bus in ((name, both[0], k.from_bus), (turned, both[1], k.to_bus)):
            wanted = S.real, S.imag, abs(S) / abs(V[ROW[bus]])
            found = [BASE * read(f"{kind}:{text}") for kind in ("flow", "flow_q", "current")]
            assert found == pytest.approx(wanted, rel=1e-9), text
    for b in CASE.buses:
        assert read(f"voltage:{b.bus}") == pytest.approx(abs(V[ROW[b.bus]]))
        relative = np.angle(V[ROW[b.bus]] * np.exp(-1j * (inertia @ angle / inertia.sum())))
        assert read(f"bus_angle:{b.bus}") == pytest.approx(relative)
    for i, m in enumerate(CASE.machines):
        rest = np.arange(4) != i
        others = inertia[rest] @ speed[rest] / inertia[rest].sum()
        assert read(f"speed:{m.machine}") == pytest.approx(speed[i])
        assert read(f"deviation:{m.machine}") == pytest.approx(speed[i] - others)
        assert read(f"angle:{m.machine}") == pytest.approx(angle[i] - inertia @ angle / inertia.sum())
    assert read("coi_speed") == pytest.approx(inertia @ speed / inertia.sum())
    pair = [1, 2]
    group = inertia[pair] @ speed[pair] / inertia[pair].sum()
    assert read("deviation:3+12") == pytest.approx(group - inertia[[0, 3]] @ speed[[0, 3]] / inertia[[0, 3]].sum())


def along(k, fraction):
    """A branch as two, with a bus 99 at a fraction of its length; ratio and outer shunts stay at their ends."""
    first = k._replace(to_bus=99, r=k.r * fraction, x=k.x * fraction, b=k.b * fraction, g_to=0.0, b_to=0.0)
    left = 1 - fraction
    last = k._replace(
        from_bus=99, r=k.r * left, x=k.x * left, b=k.b * left, tap=1.0, phase=0.0, g_from=0.0, b_from=0.0, circuit="9"
    )
    return first, last


EVENTS = {
    "a load": (st.LoadStep(50, 0.2, p=30.0, q=-17.0), {}),
    "a load where there is none": (st.LoadStep(20, 0.2, p=30.0, q=-17.0), {}),
    "a shunt": (st.SwitchShunt(30, 0.2, g=11.0, b=-44.0), {"shunt": (30, 11.0 - 44.0j)}),
    "one end": (st.Open("30-40#2", 0.2, end=40), {"open": (5, "to")}),
    "the other end": (st.Open("30-10#2", 0.2, end=30), {"open": (1, "from")}),
    "a circuit": (st.Open("20-30 ckt 1", 0.2), {"open": (3, "both")}),
    "a fault along a line": (st.Fault("40-30 ckt 1@0.3", 0.2, 0.1 + 0.3j), {"fault": (4, 0.3)}),
    "a fault from the other end": (st.Fault("30-20@0.2", 0.2, 0.1 + 0.3j), {"fault": (2, 0.8)}),
    "a fault at the tapped end": (st.Fault("10-30@0", 0.2, 0.1 + 0.3j), {"at": 10}),
}


@pytest.mark.parametrize("name", EVENTS)
def test_the_network_just_after_an_event(name):
    """What machines and storage give goes into the network as it then is, written down from the tables."""
    event, what = EVENTS[name]
    run = uneven_point().simulate(event, until=0.4, step="2ms")
    k = int(np.searchsorted(run.time, 0.2 + 1e-9)) + 3
    V = dict(zip(ROW, run.arrays.V[k], strict=True))
    given = np.array([of_units(run, "P")[k, i] + 1j * of_units(run, "Q")[k, i] for i in range(4)]) * MVA
    S = -loads(run.arrays.V[k], run.point.V)
    for m, power in zip(CASE.machines, given, strict=True):
        S[ROW[m.bus]] += power
    if isinstance(event, st.LoadStep):
        V0 = abs(run.point.V[ROW[event.bus]])
        ratio, load = abs(V[event.bus]) / V0, next((row for row in CASE.loads if row.bus == event.bus), None)
        parts = ((load.p_power, load.p_current), (load.q_power, load.q_current)) if load else ((0, 0), (0, 0))
        more = (x * (a + b * ratio + (1 - a - b) * ratio**2) for x, (a, b) in zip((30.0, -17.0), parts, strict=True))
        S[ROW[event.bus]] -= complex(*more)
    if "shunt" in what:
        bus, power = what["shunt"]
        S[ROW[bus]] -= abs(V[bus]) ** 2 * power.conjugate()
    if "at" in what:
        S[ROW[what["at"]]] -= BASE * abs(V[what["at"]]) ** 2 / (0.1 - 0.3j)
    gone = what.get("open", what.get("fault", (None, None)))[0]
    if "open" in what and what["open"][1] != "both":
        b, end = CASE.branches[gone], what["open"][1]
        bus = b.from_bus if end == "to" else b.to_bus
        V_end = open_end(b, V[bus], end)
        S[ROW[bus]] -= ends(b, V[bus], V_end)[0] if end == "to" else ends(b, V_end, V[bus])[1]
    if "fault" in what:
        b, fraction = CASE.branches[gone], what["fault"][1]
        first, last = along(b, fraction)
        V["x"] = middle(first, last, V[b.from_bus], V[b.to_bus], 1 / (0.1 + 0.3j))
        S[ROW[b.from_bus]] -= ends(first, V[b.from_bus], V["x"])[0]
        S[ROW[b.to_bus]] -= ends(last, V["x"], V[b.to_bus])[1]
    left_out = () if gone is None else (gone,)
    assert S == pytest.approx(taken(run.arrays.V[k], left_out), abs=2e-4)


def currents_into(k, Vf, Vt):
    """Currents (pu) into a branch at its ends, linear in the voltages."""
    Sf, St = ends(k, Vf, Vt)
    return (Sf / BASE / Vf).conjugate(), (St / BASE / Vt).conjugate()


def open_end(k, V, end):
    """The voltage of an open end, where no current flows."""
    if end == "to":
        a, b = (currents_into(k, V, x)[1] for x in (1.0, 2.0))
    else:
        a, b = (currents_into(k, x, V)[0] for x in (1.0, 2.0))
    return 1.0 - a / (b - a)


def middle(first, last, Vf, Vt, y):
    """The voltage of the faulted point, where what comes from both sides goes through the fault."""

    def left(x):
        return currents_into(first, Vf, x)[1] + currents_into(last, x, Vt)[0] + y * x

    a, b = left(1.0), left(2.0)
    return 1.0 - a / (b - a)


def test_short_circuit_power_and_ratios():
    """Z = inv(Y) of branches, shunts and machines behind their subtransient (classical: transient) impedance."""
    Y = np.diag([(b.g + 1j * b.b) / BASE for b in CASE.buses])
    for k in CASE.branches:
        at = [ROW[k.from_bus], ROW[k.to_bus]]
        with_one, with_two = (np.array(currents_into(k, Vf, 1.0)) for Vf in (1.0, 2.0))
        by_from = with_two - with_one
        Y[np.ix_(at, at)] += np.array([by_from, with_one - by_from]).T
    for m in CASE.machines:
        p = next(t[m.machine] for n, t in CASE.devices.items() if n in ("gencls", "genrou") and m.machine in t)
        x = getattr(p, "x2", None) or p.x1d
        Y[ROW[m.bus], ROW[m.bus]] += m.base / BASE / complex(p.ra, x)
    Z = np.linalg.inv(Y)
    assert np.abs(Z - Z.T).max() > 1e-3  # phase shifters
    found, ratio = CASE.short_circuit(), CASE.short_circuit_ratio()
    assert found.impedance == pytest.approx(np.diag(Z), abs=1e-9)
    assert found.mva == pytest.approx(BASE / np.abs(np.diag(Z)))
    assert found.df.x_over_r.to_numpy() == pytest.approx(np.diag(Z).imag / np.diag(Z).real)
    at, P = [ROW[d.bus] for d in CASE.storage], np.array([d.mva or d.rating for d in CASE.storage])
    S = BASE / np.abs(np.diag(Z))[at]
    factor = np.abs(Z[np.ix_(at, at)] / np.diag(Z)[at])
    assert ratio.ratio == pytest.approx(S / P)
    assert ratio.equivalent == pytest.approx(S / (factor @ P))
    assert ratio.weighted == pytest.approx(S @ P / P.sum() ** 2)
    assert ratio.buses == tuple(d.bus for d in CASE.storage)


def test_the_relative_motion_weighs_powers_by_the_other_inertia():
    """Of machine 7 against the rest: Pe = (H_rest P1 - H1 sum P_rest)/H, turned against each other by every angle."""
    pair, (Y, E, inertia) = equivalent(CASE, 7), reduced_network(CASE)
    assert inertia == pytest.approx(H * MVA / BASE)
    turned = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    powers = []
    for angle in turned:
        source = E * np.exp(1j * np.array([angle, 0.0, 0.0, 0.0]))
        P = (source * (Y @ source).conj()).real
        powers.append((inertia[1:].sum() * P[0] - inertia[0] * P[1:].sum()) / inertia.sum())
    wave = np.fft.rfft(powers) / len(turned)
    assert 2 * abs(wave[1]) == pytest.approx(1 / pair.X)
    assert powers[0] - wave[0].real == pytest.approx(pair.Pm1)


def test_another_load_level_changes_loads_and_dispatch_alone():
    less = CASE.with_load_level(0.8)
    for now, before in zip(less.loads, CASE.loads, strict=True):
        assert now == before._replace(p=0.8 * before.p, q=0.8 * before.q)
    for now, before in zip(less.machines, CASE.machines, strict=True):
        assert now == before._replace(p=0.8 * before.p)
    assert (less.links, less.buses, less.branches, less.storage) == (
        CASE.links, CASE.buses, CASE.branches, CASE.storage,
    )  # fmt: skip
