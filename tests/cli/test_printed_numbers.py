"""Every number that a command prints, of a case in which no two are alike: that of Python, or of a law."""

import csv
import json
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from stabctl.cli.design_tune import SHOWN, _show
from stabctl.controllers import BangBang
from stabctl.io import load, write
from stabctl.simulation.contingency import Contingency

FAULT = "--fault", "7-8@0.3", "--clear", "70ms", "--at", "0.4"
TOLD = "stabctl: 3 unusual values: stabctl check {}\n"  # bases are not ratings, reactances are 2.3 times as large
CONTINGENCY = Contingency("7-8@0.3", 0.07, at=0.4)


@pytest.fixture(scope="module")
def odd():
    """50 Hz, 230 MVA; two unequal machines at a bus, ratings of their own, a phase shifter, conductances."""
    case = load("wscc9")
    rated = {1: 131.0, 2: 212.0, 3: 97.0}
    machines = [m._replace(base=rated[m.machine]) for m in case.machines]
    machines.append(machines[1]._replace(machine=4, base=83.0, p=37.0, storage_bus=8))
    devices = {model: dict(rows) for model, rows in case.devices.items()}
    for rows in devices.values():
        rows[4] = rows[2]
    for number, H in ((1, 11.0), (2, 4.0), (3, 3.0), (4, 5.0)):
        devices["two_axis"][number] = devices["two_axis"][number]._replace(H=H)
    special = {(2, 7): {"r": 0.003, "tap": 0.98}, (4, 6): {"g_from": 0.013, "b_to": 0.021}, (8, 9): {"phase": 2.5}}
    branches = [
        k._replace(r=1.1 * k.r, x=2.3 * k.x, b=k.b / 2.3)._replace(**special.get((k.from_bus, k.to_bus), {}))
        for k in case.branches
    ]
    return replace(
        case, name="odd", base_mva=230.0, frequency_hz=50.0, machines=tuple(machines), branches=tuple(branches),
        devices=devices,
    )  # fmt: skip


@pytest.fixture(scope="module")
def folder(odd, tmp_path_factory):
    return write(odd, tmp_path_factory.mktemp("odd"))


@pytest.fixture
def printed(stabctl, folder, monkeypatch):
    """Runs a command: the cells of its tables, and all that it prints on one line."""
    monkeypatch.setenv("COLUMNS", "250")

    def run(command, *words):
        code, out, err = stabctl(command, folder, *words)
        assert (code, err) == (0, TOLD.format(folder))
        lines = ["", *out.splitlines()]
        rows = [line.split("\t") for above, line in pairwise(lines) if "\t" in line and "\t" in above]  # without heads
        return rows, " ".join(out.split())

    return run


@pytest.fixture
def told(stabctl, folder):
    """Runs a command with --json."""

    def run(command, *words):
        code, out, err = stabctl(command, folder, *words, "--json")
        assert (code, err) == (0, TOLD.format(folder))
        return json.loads(out)

    return run


def test_a_power_flow_balances_at_every_bus_and_along_every_branch(odd, printed, told):
    """From the voltages that are printed alone, with the data of the case."""
    record, (cells, text) = told("powerflow", "--branches"), printed("powerflow", "--branches")
    V = {b["bus"]: b["v_pu"] * np.exp(1j * np.deg2rad(b["angle_deg"])) for b in record["buses"]}
    left = {b["bus"]: complex(b["p_gen_mw"], b["q_gen_mvar"]) for b in record["buses"]}
    buses, lines = cells[: len(V)], cells[len(V) :]
    for load_ in odd.loads:
        left[load_.bus] -= complex(load_.p, load_.q)
    losses = 0.0
    for k, line, shown in zip(odd.branches, record["branches"], lines, strict=True):
        ratio = k.tap * np.exp(1j * np.deg2rad(k.phase))
        series, half = 1 / complex(k.r, k.x), 0.5j * k.b
        a, b = V[k.from_bus], V[k.to_bus]
        into = a * np.conj(
            ((series + half) * a / abs(ratio) ** 2 - series * b / np.conj(ratio)) + complex(k.g_from, k.b_from) * a
        )
        out = b * np.conj((series + half) * b - series * a / ratio + complex(k.g_to, k.b_to) * b)
        into, out = into * odd.base_mva, out * odd.base_mva
        assert (line["from_bus"], line["to_bus"]) == (k.from_bus, k.to_bus)
        values = [line[c] for c in ("p_from_mw", "q_from_mvar", "p_to_mw", "q_to_mvar")]
        assert values == pytest.approx([into.real, into.imag, out.real, out.imag], abs=1e-6)
        assert shown.pop(2) == line["circuit"]
        assert [float(c) for c in shown] == pytest.approx(
            [k.from_bus, k.to_bus, *values, into.real + out.real], abs=0.0051
        )
        left[k.from_bus] -= into
        left[k.to_bus] -= out
        losses += into.real + out.real
    assert max(map(abs, left.values())) < 1e-6  # MVA
    assert f"branch losses: {losses:.1f} MW" in text
    for row, b in zip(buses, record["buses"], strict=True):
        assert [float(c) for c in row[:3]] == pytest.approx([b["bus"], b["v_pu"], b["angle_deg"]], abs=0.00051)
        made = [b["p_gen_mw"], b["q_gen_mvar"]]
        assert [float(c or 0) for c in row[3:]] == pytest.approx(made, abs=0.0051)
        at = [m.p for m in odd.machines if m.bus == b["bus"] and b["bus"] != 1]
        assert not at or b["p_gen_mw"] == pytest.approx(sum(at), abs=1e-6)


def test_modes_are_those_of_the_eigenvalues(odd, printed, told):
    found = odd.modes()
    s = found.eigenvalues
    record = told("modes")
    assert [(m["real"], m["imag"]) for m in record["modes"]] == [(z.real, z.imag) for z in s]
    for m, z in zip(record["modes"], s, strict=True):
        assert m["frequency_hz"] == pytest.approx(abs(z.imag) / (2 * np.pi), rel=1e-12)
        assert m["damping_ratio"] == pytest.approx(-z.real / abs(z), rel=1e-12) if abs(z) > 1e-9 else True
    rows, text = printed("modes", "--band", "0.3", "2.2")
    swings = [s[k] for k in found.swings()]
    inside = [z for z in s if 0.3 <= z.imag / (2 * np.pi) <= 2.2]  # the swings first, then by damping
    inside.sort(key=lambda z: (0, z.imag) if z in swings else (1, -z.real / abs(z)))
    assert len(rows) == len(inside) > 3
    for row, z in zip(rows, inside, strict=True):
        wanted = [z.imag / (2 * np.pi), -z.real / abs(z), z.real, z.imag]
        assert [float(c) for c in row[:4]] == pytest.approx(wanted, abs=5.1e-5)
    assert [row[4] for row in rows].count("yes") == len(swings) == 3
    least = min(swings, key=lambda z: -z.real / abs(z))
    assert f"least damped: {least.imag / (2 * np.pi):.4g} Hz, damping ratio {-least.real / abs(least):.3g}" in text


def test_a_simulation_is_that_of_python(odd, printed, told, tmp_path):
    run = odd.with_storage("7%mva").simulate(CONTINGENCY, 3.0, control=BangBang(0.09))
    words = *FAULT, "--until", "3", "--storage", "7%mva", "--deadband", "90mHz"
    record = told("simulate", *words, "--out", tmp_path / "run.csv")
    assert (record["outcome"], record["time_s"], record["stable"]) == (run.outcome.kind.value, run.outcome.time_s, True)
    rows, text = printed("simulate", *words)
    assert run.outcome.message in text
    a, H = run.arrays, run.point.inertia
    assert len({round(h, 6) for h in H}) == 4
    moved = np.rad2deg(a.angle - (a.angle @ H / H.sum())[:, None])
    largest = np.abs(moved - moved[0]).max()
    assert record["max_angle_from_coi_deg"] == pytest.approx(largest, rel=1e-6)
    assert rows[2] == ["largest change of angle from the COI", f"{largest:.1f} degrees"]
    assert rows[3][1].startswith(f"{record['steps']} steps in ")
    with (tmp_path / "run.csv").open() as file:
        head, *lines = csv.reader(file)
    found = dict(zip(head, np.array(lines, float).T, strict=True))
    assert found["time_s"] == pytest.approx(run.time, abs=1e-12)
    for i, m in enumerate(odd.machines):
        assert found[f"speed_pu:{m.machine}"] == pytest.approx(a.speed[:, i], abs=1e-12)
        assert found[f"angle_deg:{m.machine}"] == pytest.approx(np.degrees(a.angle[:, i]), abs=1e-10)
        assert found[f"storage_mw:{m.machine}@{m.storage_bus}"] == pytest.approx(a.storage[:, i], abs=1e-9)
        assert 0.2 * 0.07 * m.base < np.abs(a.storage[:, i]).max() <= 0.07 * m.base * (1 + 1e-9)  # MW
    for i, b in enumerate(odd.buses):
        assert found[f"v_pu:{b.bus}"] == pytest.approx(np.abs(a.V[:, i]), abs=1e-12)


def test_a_clearing_time_is_that_of_python(odd, printed, told):
    words = "--fault", "8", "--trip", "8-9", "--resolution", "0.25cyc", "--observe", "0.6"
    found = odd.clearing_time(Contingency("8", trip="8-9"), resolution="0.25cyc", observe=0.6)
    record, (rows, text) = told("clearing-time", *words), printed("clearing-time", *words)
    assert found.status == record["status"] == "found"
    assert record["cycles"] == found.cycles
    assert record["seconds"] == pytest.approx(found.cycles / 50, rel=1e-12)
    assert record["machine"] == found.machine
    assert record["lowest_unstable_cycles"] == pytest.approx(found.cycles + 0.25)
    assert record["resolution_cycles"] == 0.25
    assert record["observed_s"] == 0.6
    assert record["longest_observed_s"] == found.observed_s > 0.6  # the swings decay later
    assert f"{found.cycles:g} cycles" in text
    assert sum(int(row[1]) for row in rows) == len(record["runs"])
    for row in rows:
        low, high = (float(x) for x in (row[0].split(" to ") * 2)[:2])
        alike = [r for r in record["runs"] if low <= r["cycles"] <= high and r["outcome"].replace("_", " ") == row[2]]
        assert len(alike) == int(row[1])
        first, last = (float(x) for x in (row[4].split(" to ") * 2)[:2])
        ends = [r["time_s"] for r in alike]
        assert (first, last) == pytest.approx((min(ends), max(ends)), abs=0.0051)
        assert row[3] in ("", f"machine {alike[0]['machine']}")


@pytest.fixture(scope="module")
def screened(odd):
    """A coarse screen, as short as possible."""
    return odd.screen(resolution="1cyc", observe=1.0, longest=0.0, limit="20cyc")


COARSE = "--resolution", "1cyc", "--observe", "1", "--longest", "0", "--limit", "20cyc"


@pytest.mark.slow
def test_a_screen_is_that_of_python(screened, printed, told, tmp_path):
    record = told("screen", *COARSE, "--out", tmp_path / "pairs.csv")
    wanted = [(p.fault, " ".join(p.trip), p.cycles, p.status, p.machine) for p in screened.pairs]
    assert len({w[2] for w in wanted}) > 3
    listed = [tuple(p[c] for c in ("fault", "trip", "cycles", "status", "machine")) for p in record["pairs"]]
    assert [(f, t if isinstance(t, str) else " ".join(t), *rest) for f, t, *rest in listed] == wanted
    rows, _ = printed("screen", *COARSE)
    for row, (fault, trip, cycles, status, machine) in zip(rows, wanted, strict=True):
        assert row[:2] == [fault, trip]
        assert status != "found" or float(row[2]) == cycles
        assert machine is None or row[3] == f"synchronism of machine {machine}"
    with (tmp_path / "pairs.csv").open() as file:
        head, *lines = csv.reader(file)
    numbers = [line[head.index("cycles")] for line in lines]
    assert [float(n) if n else None for n in numbers] == [w[2] for w in wanted]


@pytest.mark.parametrize("beyond", [-0.7, -0.3, 0.0, 0.3, 0.7, 1.0])
def test_below_lists_every_shorter_time_and_no_other(odd, screened, beyond):
    """Wherever the time lies between the points of the grid, and on them."""
    times = sorted({p.cycles for p in screened.pairs if p.status == "found"})
    below = times[len(times) // 2] + beyond
    found = odd.screen(f"{below}cyc", resolution="1cyc", observe=1.0, longest=0.0, limit="20cyc")
    shorter = [p for p in screened.pairs if p.status == "unstable_at_zero" or (p.cycles or np.inf) < below]
    assert [(p.fault, p.trip, p.cycles, p.status) for p in found.pairs] == [
        (p.fault, p.trip, p.cycles, p.status) for p in shorter
    ]


def test_the_networks_that_a_tuning_prints_are_those_with_the_least_damping_after_it(capsys):
    rng = np.random.default_rng(4)
    columns = {name: rng.uniform(0.01, 0.2, 10) for name in ("before", "after", "hz")}
    worst = pd.DataFrame({"network": [*"abcdefghij"], **columns, "mode": "1-2"})
    parameters = pd.DataFrame(columns=["device", "parameter", "value", "unit"])
    _show(SimpleNamespace(worst=worst, parameters=parameters, robustness=()), [], as_json=False)
    rows = [line.split("\t") for line in capsys.readouterr().out.splitlines() if line.count("\t") == 4][1:]
    least = worst.sort_values("after").head(SHOWN)
    assert [row[0] for row in rows] == least["network"].tolist()
    assert least["before"].is_monotonic_increasing is False
    assert [float(row[2]) for row in rows] == pytest.approx(least["after"].tolist(), abs=6e-5)
    assert [float(row[1]) for row in rows] == pytest.approx(least["before"].tolist(), abs=6e-5)
