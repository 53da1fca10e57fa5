"""Values checked against the fields of their record, by the validators of pydantic's core.

`checked` checks the rows of a table, `guard` a frozen dataclass. These checks are strict: no text or bool for a number,
numbers finite and of at most `LARGEST` in size. The core alone is loaded, with the first check; pydantic's own classes
around it would take several times as long. `checks_arguments` checks what a function is called with.
"""

import functools
import inspect
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import cache
from numbers import Integral, Real
from pathlib import Path
from types import NoneType, UnionType
from typing import TYPE_CHECKING, Any, NamedTuple, ParamSpec, TypeVar, get_args, get_origin

from .errors import StudyError, is_line, shown
from .schema import NAMED, Field, fields, hints
from .units import NUMBER, kind_of, quantity

if TYPE_CHECKING:
    from pydantic_core import SchemaValidator


LARGEST = 1e12  # larger numbers are assumed to be errors
Record = TypeVar("Record", bound=NamedTuple)


class Invalid(Exception):
    """A value that is not allowed: its row (from 0), its field, and what it must be."""

    def __init__(self, row: int, field: Field, value: object, expected: str) -> None:
        super().__init__(f"row {row}, {field.name}: {shown(value)} is not allowed; it must be {expected}")
        self.row, self.field, self.value, self.expected = row, field, value, expected


def checked(record: type[Record], rows: Iterable[Record]) -> tuple[Record, ...]:
    """The rows of a table with every value checked; whole numbers become floats where the field is one.

    Raises
    ------
    Invalid
        For the first value that is not allowed.
    """
    from pydantic_core import ValidationError

    try:
        return tuple(map(record._make, _table(record).validate_python(tuple(rows))))
    except ValidationError as error:
        first = _first(error)
        row, place = first["loc"][:2]
        f = fields(record)[record._fields[place]]
        raise Invalid(row, f, first["input"], _expected(f, first)) from None


def guard(record: Any) -> None:
    """Check the fields of a frozen dataclass and convert text with a unit; called from its `__post_init__`.

    The fields are written `name: Annotated[float, unit, ...]`. One may be None if this is its default.
    Text with a unit ("100mHz") becomes a number in the unit of the field.

    Raises
    ------
    StudyError
        For the first value that is not allowed; it names the field, the value and what it must be.
    """
    kind: type = type(record)
    for name, f in fields(kind).items():
        value = getattr(record, name)
        if value is None and getattr(kind, name, "") is None:
            continue
        if isinstance(value, str) and f.kind is float and kind_of(f.unit) not in (None, NUMBER):
            value = _number(name, value, f.unit)
            object.__setattr__(record, name, value)
        expected = fault(f, value)
        if expected:
            unit = "" if f.unit == "-" or isinstance(value, str) else f" {f.unit}"
            given = f"{value:g}" if isinstance(value, float) else shown(value)
            raise StudyError(f"{name} = {given}{unit} ({f.meaning}) must be {expected}.")


def _number(name: str, text: str, unit: str) -> float:
    """The number that a text with a unit holds."""
    try:
        return quantity(text, unit, bare=False)
    except StudyError as error:
        raise StudyError(f"{name}: {error}") from None


def fault(field: Field, value: object) -> str | None:
    """What a value must be, in words; None if it is allowed."""
    from pydantic_core import ValidationError

    try:
        _single(field.kind, field.choices, tuple(field.limits.items())).validate_python(value)
    except ValidationError as error:
        return _expected(field, _first(error))
    return None


@cache
def _table(record: type) -> "SchemaValidator":
    """Validator of all rows of a table."""
    from pydantic_core import SchemaValidator, core_schema

    columns = [
        _schema(f.kind, f.choices, f.limits) if f is not None else core_schema.any_schema()
        for f in hints(record).values()
    ]
    row = core_schema.tuple_schema(columns, strict=True)
    return SchemaValidator(core_schema.tuple_schema([row], variadic_item_index=0, strict=True))


@cache
def _single(kind: type, choices: tuple[str, ...], limits: tuple[tuple[str, float], ...]) -> "SchemaValidator":
    """Validator of one value."""
    from pydantic_core import SchemaValidator

    return SchemaValidator(_schema(kind, choices, dict(limits)))


def _schema(kind: type, choices: tuple[str, ...], limits: Mapping[str, float]) -> Any:
    """What pydantic's core calls such a field."""
    from pydantic_core import core_schema

    if choices:
        return core_schema.literal_schema(list(choices))
    if kind is str:
        return core_schema.no_info_after_validator_function(_line, core_schema.str_schema(strict=True))
    if kind is bool:
        return core_schema.bool_schema(strict=True)
    if kind == NAMED:
        return core_schema.union_schema([_schema(int, (), limits), _schema(str, (), {})])
    if kind is Any:
        return core_schema.any_schema()
    bounds = {"ge": -LARGEST, "le": LARGEST} | dict(limits)
    if kind is int:
        whole: Any = {name: int(limit) for name, limit in bounds.items()}
        return core_schema.int_schema(strict=True, **whole)
    real: Any = bounds
    return core_schema.float_schema(strict=True, allow_inf_nan=False, **real)


def _line(text: str) -> str:
    if not is_line(text):
        raise ValueError("not one line")
    return text


def _first(error: Any) -> Mapping[str, Any]:
    return error.errors(include_url=False, include_context=False)[0]


def _expected(f: Field, first: Mapping[str, Any]) -> str:
    """What a value must be, with more detail if the description of its field is not enough."""
    value = first["input"]
    if first["type"] == "finite_number":
        return f.expected().replace("a number", "a finite number")
    if isinstance(value, int | float) and not isinstance(value, bool) and abs(value) > LARGEST:
        return f"{f.expected()}, and at most {LARGEST:g} in size"
    return f.expected() if f.kind is not str or f.choices else "one line of text"


P = ParamSpec("P")
R = TypeVar("R")
WORDS: dict[Any, str] = {
    str: "text",
    bool: "True or False",
    int: "a whole number",
    float: "a number",
    NoneType: "None",
    Path: "a path",
    Mapping: "a dict",
    Callable: "a function",
} | dict.fromkeys((Iterable, Sequence, tuple), "a list")
CLASSES = {int: Integral, float: Real, Sequence: Collection, tuple: Collection}  # an array is a list, too


def checks_arguments(function: Callable[P, R]) -> Callable[P, R]:
    """A public function that refuses arguments of another kind than those of its annotations.

    The kinds are those of the outermost classes, `Iterable` of `Iterable[str]`; no bool is a number. Annotations in
    quotes, and those of literals, are not looked at.

    Raises
    ------
    StudyError
        For the first such argument; it names the argument, the value and what to give.
    """
    signature = inspect.signature(function)
    single = (p for p in signature.parameters.values() if p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD))
    kinds = {p.name: found for p in single if p.annotation is not p.empty and (found := _kinds(p.annotation))}

    @functools.wraps(function)
    def checked_function(*args: P.args, **kwargs: P.kwargs) -> R:
        for name, value in signature.bind(*args, **kwargs).arguments.items():
            if name in kinds and not any(_is(value, kind) for kind in kinds[name]):
                words = dict.fromkeys(WORDS.get(kind) or _with_article(kind.__name__) for kind in kinds[name])
                raise StudyError(f"{name} = {shown(value)} is not allowed; give {' or '.join(words)}.")
            if name == "seed" and value < 0:  # type: ignore[operator]
                raise StudyError(f"seed = {value} is not allowed; give a whole number from 0 on.")
        return function(*args, **kwargs)

    return checked_function


def _with_article(name: str) -> str:
    return f"{'an' if name[0] in 'AEIO' else 'a'} {name}"


def _kinds(annotation: Any) -> tuple[Any, ...]:
    """The classes that an annotation allows; none if it is not made of classes alone."""
    parts = get_args(annotation) if isinstance(annotation, UnionType) else (annotation,)
    kinds = tuple(get_origin(part) or part for part in parts)
    return kinds if all(isinstance(kind, type) and kind is not Any for kind in kinds) else ()


def _is(value: object, kind: Any) -> bool:
    if kind is bool:
        return type(value).__name__ in ("bool", "bool_")  # that of NumPy
    return isinstance(value, CLASSES.get(kind, kind)) and not (kind in (int, float) and isinstance(value, bool))
