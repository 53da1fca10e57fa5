"""A study file (TOML) and its jobs.

A key with a list, or with a grid, is combined with every other one. A grid gives equally spaced numbers:
{ from = 0.0, to = 0.4, count = 5 } or { from = 1, to = 20, step = 1 }; with text = "7-8@{}" each number takes the place
of {}. The table `set` changes the case: set."pss.1.K" = [5, 10, 20]. Each [[job]] is a group of keys that replaces or
adds to those above it, for values that belong together; the study is the union of its groups.
"""

import math
from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import cache
from itertools import product
from pathlib import Path
from types import GenericAlias
from typing import Annotated, Any, Literal, NoReturn, get_args

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, create_model
from pydantic_core import PydanticCustomError

from stabctl._util import schema, toml_file, units
from stabctl._util.errors import StudyError, is_line, shown

from .job import Job, JobKind, changed, columns

MOST = 1_000_000  # jobs of a study, and numbers of a grid
NEEDED: dict[JobKind, tuple[str, ...]] = {"clearing-time": ("case", "fault"), "simulate": ("case", "clear")}
STRICT = ConfigDict(extra="forbid", strict=True)
OF_CASE = {"s": "cyc", "pu": "Hz"}  # unit of a key -> one that the frequency of the case converts to it
SHOWN = "a grid has from, to, and either count (at least 2) or step, and text for keys that are text"


def _line(text: str) -> str:
    if not is_line(text):
        raise _wrong(f"{shown(text)} must be one line of text without control characters")
    return text


Line = Annotated[str, AfterValidator(_line)]


def read(path: str | Path) -> tuple[Job, ...]:
    """The jobs of a study file, each once. Raises StudyError with file, key and value of the first error."""
    path = Path(path)
    content = toml_file.read(path, "study file")
    groups = content.pop("job", [{}])
    if not (isinstance(groups, list) and groups and all(isinstance(group, dict) for group in groups)):
        raise StudyError(f"{path}, job: write groups of keys as tables under [[job]].")
    jobs: dict[Job, None] = {}
    for number, group in enumerate(groups, 1):
        where = f"{path}, job {number}" if len(groups) > 1 else f"{path}"
        tables = [_flat(where, one["set"]) for one in (content, group) if isinstance(one.get("set"), dict)]
        both = content | group
        if isinstance(both.get("set"), dict):
            both["set"] = {path: value for table in tables for path, value in table.items()}
        jobs.update(dict.fromkeys(_jobs(where, both)))
        if len(jobs) > MOST:
            _too_many(where)
    return tuple(jobs)


def _jobs(where: str, keys: dict[str, Any]) -> Iterator[Job]:
    """Every combination of the values of a group."""
    kind: Any = keys.get("kind")
    if kind not in get_args(JobKind):
        what = f", kind = {kind!r}: it" if "kind" in keys else ": kind is missing; it"
        raise StudyError(f"{where}{what} must be one of {', '.join(get_args(JobKind))}.")
    found: Any = toml_file.validated(_model(kind), keys, where)
    values = {name: getattr(found, f.column) for name, f in columns(kind).items() if f.column in keys and name != "set"}
    changes: dict[str, list[Any]] = found.set
    if math.prod(map(len, (*values.values(), *changes.values()))) > MOST:
        _too_many(where)
    for chosen in product(*values.values(), *changes.values()):
        own, case = chosen[: len(values)], chosen[len(values) :]
        yield Job(**dict(zip(values, own, strict=True)), set=changed(dict(zip(changes, case, strict=True))))


@cache
def _model(kind: JobKind) -> type[BaseModel]:
    """The keys of a study of this kind, each with its alternatives."""
    keys: dict[str, Any] = {}
    for name, f in columns(kind).items():
        if name == "set":
            continue
        default: Any = Field(... if f.column in NEEDED[kind] else [], description=f"{f.expected()} ({f.meaning})")
        keys[f.column] = (_list(f), default)
    changes = Annotated[dict[str, list[float | int | str]], BeforeValidator(_changes)]
    keys["set"] = (changes, Field({}, description='a number or text, such as set."pss.1.K" = [5, 10, 20]'))
    return create_model(f"{kind} study", __config__=STRICT, **keys)


def _list(f: schema.Field) -> Any:
    """The values of a key, for pydantic."""
    values: Any = GenericAlias(list, (_type(f),))
    return Annotated[values, Field(min_length=1), BeforeValidator(_alternatives(f))]


def _type(f: schema.Field) -> Any:
    """One value of a key, for pydantic."""
    if f.choices:
        return Literal[f.choices]
    if f.kind is str:
        return Line
    limits: Any = {**f.limits, **({"allow_inf_nan": False} if f.kind is float else {})}
    return Annotated[f.kind, Field(**limits)]


def _alternatives(f: schema.Field) -> Callable[[object], list[Any]]:
    """What lists the alternatives of a key: those of a list and of the grids in it, or the one value."""

    def listed(value: object) -> list[Any]:
        return [_converted(f, one) for one in expanded(value, text=f.kind is str)]

    return listed


def _converted(f: schema.Field, value: object) -> object:
    """A value in the type of its key: a bus number as text, a whole number, text with a unit as a number."""
    if f.column == "scan" and value == 0:
        return "0cyc"
    if f.kind is str and type(value) is int:
        return str(value)
    if f.kind is int and isinstance(value, float) and value.is_integer():
        return int(value)
    if f.kind is float and isinstance(value, str):
        try:
            return units.quantity(value, f.unit, bare=False)
        except StudyError:
            other = OF_CASE.get(f.unit)
            if other and other.lower() in value.lower():
                what = f"a value in {other} depends on the frequency of the case, and a study may have several cases"
                raise _wrong(f"{what}; write it in {f.unit}") from None
            return value
    return value


def _flat(where: str, table: dict[str, Any]) -> dict[str, Any]:
    """Path -> what it is set to, from quoted paths or from nested tables."""
    found: dict[str, Any] = {}
    for key, value in table.items():
        nested = isinstance(value, dict) and not is_grid(value)
        paths = {f"{key}.{path}": one for path, one in _flat(where, value).items()} if nested else {key: value}
        if twice := next((path for path in paths if path in found), None):
            raise StudyError(f"{where}, set: {twice} is there twice; give it once.")
        found |= paths
    return found


def _changes(given: object) -> dict[str, list[Any]]:
    """Path -> alternatives."""
    if not isinstance(given, dict):
        raise _wrong('write it as set."pss.1.K" = [5, 10, 20]')
    found = {path: expanded(value) for path, value in given.items()}
    if empty := next((path for path, values in found.items() if not values), None):
        raise _wrong(f"set.{empty} = []: it must have at least one value")
    for text in (one for path, values in found.items() for one in (path, *values) if isinstance(one, str)):
        _line(text)
    return found


def expanded(value: object, *, text: bool = True) -> list[Any]:
    """The alternatives of a key: those of a list and of the grids in it, those of a grid, or the one value.

    Parameters
    ----------
    value : object
        The value of a key.
    text : bool
        The key may have text; then a grid may have `text`.

    Raises
    ------
    PydanticCustomError
        For an invalid grid.
    """
    found: list[Any] = []
    for one in value if isinstance(value, list) else [value]:
        found += _numbers(one, text) if isinstance(one, dict) else [one]
    return found


def is_grid(value: object) -> bool:
    """Whether a table is meant as a grid."""
    return isinstance(value, dict) and {"from", "to"} <= set(value)


def _numbers(table: dict[str, Any], text: bool) -> list[Any]:
    try:
        grid = Grid.model_validate(table)
    except (ValidationError, OverflowError):
        raise _wrong(SHOWN) from None
    if (grid.count is None) == (grid.step is None):
        raise _wrong(SHOWN)
    if grid.text is not None and not (text and grid.text.count("{}") == 1):
        raise _wrong("text must contain {} once, and belongs to a key whose values are text")
    low, high = Fraction(repr(grid.start)), Fraction(repr(grid.to))  # decimals as they are written
    if grid.step is not None:
        step = Fraction(repr(grid.step))
        if not (high - low) * step > 0:
            raise _wrong(f"the step must lead from {grid.start:g} to {grid.to:g}")
        intervals = (high - low) // step
    else:
        intervals = (grid.count or 2) - 1
        step = (high - low) / intervals
    if intervals >= MOST:
        raise _wrong(f"the grid has more than {MOST} values")
    exact = [low + k * step for k in range(intervals + 1)]
    if grid.text is None:
        return [int(x) if x.denominator == 1 else float(x) for x in exact]
    return [grid.text.replace("{}", f"{x}" if x.denominator == 1 else f"{float(x):.15g}") for x in exact]


class Grid(BaseModel):
    """Equally spaced numbers from `from` to `to`: `count` of them, or `step` apart."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)

    start: float = Field(alias="from")
    to: float
    count: int | None = Field(None, ge=2)
    step: float | None = None
    text: str | None = None


def _wrong(text: str) -> PydanticCustomError:
    return PydanticCustomError("custom", text)


def _too_many(where: str) -> NoReturn:
    raise StudyError(f"{where}: the study has more than {MOST} jobs; split it into several files.")
