"""Section 5 (Table 3): the controller asked what it orders."""

from pathlib import Path

from stabctl.controllers import BangBang, Device, Seen, order
from stabctl.report import paper
from stabctl.report.study import Study, Table
from stabctl.report.study_console import present

DEVICE = Device(rating=50.0, machine=900.0, frequency=60.0)
ORDERS = {1.0: "absorbs", -1.0: "injects", 0.0: "idles"}
MILLIHERTZ = -200, -101, -99, 0, 99, 101, 200
VOLTAGES = 0.79, 0.81, 1.0
SPEEDS = {"faster": 200, "slower": -200, "as fast": 0}  # mHz


def study(_reports: Path) -> Study:
    """Table 3, and the edges of deadband and voltage gate."""
    law = BangBang()
    rows = (
        paper.DEADBAND.beside(1e3 * law.deadband),
        paper.GATE.beside(law.min_voltage),
        *(printed.beside(ordered(SPEEDS[key])) for key, printed in paper.TABLE_3.items()),
    )
    edges = tuple((str(mhz), *(ordered(mhz, voltage) for voltage in VOLTAGES)) for mhz in MILLIHERTZ)
    heads = "own speed less that of the rest, mHz", *(f"at {voltage:g} pu" for voltage in VOLTAGES)
    text = "As in (40) the speed of the rest is that of its center of inertia, the device's own machine left out."
    return Study("The controller", "5", (text,), rows, (Table("Orders", heads, edges),))


def ordered(mhz: float, voltage: float = 1.0) -> str:
    """What the law orders at a speed deviation (mHz) and a voltage (pu)."""
    seen = Seen(1e-3 * mhz / DEVICE.frequency, 0.0, voltage)
    return ORDERS[order(seen, BangBang().par(DEVICE), held=0.0)]


if __name__ == "__main__":
    present(study)
