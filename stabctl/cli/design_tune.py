"""stabctl design tune, pss: stabilizers, dampers and parameters at once, over every network."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

from . import groups, options, shared
from .design import Files
from .parameters import Option

if TYPE_CHECKING:
    from stabctl.design import Tuned
    from stabctl.design.tuning.case_values import Device

SHOWN = 8  # networks in the table: those with the least damping

Machine = Annotated[list[int] | None, Option("--machine", help="Machine that gets a stabilizer. Repeatable.")]
Model = Annotated[
    Literal["pss", "ieeest", "pss2b"] | None,
    Option("--model", help="Packaged stabilizer that is tuned under its own names (default: lead-lag stages)."),
]
Stages = Annotated[int, Option("--stages", min=0, max=5, help="Lead-lag stages of a stabilizer.")]
Gain = Annotated[float, Option("--gain", help="Largest gain K of a stabilizer, pu of voltage per pu of speed.")]
Fast = Annotated[float, Option("--fast", help="Largest gain of a stabilizer at high frequencies, K T1/T2 T3/T4, pu.")]
NoiseFilter = Annotated[
    str,
    Option(
        "--noise-filter",
        metavar="TIME",
        parser=options.in_unit("s"),
        help="Time constant of the lag that filters the speed, s; 0: none.",
    ),
]
Damper = Annotated[
    list[str] | None,
    Option(
        "--damper",
        metavar="INPUT,OUTPUT[,DELAY]",
        help="Damper that is tuned, too: deviation:1,order:1@5,100ms. Repeatable. Without --machine, no stabilizers.",
    ),
]
Value = Annotated[
    list[str] | None,
    Option("--value", help="Parameter of the case that is tuned from half to twice its value: exst3.KA. Repeatable."),
]
Wanted = Annotated[
    float | None,
    Option(
        "--damping",
        metavar="RATIO",
        parser=options.in_unit("-"),
        help="Damping ratio from which the gains are lowered, 0.1 or 10% (default: the most).",
    ),
]
OutagesOption = Annotated[bool, Option("--n-1", help="Also tune for the outage of each branch (in Python by default).")]
Levels = Annotated[str, Option("--levels", metavar="LIST", help="Load levels, such as 0.8,1 (the default in Python).")]
Gains = Annotated[str, Option("--gains", metavar="LIST", help="Factors of all gains that count, too: 0.7,1.3 or none.")]
Sensitivity = Annotated[
    float, Option("--sensitivity", min=0.0, help="Bound of the sensitivity |S| of every loop; 0: none.")
]
DiskMargin = Annotated[float | None, Option("--disk-margin", help="Least disk margin of every loop: 0.8.")]
Noise = Annotated[float, Option("--noise", min=0.0, help="Standard deviation of the noise of the speed, pu.")]
Reserve = Annotated[
    float | None,
    Option("--reserve", help="Share of the limits of every stabilizer that the noise must leave: 0.8."),
]
OneOut = Annotated[bool, Option("--one-out", help="Count each controller out of service, too.")]
CheckLevels = Annotated[
    str, Option("--check-levels", metavar="LIST", help="Load levels that are checked without being tuned for, or none.")
]
Checks = Annotated[int, Option("--checks", min=0, help="Most critical line faults whose clearing times are compared.")]
Starts = Annotated[int, Option("--starts", min=1, max=100, help="Starts of the search.")]
Seed = Annotated[int, Option("--seed", min=0, help="Seed of the random starts.")]
DyrOut = Annotated[Path | None, Option("--dyr-out", help="Write the stabilizers of --model to this DYR file.")]


class DeviceOptions(NamedTuple):
    """What is tuned."""

    machine: Machine = None
    model: Model = None
    stages: Stages = 2
    gain: Gain = 20.0
    fast: Fast = 300.0
    noise: Noise = 0.0
    damper: Damper = None
    value: Value = None

    def devices(self) -> "list[Device]":
        """The devices."""
        from stabctl import design
        from stabctl._util.errors import StudyError

        found: list[Device] = []
        if self.machine or self.model or not (self.damper or self.value):
            shape: dict[str, Any] = {"stages": self.stages, "gain": self.gain, "fast": self.fast, "noise": self.noise}
            found.append(design.stabilizers(self.machine or None, model=self.model, **shape))
        elif self[2:6] != DeviceOptions()[2:6]:
            raise StudyError(
                "--stages, --gain, --fast and --noise are those of stabilizers; give --machine or --model."
            )
        for text in self.damper or ():
            parts = [part.strip() for part in text.split(",")]
            if not 2 <= len(parts) <= 3:
                raise StudyError(f"--damper {text!r} is not INPUT,OUTPUT[,DELAY]; give deviation:1,order:1@5,100ms.")
            found.append(design.damper(*parts[:2], delay=parts[2] if len(parts) == 3 else 0.0))
        return found + [design.values(path) for path in self.value or ()]


def tune(
    *,
    what: DeviceOptions,
    damping: Wanted = None,
    outages: OutagesOption = False,
    levels: Levels = "1",
    gains: Gains = "0.7,1.3",
    sensitivity: Sensitivity = 2.0,
    disk_margin: DiskMargin = None,
    one_out: OneOut = False,
    reserve: Reserve = None,
    check_levels: CheckLevels = "0.9",
    checks: Checks = 3,
    starts: Starts = 5,
    seed: Seed = 0,
    store: options.Store = None,
    workers: options.Workers = None,
    files: Files,
    dyr_out: DyrOut = None,
    storage: groups.StorageOptions,
    case: groups.CaseOptions,
    as_json: options.Json = False,
) -> None:
    """Tune all stabilizers, dampers and parameters at once, for the worst damping of every network."""
    from stabctl import design
    from stabctl._util.errors import StudyError

    files.check()
    shared.file(dyr_out, ".dyr")
    if dyr_out and not what.model:
        raise StudyError("--dyr-out needs --model; only packaged stabilizers have DYR records.")
    devices, point = what.devices(), storage.initialize(case.load())
    with shared.progress("tuning", 1.0) as tell:
        found = design.tune(
            point,
            devices,
            damping=damping,
            outages="all" if outages else "none",
            levels=_numbers("--levels", levels),
            gains=_numbers("--gains", gains),
            sensitivity=sensitivity or None,
            disk_margin=disk_margin,
            one_out=one_out,
            reserve=reserve,
            check_levels=_numbers("--check-levels", check_levels),
            checks=checks,
            starts=starts,
            seed=seed,
            store=store,
            workers=workers,
            progress=lambda text, done: tell(done, text),
        )
    written = files.write(found)
    _show(found, (*written, found.save_dyr(dyr_out)) if dyr_out else written, as_json)


def pss(
    *,
    machine: Machine = None,
    damping: Wanted = None,
    stages: Stages = 2,
    gain: Gain = 20.0,
    fast: Fast = 200.0,
    noise_filter: NoiseFilter = "20ms",
    outages: OutagesOption = False,
    sensitivity: Sensitivity = 2.0,
    starts: Starts = 5,
    seed: Seed = 0,
    files: Files,
    storage: groups.StorageOptions,
    case: groups.CaseOptions,
    as_json: options.Json = False,
) -> None:
    """Tune power system stabilizers together, in place of those of the case."""
    from stabctl import design

    files.check()
    point = storage.initialize(case.load())
    points = design.outages(point) if outages else point
    shape: dict[str, Any] = {"stages": stages, "gain": gain, "fast": fast, "noise_filter": float(noise_filter)}
    more: dict[str, Any] = {"sensitivity": sensitivity or None, "starts": starts, "seed": seed}
    found = design.pss(points, machine or None, damping=damping, **shape, **more)
    _show(found, files.write(found), as_json)


def _numbers(name: str, text: str) -> list[float]:
    """Numbers separated by commas; none of "none"."""
    from stabctl._util.errors import StudyError
    from stabctl._util.units import quantity

    if text.strip().lower() in ("", "none"):
        return []
    try:
        return [quantity(part, "-") for part in text.split(",")]
    except StudyError as error:
        raise StudyError(f"{name} {text!r}: {error}") from None


def _show(found: "Tuned", written: Sequence[Path], as_json: bool) -> None:
    if as_json:
        shared.print_json({**found.summary, "files": [str(path) for path in written]})
        return
    from rich.table import Table

    out = shared.console()
    networks = Table("network", "without", "with", "Hz", "mode")
    for name, before, after, hz, mode in found.worst.sort_values("after").head(SHOWN).to_numpy().tolist():
        networks.add_row(name, f"{before:z.4f}", f"{after:z.4f}", f"{hz:.4f}", mode)
    out.print(networks)
    table = Table("controller", "parameters")
    for name, rows in found.parameters.groupby("device", sort=False):
        every = zip(rows["parameter"], rows["value"], rows["unit"], strict=True)
        table.add_row(str(name), ", ".join(f"{p} {x:.4g} {unit}".rstrip(" -") for p, x, unit in every))
    out.print(table)
    if found.robustness:
        holds = Table("with", "worst damping", "Hz", "where")
        for what, ratio, hz, where in found.holds.to_numpy().tolist():
            holds.add_row(what, f"{ratio:z.4f}", f"{hz:.3f}", where)
        out.print(holds)
    out.print(str(found))
    for path in written:
        out.print(f"written: {path}")
