"""Power flow: the law it solves, the reference it must give, and what it says when there is no solution."""

from dataclasses import replace

import numpy as np
import pytest
from mixed import mixed
from systems import CLASSICAL, doubled, rebased, small

from stabctl import io
from stabctl._util.errors import PowerFlowError
from stabctl.model import network, powerflow
from stabctl.model.case import Case
from stabctl.model.tables import Branch, Bus, Link, Load, Machine

PACKAGED = io.packaged()


def written_out(case):
    """Admittance matrix (pu), branch by branch, tap on the from side."""
    place = {b.bus: i for i, b in enumerate(case.buses)}
    Y = np.diag([(b.g + 1j * b.b) / case.base_mva for b in case.buses])
    for k in case.branches:
        i, j, y = place[k.from_bus], place[k.to_bus], 1 / (k.r + 1j * k.x)
        phi = np.deg2rad(k.phase)
        Y[i, i] += (y + 0.5j * k.b) / k.tap**2
        Y[j, j] += y + 0.5j * k.b
        Y[i, j] -= y / k.tap * np.exp(1j * phi)
        Y[j, i] -= y / k.tap * np.exp(-1j * phi)
    return Y


def balance(case, flow):
    """Power (pu) put in less power taken out, at every bus."""
    place = {b.bus: i for i, b in enumerate(case.buses)}
    S = -flow.V * (written_out(case) @ flow.V).conj()
    for m, power in zip(case.machines, flow.S, strict=True):
        S[place[m.bus]] += power
    for load in case.loads:
        S[place[load.bus]] -= (load.p + 1j * load.q) / case.base_mva
    for k in case.links:
        S[place[k.from_bus]] -= k.p / case.base_mva
        S[place[k.to_bus]] += (k.p - k.loss) / case.base_mva
    return S


@pytest.mark.parametrize("name", PACKAGED)
def test_power_balances_at_every_bus(cases, name):
    flow = powerflow.solve(cases(name))
    assert np.abs(balance(cases(name), flow)).max() < 1e-9  # pu   the tolerance of Newton is 1e-10


@pytest.mark.parametrize("name", PACKAGED)
def test_branches_and_shunts_carry_off_what_is_injected(cases, name):
    case, flow = cases(name), powerflow.solve(cases(name))
    net, ends = network.build(case), flow.branch_power
    left = abs(flow.V) ** 2 * net.shunt.conj() + powerflow.demand(case)
    np.add.at(left, net.frm, ends[:, 0])
    np.add.at(left, net.to, ends[:, 1])
    np.add.at(left, net.machine_bus, -flow.S)
    assert np.abs(left).max() < 1e-9  # pu


@pytest.mark.parametrize("name", PACKAGED)
def test_machines_and_voltages_are_as_asked(cases, name):
    case, flow = cases(name), powerflow.solve(cases(name))
    for b, V in zip(case.buses, flow.V, strict=True):
        if b.kind != "pq":
            assert abs(V) == pytest.approx(b.v, abs=1e-12)
        if b.kind == "swing":
            assert np.rad2deg(np.angle(V)) == pytest.approx(b.angle, abs=1e-10)
            swing = b.bus
    for m, S in zip(case.machines, flow.S, strict=True):
        if m.bus != swing:
            assert S.real * case.base_mva == pytest.approx(m.p, abs=1e-6)


@pytest.mark.parametrize("name", ["two_area", "ieee39", "wnaps", "wnaps_paper"])
def test_voltages_and_powers_of_the_reference(cases, reference, name):
    case, flow = cases(name), powerflow.solve(cases(name))
    data = reference(name, "powerflow")
    place = {b.bus: i for i, b in enumerate(case.buses)}
    V = flow.V[[place[int(b)] for b in data["bus"]]]
    assert np.abs(np.abs(V) - data["v_pu"]).max() < 1e-6
    assert np.abs(np.rad2deg(np.angle(V / V[0])) - (data["angle_deg"] - data["angle_deg"][0])).max() < 1e-4
    at_bus = np.zeros(len(case.buses), complex)
    np.add.at(at_bus, [place[m.bus] for m in case.machines], flow.S)
    theirs = data["p_pu"] + 1j * data["q_pu"]
    assert np.abs(at_bus[[place[int(b)] for b in data["bus"]]] - theirs).max() < 1e-4


def test_machines_at_one_bus_share_by_their_bases(cases):
    one = small({"gencls": CLASSICAL})
    single, split = powerflow.solve(one), powerflow.solve(doubled(one))
    assert pytest.approx(single.V, abs=1e-12) == split.V
    assert split.S[0] == split.S[1] == pytest.approx(single.S[0] / 2, abs=1e-10)
    case = cases("wnaps")  # machines 8 and 9 stand at one high-voltage bus, 10 and 11 too
    uneven = replace(
        case, machines=tuple(m._replace(base=2 * m.base if m.machine == 1 else m.base) for m in case.machines)
    )
    assert pytest.approx(powerflow.solve(case).S, abs=1e-9) == powerflow.solve(uneven).S


def test_remainder_of_reactive_power_is_shared_by_base_where_bases_differ():
    case = doubled(small({"gencls": CLASSICAL}))
    machines = (case.machines[0]._replace(base=300.0), case.machines[1]._replace(base=100.0), case.machines[2])
    flow = powerflow.solve(replace(case, machines=machines))
    assert flow.S[0].imag == pytest.approx(3 * flow.S[1].imag, rel=1e-12)
    assert flow.S[0].real == pytest.approx(flow.S[1].real, rel=1e-12)


def test_rows_of_the_table_hold_all_that_stands_at_a_bus():
    """Two machines at some buses, two loads at another, a link, and loads whose p and q are those of a voltage."""

    def law(load, V):
        m = V / (load.v or V)
        return complex(
            load.p * (load.p_power + load.p_current * m + (1 - load.p_power - load.p_current) * m**2),
            load.q * (load.q_power + load.q_current * m + (1 - load.q_power - load.q_current) * m**2),
        )

    flow = mixed().power_flow()
    table, base, case = flow.df, flow.case.base_mva, flow.case
    for bus, row in table.iterrows():
        made = sum(S * base for m, S in zip(case.machines, flow.S, strict=True) if m.bus == bus)
        drawn = sum(law(load, row.v_pu) for load in case.loads if load.bus == bus)
        drawn += sum(k.p * (k.from_bus == bus) - (k.p - k.loss) * (k.to_bus == bus) for k in case.links)
        assert complex(row.p_gen_mw, row.q_gen_mvar) == pytest.approx(made, abs=1e-9)
        assert complex(row.p_load_mw, row.q_load_mvar) == pytest.approx(drawn, abs=1e-9)


def test_where_the_stored_voltages_lead_nowhere_the_start_is_flat():
    """Every island at the angle of its own swing bus."""
    case = mixed()
    far = replace(case, buses=tuple(b._replace(v=0.01, angle=150.0) if b.kind == "pq" else b for b in case.buses))
    found, wanted = powerflow.solve(far), powerflow.solve(case)
    assert np.abs(found.V - wanted.V).max() < 1e-9


@pytest.mark.parametrize("name", PACKAGED)
@pytest.mark.parametrize("phase", [0.0, 30.0, -150.0])
def test_an_unloaded_bus_behind_a_transformer_changes_no_voltage(cases, name, phase):
    """Its own V = 0 fulfils S = V I* = 0, and a start at an angle far from its neighbor's leads there."""
    case = cases(name)
    wanted = powerflow.solve(case).V
    for at in case.buses[::7]:
        bus, branch = Bus(9999, "pq"), Branch(at.bus, 9999, 0.0, 0.1, 0.0, 1.0, phase)
        found = powerflow.solve(replace(case, buses=(*case.buses, bus), branches=(*case.branches, branch))).V
        assert np.abs(found[:-1] - wanted).max() < 1e-8


@pytest.mark.parametrize("seed", range(40))
def test_in_a_tree_neither_phase_shifts_nor_the_angle_of_the_swing_bus_change_a_voltage(seed):
    """With them, solutions at 0.02 to 0.4 pu are near the start that a bus table without angles gives."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 9))
    ends = [(int(rng.integers(1, k)), k) for k in range(2, n + 1)]
    data = [(rng.uniform(0, 0.02), rng.uniform(0.02, 0.1), rng.uniform(0, 0.05)) for _ in ends]
    loads = tuple(Load(k, rng.uniform(0, 25), rng.uniform(-5, 8)) for k in range(2, n + 1) if rng.random() < 0.8)

    def size(angle, phases):
        buses = (Bus(1, "swing", 1.02, angle), *(Bus(k, "pq") for k in range(2, n + 1)))
        branches = tuple(Branch(*e, *z, 1.0, phase) for e, z, phase in zip(ends, data, phases, strict=True))
        case = Case("tree", buses, branches, (Machine(1, 1, 200, 0, 1),), {"gencls": {1: CLASSICAL}}, loads)
        return np.abs(powerflow.solve(case).V)

    wanted = size(0.0, [0.0] * len(ends))
    assert wanted.min() > 0.8
    for angle in (0.0, 70.0, 180.0):
        for phases in ([0.0] * len(ends), rng.choice([-150, -30, 0, 30, 150], len(ends))):
            assert size(angle, phases) == pytest.approx(wanted, abs=1e-9)


def test_taps_phase_shifts_shunts_and_links_stand_where_the_format_says():
    case = replace(
        small({"gencls": CLASSICAL}),
        buses=(Bus(1, "pv", 1.02), Bus(2, "pq", g=10.0, b=-20.0), Bus(3, "swing")),
        branches=(Branch(1, 2, 0.001, 0.02, 0.1, 1.05, 3.0), Branch(3, 2, 0.005, 0.05, 0.1, 0.97, -2.0)),
        links=(Link("dc", 3, 2, 50.0, 2.0),),
    )
    assert np.abs(network.admittance(network.build(case)).toarray() - written_out(case)).max() < 1e-12
    assert np.abs(balance(case, powerflow.solve(case))).max() < 1e-9


def test_no_solution_names_case_bus_mismatch_and_remedy():
    case = replace(small({"gencls": CLASSICAL}), loads=(Load(2, 9000.0, 0.0),))
    with pytest.raises(
        PowerFlowError,
        match=r"^The power flow of small did not converge in .* MVA at bus [123], .* at bus [123]; ",
    ):
        powerflow.solve(case)


@pytest.mark.parametrize("bus", [27, 15, 20])
def test_the_bus_it_names_is_the_overloaded_one(cases, bus):
    case = cases("ieee39")
    loads = tuple(load._replace(p=8000.0) if load.bus == bus else load for load in case.loads)
    with pytest.raises(PowerFlowError) as caught:
        powerflow.solve(replace(case, loads=loads))
    assert f" MVA at bus {bus}, " in str(caught.value)


def test_one_bus_needs_no_iteration():
    case = Case(
        "one",
        (Bus(1, "swing"),),
        (),
        (Machine(1, 1, 100.0, 0.0, 1),),
        {"gencls": {1: CLASSICAL}},
        (Load(1, 50.0, 10.0),),
    )
    flow = powerflow.solve(case)
    assert flow.iterations == 0
    assert flow.S[0] == pytest.approx(0.5 + 0.1j, abs=1e-12)


@pytest.mark.parametrize("name", ["two_area", "ieee39", "wnaps"])
@pytest.mark.parametrize("base", [0.01, 1e4])
def test_the_system_base_does_not_matter(cases, name, base):
    flow, other = powerflow.solve(cases(name)), powerflow.solve(rebased(cases(name), base))
    assert other.iterations == flow.iterations
    assert np.abs(other.V - flow.V).max() < 1e-12  # 2e-13
    power = np.abs(flow.S).max()
    assert np.abs(other.S * base / 100 - flow.S).max() < 1e-12 * power  # 3e-13


def test_numbers_and_order_of_buses_do_not_matter(cases):
    case = cases("ieee39")
    number = {b.bus: 1000 - b.bus for b in case.buses}
    moved = replace(
        case,
        buses=tuple(b._replace(bus=number[b.bus]) for b in reversed(case.buses)),
        branches=tuple(k._replace(from_bus=number[k.from_bus], to_bus=number[k.to_bus]) for k in case.branches),
        machines=tuple(m._replace(bus=number[m.bus], storage_bus=number[m.storage_bus]) for m in case.machines),
        loads=tuple(load._replace(bus=number[load.bus]) for load in reversed(case.loads)),
    )
    flow, other = powerflow.solve(case), powerflow.solve(moved)
    assert np.abs(other.V[::-1] - flow.V).max() < 1e-12  # 1e-14
    assert np.abs(other.S - flow.S).max() < 1e-10  # 1e-12


def test_the_bus_with_the_largest_mismatch_is_named_and_not_a_pv_bus_with_free_reactive_power(cases):
    case = cases("two_area")
    small_loads = replace(case, loads=tuple(load._replace(p=0.01, q=0.0) for load in case.loads))
    with pytest.raises(PowerFlowError, match=r"the largest mismatch is \d+(\.\d+)? MVA at bus 7, "):
        powerflow.solve(small_loads)


def test_a_power_flow_prints_itself_and_has_tables(cases):
    case = cases("two_area")
    flow = powerflow.solve(case)
    assert repr(flow) == str(flow)
    assert str(flow).startswith("power flow of two_area: ")
    assert list(flow.df.index) == [b.bus for b in case.buses]
    assert flow.df.v_pu.to_numpy() == pytest.approx(np.abs(flow.V))
    assert flow.df.p_gen_mw.sum() == pytest.approx(flow.S.real.sum() * 100)
    assert flow.df.p_load_mw[7] == 967
    assert list(flow.branches.index[:3]) == ["1-5", "2-6", "3-11"]
    assert {"7-8", "7-8#2"} <= set(flow.branches.index)
    assert flow.branches.loss_mw.sum() == pytest.approx(flow.df.p_gen_mw.sum() - flow.df.p_load_mw.sum())
    assert "<table" in flow._repr_html_()
    named = replace(flow.case, name="<i>two</i>")
    for result in (named.power_flow(), named.simulate(None, until="0.1s")):
        assert "&lt;i&gt;two&lt;/i&gt;" in result._repr_html_()
    assert case.power_flow().V == pytest.approx(flow.V)


@pytest.mark.parametrize(("tap", "phase"), [(1.0, 0.0), (1.05, 0.0), (1.0, 8.0), (0.95, -12.0)])
def test_the_flow_through_a_phase_shifter_is_that_of_its_equation(tap, phase):
    """P = V1 V2 sin(d1 - d2 - phase)/(t x), Q = (V1/t)^2/x - V1 V2 cos(...)/(t x), and nothing is lost."""
    x, base = 0.1, small({"gencls": CLASSICAL})
    case = replace(base, branches=(Branch(1, 2, 0.0, x, 0.0, tap, phase), *base.branches[1:]))
    flow = powerflow.solve(case)
    (V1, V2), (sent, received) = flow.V[:2], flow.branch_power[0]
    size, angle = abs(V1) * abs(V2) / (tap * x), np.angle(V1) - np.angle(V2) - np.deg2rad(phase)
    assert sent.real == pytest.approx(size * np.sin(angle), abs=1e-12)
    assert sent.imag == pytest.approx(abs(V1 / tap) ** 2 / x - size * np.cos(angle), abs=1e-12)
    assert received.real == pytest.approx(-sent.real, abs=1e-12)
    assert received.imag == pytest.approx(abs(V2) ** 2 / x - size * np.cos(angle), abs=1e-12)
    row = flow.branches.iloc[0]
    assert (row.p_from_mw, row.q_from_mvar) == pytest.approx((300.0, 100 * sent.imag), abs=1e-6)  # all of machine 1's
    assert (row.p_to_mw, row.q_to_mvar, row.loss_mw) == pytest.approx((-300.0, 100 * received.imag, 0.0), abs=1e-6)


def test_a_phase_shifter_moves_power_from_one_of_two_parallel_circuits_to_the_other():
    """The from side leads by the shift, so that its circuit carries less: V^2 phi/2x in a loop of two reactances x."""
    base = small({"gencls": CLASSICAL})
    first, *others = base.branches
    twins = [k._replace(r=0.0, b=0.0) for k in others]
    even, moved = (
        powerflow.solve(replace(base, branches=(first, twins[0]._replace(phase=phase), twins[1])))
        for phase in (0.0, 1.0)
    )
    change = (moved.branches.p_from_mw - even.branches.p_from_mw).to_numpy()
    around = 100 * abs(even.V[1]) * np.deg2rad(1.0) / (2 * twins[0].x)
    assert change[0] == pytest.approx(0, abs=1e-6)
    assert change[1:] == pytest.approx([-around, around], rel=0.01)  # 0.002
