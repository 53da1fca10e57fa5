"""What a step computes with grows in proportion to the buses: data and operations, not seconds."""

from collections.abc import Iterator

import numpy as np
import pytest

from stabctl.dynamics import operating_point
from stabctl.model import fleet
from stabctl.model.network import UNSWITCHED
from stabctl.model.replicate import replicate
from stabctl.simulation._buffers import buffers
from stabctl.simulation.topology import stage
from stabctl.simulation.wired import wired

COPIES = 4, 16


def sizes(name: str, record: tuple) -> Iterator[tuple[str, int]]:
    """Numbers of values in all arrays of a record, by name."""
    for field, value in zip(record._fields, record, strict=True):
        if isinstance(value, np.ndarray):
            yield f"{name}.{field}", value.size
        elif hasattr(value, "_fields"):
            yield from sizes(f"{name}.{field}", value)


def counts(point: operating_point.OperatingPoint) -> dict[str, int]:
    """Sizes of everything that a step reads and writes, and the operations of a solution of the network."""
    system, net = wired(point, None), stage(point, UNSWITCHED).net
    rows, low, up = (int(part) for part in net.factors.again)
    calls = {kind: getattr(system.program, kind) for kind in ("source", "current", "sweep")}
    return {
        **dict(sizes("net", net)),
        **dict(sizes("program", system.program)),
        **dict(sizes("places", system.places)),
        **dict(sizes("run", buffers(system.start, system.layout, system.places))),
        **{f"devices called in {kind}": int(table[:, 2].sum()) for kind, table in calls.items()},
        "iterated rows": len(net.factors.d) - rows,
        "iterated entries of L": len(net.factors.L) - low,
        "iterated entries of U": up,
    }


@pytest.mark.parametrize("name", ["two_area", "wnaps"])
def test_the_data_of_a_step_grow_in_proportion_to_the_buses(cases, name):
    case = cases(name)
    if name == "two_area":
        case = case.with_storage(fleet.everywhere(case, "50MW"))
    small, large = (counts(operating_point.solve(replicate(case, copies))) for copies in COPIES)
    assert small.keys() == large.keys()
    growth = COPIES[1] / COPIES[0]
    for what in small:
        assert large[what] <= 1.02 * growth * small[what] + 8, what  # fill: 1.002
