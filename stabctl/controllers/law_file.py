"""Laws of storage devices as TOML files.

law = "storage law"             or "bang-bang", "feedback"
groups = ["13+14"]              coherent groups
angle_gain = 1.0                and the other fields of the law, numbers or text with a unit: deadband = "100mHz"
rate = 60                       if it acts at frames
delay = "50ms"
"""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from stabctl._util import files, toml_file
from stabctl.errors import StudyError, shown

from .bang_bang import BangBang
from .feedback import Feedback
from .law import Law, SampledLaw
from .storage_law import StorageLaw

KINDS: dict[str, type[Law]] = {"storage law": StorageLaw, "bang-bang": BangBang, "feedback": Feedback}


def save(law: Law, path: str | Path) -> Path:
    """Write a law to a file ending in .toml, and return its path."""
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


def from_content(content: Mapping[str, Any], path: Path) -> Law:
    """The law that a file contains. Raises `StudyError` that names the file, the key and the value."""
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
