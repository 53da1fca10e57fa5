"""Laws on two unlike islands: nothing depends on the order of rows, bases, units of text, when it happens."""

import csv
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from islands import SHIFT
from mixed import mixed, mixed_point, second
from uneven import uneven

import stabctl as st
from stabctl.dynamics import operating_point

FAULT = st.Contingency(
    "1002-1003#1@0.3", clear="80ms", trip="1002-1003#1", at=0.2, impedance=0.004 + 0.011j,
    events=["40:+13MW@0.3s", "30-40#2@0.4s"], after=["1005:-9MW@60ms"],
)  # fmt: skip
LAW = st.BangBang(deadband="30mHz")
OPTIONS = {"until": 0.8, "step": "2ms", "control": LAW}


@cache
def usual():
    return mixed_point().simulate(FAULT, **OPTIONS)


def by_name(run):
    """Every column of a run."""
    return {name: run.df[name].to_numpy() for name in run.df}


def same(run, other, tolerance=1e-7, names=lambda name: name):
    """Whether two runs have the same columns with the same values."""
    one, two = by_name(run), {names(name): values for name, values in by_name(other).items()}
    assert set(one) == set(two)
    for name, values in one.items():
        assert two[name] == pytest.approx(values, rel=1e-9, abs=tolerance * max(1, np.abs(values).max())), name


def turned(case):
    """The same case with the rows of every table in another order."""
    tables = "buses", "machines", "loads", "links"
    keep = {name: tuple(sorted(getattr(case, name), key=lambda row: repr(row)[::-1])) for name in tables}
    ends = sorted({frozenset((b.from_bus, b.to_bus)) for b in case.branches}, key=lambda e: -sum(e))
    # circuits between the same buses are numbered in their order, which stays
    lines = tuple(b for e in ends for b in case.branches if {b.from_bus, b.to_bus} == e)
    devices = {model: dict(reversed(rows.items())) for model, rows in reversed(case.devices.items())}
    return replace(case, **keep, branches=lines, devices=devices, storage=case.storage[::-1])


def test_the_order_of_rows_does_not_matter():
    other = operating_point.solve(turned(mixed()))
    assert [m.machine for m in other.case.machines] != [m.machine for m in mixed().machines]
    flow, again = (p.power_flow().df.sort_index() for p in (mixed_point(), other))
    assert again.to_numpy() == pytest.approx(flow.to_numpy(), abs=1e-9)
    same(usual(), other.simulate(FAULT, **OPTIONS))
    known, found = (np.sort_complex(p.modes().eigenvalues) for p in (mixed_point(), other))
    assert np.sort(abs(found)) == pytest.approx(np.sort(abs(known)), rel=1e-6)
    powers = [p.short_circuit().df.set_index("bus").sort_index().to_numpy(float) for p in (mixed_point(), other)]
    assert powers[1] == pytest.approx(powers[0], rel=1e-9)
    says = [sorted(str(p.case.check()).splitlines()) for p in (mixed_point(), other)]
    assert says[0] == says[1]


def test_each_island_does_what_it_does_alone():
    """What happens in one island leaves the other alone; frequencies, energies and sentences are those of each."""
    own = {"until": 0.8, "step": "2ms", "control": LAW}
    there = st.Contingency(
        "2-3#1@0.3", clear="80ms", trip="2-3#1", at=0.2, impedance=0.004 + 0.011j, after=["5:-9MW@60ms"]
    )
    first = operating_point.solve(uneven()).simulate(["40:+13MW@0.3s", "30-40#2@0.4s"], **own)
    other = operating_point.solve(second()).simulate(there, **own)
    both, times = by_name(usual()), usual().time
    for run, shift in ((first, 0), (other, SHIFT)):
        for i, m in enumerate(run.point.case.machines):
            name = m.name or m.machine + shift
            assert np.interp(run.time, times, both[f"speed_pu:{name}"]) == pytest.approx(
                run.speed.to_numpy()[:, i], abs=1e-6
            )
        for i, b in enumerate(run.point.case.buses):
            seen = np.interp(run.time[5:], times, both[f"v_pu:{b.bus + shift}"])
            assert np.median(abs(seen - run.voltage.to_numpy()[5:, i])) < 1e-6
    alone = [operating_point.solve(c).modes().eigenvalues for c in (uneven(), second())]
    joint = np.sort(abs(mixed_point().modes().eigenvalues))
    assert np.sort(abs(np.concatenate(alone))) == pytest.approx(joint, rel=1e-5, abs=1e-5)


@pytest.mark.parametrize("base", [61.0, pytest.param(233.0, marks=pytest.mark.slow)])
def test_the_base_of_the_network_does_not_matter(base):
    case, k = mixed(), base / mixed().base_mva
    ends = ("g_from", "b_from", "g_to", "b_to")
    lines = tuple(
        b._replace(r=b.r * k, x=b.x * k, b=b.b / k, **{end: getattr(b, end) / k for end in ends}) for b in case.branches
    )
    other = operating_point.solve(replace(case, base_mva=base, branches=lines))
    fault = replace(FAULT, impedance=FAULT.impedance * k)
    same(usual(), other.simulate(fault, **OPTIONS), 1e-6)
    scaled = other.short_circuit().df
    scaled[["r_pu", "x_pu"]] /= k
    for found, wanted in (
        (other.power_flow().df, mixed_point().power_flow().df),
        (other.power_flow().branches, mixed_point().power_flow().branches),
        (scaled, mixed_point().short_circuit().df),
    ):
        assert found.to_numpy(float) == pytest.approx(wanted.to_numpy(float), rel=1e-8, abs=1e-7)
    assert str(other.case.check()) == str(case.check())


def test_loads_in_halves_do_what_they_did_whole():
    case = mixed()
    parts = [
        load._replace(p=share * load.p, q=share * load.q, id=f"{load.id}{share}")
        for load in case.loads
        for share in (0.3, 0.7)
    ]
    other = operating_point.solve(replace(case, loads=tuple(parts)))
    same(usual(), other.simulate(FAULT, **OPTIONS))
    assert other.power_flow().df.to_numpy() == pytest.approx(mixed_point().power_flow().df.to_numpy(), abs=1e-8)


def test_units_of_text_do_not_matter():
    """50 Hz: a cycle is 20 ms."""
    cycles = replace(
        FAULT, clear="4cyc", at="10cyc", after=["1005:-9MW@3cyc"], events=["40:+13MW@15cyc", "30-40#2@400ms"]
    )
    found = mixed_point().simulate(cycles, "800ms", step="0.1cyc", control=st.BangBang(deadband=0.03))
    same(usual(), found, 1e-12)


def test_when_it_happens_does_not_matter():
    later = replace(FAULT, at=0.3, events=["40:+13MW@0.4s", "30-40#2@0.5s"])
    found = mixed_point().simulate(later, until=0.9, step="2ms", control=LAW)
    first, other = by_name(usual()), by_name(found)
    late = found.time > 0.3 - 1e-9
    early = usual().time > 0.2 - 1e-9
    assert late.sum() == early.sum()
    for name, values in first.items():
        shift = 0.1 if name == "time_s" else 0.0
        if name.startswith("angle_deg"):
            continue
        assert other[name][late] == pytest.approx(values[early] + shift, abs=1e-6 * max(1, np.abs(values).max())), name


def test_the_law_acts_outside_of_its_deadband_only():
    """Both sides of it, at every device."""
    run, case = usual(), mixed()
    names = [m.machine for m in case.machines]
    H = mixed_point().inertia
    speed, order, volts = (np.asarray(x) for x in (run.speed, run.dataset["storage_order"], run.voltage))
    island = np.array([n > SHIFT for n in names])
    row = {b.bus: i for i, b in enumerate(case.buses)}
    sides = set()
    for j, d in enumerate(case.storage):
        i = names.index(d.machine)
        mine = island == island[i]
        away = 50 * (speed[:, i] - speed[:, mine] @ H[mine] / H[mine].sum())
        clear = (np.abs(np.abs(away) - 0.03) > 0.004) & (np.abs(volts[:, row[d.bus]] - 0.8) > 0.02)
        wanted = np.where((np.abs(away) > 0.03) & (volts[:, row[d.bus]] > 0.8), np.sign(away), 0.0)
        if not d.ramp:
            assert (order[clear, j] == wanted[clear]).mean() > 0.97, d
        sides |= set(wanted[clear].tolist())
        assert (np.abs(order[:, j]) <= 1).all()
    assert sides == {-1.0, 0.0, 1.0}


RESULTS = {
    "run": lambda p: usual(),
    "check": lambda p: p.case.check(),
    "screen": lambda p: p.screen(
        faults=[st.Contingency("20-30#1", trip="20-30#1"), st.Contingency("1005")],
        resolution="2cyc", observe=0.5, longest=0.0, limit="10cyc", workers=1,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", RESULTS)
def test_a_saved_table_is_the_table(name, tmp_path):
    """Every column and row of it, in the file, in the notebook, and the number of rows."""
    result = RESULTS[name](mixed_point())
    frame = result.df
    result.save(tmp_path / "x.csv")
    with (tmp_path / "x.csv").open() as file:
        head, *rows = csv.reader(file)
    assert head == [str(c) for c in frame]
    assert len(rows) == len(frame) > 0
    for k, column in enumerate(frame):
        for row, value in list(zip(rows, frame[column], strict=True))[:50]:
            if isinstance(value, float | np.floating):
                assert float(row[k] or "nan") == pytest.approx(float(value), nan_ok=True, rel=1e-12)
            else:
                assert row[k].lstrip("'") == ("" if value is None or str(value) == "<NA>" else str(value).lstrip("'"))
    assert result._repr_html_().startswith("<p>")
    assert str(result) == repr(result)
