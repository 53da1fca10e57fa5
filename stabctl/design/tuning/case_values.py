"""Parameters that a case already has, to be tuned."""

from dataclasses import dataclass
from typing import Any

from stabctl._util.errors import StudyError, shown
from stabctl.model import naming
from stabctl.model.case import Case
from stabctl.model.edit import resolve

from .blocks import Range, Variable, checked_range

Shared = tuple[tuple[str, ...], Variable]  # paths of the case that share a variable


class Device:
    """What may be tuned."""

    def prepared(self, case: Case) -> Case:
        """The case without what it replaces."""
        return case

    def tunables(self, case: Case) -> list[Any]:
        """Its controllers in a case."""
        return []

    def of_case(self, case: Case) -> list[Shared]:
        """Its parameters of the case."""
        return []


def value(case: Case, path: str) -> float:
    """The value of a parameter of a device."""
    table, key, f = resolve(case, path)
    if table not in case.devices:
        raise StudyError(f"{path} is no parameter of a device; tune one such as exst3.KA or tgov.1.R.")
    found = getattr(list(case.devices[table].values())[naming.row(case, table, key)], f.name)
    if isinstance(found, bool) or not isinstance(found, int | float):
        raise StudyError(f"{path} = {shown(found)} is not a number that can be tuned.")
    return float(found)


@dataclass(frozen=True)
class Values(Device):
    """Parameters that the case has; see `values`."""

    path: str
    within: Range
    together: bool

    def of_case(self, case: Case) -> list[Shared]:
        """Paths that share a variable, and the variable."""
        paths = self._paths(case)
        held = [value(case, path) for path in paths]
        for path, own in zip(paths, held, strict=True):
            if not own > 0:
                raise StudyError(f"{path} = {own:g} of {case.name} cannot be tuned; only positive values can.")
        low, high = self.within
        if self.together:
            return [(paths, Variable(self.path, "x", low, high, 1.0))]
        return [((path,), Variable(path, "", low * v, high * v, v)) for path, v in zip(paths, held, strict=True)]

    def _paths(self, case: Case) -> tuple[str, ...]:
        """The path itself, or that of every row of its table."""
        table, *rest = self.path.split(".")
        if len(rest) == 1 and table in case.devices:
            return tuple(f"{table}.{key}.{rest[0]}" for key in case.devices[table])
        return (self.path,)


def values(path: str, *, within: Range = (0.5, 2.0), together: bool = False) -> Values:
    """Parameters of the case to be tuned.

    Parameters
    ----------
    path : str
        "exst3.KA" for every row of a table, or "exst3.2.KA" for one.
    within : pair of float
        Bounds, relative to the value that the case has.
    together : bool
        Multiply all by one common factor; by default each is tuned.

    Returns
    -------
    Values
        For `tune`.

    Raises
    ------
    StudyError
        If an argument is invalid.

    Examples
    --------
    >>> st.design.values("exst3.KA", within=(0.5, 2), together=True)
    Values(path='exst3.KA', within=(0.5, 2.0), together=True)
    """
    if not isinstance(path, str) or path.count(".") not in (1, 2):
        raise StudyError(f"{shown(path)} is no parameter of a device; give one such as exst3.KA or tgov.1.R.")
    low, high = checked_range("within", within, "-")
    if not low <= 1 <= high:
        raise StudyError(f"within = {shown(within)} leaves out the value of the case; give a range around 1.")
    return Values(path, (low, high), together)
