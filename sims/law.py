"""Section 5 (Table 3): the commands of the bang-bang controller."""

from pathlib import Path

from reproduction import paper
from reproduction.study import Study, Table, present
from stabctl.controllers import BangBang, Input, StorageDevice, decided

DEVICE = StorageDevice(rating=50.0, machine=900.0, frequency=60.0)
COMMANDS = {1.0: "absorbs", -1.0: "injects", 0.0: "idles"}
MILLIHERTZ = -200, -101, -99, 0, 99, 101, 200
VOLTAGES = 0.79, 0.81, 1.0  # pu
SPEEDS = {"faster": 200, "slower": -200, "as fast": 0}  # mHz
TEXT = "As in (40), the speed of the rest is that of the center of inertia of all other machines."


def study(_reports: Path) -> Study:
    """Table 3, and the edges of the deadband and of the voltage limit."""
    law = BangBang()
    comparisons = (
        paper.DEADBAND.compare(1e3 * law.deadband),
        paper.GATE.compare(law.min_voltage),
        *(printed.compare(command(SPEEDS[key])) for key, printed in paper.TABLE_3.items()),
    )
    heads = "speed relative to the rest (mHz)", *(f"at {voltage:g} pu" for voltage in VOLTAGES)
    rows = tuple((str(mhz), *(command(mhz, voltage) for voltage in VOLTAGES)) for mhz in MILLIHERTZ)
    return Study("The controller", "5", (TEXT,), comparisons, (Table("Commands", heads, rows),))


def command(mhz: float, voltage: float = 1.0) -> str:
    """What the controller does at a speed relative to the rest (mHz) and a voltage (pu)."""
    signals = Input(deviation=1e-3 * mhz / DEVICE.frequency, acceleration=0.0)
    return COMMANDS[decided(BangBang(), BangBang().par(DEVICE), signals, voltage).wanted]


if __name__ == "__main__":
    present(study)
