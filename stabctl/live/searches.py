"""What takes longer than a moment, told as it is found: a critical clearing time, and that of every line."""

from collections.abc import Callable, Sequence
from typing import Any

from stabctl.clearing import ClearingTime, clearing_time, screen
from stabctl.clearing.trial import Run

from .points import Points
from .state import State

Tell = Callable[[dict[str, Any]], None]
FINE = "0.015625cyc"  # of the second search


def critical(points: Points, state: State, tell: Tell) -> None:
    """The critical clearing time: the interval after every simulation, the answer, then a finer one."""
    point, low, high = points.of(state), 0.0, float("inf")

    def ran(run: Run) -> None:
        nonlocal low, high
        low, high = (max(low, run.cycles), high) if run.stable else (low, min(high, run.cycles))
        tell({"low": min(low, high), "high": high if high < float("inf") else None})

    options: dict[str, Any] = {"control": state.control(points.case.frequency_hz), "progress": ran}
    found = clearing_time(point, state.contingency, **options)
    tell(_answer(found))
    if found.status == "found":
        low, high = 0.0, float("inf")
        tell(_answer(clearing_time(point, state.contingency, resolution=FINE, **options)))


def _answer(found: ClearingTime) -> dict[str, Any]:
    return {
        "status": found.status,
        "cycles": found.cycles,
        "resolution": found.search.resolution_cycles,
        "machine": found.machine,
        "text": str(found),
    }


def landscape(points: Points, state: State, tell: Tell) -> None:
    """Critical clearing times of faults at both ends of every line, those of a bus at a time."""

    def each(pairs: Sequence[ClearingTime]) -> None:
        rows = [[p.fault, p.trip[0], p.cycles, p.status, p.machine] for p in pairs]
        tell({"pairs": rows})

    found = screen(
        points.of(state),
        control=state.control(points.case.frequency_hz),
        each=each,
        progress=lambda done, of: tell({"done": done, "of": of}),
    )
    tell({"remarks": found.remarks()})
