"""Unusual data: right systems are silent, wrong units and bases are named."""

import os
import random
from collections import Counter, defaultdict
from dataclasses import replace
from itertools import pairwise
from math import ceil, floor
from pathlib import Path

import pytest
from systems import POLES, ROUND, SALIENT, SEXS, TWO_AXES, TYPE_J, small

import stabctl as st
from stabctl._util.schema import fields
from stabctl.clearing import Search, Trial
from stabctl.io import packaged
from stabctl.model import naming, tables, unusual

GIVEN = Path(os.environ.get("STABCTL_IMPORT_DATA", Path(__file__).parents[3] / "shared" / "reference" / "import"))
FILES = {  # right systems, beside the packaged ones
    "psid/GAST/14bus.raw": "dyn_data.dyr",
    "psid/KUNDUR11/11BUS_KUNDUR.raw": "11BUS_KUNDUR_HYGOV.dyr",
    "steps/IEEE9/IEEE9.raw": "IEEE9_detail.dyr",
    "tops/ieee39_derived.raw": "ieee39_derived.dyr",
    "tops/k2a_derived.raw": "k2a_derived.dyr",
}
SYSTEMS = ["ieee39", "two_area", "two_area_pss", "wnaps", "wscc9", *FILES]
FAULTS, NAMED = 300, 30  # seeded faults, and those of the named whose clearing time is computed
SHARE = 0.9  # least share that is named of the faults that change a clearing time by 10 %


def system(name):
    if name not in FILES:
        return st.load(name)
    if not (GIVEN / name).exists():
        pytest.skip("the reference systems are not here")
    return st.load(
        GIVEN / name, dyr=(GIVEN / name).with_name(FILES[name]), missing="injection", missing_controls="fixed"
    )


@pytest.mark.parametrize("name", packaged())
def test_packaged_cases_have_no_unusual_values(cases, name):
    assert cases(name).check().findings == ()
    assert str(cases(name).check()) == f"{name}: no unusual values."
    assert cases(name).check().df.empty


@pytest.mark.parametrize("name", FILES)
def test_right_public_systems_are_silent(name):
    assert system(name).check().sentences() == []


def test_a_file_with_reactances_on_the_system_base_is_told_in_one_sentence_for_each_of_them():
    """In this file Xd is 0.0262 on 1000 MVA: the machine's 0.262 on 100 MVA was divided by ten twice."""
    raw = GIVEN / "steps" / "IEEE39_v33" / "ieee39.raw"
    if not raw.exists():
        pytest.skip("the reference systems are not here")
    report = st.import_report(raw, raw.with_name("IEEE39.dyr"), check=False)
    said = report.unusual.sentences()
    assert sum("is it on the base of the system and not of the machine" in text for text in said) == 3
    assert len(said) < len(report.unusual.findings) / 5
    assert [block.splitlines()[0] for block in str(report).split("\n\n")][1] == "Unusual data"


@pytest.mark.parametrize(
    ("path", "value", "says"),
    [
        ("genrou.1.H", 1500, "genrou, machine 1: H = 1500 s, usually 1 to 30 s; is it on the base of the system, or "),
        ("genrou.1.T1d", 7000, "genrou, machine 1: T1d = 7000 s, usually 1.5 to 18 s; is it in ms, or "),
        ("branches.7-8.r", -0.004, "branches, branch 7-8: r = -0.004 pu, usually 0 to 5 pu; is its sign right, or "),
        ("genrou.1.xd", 0.0262, "genrou, machine 1: xd = 0.0262 pu, usually 0.08 to 4 pu; is it on the base of "),
        ("branches.7-8.x", 0, "branches, branch 7-8: x = 0 pu, usually 1e-09 to 20 pu; a line or a transformer has a "),
        ("branches.7-8.x", 1.1, "branches, branch 7-8: surge impedance sqrt(x/b) = 2.39 pu, usually 0.7559 pu; "),
        ("branches.1-5.x", 0.1667, "machines, machine 1: x of its transformer = 1.5 pu, usually 0.03 to 0.45 pu; "),
        ("machines.2.base", 90, "machines, machine 2: loading = 8.203 pu, usually 0 to 1.2 pu; is the power beyond "),
    ],
)  # fmt: skip
def test_a_wrong_unit_or_base_is_named(cases, path, value, says):
    found = cases("two_area").set(path, value).check(balance=False)
    assert sum(text.startswith(says) for text in found.sentences()) == 1
    row = found.df.iloc[0]
    assert row.value < row.low or row.value > row.high


@pytest.mark.parametrize(("x", "named"), [(0.15, False), (1.5, True)])
def test_a_transformer_is_judged_by_all_machines_that_share_it(x, named):
    """Its x on the base of a unit is the same if the unit is divided into ten: 0.15 pu of 900 MVA, 0.015 pu of 90."""
    case = st.load("two_area").set("branches.1-5.x", x / 9)
    one = next(m for m in case.machines if m.machine == 1)
    parts = 1, *range(101, 110)
    units = [one._replace(machine=k, base=one.base / 10, p=one.p / 10, q=one.q / 10) for k in parts]
    devices = {model: dict(rows) | dict.fromkeys(parts, rows[1]) for model, rows in case.devices.items()}
    divided = replace(case, machines=(*units, *(m for m in case.machines if m is not one)), devices=devices)
    for system, number in ((case, 1), (divided, 10)):
        found = [f.value for f in system.check(balance=False).findings if f.quantity == "x of its transformer"]
        assert found == pytest.approx([x] * number * named)


@pytest.mark.parametrize("rule", unusual.usual(), ids=lambda rule: f"{rule.of} {rule.quantity}")
def test_a_rule_is_silent_inside_its_range_and_speaks_outside(monkeypatch, rule):
    """Values at the bounds and those with a meaning of their own are usual."""
    monkeypatch.setattr(unusual, "usual", lambda: (rule,))
    table = rule.of if rule.of in (*tables.TABLES, *tables.models()) else tables.of_role(rule.of)[0]

    def said(value):
        row = dict.fromkeys(rule.columns, 1.0) | {rule.columns[0]: value}
        return list(unusual._outside(table, {"machine 1": row}))

    step = 0.01 * (rule.high - rule.low)
    below = 0.99 * rule.low if rule.low > 0 else rule.low - step
    assert not [value for value in (rule.low, (rule.low + rule.high) / 2, rule.high, *rule.but) if said(value)]
    for value in (below, rule.high + step):
        ((object, quantity, found),) = [(f.object, f.quantity, f.value) for f in said(value)]
        assert (object, quantity, found) == ("machine 1", rule.quantity, value)
    assert rule.likely[-1] == "?" or "usually" in rule.likely


@pytest.mark.parametrize(
    ("model", "par"), [("genrou", ROUND), ("gensal", POLES), ("two_axis", TWO_AXES), ("gentpj1", TYPE_J)]
)
def test_reactances_in_an_unusual_order_are_named(model, par):
    """Xd >= Xq >= Xq' >= Xd' >= Xd'' >= Xl, as far as the model has them; estimated ones may differ somewhat."""
    assert not small({model: par}).check().findings
    order = [name for name in ("xd", "xq", "x1d", "x2", "x2d", "xl") if name in par._fields]
    for high, low in pairwise(order):
        wrong = par._replace(**{low: 2 * getattr(par, high)})
        named = {f.quantity for f in small({model: wrong}).check().findings}
        assert any(low in quantity or high in quantity for quantity in named), (low, high)


def test_the_odd_one_of_several_devices_is_named():
    case = st.load("ieee39")
    KA = {key: par.KA for key, par in case.devices["exst3"].items()}
    assert len(set(KA.values())) <= 2
    (finding,) = case.set("exst3.3.KA", KA[3] / 10).check().findings
    assert (finding.object, finding.quantity, finding.high) == ("machine 3", "KA", max(KA.values()))
    assert "the others of this case have" in finding.likely


@pytest.mark.parametrize("odd", [0.1, 70.0])
def test_the_range_named_is_that_of_all_others(odd):
    values = {f"machine {i}": value for i, value in enumerate((2.0, 4.0, odd, 1.0, 3.0))}
    (found,) = unusual._alone("exst3", "KA", "-", values, unusual.ALONE)
    assert (found.object, found.value, found.low, found.high) == ("machine 2", odd, 1.0, 4.0)
    assert found.likely.endswith("have 1 to 4")


def test_power_left_at_the_stored_voltages_is_named_unless_they_are_no_solution():
    case = st.load("wscc9")
    wrong = case.set("loads.5.p", 12.5)
    assert [f.object for f in wrong.check().findings] == ["bus 5"]
    assert wrong.check(balance=False).findings == ()
    flat = [b._replace(angle=0.0) for b in case.buses]
    assert replace(wrong, buses=tuple(flat)).check().findings == ()


@pytest.mark.parametrize(("share", "named"), [(0.94, True), (0.96, False), (1.04, False), (1.06, True)])
def test_power_left_at_a_bus_is_named_from_a_twentieth_of_what_passes_through(share, named):
    """Through a bus without a machine passes what comes in by its lines, and leaves by them and as load."""
    case = st.load("wscc9")
    found = case.set("loads.5.p", share * case.loads[0].p).check().findings
    assert [f.object for f in found] == ["bus 5"] * named
    assert [f.value for f in found] == [pytest.approx((share - 1) * case.loads[0].p, abs=0.6)] * named  # 0.5


def test_reactive_power_left_at_a_bus_is_named_where_nothing_holds_the_voltage():
    """What a machine produces to hold its voltage is not in the bus table."""
    case = st.load("ieee39")
    wrong = case.set("loads.8.q", case.loads[naming.row(case, "loads", "8")].q - 700)
    (found,) = wrong.check().findings
    assert (found.object, found.unit, found.value) == ("bus 8", "Mvar", pytest.approx(-700, abs=1))
    assert case.set("loads.39.q", 950).check().findings == ()
    wrong = case.set("buses.8.b", 500).check().findings
    assert [(f.object, f.unit) for f in wrong] == [("bus 8", "Mvar")]


def test_a_power_flow_without_a_solution_hides_nothing_else():
    case = st.load("two_area").set({"branches.7-8.x": 11.0, "branches.7-8#2.x": 11.0, "genrou.1.H": 1500})
    with pytest.raises(st.StabctlError):
        case.power_flow()
    assert "H" in {f.quantity for f in case.check().findings}


def test_infinite_buses_and_unused_time_constants_are_usual():
    case = small({"genrou": SALIENT._replace(T2d=999.0, T1q=0.0), "sexs": SEXS})
    assert not case.set("gencls.2.H", 0).check().findings
    assert not case.set({"gencls.2.H": 1000, "gencls.2.x1d": 1e-5}).check().findings
    assert case.set("gencls.2.H", 1000).check().findings


def test_something_else_than_a_system_is_refused():
    with pytest.raises(st.StabctlError, match="is not a system"):
        st.check("two_area")


def candidates(case):
    """Kind of quantity -> paths, values, and the factor to the other base."""
    found = defaultdict(list)
    for model, rows in case.devices.items():
        role = tables.role(model)
        for key, par in rows.items():
            base = case.base_mva / case.machine(naming.number(key)).base if role != "load" else 1
            for f in fields(type(par)).values():
                kind = {"H": "H", "KA": "gain", "K": "gain", "KS": "gain"}.get(f.name)
                if role == "governor":
                    kind = "droop" if f.name in ("R", "K", "K1") else None
                elif role == "machine" and f.name in ("xd", "xq", "x1d", "x1q", "x2"):
                    kind = "reactance"
                kind = "time constant" if f.unit == "s" and f.name != "H" and role != "load" else kind
                if f.kind is float and getattr(par, f.name) and kind:
                    on_base = kind in ("H", "reactance", "droop")
                    found[kind].append((f"{model}.{key}.{f.name}", getattr(par, f.name), base if on_base else 1))
    ends = Counter(end for k in case.branches for end in (k.from_bus, k.to_bus))
    machines = {m.bus: m for m in case.machines}
    for name, k in zip(naming.circuits(case.branches), case.branches, strict=True):
        unit = [machines[end] for end in (k.from_bus, k.to_bus) if ends[end] == 1 and end in machines]
        base = unit[0].base / case.base_mva if unit else 1
        found["transformer x" if unit else "branch x"].append((f"branches.{name}.x", k.x, base))
        found["branch r"] += [(f"branches.{name}.r", k.r, 1)] if k.r else []
    for key, load in zip(naming.keys(case, "loads"), case.loads, strict=True):
        found["load"] += [(f"loads.{key}.p", load.p, 1)] if load.p and load.kind == "load" else []
    swing = {b.bus for b in case.buses if b.kind == "swing"}
    found["dispatch"] = [(f"machines.{m.machine}.p", m.p, 1) for m in case.machines if m.p and m.bus not in swing]
    return found


def contingencies(case):
    """A few faults whose clearing times are within the search."""
    return {
        39: [("29", "26-29"), ("21", "21-22"), ("16", "16-17")],
        122: [("83", "83-33"), ("82", "18-82"), ("44", "40-44")],
        14: [("1", "1-5"), ("6", "6-12")],
        9: [("7", "5-7"), ("9", "6-9"), ("4", "4-6")],
        11: [("7", "7-8"), ("9", "8-9")],
    }[len(case.buses)]


SEARCH = Search(resolution_cycles=0.25, observed_s=3.0)


def searched(case):
    """A few faults of a case whose loads are impedances, with the operating point."""
    point = case.with_loads("impedance").initialize()
    for fault, trip in contingencies(case):
        a, b = map(int, trip.split("-"))
        circuit = naming.circuits(case.branches)[naming.circuit_rows(case, naming.Circuit(a, b, None, None))[0]]
        yield point, st.Contingency(fault, clear="1cyc", trip=circuit)


def clearing_times(case):
    """Clearing times (cycles)."""
    options = {"resolution": "0.25cyc", "observe": "3s", "longest": "3s", "scan": 0}
    found = [point.clearing_time(one, **options) for point, one in searched(case)]
    return [{"found": time.cycles, "unstable_at_zero": 0.0}.get(time.status, 60.0) for time in found]


def elsewhere(case, before):
    """Is a clearing time more than a tenth from what it was? False if the case does not start, which all notice.

    It is not if the shortest fault of the grid within that tenth is survived, and the first one beyond it is not.
    """
    try:
        for (point, one), cycles in zip(searched(case), before, strict=True):
            trial, (low, high) = Trial(point, one, None, SEARCH), (round(4 * x * cycles, 6) for x in (0.9, 1.1))
            if low > 0 and not trial.simulate(ceil(low)).outcome.stable:
                return True
            if high < 240 and trial.simulate(floor(high) + 1).outcome.stable:
                return True
    except st.StabctlError:
        pass
    return False


@pytest.mark.slow
def test_nine_of_ten_faults_that_change_a_clearing_time_are_named():
    """One value on another base, or wrong by a factor of 10 to 1000. Clearing times are computed for all that are not
    named, and for 30 of those that are: their share estimates how many of the named change a clearing time."""
    rng, known = (
        random.Random(1),
        {name: system(name) for name in SYSTEMS if name not in FILES or (GIVEN / name).exists()},
    )
    every = {name: candidates(case) for name, case in known.items()}
    before = {name: clearing_times(case) for name, case in known.items()}

    named, silent, exact = [], [], 0
    while len(named) + len(silent) < FAULTS:
        name = rng.choice(list(known))
        path, value, base = rng.choice(every[name][rng.choice(sorted(every[name]))])
        factor = rng.choice([10, 100, 1000, 0.1, 0.01, 0.001, *([base] if base != 1 else [])])
        try:
            case = known[name].set(path, value * factor)
        except st.StabctlError:
            continue  # an error, which is not overlooked either
        found = case.check().findings
        (named if found else silent).append((name, case))
        exact += any(f.object.endswith(path.split(".")[1].split("#")[0]) for f in found)
    sample = rng.sample(named, NAMED)
    told = len(named) * sum(elsewhere(case, before[name]) for name, case in sample) / NAMED
    missed = sum(elsewhere(case, before[name]) for name, case in silent)
    assert len(named) > 0.88 * FAULTS  # 273
    assert exact > 0.6 * len(named)  # 174; the others are named by what they do to the power flow
    assert told / (told + missed) >= SHARE  # 73 of 78


@pytest.mark.parametrize(("path", "value", "quantity"), [("genrou.1.H", 1500, "H"), ("genrou.1.x1d", 30, "x1d")])
def test_a_value_outside_by_itself_is_named_once(cases, path, value, quantity):
    """And not again in every product and ratio in which it is."""
    found = cases("two_area").set(path, value).check(balance=False).findings
    rules = {rule.quantity for rule in unusual.usual() if quantity in rule.columns}
    assert len(rules) > 1
    assert [f.quantity for f in found if f.quantity in rules] == [quantity]


def test_the_power_of_the_swing_machine_is_what_is_left():
    """Its dispatch is not used, and says nothing about the solution."""
    case = st.load("wscc9")
    swing = next(m for m in case.machines if {b.bus: b.kind for b in case.buses}[m.bus] == "swing")
    assert case.set(f"machines.{swing.machine}.p", swing.p + 50).check().findings == ()
