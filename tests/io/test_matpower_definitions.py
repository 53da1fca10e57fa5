"""A MATPOWER file against the definitions of its manual (appendix B): no two numbers are equal, base 85 MVA, 50 Hz."""

import numpy as np
import pytest

import stabctl as st
from stabctl.io.matpower import to_case
from stabctl.model import network, powerflow

TEXT = """function mpc = unequal
mpc.version = '2';
mpc.baseMVA = 85;
mpc.bus = [
	11	3	3.1	1.3	0	0	4	1.031	-2	132	8	1.1	0.9;
	12	1	21.7	8.3	1.7	6.9	5	1.012	-4.5	66	9	1.11	0.91;
	13	2	5.9	-2.2	0	0	6	1.024	-3.7	33	10	1.12	0.92;
	14	1	0	0	0	0	7	0.987	-6.1	21	12	1.13	0.93;
];
mpc.gen = [
	11	41.3	12.7	55	-35	1.043	120	1	77	3;
	13	7.9	4.4	31	-18	1.027	47	1	44	5;
	13	9.3	2.6	33	-17	1.019	0	1	43	6;
	12	-6.6	-1.4	0.2	-3	1.051	39	1	0	-9;
	13	8.8	5.1	35	-16	1.061	71	0	45	7;
];
mpc.branch = [
	11	12	0.013	0.087	0.031	55	66	77	0	0	1;
	12	13	0.017	0.143	0.043	56	67	78	1.043	-7	1;
	13	14	0.023	0.211	0.057	57	68	79	0.961	5	1;
	14	11	0.029	0.171	0.061	58	69	80	0	0	1;
	12	14	0.019	0.131	0.037	59	70	81	0	0	0;
];
mpc.dcline = [
	12	14	1	15.3	14.1	2.7	-3.9	1.02	0.99	1	20	-5	6	-7	8	0.37	0.023;
	13	11	0	25.3	24.1	3.7	-4.9	1.03	0.98	2	21	-4	5	-6	7	0.47	0.033;
];
"""


@pytest.fixture
def case(tmp_path):
    (tmp_path / "unequal.m").write_text(TEXT)
    return st.load(tmp_path / "unequal.m", frequency="50Hz")


def test_branches(case):
    """Manual, eq. 3.2: the tap and the shift are at the from bus, half of the charging at each end."""
    Y = np.zeros((4, 4), complex)
    for i, j, z, b, tap, shift in (
        (0, 1, 0.013 + 0.087j, 0.031, 1, 0),
        (1, 2, 0.017 + 0.143j, 0.043, 1.043, -7),
        (2, 3, 0.023 + 0.211j, 0.057, 0.961, 5),
        (3, 0, 0.029 + 0.171j, 0.061, 1, 0),
    ):
        t, y = tap * np.exp(1j * np.deg2rad(shift)), 1 / z
        Y[i, i] += (y + 0.5j * b) / tap**2
        Y[j, j] += y + 0.5j * b
        Y[i, j] -= y / t.conj()
        Y[j, i] -= y / t
    Y[1, 1] += (1.7 + 6.9j) / 85  # GS is consumed and BS injected, MW and Mvar at 1 pu
    assert network.admittance(network.build(case)).toarray() == pytest.approx(Y, rel=1e-12)


def test_buses_and_machines(case):
    """The last generator in service at a bus holds its voltage; one without MBASE is on baseMVA."""
    assert (case.base_mva, case.frequency_hz) == (85, 50)
    assert [(b.bus, b.kind, b.v, b.angle, b.rated, b.area, b.zone) for b in case.buses] == [
        (11, "swing", 1.043, -2, 132, 4, 8),
        (12, "pq", 1.012, -4.5, 66, 5, 9),
        (13, "pv", 1.019, -3.7, 33, 6, 10),
        (14, "pq", 0.987, -6.1, 21, 7, 12),
    ]
    assert [(m.name, m.bus, m.base, m.p, m.q) for m in case.machines] == [
        ("11/1", 11, 120, 41.3, 12.7),
        ("13/1", 13, 47, 7.9, 4.4),
        ("13/2", 13, 85, 9.3, 2.6),
    ]


def test_what_buses_draw(case):
    """PF is drawn at the from bus, PF less its losses delivered at the to bus; QF and QT are injected there."""
    delivered = 15.3 - (0.37 + 0.023 * 15.3)
    drawn = [3.1 + 1.3j, 21.7 + 8.3j + 15.3 - 2.7j + 6.6 + 1.4j, 5.9 - 2.2j, -delivered + 3.9j]
    assert powerflow.demand(case) * 85 == pytest.approx(np.array(drawn), rel=1e-12)


def test_kinds_and_ratings_of_generators(tmp_path):
    """By fuel, then by type; a rating left at baseMVA is that of PMAX at the usual power factor, 0.85."""
    text = TEXT.replace("47	1	44", "85	1	44")
    fuels, types = ("ng", "hydro", "ng", "coal", "ng"), ("GT", "HY", "CA", "ST", "CT")
    text += "".join(
        f"mpc.{n} = {{ {'; '.join(map(repr, v))} }};\n" for n, v in (("genfuel", fuels), ("gentype", types))
    )
    (tmp_path / "unequal.m").write_text(text)
    found = list(to_case.read(tmp_path / "unequal.m").known.values())
    assert [k.kind for k in found] == ["gas", "hydro", "steam"]
    assert [k.mva for k in found] == pytest.approx([120.0, 44 / 0.85, 43 / 0.85])
    (tmp_path / "fuel.m").write_text(text[: text.index("mpc.gentype")])
    assert [k.kind for k in to_case.read(tmp_path / "fuel.m").known.values()] == ["gas", "hydro", "gas"]
