"""What several commands share: the case and its storage, events, control, output."""

import json
import math
import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console

    from stabctl.controllers import BangBang
    from stabctl.dynamics.operating_point import OperatingPoint
    from stabctl.estimation.estimator_control import EstimatorControl
    from stabctl.estimation.estimators import Engine
    from stabctl.estimation.pmu import Pmu
    from stabctl.model.case import Case
    from stabctl.simulation.criterion import Criterion
    from stabctl.simulation.events import Event


def load(name: str, classical: bool = False, settings: Iterable[str] | None = None, verbose: bool = False) -> "Case":
    """The case with its settings (`pss.1.K=10`) applied; its warnings go to stderr."""
    from stabctl import io
    from stabctl.errors import StudyError

    case, values = io.load(name), {}
    known = case.warnings if name in io.packaged() and not verbose else ()
    for text in settings or ():
        path, given, value = text.partition("=")
        if not given:
            raise StudyError(f"--set {text!r} is not allowed; write PATH=VALUE, as in --set pss.1.K=10.")
        values[path.strip()] = value.strip()
    case = case.set(values) if values else case
    case = case.classical() if classical else case
    warn([sentence for sentence in case.warnings if sentence not in known], verbose)
    return case


def warn(sentences: Sequence[str], verbose: bool) -> None:
    """Print the first warning and the number of the others on stderr, or all of them."""
    for sentence in sentences if verbose else sentences[:1]:
        print(f"stabctl: warning: {sentence}", file=sys.stderr)
    if len(sentences) > 1 and not verbose:
        more = "another warning" if len(sentences) == 2 else f"{len(sentences) - 1} more warnings"
        print(f"stabctl: {more}; --verbose prints all {len(sentences)}.", file=sys.stderr)


def start(case: "Case", storage: str | None = None, storage_at: str | None = None, **options: Any) -> "OperatingPoint":
    """The operating point of the case with its storage devices; options are columns of their table."""
    from stabctl.dynamics.coerce import initialize
    from stabctl.errors import StudyError

    if storage is not None and storage_at is not None:
        raise StudyError("--storage and --storage-at cannot be used together; give one of them.")
    if "lag" in options:
        options["lag"] = lag(options["lag"], case)
    sizes = storage if storage is not None else storage_at
    return initialize(case if sizes is None else case.with_storage(sizes, **options))


def lag(time: str | float, case: "Case") -> float:
    """The lag (s) of the devices, checked."""
    from stabctl.errors import StudyError
    from stabctl.units import seconds

    found = seconds(time, case.frequency_hz)
    if found < 0:
        raise StudyError(f"--lag {found:g} s is not allowed; it must be at least 0.")
    return found


def events(
    case: "Case", opened: Iterable[str] | None, machines: Iterable[str] | None, loads: Iterable[str] | None
) -> "tuple[Event, ...]":
    """What --open, --trip-machine and --load-step describe."""
    from stabctl.simulation import notation

    hz = case.frequency_hz
    return (
        *(notation.opening(text, hz) for text in opened or ()),
        *(notation.machine_trip(text, hz) for text in machines or ()),
        *(notation.load_step(text, hz) for text in loads or ()),
    )


def file(path: Path | None, *endings: str) -> None:
    """Reject a file that cannot be written, before any work is done."""
    from stabctl.errors import StudyError

    if path is None:
        return
    if path.suffix.lower() not in endings:
        raise StudyError(f"The file {path.name!r} must end in {' or '.join(endings)}.")
    if not path.parent.is_dir():
        raise StudyError(f"There is no folder {str(path.parent)!r} to write {path.name!r} to; create it first.")
    if path.is_dir():
        raise StudyError(f"{path} is a folder; give a file name.")
    if not os.access(path if path.exists() else path.parent, os.W_OK):
        raise StudyError(f"{path} is not writable; choose another file.")


def folder(path: Path | None) -> None:
    """Reject a report folder that cannot be created or written to, before any work is done."""
    from stabctl.errors import StudyError

    if path is None:
        return
    there = next(p for p in (path.absolute(), *path.absolute().parents) if p.exists())
    if not there.is_dir():
        raise StudyError(f"Cannot write a report to {path} because {there} is a file; give a folder.")
    if not os.access(there, os.W_OK):
        raise StudyError(f"Cannot write a report to {path} because {there} is not writable; choose another folder.")


def law(case: "Case", control: str | None, deadband: float, min_voltage: float) -> "BangBang | None":
    """The control law: bang-bang if there is storage, unless another is given."""
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
    """The control of the storage: the law itself where the estimator is ideal, else the law with estimated speeds."""
    if estimator == "ideal":
        return law
    from stabctl.errors import StudyError
    from stabctl.estimation.estimator_control import EstimatorControl

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
            f"--fault-impedance {text!r} is not allowed; write R,X in pu, such as 0.01,0.05, with R at least 0."
        )
    return complex(r, x)


def criterion(case: "Case", max_angle: float, low: float | None, high: float | None, delay: str | float) -> "Criterion":
    """The criterion of stability with this angle (rad), and range of frequency (Hz)."""
    from stabctl.errors import StudyError
    from stabctl.simulation.criterion import DEFAULT
    from stabctl.units import seconds

    if not max_angle > 0:
        raise StudyError(f"--max-angle {max_angle:g} rad is not allowed; it must be more than 0.")
    hz, given = case.frequency_hz, {"min_frequency": low, "max_frequency": high}
    limits = {name: value / hz for name, value in given.items() if value is not None}
    return DEFAULT._replace(max_angle=max_angle, frequency_delay_s=seconds(delay, hz), **limits)


def print_json(record: dict[str, Any]) -> None:
    """One JSON object on stdout; infinities and NaN become null."""
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
    """A progress bar on stderr if it is a terminal; yields a function of (amount done, remark)."""
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
