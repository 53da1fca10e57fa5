"""The page of a design: modes without and with it, root locus, loop gains, step responses, clearing times."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np

from stabctl.design.evidence import Check, Evidence, evidence
from stabctl.design.result import FAST, SLOW, Design
from stabctl.design.tuning import Tuned
from stabctl.simulation.contingency import Contingency
from stabctl.smallsignal.modes import Modes

from ..figures import design as figures
from . import document
from .document import svg
from .modes_page import number


def page(found: Evidence) -> str:
    """Return the page of a design."""
    design = found.design
    return (
        document.environment()
        .get_template("design.html")
        .render(
            title=f"Controllers of {design.base.case.name}",
            summary=str(design).splitlines(),
            numbers=list(_numbers(found)),
            controllers=[_controller(c, design.largest_gains.get(c.name)) for c in design.controllers],
            modes=list(_modes(design)),
            points=list(_points(design)) if len(design.before) > 1 else [],
            parameters=list(_parameters(design)) if isinstance(design, Tuned) else [],
            holds=list(_holds(design)) if isinstance(design, Tuned) else [],
            checks=[_check(c) for c in found.checks],
            changes=found.summary,
            replaces=design.given is not None,
            loops=[(x.name, number(x.distance, 3), _degrees(x.phase_margin)) for x in found.loops],
            margins=found.margins.together if found.margins else "",
            load=f"{found.steps.mw:.3g} MW at bus {found.steps.bus}",
            map=svg(figures.plot_design(design), "Modes without and with the controllers"),
            locus=svg(figures.locus(found), "Root locus over the gain"),
            bode=svg(figures.bode(found), "Loop gains") if found.loops else None,
            steps=svg(figures.steps(found), "Speeds after a load step without and with the controllers"),
            own=svg(figures.own_steps(found), "Step responses of the controllers") if found.steps.own else None,
        )
    )


def write(design: Design, folder: str | Path, checks: Iterable[Contingency | str] = ()) -> Path:
    """Write the page of a design into a folder as CASE_design.html and return its path.

    Parameters
    ----------
    design : Design
        The design.
    folder : str or Path
        Folder of the page, created if it is missing.
    checks : iterable of Contingency or str
        Contingencies, such as "7-8@0.4", whose critical clearing times are compared without and with the controllers.

    Raises
    ------
    StudyError
        If the folder cannot be written to, or a contingency does not fit the case.

    Examples
    --------
    >>> base = st.load("two_area_thyristor").initialize(storage="3@11=50MW")
    >>> found = st.design.pod(base, "deviation:3", "order:3@11", damping=0.05)
    >>> found.report("pages").exists()
    True
    """
    found = evidence(design, checks)
    if isinstance(design, Tuned):
        found = replace(found, checks=(*design.checks, *found.checks))
    return document.write(folder, f"{design.base.case.name}_design", page(found))


def _numbers(found: Evidence) -> Iterator[tuple[str, str]]:
    yield f"{found.design.worst_before:.4f}", f"smallest damping ratio of {SLOW:g} to {FAST:g} Hz without"
    yield f"{found.design.worst_after:.4f}", "with the controllers"
    if found.design.worst_replaced is not None:
        yield f"{found.design.worst_replaced:.4f}", "with the stabilizers of the case, which they replace"
    if found.margins:
        late = found.margins.delay
        yield "over 2 s" if np.isinf(late) else f"{1e3 * late:.4g} ms", "delay margin"
        up = found.margins.gain_up
        yield "over 1000" if np.isinf(up) else f"{up:.3g}", "times the gains are still stable"


def _controller(c: Any, gain: float | None) -> tuple[str, ...]:
    limits = "none" if np.isinf(c.limits[1]) and np.isinf(c.limits[0]) else f"{c.limits[0]:g} to {c.limits[1]:g}"
    kind, late = f"{c.rate}/s" if c.rate else "continuous", f"{1e3 * c.delay:g} ms"
    return (
        c.name,
        _short(c.inputs),
        _short(c.outputs),
        str(len(c.A)),
        kind,
        late,
        limits,
        number(gain, 1) if gain else "",
    )


def _short(names: tuple[str, ...]) -> str:
    return ", ".join(names) if len(names) <= 6 else f"{', '.join(names[:4])} and {len(names) - 4} more"


def _modes(design: Design) -> Iterator[tuple[str, ...]]:
    """Modes of the first operating point without and with the controllers, side by side."""

    def rows(modes: Modes) -> list[tuple[str, ...]]:
        return [
            (modes.label(k), number(modes.frequency_hz[k], 3), number(100 * modes.damping_ratio[k], 2))
            for k in modes.within(SLOW, FAST)
        ]

    for before, after in zip_longest(rows(design.before[0]), rows(design.after[0]), fillvalue=("", "", "")):
        yield (*before, *after)


def _points(design: Design) -> Iterator[tuple[str, ...]]:
    for case, before, after, hz, mode in design.worst.to_numpy().tolist():
        yield case, number(100 * before, 2), number(100 * after, 2), number(hz, 3), mode


def _parameters(design: Tuned) -> Iterator[tuple[str, ...]]:
    """Every parameter that was tuned, with its bounds."""
    for device, name, value, unit, low, high, at in design.parameters.to_numpy().tolist():
        yield device, name, f"{value:.4g} {unit}".rstrip(" -"), f"{low:.4g} to {high:.4g}", at


def _holds(design: Tuned) -> Iterator[tuple[str, ...]]:
    """The worst damping with what is different from the networks tuned for."""
    for what, ratio, hz, where in design.holds.to_numpy().tolist():
        yield what, number(100 * ratio, 2), number(hz, 3), where


def _check(c: Check) -> tuple[str, ...]:
    def cycles(value: float | None) -> str:
        return "none" if value is None else f"{value:g}"

    lost = "" if c.after.machine is None else str(c.after.machine)
    own = (cycles(c.replaced.cycles),) if c.replaced else ()
    return c.label, cycles(c.before.cycles), *own, cycles(c.after.cycles), lost


def _degrees(value: float) -> str:
    return "" if np.isinf(value) else number(value, 1)
