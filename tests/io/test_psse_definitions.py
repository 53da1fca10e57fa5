"""A RAW file against PSS/E's definitions: no two numbers are equal, no base is a default, 50 Hz."""

import re
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest

import stabctl as st
from stabctl.io._lexer import Place
from stabctl.io.psse import dyr
from stabctl.model import network, powerflow

BASE = 85.0
KV = {11: 132.0, 12: 66.0, 13: 33.0, 14: 21.0}
VOLTAGE = {11: (1.031, -2.0), 12: (1.012, -4.5), 13: (1.024, -3.7), 14: (0.987, -6.1)}
GENERATOR = "11,'1', 41.3, 12.7, 55.0, -35.0, 1.043, 0,{node} 120.0, 0.004, 0.21, 0.0, 0.0, 1.0, 1, 77.0, 99.0, 3.0"
BEHIND = "13,'A', 23.5, 6.4, 31.0, -18.0, 1.024, 0,{node} 47.0, 0.006, 0.27, 0.009, 0.13, 1.06, 1, 88.0, 44.0, 5.0"
LINE = "11,-12,'1', 0.013, 0.087, 0.031,{rates} 0.002, 0.005, 0.003, 0.007, {status}, 2, 17.0"
_BEGIN = ("bus", "load", "shunt", "generator", "branch", "transformer", "area", "dc", "vsc")
_END = ("impedance", "multiterminal", "section", "zone", "transfer", "owner", "facts")
ORDER = *_BEGIN, *_END, "switched_shunt", "gne", "induction"


def raw(folder, version=33, base=BASE, hertz=50.0, **sections):
    """A file with buses 11 to 14 and, unless another is given, a machine at bus 11; each section is a list of lines."""
    bus = []
    for k, (number, kv) in enumerate(KV.items()):
        (vm, va), labels = VOLTAGE[number], f"{4 + k}, {8 + k}, {15 + k}"
        kind = {11: 3, 13: 2}.get(number, 1)
        shunt, (area, zone, owner) = (
            ("1.7, 6.9" if number == 12 and "shunt" in sections else "0, 0"),
            labels.split(", "),
        )
        old = f"{number},'B{number}', {kv}, {kind}, {shunt}, {area}, {zone}, {vm}, {va}, {owner}"
        new = f"{number},'B{number}', {kv}, {kind}, {labels}, {vm}, {va}, 1.1, 0.9, 1.12, 0.88"
        bus.append(old if version < 31 else new)
    sections = {"bus": bus, "generator": [GENERATOR.format(node=" 0," * (version >= 35))]} | sections
    order = [s for s in ORDER if version > 30 or s not in ("shunt", "gne", "induction")]
    if version < 31:
        order.remove("switched_shunt")
        order.insert(order.index("vsc") + 1, "switched_shunt")
    if version >= 34:
        order.insert(order.index("transformer"), "switch")
    lines = [f"0, {base}, {version}, 0, 1, {hertz} / a test", "first", "second"]
    lines += ["GENERAL, THRSHZ=0.0001", "0 / END OF SYSTEM"] if version >= 34 else []
    for section in order:
        lines += [*sections.get(section, ()), f"0 / END OF {section}"]
    (folder / "x.raw").write_text("\n".join([*lines, "Q", ""]))
    return st.load(folder / "x.raw")


def admittance(case):
    return network.admittance(network.build(case)).toarray()


def seen(Y, at, shorted=()):
    """Admittance into bus `at` (row) with others shorted to ground and the rest open."""
    rest = [k for k in range(len(Y)) if k != at and k not in shorted]
    return Y[at, at] - Y[at, rest] @ np.linalg.lstsq(Y[np.ix_(rest, rest)], Y[rest, at], rcond=None)[0]


def open_voltages(Y, at):
    """Voltages of all buses with 1 pu at one and no other current."""
    rest = [k for k in range(len(Y)) if k != at]
    V = np.ones(len(Y), complex)
    V[rest] = -np.linalg.solve(Y[np.ix_(rest, rest)], Y[rest, at])
    return V


RATED = {1: (137.5, 31.0, 17.0), 2: (64.0, 97.0, 0.0), 3: (34.5, 52.0, -11.0)}  # NOMV kV, MVA, degrees of each winding
PAIRS = {(1, 2): (0.011, 0.097, 31.0), (2, 3): (0.017, 0.143, 52.0), (3, 1): (0.023, 0.211, 97.0)}  # R, X pu, MVA
TURNS = 1.043, 0.972, 1.021


def ratio(cw, k, buses):
    """What is written, and the turns ratio of winding k in pu of its bus."""
    kv, nominal, t = KV[buses[k]], RATED[k + 1][0], TURNS[k]
    return {1: (t, t), 2: (t * kv, t), 3: (t, t * nominal / kv)}[cw]


def impedance(cz, pair):
    """What is written of a pair of windings, and the impedance in pu on the system base."""
    r, x, mva = PAIRS[pair]
    if cz == 1:
        return (r, x, mva), complex(r, x)
    if cz == 2:
        return (r, x, mva), complex(r, x) * BASE / mva
    return (r * mva * 1e6, abs(complex(r, x)), mva), complex(r, x) * BASE / mva


def windings(version, cw, buses):
    """Lines of the windings."""
    rates, node = ", ".join(["55.0"] * (12 if version >= 34 else 3)), " 0," * (version >= 35)
    rest = f"{rates}, 0, 0,{node} 1.1, 0.9, 1.1, 0.9, 33, 0, 0.0, 0.0"
    return [f"{ratio(cw, k, buses)[0]}, {RATED[k + 1][0]}, {RATED[k + 1][2]}, {rest}" for k in range(len(buses))]


def transformer(version=33, cw=1, cz=1, cm=1, mag=(0.0, 0.0), status=1, buses=(11, 12, 13)):
    """Lines of a transformer with a winding at each of the buses."""
    three = len(buses) == 3
    pairs = [v for pair in list(PAIRS)[: 3 if three else 1] for v in impedance(cz, pair)[0]]
    ends = ", ".join(map(str, [*buses, *([] if three else [0])]))
    first = f"{ends}, '1', {cw}, {cz}, {cm}, {mag[0]}, {mag[1]}, 2, 'T', {status}, 1, 1.0"
    lines = windings(version, cw, buses)
    if not three:
        lines[1] = ", ".join(lines[1].split(", ")[:2])
    return [first, ", ".join(map(repr, pairs)) + (", 1.009, -3.3" if three else ""), *lines]


@pytest.mark.parametrize("version", [30, 33, 34, 35])
@pytest.mark.parametrize(("cw", "cz"), [(1, 1), (2, 2), (3, 3)])
def test_three_windings_have_the_impedances_of_their_pairs(tmp_path, version, cw, cz):
    """Fed at one winding with another shorted and the third open, it shows the impedance of the two."""
    case = raw(tmp_path, version, transformer=transformer(version, cw, cz))
    Y, t = admittance(case), [ratio(cw, k, (11, 12, 13))[1] for k in range(3)]
    Y = np.delete(np.delete(Y, 3, 0), 3, 1) if len(Y) == 5 else Y  # bus 14 is not connected
    for i, j in permutations(range(3), 2):
        z = impedance(cz, next(p for p in PAIRS if set(p) == {i + 1, j + 1}))[1]
        assert 1 / seen(Y, i, [j]) == pytest.approx(z * t[i] ** 2, rel=1e-9)
    V = open_voltages(Y, 0)
    turned = [t[k] * np.exp(1j * np.deg2rad(RATED[k + 1][2])) for k in range(3)]
    assert V[:3] == pytest.approx(np.array(turned) / turned[0], rel=1e-9)


@pytest.mark.parametrize("version", [30, 33, 34, 35])
@pytest.mark.parametrize(("cw", "cz"), [(1, 2), (2, 3), (3, 1)])
def test_two_windings_have_their_impedance_and_ratio(tmp_path, version, cw, cz):
    case = raw(tmp_path, version, transformer=transformer(version, cw, cz, buses=(11, 12)))
    Y, (one, two) = admittance(case), (ratio(cw, k, (11, 12))[1] for k in range(2))
    z = impedance(cz, (1, 2))[1]
    assert 1 / seen(Y, 0, [1]) == pytest.approx(z * one**2, rel=1e-9)
    assert 1 / seen(Y, 1, [0]) == pytest.approx(z * two**2, rel=1e-9)
    assert open_voltages(Y, 0)[1] == pytest.approx(two / one * np.exp(-1j * np.deg2rad(17.0)), rel=1e-9)


@pytest.mark.parametrize("buses", [(11, 12), (11, 12, 13)])
def test_magnetizing_admittance(tmp_path, buses):
    """CM = 1: pu on the system base; CM = 2: loss (W) and current (pu of SBASE1-2) at the rated voltage NOMV1."""
    case = raw(tmp_path, transformer=transformer(cm=1, mag=(0.0013, -0.0171), buses=buses))
    assert seen(admittance(case), 0) == pytest.approx(0.0013 - 0.0171j, rel=1e-9)
    case = raw(tmp_path, transformer=transformer(cm=2, mag=(57e3, 0.0127), buses=buses))
    y = seen(admittance(case), 0) * BASE * (137.5 / 132.0) ** 2  # MVA at 137.5 kV
    assert y.real == pytest.approx(0.057, rel=1e-9)
    assert abs(y) == pytest.approx(0.0127 * 31.0, rel=1e-9)
    assert y.imag < 0


@pytest.mark.parametrize(
    ("status", "left"), [(1, {11, 12, 13}), (2, {11, 13}), (3, {11, 12}), (4, {12, 13}), (0, set())]
)
def test_windings_out_of_service(tmp_path, status, left):
    """Status 2, 3 and 4: winding two, three and one is open."""
    lines = [
        LINE.format(rates=" 55.0, 66.0, 77.0,", status=1),
        LINE.format(rates=" 0, 0, 0,", status=1).replace("-12", "13"),
    ]
    case = raw(tmp_path, branch=lines, transformer=transformer(status=status))
    star = {b.bus for b in case.buses} - set(KV)
    assert {k.from_bus for k in case.branches if k.to_bus in star} == left


def lines_of(version, status=1):
    rates = " 'L'," + " 55.0," * 12 if version >= 34 else " 55.0, 66.0, 77.0,"
    return LINE.format(rates=rates, status=status)


@pytest.mark.parametrize("version", [30, 33, 34, 35])
def test_lines_shunts_and_buses(tmp_path, version):
    """A line's own shunts are at their ends; shunts are MW and Mvar at 1 pu."""
    head, tail = "12, 1, 1.1, 0.9, 0, 100.0, 'X', 4.6, 1, 4.6", "12, 1, 0, 1, 1.1, 0.9, 0, 100.0, 'X', 4.6, 1, 4.6"
    new = "12, 'S', 1, 0, 1, 1.1, 0.9, 0, 0, 100.0, 'X', 4.6, 1, 1, 4.6"
    case = raw(
        tmp_path,
        version,
        branch=[lines_of(version), lines_of(version, status=0).replace("'1'", "'2'")],
        shunt=["12, 'S', 1, 1.7, 6.9", "12, 'T', 0, 2.9, 3.7"],
        switched_shunt=[head if version < 32 else tail if version < 35 else new],
    )
    y, ends = 1 / (0.013 + 0.087j), (0.002 + 0.005j, 0.003 + 0.007j)
    expected = [[y + 0.0155j + ends[0], -y], [-y, y + 0.0155j + ends[1] + (1.7 + (6.9 + 4.6) * 1j) / BASE]]
    assert admittance(case) == pytest.approx(np.array(expected), rel=1e-12)
    assert (case.base_mva, case.frequency_hz, case.title) == (85.0, 50.0, "first second")
    assert [(b.bus, b.name, b.rated, b.area, b.zone, b.owner) for b in case.buses] == [
        (11, "B11", 132.0, 4, 8, 15),
        (12, "B12", 66.0, 5, 9, 16),
    ]
    assert [(b.kind, b.v, b.angle) for b in case.buses] == [("swing", 1.043, -2.0), ("pq", 1.012, -4.5)]
    (machine,) = case.machines
    assert machine[:6] == (11, 11, 120.0, 41.3, 11, 12.7)


def test_a_switch_is_a_branch(tmp_path):
    case = raw(tmp_path, 34, switch=["11, 12, '@1', 0.0023, " + "55.0, " * 12 + "1, 1, 2, 'S'"])
    assert [(k.from_bus, k.to_bus, k.circuit, k.r, k.x) for k in case.branches] == [(11, 12, "@1", 0.0, 0.0023)]


@pytest.mark.parametrize("version", [33, 34])
def test_loads(tmp_path, version):
    """Constant power, current and admittance at 1 pu, YQ negative for an inductive load; v34: less its generation."""
    own = ", 1, 0, 2.6, 0.8, 1" * (version >= 34)
    load = ["12, 'X', 1, 5, 6, 21.7, 8.3, 3.1, 1.9, 2.3, -1.1, 7" + own, "12, 'Y', 0, 1, 1, 99.0, 9.0, 0, 0, 0, 0, 1"]
    case = raw(tmp_path, version, branch=[lines_of(version)], load=load)
    v, p, q = 1.012, (21.7, 19.1)[version >= 34], (8.3, 7.5)[version >= 34]
    drawn = p + 1j * q + (3.1 + 1.9j) * v + (2.3 + 1.1j) * v**2
    V = np.array([1.043, v])
    assert powerflow.demand(case, V)[1] * BASE == pytest.approx(drawn, rel=1e-12)


@pytest.mark.parametrize("version", [33, 35])
def test_a_step_up_transformer_delivers_what_the_file_says(tmp_path, version):
    """RT + jXT on MBASE from the terminal to the bus, where PG and QG arrive; GTAP on the side of the bus."""
    machines = [g.format(node=" 0," * (version >= 35)) for g in (GENERATOR, BEHIND)]
    case = raw(tmp_path, version, branch=[lines_of(version).replace("-12", "13")], generator=machines)
    z, V = (0.009 + 0.13j) * 85.0 / 47.0, 1.024 * np.exp(-1j * np.deg2rad(3.7))
    current = np.conj((23.5 + 6.4j) / 85.0 / V)  # into bus 13
    inside = current * 1.06
    terminal = V / 1.06 + z * inside
    delivered = 85.0 * terminal * np.conj(inside)
    machine, bus = case.machines[1], case.buses[2]
    assert machine.p + 1j * machine.q == pytest.approx(delivered, rel=1e-12)
    assert (machine.name, machine.base, machine.bus) == ("13/A", 47.0, bus.bus)
    assert bus.v * np.exp(1j * np.deg2rad(bus.angle)) == pytest.approx(terminal, rel=1e-12)
    Y = admittance(case)
    assert Y[1, 2] * terminal + (Y[1, 1] + Y[0, 1]) * V == pytest.approx(
        V / z / 1.06**2 - terminal / z / 1.06 + V * (0.0155j + 0.003 + 0.007j), rel=1e-9
    )


RECTIFIER = "12, 2, 30.0, 5.0, 0.7, 9.1, 61.0, 0.93, 1.04, 1.5, 0.51, 0.00625, 0, 0, 0, '1', 0.0"
INVERTER = "14, 3, 25.0, 15.0, 0.5, 8.2, 23.0, 1.71, 0.97, 1.5, 0.51, 0.00625, 0, 0, 0, '1', 0.0"


@pytest.mark.parametrize(("mode", "setpoint"), [(1, 63.0), (1, -63.0), (2, 411.0)])
def test_a_dc_line_holds_its_set_point_at_the_right_end(tmp_path, mode, setpoint):
    """SETVL > 0 is the power of the rectifier, < 0 of the inverter; or A. VSCHD is the inverter's voltage + RCOMP I."""
    dc = [f"'D', {mode}, 7.3, {setpoint}, 141.0, 0.0, 2.9, 0.1, 'I', 0.0, 20, 1.0", RECTIFIER, INVERTER]
    lines = [lines_of(33), lines_of(33).replace("-12", "14").replace("0.087", "0.111")]
    case = raw(tmp_path, branch=lines, dc=dc)
    sent, received = {load.bus: load for load in case.loads}[12], {load.bus: load for load in case.loads}[14]
    commutating = 2 * 2 * 0.7, 2 * 3 * 0.5  # ohm
    current = np.sqrt((sent.p + received.p) / (7.3 + sum(commutating)))  # kA
    of_line = [load.p - R * current**2 for load, R in zip((sent, received), commutating, strict=True)]
    given = {(1, 63.0): of_line[0], (1, -63.0): of_line[1], (2, 411.0): 1e3 * current}
    assert given[mode, setpoint] == pytest.approx(setpoint)
    at_inverter = -of_line[1] / current
    assert at_inverter + 2.9 * current == pytest.approx(141.0)
    for load, ideal in ((sent, 2 * 61.0 * 1.012 * 0.93 / 1.04), (received, 3 * 23.0 * 0.987 * 1.71 / 0.97)):
        factor = abs(load.p) / current / (3 * np.sqrt(2) / np.pi * ideal)
        assert 0 < factor < 1
        assert load.q == pytest.approx(abs(load.p) * np.sqrt(1 / factor**2 - 1))
        assert (load.kind, load.p_power, load.q_power) == ("hvdc", 1.0, 1.0)


def test_machines_at_one_bus(tmp_path):
    """The first holds the voltage; one without MBASE is on SBASE."""
    first = GENERATOR.format(node="").replace(" 120.0,", " 0,")
    second = BEHIND.format(node="").replace("13,'A'", "11,'B'").replace("0.009, 0.13, 1.06", "0, 0, 1")
    out = BEHIND.format(node="").replace("13,'A'", "11,'C'").replace("1.06, 1,", "1.06, 0,")
    case = raw(tmp_path, branch=[lines_of(33)], generator=[first, second, out])
    assert [(m.name, m.base, m.p, m.q) for m in case.machines] == [
        ("11/1", 85.0, 41.3, 12.7),
        ("11/B", 47.0, 23.5, 6.4),
    ]
    assert case.buses[0].v == 1.043


def test_fields_that_are_left_out_have_the_defaults_of_the_manual(tmp_path):
    case = raw(
        tmp_path,
        bus=["11,,132,3", "12,,,,,,,0.98", "13", "14,,,4"],
        load=["12", "13,,,,,5.3"],
        shunt=["12,,,2.3", "13,,0,3.1"],
        generator=["11"],
        branch=["11,12,,,0.087", "12,13,'2',0.013,0.07,0.04", "11,13,,,0.3,,,,,,,,,0"],
        transformer=["11,13", "0.013,0.143,31", ",", ","],
    )
    assert [(b.kind, b.v, b.angle, b.g, b.rated, b.area, b.zone, b.owner) for b in case.buses] == [
        ("swing", 1.0, 0.0, 0.0, 132.0, 1, 1, 1),
        ("pq", 0.98, 0.0, 2.3, 0.0, 1, 1, 1),
        ("pq", 1.0, 0.0, 0.0, 0.0, 1, 1, 1),
    ]
    assert not any("bus 12" in note for note in case.notes), "IDE = 1: not a bus that has lost its machine"
    assert [(load.bus, load.p, load.q, load.id) for load in case.loads] == [(13, 5.3, 0.0, "1")]
    assert [m[:7] for m in case.machines] == [(11, 11, 85.0, 0.0, 11, 0.0, "11/1")]
    assert [(k.from_bus, k.to_bus, k.circuit, k.r, k.x, k.b, k.tap, k.phase) for k in case.branches] == [
        (11, 12, "1", 0.0, 0.087, 0.0, 1.0, 0.0),
        (12, 13, "2", 0.013, 0.07, 0.04, 1.0, 0.0),
        (11, 13, "1", 0.013, 0.143, 0.0, 1.0, 0.0),
    ]


def test_the_source_of_a_machine_is_that_of_the_raw_file(tmp_path):
    """ZR + jZX on MBASE, 0 + j1 if left out, is the impedance of a classical machine; GENROU has its own reactances."""
    raw(tmp_path, generator=[GENERATOR.format(node=""), "12,'B', 23.5"], branch=[lines_of(33)])
    records = "11 'GENCLS' 1 5.3 0.7 / 12 'GENCLS' B 3.1 0.2 /"
    (tmp_path / "x.dyr").write_text(records)
    rows = st.load(tmp_path / "x.raw", dyr=tmp_path / "x.dyr").devices["gencls"]
    assert {m: (p.H, p.D, p.ra, p.x1d) for m, p in rows.items()} == {
        11: (5.3, 0.7, 0.004, 0.21),
        12: (3.1, 0.2, 0.0, 1.0),
    }


def test_a_step_up_transformer_without_a_ratio(tmp_path):
    case = raw(tmp_path, generator=["11,'1', 41.3, 12.7, 55, -35, 1.043, 0, 120, 0.004, 0.21, 0.007, 0.11"])
    assert [(k.tap, k.r, k.x) for k in case.branches] == [
        (1.0, pytest.approx(0.007 * 85 / 120), pytest.approx(0.11 * 85 / 120))
    ]


def test_correction_tables_are_told(tmp_path):
    """TAB of a winding, whatever is before it in the version."""
    for version in (30, 33, 34, 35):
        lines = transformer(version)
        assert not any("impedance correction" in note for note in raw(tmp_path, version, transformer=lines).notes)
        lines[3] = lines[3].replace(" 33, 0, 0.0", " 33, 7, 0.0")
        notes = [
            note for note in raw(tmp_path, version, transformer=lines).notes if "impedance correction table 7" in note
        ]
        assert len(notes) == 1


@pytest.mark.parametrize("version", [30, 33, 34, 35])
def test_a_correction_table_hides_nothing_behind_it(tmp_path, version):
    """A line of zeros, with which the table may continue, is no end of its section."""
    behind = {"facts": ["'F', 12, 13, 1"]}
    table = ["7, 0.9, 1.01, 1.0, 1.0, 1.1, 0.99", "0, 0, 0", "8, 0.9, 1.01", "0.0, 0.0, 0.0"]
    alone, beside = (raw(tmp_path, version, impedance=lines, **behind) for lines in ([], table))
    told, wanted = ([re.sub(r" line \d+", "", note) for note in case.notes] for case in (beside, alone))
    assert "FACTS" in str(wanted)
    assert (beside, told) == (alone, wanted)


def test_the_star_point_begins_at_the_voltage_at_which_its_currents_sum_to_zero(tmp_path):
    case = raw(tmp_path, transformer=transformer(cw=3, cz=2))
    V = np.array([b.v * np.exp(1j * np.deg2rad(b.angle)) for b in case.buses])
    V[0] *= 1.031 / 1.043  # the star point is found before the machine's VS is read
    current = admittance(case) @ V
    assert abs(current[-1]) < 1e-12 < abs(current[0])


def test_a_record_of_a_user_written_model_is_that_of_its_model(tmp_path):
    """Name, six numbers (type, application, counts of ICONs, CONs, STATEs and VARs), then the constants."""
    (tmp_path / "x.dyr").write_text("11 'USRMDL' 'A' 'GENCLS' 1 1 0 2 4 3 5.3 0.7 /\n11 'GENCLS' 'A' 5.3 0.7 /")
    user, plain = dyr.read(tmp_path / "x.dyr")
    assert user[1:] == plain[1:] == (11, "GENCLS", "A", ("5.3", "0.7"))


def test_the_source_impedance_of_a_converter(tmp_path):
    raw(tmp_path)
    (tmp_path / "x.dyr").write_text("11 'REGCB1' 1 1 0 0.021 0.023 77 -78 9 0.017 1.3 /")
    (par,) = st.load(tmp_path / "x.raw", dyr=tmp_path / "x.dyr").devices["regc_b"].values()
    assert (par.Re, par.Xe, par.Tg, par.Tfltr, par.Te, par.Imax) == (0.004, 0.21, 0.021, 0.023, 0.017, 1.3)


def test_the_constants_of_every_record_are_in_the_order_of_the_library():
    """Kinds of loads have an ending for their scope: a bus, an owner, a zone, an area, all."""
    rows = (Path(__file__).parent / "psse_constants.txt").read_text().split("\n")
    listed = dict(row.split(" ", 1) for row in rows if row and not row.startswith("#"))
    found = {kind: order for kind, (_, order) in dyr.kinds().items()}
    scoped = {kind: f"{kind[:-2]}xx" for kind in found if f"{kind[:-2]}xx" in listed}
    assert {scoped.get(kind, kind): order for kind, order in found.items()} == listed
    for name in {kind[:-2] for kind in scoped}:
        assert {kind[-2:] for kind in scoped if kind[:-2] == name} == {"BL", "OW", "ZN", "AR", "AL"}
        assert len({found[kind] for kind in scoped if kind[:-2] == name}) == 1


@pytest.mark.parametrize(("TE", "short"), [(0.0, False), (2e-4, True), (9.99e-4, True), (1e-3, False), (0.05, False)])
def test_a_time_constant_that_is_bypassed_is_said(TE, short):
    model, order = dyr.kinds()["SEXS"]
    record = dyr.Record(Place(Path("x.dyr"), 3), 1, "SEXS", "1", ("0.1", "10.0", "100.0", str(TE), "-5.0", "5.0"))
    par, said = dyr.parameters(record, model, order, None)
    assert par.TA == TE
    assert said == [f"TA = {TE:g} s is below 1 ms, where a lag is bypassed."] * short


def test_the_new_swing_bus_is_in_the_island_of_the_old_one(tmp_path):
    """Machine 11 has no model; 13 is larger than 12, but in an island of its own."""
    numbers = zip(KV.items(), (3, 2, 3, 1), strict=True)
    bus = [f"{n},'B{n}', {kv}, {kind}, 4, 8, 15, 1.0, 0.0, 1.1, 0.9, 1.12, 0.88" for (n, kv), kind in numbers]
    generator = [
        GENERATOR.format(node="").replace("11,'1'", f"{n},'1'").replace("120.0", mva)
        for n, mva in ((11, "120.0"), (12, "60.0"), (13, "500.0"))
    ]
    ends = ((11, 12), (13, 14))
    branch = [f"{a},{b},'1', 0.01, 0.1, 0.02, 0, 0, 0, 0, 0, 0, 0, 1, 1, 0.0" for a, b in ends]
    raw(tmp_path, bus=bus, generator=generator, branch=branch)
    (tmp_path / "x.dyr").write_text("".join(f"{n} 'GENCLS' 1 4.0 0.0 /\n" for n in (12, 13)))
    case = st.load(tmp_path / "x.raw", missing="injection")
    assert [b.bus for b in case.buses if b.kind == "swing"] == [12, 13]
