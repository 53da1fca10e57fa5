"""Clearing times as plain values, for a file of rows, and back."""

from typing import Any

from stabctl.simulation.contingency import Contingency
from stabctl.simulation.outcome import Kind
from stabctl.simulation.swings import Swings

from .margin import Margin
from .result import ClearingTime
from .search import Search
from .trial import Run


def as_plain(found: ClearingTime) -> dict[str, Any]:
    """The clearing time of a fault and the lines opened, without its search."""
    return {
        "case": found.case,
        "fault": found.fault,
        "trip": list(found.trip),
        "status": found.status,
        "cycles": found.cycles,
        "seconds": found.seconds,
        "machine": found.machine,
        "runs": [_run(run) for run in found.runs],
        "wall_s": found.wall_s,
    }


def from_plain(plain: dict[str, Any], search: Search) -> ClearingTime:
    """The clearing time that was found by a search, from its plain values."""
    contingency = Contingency(plain["fault"], trip=plain["trip"])
    runs = tuple(map(_run_of, plain["runs"]))
    answer = {name: plain[name] for name in ("case", "status", "cycles", "seconds", "machine", "wall_s")}
    return ClearingTime(contingency=contingency, search=search, runs=runs, **answer)


def _run(run: Run) -> list[Any]:
    margin = None if run.margin is None else [float(energy) for energy in run.margin]
    swings = None if run.swings is None else list(run.swings)
    return list(run._replace(margin=margin, swings=swings, stalled=list(run.stalled)))  # type: ignore[arg-type]


def _run_of(plain: list[Any]) -> Run:
    run = Run(*plain)
    return run._replace(
        outcome=Kind(run.outcome),
        margin=None if run.margin is None else Margin(*run.margin),
        swings=None if run.swings is None else Swings(*run.swings),
        stalled=tuple(run.stalled),
    )
