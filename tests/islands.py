"""Two cases in one, without a connection: a network of two islands from the beginning."""

from dataclasses import replace

from stabctl.model import naming
from stabctl.model.tables import Branch, Bus, Load, Machine

SHIFT = 1000  # of the numbers of the second case


def joined(one, other):
    """Both; in the second one every bus and machine number is increased by `SHIFT`."""

    def moved(row):
        numbers = {f: getattr(row, f) + SHIFT for f in row._fields if f == "machine" or f.endswith("bus")}
        return row._replace(**numbers)

    tables = ("buses", "branches", "machines", "loads", "links", "storage")
    devices = {model: dict(rows) for model, rows in one.devices.items()}
    for model, rows in other.devices.items():
        devices.setdefault(model, {}).update({naming.moved(key, SHIFT): par for key, par in rows.items()})
    both = {name: (*getattr(one, name), *map(moved, getattr(other, name))) for name in tables}
    return replace(one, name=f"{one.name}_and_{other.name}", devices=devices, **both)


def single(case, power):
    """Machine 1 of a case with its controls, alone with a load (MW)."""
    devices = {model: {1: rows[1]} for model, rows in case.devices.items() if 1 in rows}
    return replace(
        case,
        name="single",
        buses=(Bus(1, "swing"), Bus(2, "pq")),
        branches=(Branch(1, 2, 0.0, 0.05),),
        machines=(Machine(1, 1, 3 * power, power, 1),),
        loads=(Load(2, power, power / 6),),
        devices=devices,
    )
