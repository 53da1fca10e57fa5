"""A system of unlike sizes: machines of 0.05 and 2,000 MVA, 0.4 and 380 kV, loads of 12 kW, time constants near 0.

50 Hz on a base of 137 MVA. Bus 60, behind transformers of a few hundred kVA, has a machine, a load and storage.
"""

from dataclasses import replace
from functools import cache

from systems import CLASSICAL, ROUND, SEXS, STEAM
from uneven import uneven

from stabctl.dynamics import operating_point
from stabctl.model.tables import Branch, Bus, Load, Machine, Storage

STORAGE = (
    Storage(9, 60, 0.008, "power", 0.05, 0.4, 0.09, 0.002, 0.81, 0.011),
    Storage(12, 40, 60.0, "current", 0.001, 0.7, 0.0, 0.05, 0.64),
    Storage(5, 50, 0.7, "conductance", 0.03, 0.6, 4.0, 0.0, 0.9, 0.9),
)


def unlike(storage=STORAGE):
    """Machine 12 (swing) of 2,000 MVA, machine 9 of 50 kVA, and those of `uneven` between."""
    case = uneven(())
    quick = {
        "genrou": case.devices["genrou"] | {9: ROUND._replace(H=0.6, D=0.3, T2d=0.011, T2q=0.012)},
        "sexs": case.devices["sexs"] | {9: SEXS._replace(TR=0.001, KA=50.0, TA=0.002)},
        "tgov": case.devices["tgov"] | {9: STEAM._replace(K=12.0, Ts=0.002, Tc=0.05)},
        "gencls": case.devices["gencls"] | {12: CLASSICAL._replace(H=6.1, D=2.0)},
    }
    return replace(
        case,
        name="unlike",
        buses=(
            *(b._replace(rated=380.0) if b.bus == 30 else b for b in case.buses),
            Bus(60, "pq", 0.97, -3.0, rated=0.4),
        ),
        branches=(
            *case.branches,
            Branch(50, 60, 1.9, 21.0, 0.0, 1.01, 0.0, "", 0.00001, -0.00004),
            Branch(60, 50, 3.1, 37.0, 0.0, 0.99),
        ),
        machines=(
            *(m._replace(base=2000.0) if m.machine == 12 else m for m in case.machines),
            Machine(9, 60, 0.05, 0.031, 60, 0.004),
        ),
        devices=case.devices | quick,
        storage=tuple(storage),
        loads=(*case.loads, Load(60, 0.012, 0.003, 0.3, 0.2, 0.4, 0.1), Load(50, 0.4, -0.2, id="z")),
    )


def based(case, base):
    """The same system on another base (MVA)."""
    k, ends = base / case.base_mva, ("g_from", "b_from", "g_to", "b_to")
    lines = tuple(
        b._replace(r=b.r * k, x=b.x * k, b=b.b / k, **{end: getattr(b, end) / k for end in ends}) for b in case.branches
    )
    return replace(case, base_mva=base, branches=lines)


def numbered(case, bus, machine):
    """The same system with other numbers, given by functions of the old ones."""

    def new(row):
        numbers = {f: bus(getattr(row, f)) for f in row._fields if f.endswith("bus")}
        return row._replace(**numbers, **({"machine": machine(row.machine)} if "machine" in row._fields else {}))

    tables = {
        name: tuple(map(new, getattr(case, name))) for name in ("buses", "branches", "machines", "loads", "links")
    }
    devices = {model: {machine(key): par for key, par in rows.items()} for model, rows in case.devices.items()}
    return replace(case, **tables, storage=tuple(map(new, case.storage)), devices=devices)


@cache
def unlike_point():
    """Its operating point."""
    return operating_point.solve(unlike())
