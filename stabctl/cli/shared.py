"""What several commands share: cases, storage, output."""

import json
import math
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

if TYPE_CHECKING:
    from rich.console import Console

    from stabctl.controllers import BangBang
    from stabctl.dynamics.operating_point import OperatingPoint
    from stabctl.estimation.estimator_control import EstimatorControl
    from stabctl.estimation.estimators import Engine
    from stabctl.estimation.pmu import Pmu
    from stabctl.model.case import Case

CaseName = Annotated[str, typer.Argument(metavar="CASE", help="A packaged case, or a folder.")]
Classical = Annotated[bool, typer.Option("--classical", help="Classical machines, without controls.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]
Fault = Annotated[
    str, typer.Option("--fault", help="83 (a bus), 7-8@0.4 (along it from the first bus named; 7-8: half-way).")
]
Trip = Annotated[
    list[str] | None,
    typer.Option("--trip", help="Circuit opened at clearing (--at where there is no fault): 83-33, 7-8#2. Repeatable."),
]
Size = Annotated[
    str | None,
    typer.Option("--storage", help="A device at every machine, for the case's own: 5%mva, 5%dispatch or 50MW."),
]
SizeAt = Annotated[str | None, typer.Option("--storage-at", help="Devices at machines: 14=50MW,13@33=20MW.")]
Control = Annotated[
    Literal["none", "bang-bang"] | None,
    typer.Option("--control", help="Storage law; bang-bang where there is storage."),
]
Characteristic = Annotated[
    Literal["power", "current", "conductance"], typer.Option("--characteristic", help="What is constant in a device.")
]
Lag = Annotated[float, typer.Option("--lag", help="Time constant from order to power, s.")]
Deadband = Annotated[float, typer.Option("--deadband", help="Speed deviation without action, Hz.")]
MinVoltage = Annotated[float, typer.Option("--min-voltage", help="Voltage below which a device idles, pu.")]
FaultImpedance = Annotated[str, typer.Option("--fault-impedance", help="R,X of the fault, pu (0,0: bolted).")]
Angle = Annotated[
    float, typer.Option("--max-angle", help="Change of angle against the COI that loses synchronism, rad.")
]
Observe = Annotated[float, typer.Option("--observe", help="Time watched after clearing, s.")]
Limit = Annotated[str, typer.Option("--limit", help="Longest clearing time tried.")]
Workers = Annotated[int | None, typer.Option("--workers", min=1, help="Threads (default: one per core).")]
Step = Annotated[float | None, typer.Option("--step", help="Time step, s (default: at most 1/120).")]

Estimator = Annotated[
    Literal["ideal", "frequency", "kinematic", "kalman"],
    typer.Option("--estimator", help="What the storage law sees: true speeds, or estimates from PMU signals."),
]
PmuRate = Annotated[int, typer.Option("--pmu-rate", help="PMU reports per second.")]
PmuNoise = Annotated[float, typer.Option("--pmu-noise-mrad", help="Noise of phasor angles; magnitudes per mille.")]
Latency = Annotated[float, typer.Option("--latency-ms", help="Latency of the reports of other machines.")]
Loss = Annotated[float, typer.Option("--loss", help="Share of the reports that never arrive.")]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Seed of noise and losses.")]


def load(name: str, classical: bool = False) -> "Case":
    """The case; what is unusual in it goes to stderr."""
    from stabctl import io

    case = io.load(name)
    case = case.classical() if classical else case
    for sentence in case.warnings:
        print(f"stabctl: warning: {sentence}", file=sys.stderr)
    return case


def start(case: "Case", storage: str | None = None, storage_at: str | None = None, **options: Any) -> "OperatingPoint":
    """The operating point of the case with its storage devices."""
    from stabctl.dynamics import operating_point
    from stabctl.errors import StudyError
    from stabctl.model import fleet, powerflow

    if storage is not None and storage_at is not None:
        raise StudyError("--storage and --storage-at exclude each other; give one of them.")
    checked_lag(options.get("lag", 0.0))
    flow = powerflow.solve(case)
    if storage is not None:
        case = case.with_storage(fleet.everywhere(case, storage, flow, **options))
    elif storage_at is not None:
        case = case.with_storage(fleet.chosen(case, storage_at, flow, **options))
    return operating_point.solve(case, flow)


def checked_lag(lag: float) -> float:
    """The lag (s) of the devices, where it is one."""
    from stabctl.errors import StudyError

    if not 0 <= lag < float("inf"):
        raise StudyError(f"--lag {lag:g} s is not allowed; it must be at least 0.")
    return lag


def file(path: Path | None, *endings: str) -> None:
    """Refuse a file that cannot be written, before the work for it is done."""
    from stabctl.errors import StudyError

    if path is None:
        return
    if path.suffix.lower() not in endings:
        raise StudyError(f"The file {path.name!r} must end in {' or '.join(endings)}.")
    if not path.parent.is_dir():
        raise StudyError(f"There is no folder {str(path.parent)!r} to write {path.name!r} into; make it first.")
    if path.is_dir():
        raise StudyError(f"{path} is a folder; name a file to write.")
    if not os.access(path if path.exists() else path.parent, os.W_OK):
        raise StudyError(f"{path} may not be written; name a file in a folder of yours.")


def folder(path: Path | None) -> None:
    """Refuse a folder for a report that cannot be made or written into, before the work for it is done."""
    from stabctl.errors import StudyError

    if path is None:
        return
    there = next(p for p in (path.absolute(), *path.absolute().parents) if p.exists())
    if not there.is_dir():
        raise StudyError(f"No report can be written into {path}, since {there} is a file; name a folder.")
    if not os.access(there, os.W_OK):
        raise StudyError(
            f"No report can be written into {path}, since {there} may not be written; name another folder."
        )


def law(case: "Case", control: str | None, deadband: float, min_voltage: float) -> "BangBang | None":
    """The control law: bang-bang where there is storage, unless told otherwise."""
    from stabctl.controllers import BangBang
    from stabctl.errors import StudyError

    if control == "bang-bang" and not case.storage:
        raise StudyError("--control bang-bang needs storage devices; give --storage or --storage-at.")
    steering = BangBang(deadband, min_voltage)
    return steering if (control or ("bang-bang" if case.storage else "none")) == "bang-bang" else None


def pmu(rate: int, noise_mrad: float, latency_ms: float, loss: float) -> "Pmu":
    """The PMUs of the options."""
    from stabctl.estimation.pmu import Pmu

    return Pmu.noisy(rate, noise_mrad, latency_ms, loss)


def steering(
    law: "BangBang | None", estimator: str, pmu: "Pmu", seed: int, engine: "Engine" = "filterpy"
) -> "BangBang | EstimatorControl | None":
    """What sets the orders: the law itself where the estimator is ideal, else the law on PMU signals."""
    from stabctl.errors import StudyError
    from stabctl.estimation.estimator_control import EstimatorControl

    if estimator == "ideal":
        return law
    if law is None:
        raise StudyError(f"--estimator {estimator} needs storage devices under control; give --storage.")
    return EstimatorControl(law, estimator, pmu, seed=seed, engine=engine)


def impedance(text: str) -> complex:
    """A fault impedance written as R,X (pu)."""
    from stabctl.errors import StudyError

    try:
        r, x = (float(part) for part in text.split(","))
    except ValueError:
        r = x = float("nan")
    if not (abs(complex(r, x)) < float("inf") and r >= 0):
        raise StudyError(
            f"--fault-impedance {text!r} is not allowed; write R,X in pu, as 0.01,0.05, with R at least 0."
        )
    return complex(r, x)


def criterion(max_angle: float) -> Any:
    """When a run ends."""
    from stabctl.errors import StudyError
    from stabctl.simulation.criterion import Criterion

    if not 0 < max_angle < float("inf"):
        raise StudyError(f"--max-angle {max_angle:g} rad is not allowed; it must be more than 0.")
    return Criterion(max_angle=max_angle)


def print_json(record: dict[str, Any]) -> None:
    """One JSON object on stdout; a number beyond the floating-point range is null, which JSON has for it."""
    print(json.dumps(_plain(record), allow_nan=False))


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    value = value.item() if hasattr(value, "item") else value
    return None if isinstance(value, float) and not math.isfinite(value) else value


def console(stderr: bool = False) -> "Console":
    """Where tables (stdout) and progress (stderr) go."""
    from rich.console import Console

    return Console(stderr=stderr, highlight=False, markup=False)


@contextmanager
def progress(text: str, total: float | None) -> Iterator[Any]:
    """A progress bar on a terminal's stderr; yields what is told (done so far, and what else there is to say)."""
    if not sys.stderr.isatty():
        yield lambda _done, _said="": None
        return
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console(stderr=True), transient=True) as bar:
        task = bar.add_task(text, total=total)
        yield lambda done, said="": bar.update(task, completed=done, description=f"{text} {said}".rstrip())
