"""Options shared by several commands. A quantity is a number in the unit given in its help, or text with a unit."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal

import click

from .parameters import Argument, Option


def in_unit(unit: str) -> Callable[[str | float], float]:
    """The parser of a quantity in a unit."""

    def read(text: str | float) -> float:
        from stabctl._util.errors import StudyError
        from stabctl._util.units import quantity

        try:
            return quantity(text, unit)
        except StudyError as error:
            raise click.BadParameter(str(error)) from None

    return read


def time(text: str | float) -> str | float:
    """Read a time: seconds, or text in cycles of the case's frequency."""
    from stabctl._util.errors import StudyError
    from stabctl._util.units import quantity, seconds

    try:
        seconds(text, 60.0)
        return text
    except StudyError as error:
        wrong = str(error)
    try:
        return quantity(text, "s")
    except StudyError:
        raise click.BadParameter(wrong) from None


def each(names: list[str] | None) -> list[str] | None:
    """The names of a repeatable option, each of which may be several separated by commas."""
    from stabctl.model.naming import listed

    return names and [one for text in names for one in listed(text)]


def register(files: list[str] | None) -> list[str] | None:
    """Register the devices in these files before the case that uses them is read."""
    from stabctl import devices

    for file in files or ():
        devices.register(file)
    return files


def cases() -> list[str]:
    """The packaged cases."""
    from stabctl import io

    return list(io.packaged())


CaseName = Annotated[
    str,
    Argument("CASE", "A packaged case, a folder, a PSS/E file x.raw, or a MATPOWER or PST file x.m.", cases),
]
Dyr = Annotated[Path | None, Option("--dyr", help="DYR file of x.raw (default: x.dyr in the same folder).")]
Loads = Annotated[
    Literal["impedance", "current", "power"] | None,
    Option("--loads", help="What remains constant in every load when the voltage changes (default: as in the case)."),
]
MotorShare = Annotated[
    float | None,
    Option(
        "--motor-share",
        metavar="SHARE",
        parser=in_unit("-"),
        help="Share of every load that induction motors draw: 40% or 0.4 (default: as in the case).",
    ),
]
Machines = Annotated[
    Literal["typical"] | None,
    Option("--machines", help="Typical machines, exciters and governors for a case without dynamic data."),
]
Frequency = Annotated[
    float | None,
    Option("--frequency", metavar="FREQUENCY", parser=in_unit("Hz"), help="Rated frequency of x.m (60 Hz)."),
]
Conventions = Annotated[
    Literal["pst", "psse", "andes", "book"] | None,
    Option(
        "--conventions",
        help="Machine equations as in PST, PSS/E, ANDES or textbooks (default: as in the case).",
    ),
]
Missing = Annotated[
    Literal["refuse", "injection"],
    Option("--missing", help="Machines of x.raw without a model: an error, or constant-power injections."),
]
MissingControls = Annotated[
    Literal["refuse", "fixed"],
    Option("--missing-controls", help="Controls without a model: an error, or left out with their outputs constant."),
]
Classical = Annotated[bool, Option("--classical", help="Classical machines, without controls.")]
Ratio = Annotated[
    float, Option("--damping", metavar="RATIO", parser=in_unit("-"), help="Damping ratio wanted: 0.05 or 5%.")
]
Json = Annotated[bool, Option("--json", help="Print one JSON object and nothing else.")]
Set = Annotated[
    list[str] | None, Option("--set", metavar="PATH=VALUE", help="Change the case: pss.1.K=10. Repeatable.")
]
Device = Annotated[
    list[str] | None,
    Option(
        "--device",
        metavar="FILE",
        callback=register,
        help="Your own device model, my_exciter.py; the file is executed, with your rights. Repeatable.",
    ),
]
Verbose = Annotated[bool, Option("--verbose", help="Print every warning, not only the first.")]
Report = Annotated[Path | None, Option("--report", help="Write a page with figures to this folder.")]
Criteria = Annotated[
    str | None,
    Option("--criteria", help="Criteria of performance: wecc-tpl-001, nerc-prc-024, entso-e, or a TOML file."),
]
Workers = Annotated[int | None, Option("--workers", min=1, help="Threads (default: one per core).")]
Store = Annotated[
    Path | None,
    Option("--store", help="Store finished jobs in this folder; the same command continues an interrupted study."),
]
Scheduler = Annotated[
    str | None, Option("--scheduler", help="Scheduler of a Dask cluster, instead of threads: tcp://host:8786.")
]

FAULT = "Fault location: 83 (a bus), 7-8@0.4 (on a line, measured from the first bus), 7-8 (its middle)."
Fault = Annotated[str, Option("--fault", help=FAULT)]
Trip = Annotated[
    list[str] | None,
    Option(
        "--trip", callback=each, help="Line opened at clearing, or at --at without a fault: 83-33, 7-8#2. Repeatable."
    ),
]
TripAtClearing = Annotated[
    list[str] | None,
    Option("--trip", callback=each, help="Line opened at clearing: 83-33, 7-8#2. Repeatable."),
]
FaultImpedance = Annotated[str, Option("--fault-impedance", help="R,X of the fault, pu (0,0: bolted).")]
BEGINS = "1s"  # of the fault
At = Annotated[str, Option("--at", metavar="TIME", parser=time, help="Time of the fault, s or 60cyc.")]
Open = Annotated[list[str] | None, Option("--open", help="Line trip without a fault: 7-8@1s. Repeatable.")]
TripMachine = Annotated[list[str] | None, Option("--trip-machine", help="Machine trip: 14@2s. Repeatable.")]
LoadStep = Annotated[list[str] | None, Option("--load-step", help="Load step at a bus: 7:+50MW@1s. Repeatable.")]

Size = Annotated[
    str | None,
    Option(
        "--storage", help="A storage device at every machine, instead of those of the case: 5%mva, 5%dispatch, 50MW."
    ),
]
SizeAt = Annotated[str | None, Option("--storage-at", help="Storage devices at machines: 14=50MW,13@33=20MW.")]
Characteristic = Annotated[
    Literal["power", "current", "conductance"],
    Option("--characteristic", help="What remains constant when the voltage changes."),
]
StorageModel = Annotated[
    str,
    Option(
        "--storage-model",
        help="What stores the energy, and its converter: ideal, regc, regc_repc, regfm, ...; supercap and flywheel, "
        "alone or as in supercap_regc.",
    ),
]
StorageEnergy = Annotated[
    float,
    Option(
        "--storage-energy",
        metavar="ENERGY",
        parser=in_unit("MWh"),
        help="Energy capacity of every device, 5kWh or MWh (0: no limit); supercap and flywheel need one.",
    ),
]
Mva = Annotated[
    str | None,
    Option(
        "--storage-mva",
        help="MVA of every device: 60MVA, 120% of its power rating (default 100%), or for its power at 0.8pu.",
    ),
]
Converter = Annotated[
    str, Option("--converter", help="Parameters of the converters that are not the default: 'Imax=1.3 Lvplsw=0'.")
]
Lag = Annotated[
    str, Option("--lag", metavar="TIME", parser=time, help="Time constant from order to power, s or 100ms.")
]
Control = Annotated[
    Literal["none", "bang-bang"] | None,
    Option(
        "--control", help="Storage control law (default: bang-bang, if there is storage that no --controller drives)."
    ),
]
Controllers = Annotated[
    list[str] | None, Option("--controller", metavar="FILE", help="A saved controller (TOML). Repeatable.")
]
Deadband = Annotated[
    float,
    Option("--deadband", metavar="FREQUENCY", parser=in_unit("Hz"), help="Deadband of speed, Hz or 100mHz."),
]
MinVoltage = Annotated[float, Option("--min-voltage", help="Voltage below which a device is idle, pu.")]

Step = Annotated[
    str | None,
    Option("--step", metavar="TIME", parser=time, help="Time step, s or 2ms (default: at most 1/120 s)."),
]
Observe = Annotated[
    str, Option("--observe", metavar="TIME", parser=time, help="Time simulated after the last event, s or 300cyc.")
]
Longest = Annotated[
    str,
    Option(
        "--longest",
        metavar="TIME",
        parser=time,
        help="Longest time simulated after the last event if the swings do not decay, s; 0: never more than --observe.",
    ),
]
Resolution = Annotated[
    str,
    Option(
        "--resolution", metavar="TIME", parser=time, help="Spacing of the clearing times that are tried, s or 0.5cyc."
    ),
]
Scan = Annotated[
    str,
    Option(
        "--scan",
        metavar="TIME",
        parser=lambda text: text if text == "auto" else time(text),
        help="Range below and above the critical clearing time that is scanned in steps of 1/8 cycle; 0 for none; "
        "auto: 4cyc above, and 0.5cyc to 2cyc below, as its swings demand.",
    ),
]
_LIMIT = Option("--limit", metavar="TIME", parser=time, help="Longest clearing time that is tried, s or 60cyc.")
Limit = Annotated[str, _LIMIT]
OwnLimit = Annotated[str | None, _LIMIT]  # None: as the function called with it says
Angle = Annotated[
    float,
    Option(
        "--max-angle",
        metavar="ANGLE",
        parser=in_unit("rad"),
        help="Change of a rotor angle relative to the COI that counts as loss of synchronism, rad or 200deg.",
    ),
]
MinFrequency = Annotated[
    float | None,
    Option(
        "--min-frequency",
        metavar="FREQUENCY",
        parser=in_unit("Hz"),
        help="Lowest frequency of an island, Hz (default: 0.95 pu, 57 Hz at 60 Hz).",
    ),
]
MaxFrequency = Annotated[
    float | None,
    Option(
        "--max-frequency",
        metavar="FREQUENCY",
        parser=in_unit("Hz"),
        help="Highest frequency of an island, Hz (default: 1.033 pu, 62 Hz at 60 Hz).",
    ),
]
FrequencyDelay = Annotated[
    str,
    Option(
        "--frequency-delay",
        metavar="TIME",
        parser=time,
        help="Time outside this range that counts as frequency instability, s or 500ms; 0 disables the check.",
    ),
]
CenterOfInertia = Annotated[
    Literal["all", "machines"],
    Option("--coi", help="Center of inertia of machines and grid-forming converters, or of machines alone."),
]

Estimator = Annotated[
    Literal["ideal", "frequency", "kinematic", "kalman"],
    Option("--estimator", help="Signals of law and controllers: the true ones, or estimates from PMU reports."),
]
PmuRate = Annotated[int, Option("--pmu-rate", help="PMU reports per second.")]
PmuNoise = Annotated[
    float,
    Option(
        "--pmu-noise-mrad",
        parser=in_unit("mrad"),
        metavar="ANGLE",
        help="Noise of the phasor angles, mrad, and magnitudes, per mille.",
    ),
]
Latency = Annotated[
    float, Option("--latency-ms", parser=in_unit("ms"), metavar="TIME", help="Latency of remote reports, ms.")
]
Loss = Annotated[float, Option("--loss", help="Fraction of the reports that are lost.")]
Seed = Annotated[int, Option("--seed", min=0, help="Seed of noise and losses.")]
