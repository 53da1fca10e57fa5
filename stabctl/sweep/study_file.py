"""A study file (TOML) and its jobs.

A key with a list, or with a grid, is combined with every other one. A grid gives equally spaced numbers:
{ from = 0.0, to = 0.4, count = 5 } or { from = 1, to = 20, step = 1 }; with text = "7-8@{}" each number takes the place
of {}. The table `set` changes the case: set."pss.1.K" = [5, 10, 20]. Each [[job]] is a group of keys that replaces or
adds to those above it, for values that belong together; the study is the union of its groups.
"""

import math
from collections.abc import Callable, Iterator
from functools import cache
from itertools import product
from pathlib import Path
from types import GenericAlias
from typing import Annotated, Any, Literal, NoReturn, get_args

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, create_model
from pydantic_core import PydanticCustomError

from stabctl._util import schema, toml_file, units
from stabctl._util.errors import StudyError

from .job import Job, JobKind, changed, columns

MOST = 1_000_000  # jobs of a study, and numbers of a grid
NEEDED: dict[JobKind, tuple[str, ...]] = {"clearing-time": ("case", "fault"), "simulate": ("case", "clear")}
STRICT = ConfigDict(extra="forbid", strict=True)
OF_CASE = {"s": "cyc", "pu": "Hz"}  # unit of a key -> one that the frequency of the case converts to it
SHOWN = "a grid has from, to, and either count (at least 2) or step, and text for keys that are text"


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
        both = content | group
        if isinstance(content.get("set"), dict) and isinstance(group.get("set"), dict):
            both["set"] = content["set"] | group["set"]
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
        return Annotated[str, Field(pattern=r"^[^\x00-\x1f\x7f]*$")]
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


def _changes(given: object) -> dict[str, list[Any]]:
    """Path -> alternatives, from quoted paths or from nested tables."""
    if not isinstance(given, dict):
        raise PydanticCustomError("custom", 'write it as set."pss.1.K" = [5, 10, 20]')
    found: dict[str, list[Any]] = {}
    for key, value in given.items():
        if isinstance(value, dict) and not is_grid(value):
            found |= {f"{key}.{path}": values for path, values in _changes(value).items()}
        else:
            found[key] = expanded(value)
            if not found[key]:
                raise PydanticCustomError("custom", f"set.{key} = []: it must have at least one value")
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
    low, high = grid.start, grid.to
    if grid.step is not None:
        if not (high - low) * grid.step > 0:
            raise _wrong(f"the step must lead from {low:g} to {high:g}")
        step, intervals = grid.step, (high - low) / grid.step + 1e-9
    else:
        intervals = (grid.count or 2) - 1
        step = (high - low) / intervals
    if intervals >= MOST:
        raise _wrong(f"the grid has more than {MOST} values")
    points = [float(f"{low + k * step:.12g}") + 0.0 for k in range(int(intervals) + 1)]
    return points if grid.text is None else [grid.text.replace("{}", f"{x:.12g}") for x in points]


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
