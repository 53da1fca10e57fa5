"""Two cases in one, without a connection: a network of two islands from the beginning."""

from dataclasses import replace

from stabctl.model import naming

SHIFT = 1000  # of the numbers of the second case


def joined(one, other):
    """Both; in the second one every bus and machine number is increased by `SHIFT`."""

    def moved(row):
        numbers = {f: getattr(row, f) + SHIFT for f in row._fields if f == "machine" or f.endswith("bus")}
        return row._replace(**numbers)

    tables = ("buses", "branches", "machines", "loads", "storage")
    devices = {model: dict(rows) for model, rows in one.devices.items()}
    for model, rows in other.devices.items():
        devices.setdefault(model, {}).update({naming.moved(key, SHIFT): par for key, par in rows.items()})
    both = {name: (*getattr(one, name), *map(moved, getattr(other, name))) for name in tables}
    assert not one.links + other.links
    return replace(one, name=f"{one.name}_and_{other.name}", devices=devices, **both)
