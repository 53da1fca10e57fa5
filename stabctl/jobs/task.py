"""A task: one job of a study, ready for any process; how it is run to a row, and the key that determines the row.

A key is the SHA-256 of everything that determines a row. An operating point (`Base`) is sent as its case, and solved
once by every process that receives it.
"""

import dataclasses
import hashlib
import json
import os
import pickle
import platform
import sys
import time
from collections import OrderedDict
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from functools import cache, cached_property, lru_cache
from importlib.metadata import version
from threading import Lock
from typing import Annotated, Any, Literal, NamedTuple, Protocol

import numpy as np

from stabctl import devices
from stabctl._util.content import Content, attributes, content
from stabctl._util.errors import StabctlError, StudyError, bug
from stabctl._util.schema import fields
from stabctl.devices.device import Device
from stabctl.dynamics import operating_point
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.model.case import Case
from stabctl.model.tables import TABLES

COMPUTED = ("wall_s", "worker", "finished", "version")  # columns about the computation, not the system
POINTS_KEPT = 16  # operating points that a process keeps
SHARED_KEPT = 8  # shared data that a worker of a cluster keeps
Status = Literal["ok", "error", "bug"]


class Job(Protocol):
    """What is computed."""

    def given(self) -> dict[str, Any]:
        """Column -> plain value."""
        ...


class Found(NamedTuple):
    """What a job has found."""

    values: Mapping[str, Any]  # column -> value; None, or left out, if not applicable
    message: str | None = None  # in a sentence


class Kind(NamedTuple):
    """A kind of study: its table, and the function that runs a job."""

    table: str  # in the file of its rows
    given: Mapping[str, Any]  # column -> type, of the jobs
    found: Mapping[str, Any]  # column -> type, of what they find
    run: Callable[["Task"], Found]  # a function of a module, as other processes import it
    format: int  # raised when a column changes its meaning
    labels: tuple[str, ...] = ()  # columns of the jobs that name what is in the key, and tell rows of one key apart

    def row(self, values: Mapping[str, Any]) -> tuple[str, ...]:
        """What tells a row from all others: its key and labels."""
        return tuple(values[column] for column in ("key", *self.labels))

    @property
    def columns(self) -> dict[str, Any]:
        """Column -> type, of the rows."""
        first, *last = ((f.column, f.kind) for f in fields(About).values())
        return {"key": str, **self.given, **dict([first]), **self.found, **dict(last)}


class Task(NamedTuple):
    """A job, the data that it shares with other jobs, and the key that both determine."""

    key: str  # SHA-256
    job: Any
    shared: Any  # such as the case; a cluster gets it once
    kind: Kind

    @property
    def row(self) -> tuple[str, ...]:
        """What tells its row from all others."""
        return self.kind.row({"key": self.key, **self.job.given()})


class About(NamedTuple):
    """How, where and when a job ran."""

    status: Annotated[Status, "-", "ok; error: not possible, see message; bug: an error in stabctl"]
    message: Annotated[str | None, "-", "the result in a sentence"] = None
    wall: Annotated[float | None, "s", "computing time"] = None
    worker: Annotated[str | None, "-", "host:process"] = None
    finished: Annotated[str | None, "-", "time of completion, UTC"] = None
    version: Annotated[str | None, "-", "of stabctl"] = None


class Row(NamedTuple):
    """A job that has ended."""

    key: str
    given: Mapping[str, Any]  # column -> value
    found: Mapping[str, Any]  # column -> value
    about: About

    @property
    def values(self) -> dict[str, Any]:
        """Column -> value."""
        about = {f.column: value for f, value in zip(fields(About).values(), self.about, strict=True)}
        return {"key": self.key, **self.given, **self.found, **about}


def run_task(task: Task) -> Row:
    """Run the job of a task; any error is recorded in its row."""
    began = time.perf_counter()
    try:
        return completed(task)
    except StabctlError as error:
        return row(task, {}, "error", " ".join(str(error).split()), **_here(began))
    except Exception as error:
        return row(task, {}, "bug", bug(error), **_here(began))


def completed(task: Task) -> Row:
    """Run the job of a task; raises what the job raises."""
    began = time.perf_counter()
    found = task.kind.run(task)
    return row(task, found.values, "ok", found.message, **_here(began))


def _here(began: float) -> dict[str, Any]:
    return {"wall": time.perf_counter() - began, "worker": f"{platform.node()}:{os.getpid()}"}


def row(task: Task, found: Mapping[str, Any], status: Status, message: str | None, **about: Any) -> Row:
    """The row of a task, with its time of completion and the version of the package."""
    finished = datetime.now(UTC).isoformat(timespec="milliseconds")
    how = About(status, message, finished=finished, version=_version(), **about)
    return Row(task.key, task.job.given(), found, how)


def stored(task: Task, values: Mapping[str, Any]) -> Row:
    """The row of a task whose result a row of the same key has, by column."""
    about = About(*(values[f.column] for f in fields(About).values()))
    return Row(task.key, task.job.given(), {column: values[column] for column in task.kind.found}, about)


@cache
def _version() -> str:
    return version("stabctl")


def run_received(files: Mapping[str, str], task: bytes, shared: bytes) -> Row:
    """Register the user's devices in `files`, which unpickling the case may need, and run a pickled task."""
    devices.register_as(files)
    return run_task(pickle.loads(task)._replace(shared=_unpacked(shared)))  # from the process that made the study


@lru_cache(SHARED_KEPT)
def _unpacked(shared: bytes) -> Any:
    return pickle.loads(shared)


def fingerprint(case: Case) -> str:
    """SHA-256 of the content of a case, wherever it was read from, and of the user's own devices in it."""
    given: dict[str, Any] = {
        name: [row._asdict() for row in getattr(case, name)] for name in TABLES if name != "out_of_service"
    }
    given |= {name: getattr(case, name) for name in ("name", "base_mva", "frequency_hz")}
    given["devices"] = {
        model: [[number, par._asdict()] for number, par in rows.items()] for model, rows in case.devices.items()
    }
    used = {model: devices.every()[model] for model in case.devices}
    files = devices.registered()
    own = {model: _read(model, d.content) for model, d in used.items() if d.file in files}
    given |= {"devices_of_the_user": own} if own else {}
    return sha256(given)


def sha256(content: object) -> str:
    """SHA-256 of the text of a content."""
    return hashlib.sha256(canonical(content).encode()).hexdigest()


def canonical(content: object) -> str:
    """The unique JSON text of a content."""
    return json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)


def text(content: object) -> str:
    """The unique JSON text of records, numbers and texts, such as a control law, with the names of the classes."""
    return canonical(_plain(content))


def _plain(value: Any) -> Any:
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return value if np.isfinite(value) else str(value)
    if isinstance(value, complex):
        return [value.real, value.imag]
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        named = {f.name: _plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
        return {"class": type(value).__name__, **_own(value), **named}
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        return _plain(value._asdict())
    if hasattr(value, "model_dump"):  # a pydantic model
        return _plain({"class": type(value).__name__, **value.model_dump()})
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if isinstance(value, Mapping):
        return {str(name): _plain(one) for name, one in value.items()}
    what = getattr(value, "__name__", type(value).__name__)
    raise StudyError(
        f"The Python function or object {what} cannot be kept in a store or sent to a cluster, because a later change "
        "of it would go unnoticed; give a law or a controller with matrices, or leave out the store and the scheduler."
    )


def _own(value: Any) -> dict[str, Any]:
    """What an object of a class of the user's does: its class, its equations if it is a law, and what it was given."""
    kind = type(value)
    if kind.__module__.startswith("stabctl."):
        return {}
    home = getattr(sys.modules.get(kind.__module__), "__file__", None)
    parts, device = [content([kind, attributes(value)], home)], getattr(value, "device", None)
    if isinstance(device, Device) and not device.module.__name__.startswith("stabctl."):
        parts.append(device.content)
    return {"does": [_read(kind.__name__, part) for part in parts]}


def _read(name: str, found: Content) -> str:
    """SHA-256 of a content. Raises `StudyError` if there is something in it that cannot be read."""
    if found.unknown:
        raise StudyError(
            f"{name} uses an object of type {found.unknown[0]}, a later change of which would go unnoticed in a store; "
            "use numbers, texts, arrays and functions, or leave out the store and the scheduler."
        )
    return sha256(found.text)


_known: OrderedDict[str, OperatingPoint] = OrderedDict()
_lock = Lock()


class Base:
    """The operating point of jobs."""

    def __init__(self, point: OperatingPoint) -> None:
        self.point = point

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 of the content of its case."""
        return fingerprint(self.point.case)

    def __reduce__(self) -> tuple[Any, ...]:
        return _received, (self.fingerprint, self._packed)

    @cached_property
    def _packed(self) -> bytes:
        return pickle.dumps(self.point.case)


def _received(key: str, case: bytes) -> Base:
    """The operating point of a pickled case from another process."""
    with _lock:
        if key not in _known:
            _known[key] = operating_point.solve(pickle.loads(case))
            while len(_known) > POINTS_KEPT:
                _known.popitem(last=False)
        _known.move_to_end(key)
        return Base(_known[key])
