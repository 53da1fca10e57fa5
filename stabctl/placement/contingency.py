"""What a fleet of storage devices must survive: a fault, what clears it, and when."""

import tomllib
from collections.abc import Iterable
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

from stabctl.clearing import Screen
from stabctl.errors import StudyError
from stabctl.model.case import Case
from stabctl.simulation import contingency as simulated
from stabctl.simulation.events import branch, locate
from stabctl.units import seconds

COUNT, LONGER = 8, 1.2
LONGEST = 1_000_000  # bytes of a file
LATEST = 10.0  # s   clearing, which in practice is a matter of cycles
KEYS = {"fault": str, "trip": (str, list), "clear": str}
SHOWN = 'write [[contingency]] with fault = "16", trip = "16-21", clear = "8.2cyc"'


class Contingency(NamedTuple):
    """A fault, the circuits opened with it, and the clearing time that is to be survived."""

    fault: str
    trip: tuple[str, ...]
    clear: float  # s

    @property
    def name(self) -> str:
        """As a planner says it: `16 trip 16-21`."""
        return f"{self.fault} trip {', '.join(self.trip)}" if self.trip else self.fault


def packaged(case: str, classical: bool = False) -> Path | None:
    """The contingency file of a packaged case; None where it has none."""
    file = resources.files("stabctl") / "model" / "cases" / case / f"contingencies{'_classical' * classical}.toml"
    return Path(str(file)) if file.is_file() else None


def from_screen(found: Screen, hz: float, count: int = COUNT, longer: float = LONGER) -> tuple[Contingency, ...]:
    """The most critical pairs of a screen, one for each machine that goes first, to be survived `longer` times as long.

    Args: the screen, without storage; frequency (Hz); at most so many; share of the clearing times (1.2: a fifth more).
    """
    chosen: dict[int | None, Contingency] = {}
    for pair in found.pairs:
        if pair.cycles and pair.machine not in chosen:
            chosen[pair.machine] = Contingency(pair.fault, pair.trip, longer * pair.cycles / hz)
    return tuple(chosen.values())[:count]


def load(path: str | Path, case: Case) -> tuple[Contingency, ...]:
    """The contingencies of a TOML file, in the cycles of a case. `StudyError` names file, row, key and value."""
    path = Path(path)
    try:
        with path.open("rb") as file:
            text = file.read(LONGEST + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise StudyError(f"The contingency file {str(path)[:200]!r} cannot be read: {reason}.") from None
    if len(text) > LONGEST:
        raise StudyError(f"The contingency file {path} has more than {LONGEST} bytes; {SHOWN}.")
    try:
        found = tomllib.loads(text.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise StudyError(f"The contingency file {path} is not TOML: {error}.") from None
    rows = found.pop("contingency", None)
    if found:
        raise StudyError(f"{path}: the key {next(iter(found))!r} is not known; {SHOWN}.")
    if not isinstance(rows, list) or not rows or not all(isinstance(row, dict) for row in rows):
        raise StudyError(f"{path} holds no contingencies; {SHOWN}.")
    made = [_made(path, i, row, case) for i, row in enumerate(rows, start=1)]
    try:
        return checked(made, case)
    except StudyError as error:
        raise StudyError(f"{path}: {error}") from None


def _made(path: Path, i: int, row: dict[str, Any], case: Case) -> Contingency:
    where = f"{path}, contingency {i}"
    for key, value in row.items():
        if key not in KEYS:
            raise StudyError(f"{where}: the key {key!r} is not known; its keys are {', '.join(KEYS)}.")
        if not isinstance(value, KEYS[key]) and not (key == "fault" and type(value) is int):
            raise StudyError(f"{where}: {key} = {value!r} is not a text; {SHOWN}.")
    for key in ("fault", "clear"):
        if key not in row:
            raise StudyError(f"{where}: {key} is missing; {SHOWN}.")
    trip = row.get("trip", [])
    names = [trip] if isinstance(trip, str) else trip
    if not all(isinstance(name, str) for name in names):
        raise StudyError(f"{where}: trip = {trip!r} does not name circuits; write them as texts, 16-21.")
    try:
        return Contingency(str(row["fault"]), tuple(names), seconds(row["clear"], case.frequency_hz))
    except StudyError as error:
        raise StudyError(f"{where}: {error}") from None


def checked(contingencies: Iterable[Contingency], case: Case) -> tuple[Contingency, ...]:
    """The contingencies, each possible in the case and met once; else `StudyError`."""
    out = tuple(contingencies)
    if not out:
        raise StudyError("There is no contingency to survive; give at least one.")
    for i, one in enumerate(out, start=1):
        if not 0 < one.clear <= LATEST:
            raise StudyError(
                f"Contingency {i} ({one.name}) is cleared after {one.clear:g} s; give a time above 0 and at most "
                f"{LATEST:g} s."
            )
        try:
            locate(case, one.fault)
            for name in one.trip:
                branch(case, name)
            simulated.Contingency(one.fault, one.clear, one.trip, at=0.0).check(case)
        except StudyError as error:
            raise StudyError(f"Contingency {i} ({one.name}): {error}") from None
        if one in out[: i - 1]:
            raise StudyError(f"Contingency {i} ({one.name}) is listed twice; take one out.")
    return out
