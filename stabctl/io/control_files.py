"""Controllers and laws of storage devices as TOML files. A controller:

name = "pod"
inputs = ["deviation:1"]        signals that it reads
outputs = ["order:1@5"]         inputs that it drives
rate = 60                       frames per second; omit it for a continuous controller
delay = "100ms"
limits = [-0.5, 0.5]
deadband, relay, ramp, tracking, [gate] signal, low, high, magnitude, start, end

A = [[0.98]]                    x+ = A x + B y (x' if continuous), u = C x + D y
B = [[1.0]]
C = [[3.0]]
D = [[0.0]]

A law of the storage devices:

law = "storage law"             or "bang-bang", "feedback"
groups = ["13+14"]              coherent groups
angle_gain = 1.0                and the other fields of the law, numbers or text with a unit: deadband = "100mHz"
rate = 60                       if it acts at frames
delay = "50ms"
"""

import dataclasses
import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from stabctl._util import files, toml_file
from stabctl._util.errors import StudyError, shown
from stabctl.controllers.bang_bang import BangBang
from stabctl.controllers.controller import Controller
from stabctl.controllers.feedback import Feedback
from stabctl.controllers.law import Law, SampledLaw
from stabctl.controllers.storage_law import StorageLaw
from stabctl.controllers.timing import Gate

if TYPE_CHECKING:
    from pydantic import BaseModel

MOST = 1000  # states, inputs or outputs
KINDS: dict[str, type[Law]] = {"storage law": StorageLaw, "bang-bang": BangBang, "feedback": Feedback}


def load(path: str | Path) -> Controller | Law:
    """Read a controller, or a law of storage devices, from a TOML file.

    Parameters
    ----------
    path : str or Path
        The file; `stabctl.io.control_files` describes its keys.

    Returns
    -------
    Controller or Law

    Raises
    ------
    StudyError
        If the file cannot be read, or a value is not allowed; names the file and the key.

    Examples
    --------
    >>> st.Controller("deviation:1", "order:1@5", [], [], [], [[100.0]], name="pod").save("pod.toml")
    PosixPath('pod.toml')
    >>> print(st.load_controller("pod.toml"))
    pod: deviation:1 -> order:1@5 (0 states, continuous)
    """
    path = files.path_of(path)
    content = toml_file.read(path, "controller file")
    return _law(content, path) if "law" in content else _controller(content, path)


def _controller(content: Mapping[str, Any], path: Path) -> Controller:
    """The controller that a file contains."""
    found: Any = toml_file.validated(_model(), content, str(path))
    values = {key: getattr(found, key) for key in found.model_fields_set}
    gate = values.pop("gate", None)
    for key in gate or ():
        if key not in Gate.__dataclass_fields__:
            raise StudyError(f"{path}, gate: {toml_file.unknown(key, Gate.__dataclass_fields__)}")
    try:
        for key in "ABCD":
            values[key] = np.array(values[key], float)
        if not values["D"].size:
            values["D"] = np.zeros((len(found.outputs), len(found.inputs)))
        values["limits"] = tuple(values.get("limits", (-math.inf, math.inf)))
        values["inputs"], values["outputs"] = tuple(values["inputs"]), tuple(values["outputs"])
        return Controller(**values, gate=Gate(**gate) if gate is not None else None)
    except ValueError:
        raise StudyError(f"{path}: the rows of the matrix {key} differ in length; give rows of equal length.") from None
    except StudyError as error:
        raise StudyError(f"{path}: {error}") from None


def _model() -> "type[BaseModel]":
    """What a file of a controller may contain."""
    from pydantic import BaseModel, ConfigDict, Field

    class File(BaseModel):
        model_config = ConfigDict(extra="forbid", strict=True)
        name: str = Field("controller", min_length=1, max_length=100, description="text of at most 100 characters")
        inputs: list[str] = Field(min_length=1, max_length=MOST, description="a list of signals, such as ['speed:2']")
        outputs: list[str] = Field(min_length=1, max_length=MOST, description="a list of inputs, such as ['vs:2']")
        rate: int | None = Field(None, description="a number of frames per second")
        delay: str | float = Field(0.0, description="a time, such as '50ms'")
        limits: list[float] = Field([-math.inf, math.inf], min_length=2, max_length=2, description="two numbers")
        deadband: float = Field(0.0, description="a number of at least 0")
        relay: bool = Field(False, description="true or false")
        ramp: float = Field(0.0, description="a number of at least 0")
        tracking: str | float | None = Field(None, description="a time, such as '50ms'")
        gate: dict[str, Any] | None = Field(None, description="a table with signal, low, high, magnitude, start, end")
        A: list[list[float]] = Field(max_length=MOST, description="rows of numbers")
        B: list[list[float]] = Field(max_length=MOST, description="rows of numbers")
        C: list[list[float]] = Field(max_length=MOST, description="rows of numbers")
        D: list[list[float]] = Field(max_length=MOST, description="rows of numbers")

    return File


def _law(content: Mapping[str, Any], path: Path) -> Law:
    """The law that a file contains."""
    values = dict(content)
    name, rate, delay = values.pop("law"), values.pop("rate", None), values.pop("delay", 0.0)
    if name not in tuple(KINDS):
        raise StudyError(f"{path}, law = {shown(name)}: it must be one of {', '.join(KINDS)}.")
    if rate is None and "delay" in content:
        raise StudyError(f"{path}: a delay needs a sampling rate; give one, such as rate = 60, or leave out the delay.")
    kind = KINDS[name]
    known = [f.name for f in dataclasses.fields(kind)]  # type: ignore[arg-type]
    for key in values:
        if key not in known:
            raise StudyError(f"{path}: {toml_file.unknown(key, ['law', *known, 'rate', 'delay'])}")
    try:
        law = kind(**values)
        return law if rate is None else law.sampled(rate, delay)
    except StudyError as error:
        raise StudyError(f"{path}: {error}") from None


def save_controller(controller: Controller, path: str | Path) -> Path:
    """Write a controller to a file, and return its path. Raises `StudyError` for a Python function.

    Parameters
    ----------
    controller : Controller
        The controller.
    path : str or Path
        File to write, ending in .toml.

    Examples
    --------
    >>> st.Controller("deviation:1", "order:1@5", [], [], [], [[100.0]]).save("pod.toml")
    PosixPath('pod.toml')
    """
    path = toml_file.target(path)
    if controller.law is not None:
        raise StudyError(f"{controller.name} is a Python function, which cannot be saved to a file; keep its script.")
    lines = [f"{key} = {value}" for key, value in _values(controller)]
    if controller.gate is not None:
        gate = (f"{k} = {toml_file.as_text(v)}" for k, v in vars(controller.gate).items() if v is not None)
        lines += ["", "[gate]", *gate]
    files.replace(path, "\n".join([*lines, ""]))
    return path


def _values(c: Controller) -> Iterable[tuple[str, str]]:
    yield "name", toml_file.as_text(c.name)
    yield "inputs", toml_file.as_text(list(c.inputs))
    yield "outputs", toml_file.as_text(list(c.outputs))
    for key in ("rate", "delay", "limits", "deadband", "relay", "ramp", "tracking"):
        value = getattr(c, key)
        if value not in (None, 0, False, (-math.inf, math.inf)):
            yield key, toml_file.as_text(list(value) if isinstance(value, tuple) else value)
    for key in "ABCD":
        yield key, _rows(getattr(c, key))


def _rows(M: np.ndarray) -> str:
    rows = [toml_file.as_text(row) for row in M.tolist()]
    return f"[{', '.join(rows)}]" if M.size < 8 else "[\n" + "".join(f"    {row},\n" for row in rows) + "]"


def save_law(law: Law, path: str | Path) -> Path:
    """Write a law to a file ending in .toml, and return its path. Raises `StudyError` if it is none of `KINDS`."""
    path = toml_file.target(path)
    inner = law.law if isinstance(law, SampledLaw) else law
    kind = next((name for name, kind in KINDS.items() if type(inner) is kind), None)
    if kind is None:
        raise StudyError(f"A law of the type {type(inner).__name__} cannot be written to a file; keep its script.")
    values: dict[str, Any] = {"law": kind}
    values |= {f.name: getattr(inner, f.name) for f in dataclasses.fields(inner)}  # type: ignore[arg-type]
    if "groups" in values:
        values["groups"] = ["+".join(map(str, group)) for group in values["groups"]]
    if isinstance(law, SampledLaw):
        values |= {"rate": law.rate, "delay": law.delay}
    files.replace(path, "".join(f"{key} = {toml_file.as_text(value)}\n" for key, value in values.items()))
    return path
