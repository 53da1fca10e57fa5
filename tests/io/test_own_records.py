"""Records of a DYR file that a registered device says it reads, also after other files were read."""

from pathlib import Path

import pytest
from systems import registered

import stabctl as st
from stabctl._util.errors import CaseError

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"
REACTOR = '''
from typing import Annotated, NamedTuple
from stabctl._util.jit import inline

NAME = "reactor"
ROLE = "shunt"
DYR = {"REACT1": "G B"}


class Par(NamedTuple):
    """Constants."""

    G: Annotated[float, "pu", "conductance"]
    B: Annotated[float, "pu", "susceptance"]


@inline
def current(v, p):
    """Injected current (pu)."""
    return p.B * v[1] - p.G * v[0], -p.B * v[0] - p.G * v[1]
'''


def test_a_shunt_of_ones_own_stands_at_the_bus_of_its_record(tmp_path):
    st.load(EXAMPLES / "three.raw")
    (tmp_path / "three.raw").write_text((EXAMPLES / "three.raw").read_text())
    dyr = (EXAMPLES / "three.dyr").read_text()
    (tmp_path / "reactor.py").write_text(REACTOR)
    (tmp_path / "three.dyr").write_text(f"{dyr}\n102 'REACT1' 1 0.02 0.3 /\n")
    with registered(tmp_path / "reactor.py"):
        par = st.load(tmp_path / "three.raw").devices["reactor"][102]
        assert (par.G, par.B) == (0.02, 0.3)
        (tmp_path / "three.dyr").write_text(f"{dyr}\n999 'REACT1' 1 0.02 0.3 /\n")
        with pytest.raises(CaseError, match="there is no bus 999"):
            st.load(tmp_path / "three.raw")
    (tmp_path / "three.dyr").write_text(f"{dyr}\n102 'REACT1' 1 0.02 0.3 /\n")
    with pytest.raises(CaseError, match="no model for REACT1 of 102/1"):
        st.load(tmp_path / "three.raw")
