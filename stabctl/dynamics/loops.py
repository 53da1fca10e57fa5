"""Control loops of converters, by which modes and fast states are named."""

from stabctl import devices

from .operating_point import OperatingPoint


def loops(point: OperatingPoint, table: str, unit: int) -> dict[str, str]:
    """State -> name of its control loop, of a converter or a control of one; empty if its device names none.

    Parameters
    ----------
    point
        The operating point.
    table
        Device table.
    unit
        Row of the unit.
    """
    device = devices.every()[table]
    if device.loops is None:
        return {state: name for name, states in device.named_loops.items() for state in states}
    units, constants = point.constants(table)
    row = units.tolist().index(unit)
    par = device.Par(*(constants[name][row] for name in device.Par._fields))
    return {state: name for name, states in device.loops(par).items() for state in states}
