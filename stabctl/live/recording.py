"""A page that is saved: its answers at clearing times around the present one, recorded."""

from dataclasses import fields, replace
from typing import Any

from . import page, runs
from .commands import Source
from .points import Points
from .state import State

FRAMES = 17  # recorded clearing times
SPREAD = 8.0  # cycles   over which they are spread


def recording(points: Points, state: State, load: Source, results: Any) -> dict[str, Any]:
    """What a saved page knows: the case, the state, recorded runs, and the results that the page has."""
    first = max(0.0, state.clear - SPREAD / 2)
    times = sorted({*(first + SPREAD * k / (FRAMES - 1) for k in range(FRAMES)), state.clear})
    taken = [(clear, runs.answer(points, replace(state, clear=clear), load)) for clear in times]
    return {
        "case": page.about(points),
        "clear": state.clear,
        "state": {f.name: getattr(state, f.name) for f in fields(state)} | {"megawatts": dict(state.megawatts)},
        "runs": [[clear, page.encoded(answer)] for clear, answer in taken],
        "results": results,
    }
