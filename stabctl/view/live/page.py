"""The page: one HTML file from its parts, served, or saved with recorded answers."""

import base64
import json
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

from stabctl._util.errors import StudyError
from stabctl.clearing.screen_result import lines

from ..diagram import OneLine, one_line, storage
from ..figures.palette import AREAS, CLEARING, COLORS, LABELS, VOLTAGES, css
from . import answers
from .commands import Source
from .state import STORES, Points, State

STATIC = Path(__file__).parent / "static"
SCRIPTS = (
    "uPlot.iife.min.js", "core.js", "asking.js", "diagram.js", "symbols.js", "labels.js", "charts.js",
    "exports.js", "time.js", "critical.js", "plane.js", "modes.js", "landscape.js", "theory.js", "controls.js",
    "address.js", "main.js",
)  # fmt: skip
SHEETS = "style.css", "uPlot.min.css", "page.css"  # the first is made from that of all figures
KINDS = {".js": "text/javascript", ".css": "text/css"}
FRAMES = 17  # clearing times recorded in a saved page
SPREAD = 8.0  # cycles   over which they are spread


@cache
def html() -> str:
    """The page as it is served: its scripts and styles beside it."""
    links = "".join(f'<link rel="stylesheet" href="{name}">' for name in SHEETS)
    scripts = "".join(f'<script src="{name}"></script>\n' for name in SCRIPTS)
    return _text("page.html").replace("<!-- styles -->", links).replace("<!-- scripts -->", scripts)


def saved(recorded: Mapping[str, Any]) -> str:
    """The page with everything in it, and recorded answers in place of the server."""
    css = "".join(f"<style>{_text(name)}</style>" for name in SHEETS)
    data = json.dumps(recorded).replace("<", "\\u003c")
    scripts = f"<script>window.RECORDED = {data};</script>\n"
    scripts += "".join(f"<script>{_text(name)}</script>\n" for name in SCRIPTS)  # none has a closing tag in its text
    return _text("page.html").replace("<!-- styles -->", css).replace("<!-- scripts -->", scripts)


def file(name: str) -> tuple[bytes, str]:
    """A script or style sheet, and its kind. `StudyError` if there is none of this name."""
    if name not in (*SCRIPTS, *SHEETS):
        raise StudyError(f"The page has no file {name!r}.")
    return _text(name).encode(), KINDS[Path(name).suffix]


def _text(name: str) -> str:
    return css() if name == SHEETS[0] else (STATIC / name).read_text(encoding="utf-8")


@lru_cache(2)
def about(points: Points) -> dict[str, Any]:
    """What the page knows of the case: the diagram, names, gains, and the colors of all figures."""
    case, start = points.case, points.bare(State())
    drawn, found = one_line(start), lines(case)
    row, unit = case.row_of_bus, {m.machine: i for i, m in enumerate(case.machines)}
    return {
        "name": case.name,
        "title": case.title,
        "hz": case.frequency_hz,
        "diagram": _diagram(drawn),
        "buses": [[b.bus, b.name, b.rated] for b in case.buses],
        "branches": [
            [name, row[k.from_bus], row[k.to_bus], bool(t), float(mva)]
            for name, k, t, mva in zip(drawn.circuits, case.branches, drawn.transformer, drawn.loading, strict=True)
        ],
        "machines": [[str(m.called), row[m.bus], m.base, m.machine, row[m.storage_bus]] for m in case.machines],
        "rotors": [unit[number] for number in start.rotor_numbers],
        "lines": list(map(str, found.screened)),
        "states": start.layout.nx,
        "gains": answers.gains(case),
        "laws": points.laws,
        "stores": STORES,
        "storage": [s.machine for s in case.storage],  # of its own
        "controllers": [str(one.name) for one in points.controllers],
        "first": {name: getattr(points.first, name) for name in ("fault", "trip", "clear", "law")},
        "style": {"colors": COLORS, "areas": AREAS, "voltages": VOLTAGES, "clearing": CLEARING, "labels": LABELS},
    }


def _diagram(drawn: OneLine) -> dict[str, Any]:
    """Positions, y downward, and voltages."""
    flip, case = [1, -1], drawn.case
    beside = storage(case, drawn.buses, drawn.machines, range(len(case.machines)))
    return {
        "buses": (drawn.buses * flip).round(3).tolist(),
        "machines": (drawn.machines * flip).round(3).tolist(),
        "storage": (beside * flip).round(3).tolist(),
        "ends": (drawn.ends * flip).round(3).tolist(),
        "voltage": drawn.voltage.round(4).tolist(),
    }


def recording(
    points: Points, state: State, load: Source, results: Any, percents: Sequence[float] = ()
) -> dict[str, Any]:
    """What a saved page knows: the case, the state, recorded runs, and the results that the page has.

    Runs are recorded over the clearing time and, if `percents` are given, over the storage of every machine (% of MVA).
    """
    first = max(0.0, state.clear - SPREAD / 2)
    times = sorted({*(first + SPREAD * k / (FRAMES - 1) for k in range(FRAMES)), state.clear})
    each = [(clear, percent) for percent in percents or (state.percent,) for clear in times]
    runs = [(*one, answers.run_answer(points, replace(state, clear=one[0], percent=one[1]), load)) for one in each]
    return {
        "case": about(points),
        "clear": state.clear,
        "state": {f.name: getattr(state, f.name) for f in fields(state)} | {"megawatts": dict(state.megawatts)},
        "runs": [[*one, base64.b64encode(answer).decode()] for *one, answer in runs],
        "results": results,
    }
