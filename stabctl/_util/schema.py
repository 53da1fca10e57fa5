"""Fields of a record with their unit, meaning and allowed values, read from `Annotated` type hints.

A record is a `NamedTuple` (a row of a table) or a frozen dataclass whose fields are written on one line each:

    H: Annotated[float, "s", "inertia constant", POSITIVE] = 5.0

Name, unit and default make the column of a table; constraints are those of `annotated_types`, or one of the names
below. `_util.validation` checks values against them.
"""

import dataclasses
import types
from collections.abc import Iterable, Mapping
from functools import cache
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin, get_type_hints

from annotated_types import BaseMetadata, Ge, Gt, Interval

POSITIVE = Gt(0)
NOT_NEGATIVE = Ge(0)
SHARE = Interval(ge=0, le=1)
RATIO = Interval(ge=0.01, le=100)
NAMED = int | str  # a number or a name
FROM_CASE = "filled from the case, not a column"
_SUFFIX = {"-": "", "MW/s": "_mw_per_s", "pu/s": "_pu_per_s"}
_NOUNS: dict[Any, str] = {
    NAMED: "a whole number or a name",
    int: "a whole number",
    float: "a number",
    str: "text",
    bool: "True or False",
}
_WORDS = {"ge": "of at least {:g}", "gt": "above {:g}", "le": "of at most {:g}", "lt": "below {:g}"}


class Field(NamedTuple):
    """One field of a record: a column of its table.

    Attributes
    ----------
    name, unit, meaning : str
        As written in the record; the unit of a dimensionless field is "-".
    kind : type
        `float`, `int`, `str`, `bool` or `int | str`; `Any` where the record itself checks the value.
    choices : tuple of str
        The allowed texts, if the field is a `Literal`.
    limits : mapping
        Bounds of a number by name: ge, gt, le, lt.
    default : object
        `NotImplemented` if the value is required.
    """

    name: str
    kind: type
    choices: tuple[str, ...]
    unit: str
    meaning: str
    limits: Mapping[str, float]
    default: Any

    @property
    def column(self) -> str:
        """Header of the column: the name, then the unit in lower case."""
        return self.name + _SUFFIX.get(self.unit, "_" + self.unit.lower())

    @property
    def required(self) -> bool:
        """Whether there is no default."""
        return self.default is NotImplemented

    def expected(self) -> str:
        """What a value must be, in words."""
        if self.choices:
            return "one of " + ", ".join(self.choices)
        limits = dict(self.limits)
        words = [_NOUNS[self.kind]]
        if {"ge", "le"} <= set(limits):
            words.append(f"from {limits.pop('ge'):g} to {limits.pop('le'):g}")
        words.append(" and ".join(_WORDS[name].format(limit) for name, limit in limits.items()))
        return " ".join(word for word in words if word)


@cache
def fields(record: type) -> Mapping[str, Field]:
    """Fields of a record that a user gives, by name; those filled from the case are left out."""
    return types.MappingProxyType({name: f for name, f in hints(record).items() if f is not None})


@cache
def hints(record: type) -> Mapping[str, Field | None]:
    """Every annotated field of a record by name, in order; None for fields filled from the case."""
    found: dict[str, Field | None] = {}
    for name, hint in get_type_hints(record, include_extras=True).items():
        if get_origin(hint) is not Annotated:
            if dataclasses.is_dataclass(record):
                continue
            raise TypeError(f"{record.__module__}.{record.__name__}.{name} has no unit and meaning")
        kind, unit, meaning, *rest = get_args(hint)
        if FROM_CASE in rest:
            found[name] = None
            continue
        if get_origin(kind) in (Union, types.UnionType):
            kinds = [k for k in get_args(kind) if k is not type(None)]
            kind = kinds[0] if len(kinds) == 1 else Union[tuple(kinds)]  # noqa: UP007
        choices = get_args(kind) if get_origin(kind) is Literal else ()
        default = _default(record, name)
        found[name] = Field(name, str if choices else kind, choices, unit, meaning, _limits(rest), default)
    return types.MappingProxyType(found)


def _default(record: type, name: str) -> Any:
    """Default of a field of a NamedTuple or dataclass, NotImplemented if there is none."""
    if not dataclasses.is_dataclass(record):
        return getattr(record, "_field_defaults", {}).get(name, NotImplemented)
    default = record.__dataclass_fields__[name].default
    return NotImplemented if default is dataclasses.MISSING else default


def _limits(metadata: Iterable[object]) -> Mapping[str, float]:
    """Bounds by name (ge, gt, le, lt)."""
    single = [c for m in metadata for c in (m if isinstance(m, Interval) else (m,)) if isinstance(c, BaseMetadata)]
    return types.MappingProxyType({name: getattr(c, name) for c in single for name in [type(c).__name__.lower()]})
