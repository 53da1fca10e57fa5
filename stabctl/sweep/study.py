"""A study file (TOML) -> its jobs.

A key with a list, or with a grid { from, to, count | step, text }, is crossed with every other one. Each [[job]] is a
group of keys laid over those above it, for values that belong together; the study is the union of its groups.
"""

import math
import tomllib
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any, NoReturn, get_args

from stabctl._util.validation import fault
from stabctl.errors import StudyError
from stabctl.schema import Field

from .job import Job, Kind, columns

MOST = 1_000_000  # jobs of a study
GRID = {"from", "to", "count", "step", "text"}


def read(path: str | Path) -> tuple[Job, ...]:
    """The jobs of a study file, each once. `StudyError` names file, key and value of the first mistake."""
    path = Path(path)
    try:
        record = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        raise StudyError(f"There is no study file {path}; give the path of a TOML file.") from None
    except (ValueError, OSError, RecursionError) as error:
        raise StudyError(f"{path}: it cannot be read as TOML ({getattr(error, 'strerror', None) or error}).") from None
    groups = record.pop("job", [{}])
    if not (isinstance(groups, list) and groups and all(isinstance(g, dict) for g in groups)):
        raise StudyError(f"{path}, job: groups of jobs are written as tables under [[job]].")
    jobs: dict[Job, None] = {}
    for number, group in enumerate(groups, 1):
        place = f"{path}, job {number}" if len(groups) > 1 else f"{path}"
        jobs.update(dict.fromkeys(_crossed(place, record | group)))
        if len(jobs) > MOST:
            _too_many(place)
    return tuple(jobs)


def _crossed(place: str, keys: dict[str, Any]) -> Iterator[Job]:
    kind = keys.get("kind")
    if kind not in get_args(Kind):
        what = f", kind = {kind!r}: it" if "kind" in keys else ": kind is missing; it"
        raise StudyError(f"{place}{what} must be one of {', '.join(get_args(Kind))}.")
    known = {f.column: f for f in columns(kind).values()}
    for key in keys:
        if key not in known:
            raise StudyError(f"{place}, {key}: a {kind} study has no such key; it has {', '.join(known)}.")
    needed = {"clearing-time": ("case", "fault"), "simulate": ("case", "clear")}[kind]
    for key in needed:
        if key not in keys:
            raise StudyError(f"{place}: {key} is missing; a {kind} study needs it.")
    values = {known[key].name: _values(f"{place}, {key}", known[key], value) for key, value in keys.items()}
    if math.prod(map(len, values.values())) > MOST:
        _too_many(place)
    return (Job(**dict(zip(values, chosen, strict=True))) for chosen in product(*values.values()))


def _values(place: str, field: Field, value: object) -> list[Any]:
    """The alternatives of a key: those of a list and of the grids in it, of a grid, or the one value."""
    if value == []:
        raise StudyError(f"{place} = []: the list is empty; give at least one value.")
    found = []
    for one in value if isinstance(value, list) else [value]:
        found += _grid(place, field, one) if isinstance(one, dict) else [one]
    return [_value(place, field, one) for one in found]


def _value(place: str, field: Field, value: object) -> Any:
    """A value of the kind of its key; whole numbers pass for numbers and for texts (a bus)."""
    number = _is_number(value)
    whole = number and float(value).is_integer()
    if field.kind is str and number and isinstance(value, int):
        value = str(value)
    good = value in field.choices if field.choices else isinstance(value, str) and value.isprintable()
    if field.kind is not str:
        good = number and (whole or field.kind is float) and fault(field, field.kind(value)) is None
    if not good:
        raise StudyError(f"{place} = {value!r}: it must be {field.expected()} ({field.meaning}).")
    return field.kind(value)


def _is_number(value: object) -> bool:
    """Is it a number, and one that floating point holds?"""
    try:
        return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    except OverflowError:
        return False


def _grid(place: str, field: Field, grid: dict[str, Any]) -> list[Any]:
    """Numbers from `from` to `to`, `count` of them or `step` apart; in `text` each takes the place of {}."""
    place = f"{place} = {grid}"
    if not {"from", "to"} <= set(grid) <= GRID or ("count" in grid) == ("step" in grid):
        raise StudyError(f"{place}: a grid has from, to, and count or step (and text, as in '7-8@{{}}').")
    text = grid.get("text", "{}")
    if not isinstance(text, str) or text.count("{}") != 1 or (field.kind is not str and "text" in grid):
        raise StudyError(f"{place}: text must hold {{}} once, and belongs to a key whose values are texts.")
    numbers = {k: v for k, v in grid.items() if k != "text"}
    for name, value in numbers.items():
        if not _is_number(value):
            raise StudyError(f"{place}: {name} must be a number.")
    low, high = grid["from"], grid["to"]
    if "step" in grid:
        if not (high - low) * grid["step"] > 0:
            raise StudyError(f"{place}: step must lead from {low:g} to {high:g}.")
        step, intervals = grid["step"], (high - low) / grid["step"] + 1e-9
    else:
        if not (isinstance(grid["count"], int) and grid["count"] >= 2):
            raise StudyError(f"{place}: count must be a whole number of at least 2.")
        step, intervals = (high - low) / (grid["count"] - 1), grid["count"] - 1
    if intervals >= MOST:
        _too_many(place)
    points = [float(f"{low + k * step:.12g}") + 0.0 for k in range(int(intervals) + 1)]
    return [text.replace("{}", f"{x:.12g}") for x in points] if field.kind is str else points


def _too_many(place: str) -> NoReturn:
    raise StudyError(f"{place}: the study has more than {MOST} jobs; split it into several files.")
