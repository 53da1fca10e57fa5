"""Equally spaced numbers in a study file: { from = 0.0, to = 0.4, count = 5 }, { from = 1, to = 20, step = 1 }.

In `text = "7-8@{}"` each number takes the place of {}.
"""

from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import PydanticCustomError

MOST = 1_000_000  # numbers of a grid
SHOWN = "a grid has from, to, and either count (at least 2) or step, and text for keys that are text"


class Grid(BaseModel):
    """Equally spaced numbers from `from` to `to`: `count` of them, or `step` apart."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)

    start: float = Field(alias="from")
    to: float
    count: int | None = Field(None, ge=2)
    step: float | None = None
    text: str | None = None


def is_grid(value: object) -> bool:
    """Whether a table is meant as a grid."""
    return isinstance(value, dict) and {"from", "to"} <= set(value)


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


def _wrong(text: str) -> PydanticCustomError:
    return PydanticCustomError("custom", text)
