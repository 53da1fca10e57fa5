"""Fields of a record with their unit, meaning and allowed values, read from `Annotated` type hints.

A record is a `NamedTuple` whose fields are written on one line each:

    H: Annotated[float, "s", "inertia constant", POSITIVE] = 5.0

Name, unit and default make the column of a table; the rest makes its error messages.
"""

import math
import types
from collections.abc import Mapping
from functools import cache
from typing import Annotated, Any, Literal, NamedTuple, get_args, get_origin, get_type_hints


class Range(NamedTuple):
    """Allowed numbers: low <= x <= high, or low < x where the low end is open."""

    low: float = -math.inf
    high: float = math.inf
    open_low: bool = False

    def __contains__(self, x: object) -> bool:
        return isinstance(x, int | float) and (self.low < x if self.open_low else self.low <= x) and x <= self.high

    def __str__(self) -> str:
        low = f"{'more than' if self.open_low else 'at least'} {self.low:g}"
        return low if self.high == math.inf else f"{low} and at most {self.high:g}"


ANY = Range()
POSITIVE = Range(0.0, open_low=True)
NOT_NEGATIVE = Range(0.0)
SHARE = Range(0.0, 1.0)
RATIO = Range(0.01, 100.0)
FROM_CASE = "filled from the case, not a column"

_SUFFIX = {"-": "", "MW/s": "_mw_per_s"}


class Field(NamedTuple):
    """One field of a record: a column of its table."""

    name: str
    kind: type  # float, int or str
    choices: tuple[str, ...]
    unit: str
    meaning: str
    allowed: Range
    default: Any  # NotImplemented where the column must be given

    @property
    def column(self) -> str:
        """Header of the column: the name, then the unit in lower case."""
        return self.name + _SUFFIX.get(self.unit, "_" + self.unit.lower())

    @property
    def required(self) -> bool:
        """Has no default."""
        return self.default is NotImplemented

    def expected(self) -> str:
        """What a value must be, in words."""
        if self.choices:
            return "one of " + ", ".join(self.choices)
        noun = {int: "a whole number", float: "a number", str: "a text"}[self.kind]
        return noun if self.allowed == ANY or self.kind is str else f"{noun} {self.allowed}"


@cache
def fields(record: type) -> Mapping[str, Field]:
    """Fields of a `NamedTuple` class that stand in a table, by name."""
    found = {}
    for name, hint in get_type_hints(record, include_extras=True).items():
        if get_origin(hint) is not Annotated:
            raise TypeError(f"{record.__module__}.{record.__name__}.{name} has no unit and meaning")
        kind, unit, meaning, *rest = get_args(hint)
        if FROM_CASE in rest:
            continue
        choices = get_args(kind) if get_origin(kind) is Literal else ()
        allowed = next((r for r in rest if isinstance(r, Range)), ANY)
        default = record._field_defaults.get(name, NotImplemented)
        found[name] = Field(name, str if choices else kind, choices, unit, meaning, allowed, default)
    return types.MappingProxyType(found)
