"""Criteria of performance: how far and for how long voltages, frequencies and angles of a run may leave their ranges.

Criteria are data, packaged ones or those of a TOML file.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from stabctl._util import toml_file
from stabctl._util.errors import StudyError, shown
from stabctl._util.units import radians, seconds
from stabctl._util.validation import checks_arguments
from stabctl._util.wording import near
from stabctl.model import naming
from stabctl.model.case import Case
from stabctl.model.tables import Bus


class _Rule(BaseModel):
    """What all rules have."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    name: str = Field(description='what the rule is called, such as "WR1.4"')


class _Local(_Rule):
    """A rule for the buses of some areas, or for all."""

    areas: tuple[int, ...] = Field((), strict=False, description="numbers of areas, such as [1, 3]; none: all")

    def concerns(self, bus: Bus) -> bool:
        """Whether the rule is for a bus."""
        return not self.areas or bus.area in self.areas


class Voltage(_Local):
    """A [[voltage]] rule: no longer below (or above) a level than a time."""

    below: float | None = Field(None, gt=0, le=2, description="a voltage in pu, above 0")
    above: float | None = Field(None, gt=0, le=2, description="a voltage in pu, above 0")
    of: Literal["nominal", "before"] = Field(
        "nominal", description='"nominal", or "before": the voltage before the fault'
    )
    longest: str = Field("0s", description='a time such as "2s" or "30cyc"')
    total: bool = Field(False, description="true, if the times below are added up, or false")
    since: Literal["start", "clearing", "recovery"] = Field(
        "start", description='"start", "clearing", or "recovery": the first time above `recovered` after clearing'
    )
    recovered: float | None = Field(None, gt=0, le=2, description="a voltage in pu, above 0")
    recover: str | None = Field(None, description='the time from the fault within which the level is reached, "20s"')
    buses: Literal["all", "loads", "machines"] = Field("all", description='"all", "loads" or "machines"')
    kv: tuple[float, float] | None = Field(
        None, strict=False, description="the lowest and highest rated voltage, in kV, such as [110, 400]"
    )

    def concerns(self, bus: Bus) -> bool:
        """Whether the rule is for the area and the rated voltage of a bus, which is not inside a transformer."""
        left_out = naming.internal(bus) or (self.kv and not self.kv[0] <= bus.rated <= self.kv[1])
        return super().concerns(bus) and not left_out


class Frequency(_Local):
    """A [[frequency]] rule: the speed of no machine longer below (or above) a frequency than a time."""

    below: float | None = Field(None, gt=10, description="a frequency in Hz, such as 59.0")
    above: float | None = Field(None, gt=10, description="a frequency in Hz, such as 61.0")
    longest: str = Field("0s", description='a time such as "2s"')
    total: bool = Field(False, description="true, if the times below are added up, or false")


class Angle(_Rule):
    """An [[angle]] rule: rotors of an island no farther apart."""

    separation: str = Field(description='an angle such as "120deg"')


class Swings(_Rule):
    """A [[swings]] rule: the last swings of the run decay, or at least do not grow."""

    must: Literal["decay", "not grow"] = Field(description='"decay" or "not grow"')


MODELS: dict[str, Any] = {"voltage": Voltage, "frequency": Frequency, "angle": Angle, "swings": Swings}


class _File(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    title: str = Field(description="a text")
    source: str = Field("", description="a text")
    unverified: str = Field("", description="a text")
    frequency_hz: float | None = Field(None, gt=0, description="the rated frequency for which the rules hold")
    voltage: list[Any] = Field([], description="[[voltage]] rules")
    frequency: list[Any] = Field([], description="[[frequency]] rules")
    angle: list[Any] = Field([], description="[[angle]] rules")
    swings: list[Any] = Field([], description="[[swings]] rules")


@dataclass(frozen=True)
class Criteria:
    """Rules for the runs of a system.

    Attributes
    ----------
    title, source, unverified
        What they are, where they are from, and what of them could not be verified.
    rules
        The rules.
    frequency_hz
        Rated frequency of the systems for which they hold; None: any.

    Examples
    --------
    >>> len(st.criteria("wecc-tpl-001").rules)
    4
    """

    title: str
    source: str
    unverified: str
    rules: tuple[Voltage | Frequency | Angle | Swings, ...]
    frequency_hz: float | None = None

    def check(self, case: Case) -> None:
        """Check that the criteria can be applied to a case.

        Parameters
        ----------
        case : Case
            The system.

        Raises
        ------
        StudyError
            If they are for another rated frequency, or a rule is for areas or rated voltages that the buses of the case
            do not have.

        Examples
        --------
        >>> st.criteria("wecc-tpl-001").check(st.load("two_area"))
        """
        if self.frequency_hz not in (None, case.frequency_hz):
            raise StudyError(
                f"{self.title} is for {self.frequency_hz:g} Hz, but {case.name} has {case.frequency_hz:g} Hz."
            )
        buses = [b for b in case.buses if not naming.internal(b)]
        for rule in self.rules:
            if isinstance(rule, Voltage) and rule.kv and (without := [b for b in buses if not b.rated]):
                raise StudyError(
                    f"{self.title}, {rule.name}: the rule is for rated voltages, but bus {without[0].bus} of "
                    f"{case.name} has none; fill in its column rated, or leave out kv."
                )
            if isinstance(rule, _Local) and not any(map(rule.concerns, buses)):
                raise StudyError(
                    f"{self.title}, {rule.name}: {case.name} has no bus with {_meant(rule)}; its areas are "
                    f"{_listed({b.area for b in buses})}, its rated voltages {_listed({b.rated for b in buses})} kV."
                )


def packaged() -> tuple[str, ...]:
    """Names of the packaged criteria."""
    folder = resources.files("stabctl") / "judgment" / "packaged"
    return tuple(sorted(one.name.removesuffix(".toml") for one in folder.iterdir() if one.name.endswith(".toml")))


@checks_arguments
def criteria(name: Criteria | str | Path) -> Criteria:
    """Read criteria.

    Parameters
    ----------
    name : Criteria, str or Path
        Criteria, which are returned, packaged ones (wecc-tpl-001, nerc-prc-024, entso-e), or a TOML file.

    Returns
    -------
    Criteria

    Raises
    ------
    StudyError
        If there is no such file, or for the first mistake in it, with its place.

    Examples
    --------
    >>> st.criteria("nerc-prc-024").rules[0].name
    'PRC-024-3, above 1.200 pu'
    """
    if isinstance(name, Criteria):
        return name
    if str(name) in packaged():
        path = Path(str(resources.files("stabctl") / "judgment" / "packaged" / f"{name}.toml"))
    elif Path(name).suffix.lower() == ".toml":
        path = Path(name)
    else:
        others = near(str(name), packaged(), "there are")
        raise StudyError(f"There are no criteria {shown(str(name))}; {others} Or give a TOML file.")
    found = toml_file.validated(_File, toml_file.read(path, "criteria file"), str(path))
    rules: list[Any] = []
    for kind, model in MODELS.items():
        for k, row in enumerate(getattr(found, kind), start=1):
            where = f"{path}, {kind} rule {k}"
            rules.append(_checked(toml_file.validated(model, row, where), where))
    if not rules:
        raise StudyError(f"{path} has no rules; write [[voltage]], [[frequency]], [[angle]] or [[swings]].")
    return Criteria(found.title, found.source, found.unverified, tuple(rules), found.frequency_hz)


def _meant(rule: Any) -> str:
    """The areas and rated voltages that a rule is for."""
    kv = getattr(rule, "kv", None)
    areas = f"area {_listed(rule.areas)}" if rule.areas else ""
    return " and ".join(filter(None, (areas, f"{kv[0]:g} to {kv[1]:g} kV" if kv else "")))


def _listed(numbers: Iterable[float]) -> str:
    """The first numbers of some, in order."""
    every = sorted(numbers)
    return ", ".join(f"{x:g}" for x in every[:8]) + (", ..." if len(every) > 8 else "")


def _checked(rule: Any, where: str) -> Any:
    """A rule whose limits make sense."""
    if isinstance(rule, Voltage | Frequency) and (rule.below is None) == (rule.above is None):
        raise StudyError(f"{where}: give either below or above.")
    if isinstance(rule, Voltage) and (rule.since == "recovery") != (rule.recovered is not None):
        raise StudyError(f'{where}: since = "recovery" and recovered belong together.')
    if isinstance(rule, Voltage) and rule.recover is not None and rule.below is None:
        raise StudyError(f"{where}: recover needs below, the level to be reached.")
    if isinstance(rule, Voltage) and rule.kv and not 0 < rule.kv[0] <= rule.kv[1]:
        raise StudyError(f"{where}: kv = [{rule.kv[0]:g}, {rule.kv[1]:g}] is not a range above 0.")
    try:
        for text in (getattr(rule, "longest", None), getattr(rule, "recover", None)):
            seconds(text or "0s", 60.0)
        apart = radians(rule.separation) if isinstance(rule, Angle) else 1.0
    except StudyError as error:
        raise StudyError(f"{where}: {error}") from None
    if not apart > 0:
        raise StudyError(f"{where}: the separation {rule.separation!r} is not above 0.")
    return rule
