"""The page of a design: modes without and with it, root locus, loop gains, step responses, clearing times."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np

from stabctl._util.wording import number
from stabctl.design.evidence import Check, Evidence, evidence
from stabctl.design.result import FAST, SLOW, Design
from stabctl.design.tuning import Tuned
from stabctl.design.tuning.robustness import RingDown
from stabctl.simulation.contingency import Contingency
from stabctl.smallsignal.modes import Modes

from ..figures import design as figures
from . import pattern
from .pattern import Page, Pair, Part, Section, Text, figure, table

CONTROLLER = "controller", "reads", "drives", "states", "frames", "delay", "limits", "largest gain"
POINTS = "operating point", "without (%)", "with (%)", "frequency (Hz)", "least damped mode with the controllers"
ON_POINTS = "Smallest damping ratio of 0.1 to 3 Hz at each operating point."
STEP_OF_ONE = "after a step of 1 in one input."


def page(found: Evidence) -> Page:
    """Return the page of a design."""
    design = found.design
    together = (
        f"All controllers together: {found.margins.together}."
        if found.margins
        else "The closed loop is unstable, so it has no margins."
    )
    own = found.steps.own
    return Page(
        f"{design.base.case.name}_design",
        f"Controllers of {design.base.case.name}",
        [" ".join(str(design).splitlines()), together],
        list(_numbers(found)),
        [
            Section(
                "Controllers",
                [table(CONTROLLER, [_controller(c, design.largest_gains.get(c.name)) for c in design.controllers])],
            ),
            *(_tuned(design) if isinstance(design, Tuned) else ()),
            Section("Modes", _modes(found)),
            Section("Operating points", [table(POINTS, _points(design), ON_POINTS)] if len(design.before) > 1 else []),
            Section("Loop gains", _loops(found) if found.loops else []),
            Section(
                "Step responses",
                [
                    figure(
                        figures.steps(found),
                        "Speeds against the center of inertia of the others",
                        f"after a load step of {found.steps.mw:.3g} MW at bus {found.steps.bus}, by the linear model, "
                        "without and with the controllers.",
                    ),
                    *(
                        [figure(figures.own_steps(found), "Outputs of the controllers alone", STEP_OF_ONE)]
                        if own
                        else []
                    ),
                ],
            ),
            Section("Contingencies", _checks(found) if found.checks else []),
        ],
    )


def _tuned(design: Tuned) -> Iterator[Section]:
    """How a tuned design holds elsewhere, and its parameters."""
    elsewhere = "with", "worst damping ratio (%)", "frequency (Hz)", "where"
    yield Section(
        "How it holds elsewhere", [table(elsewhere, _holds(design), "Every mode above 0.1 Hz, of all networks.")]
    )
    if design.ring_down:
        yield Section("Ring-down", [_ring_down(design.ring_down, design.base.case.frequency_hz)])
    heads = "controller", "parameter", "value", "bounds", "at a bound"
    yield Section("Parameters", [table(heads, _parameters(design))])


def _ring_down(found: RingDown, frequency_hz: float) -> Part:
    """The speeds after a small pulse, simulated and linear."""
    return figure(
        figures.ring_down(found, frequency_hz),
        "Speeds against the center of inertia of the others",
        f"after {found.mw:.3g} MW more load at bus {found.bus} for 0.1 s. Dots: nonlinear simulation, with the limits "
        "of the controllers. Lines: linear model.",
    )


def _modes(found: Evidence) -> list[Part]:
    """The map of modes, the root locus, and the modes of the first operating point."""
    one, other = "frequency (Hz)", "damping ratio (%)"
    return [
        Pair(
            figure(
                figures.plot_design(found.design),
                "Modes without and with the controllers,",
                "of all operating points. Dashed lines mark constant damping ratios.",
            ),
            figure(
                figures.locus(found),
                "Root locus.",
                "Eigenvalues of the first operating point with 0 to 2 times all gains, from light to dark.",
            ),
        ),
        table(
            ("without", one, other, "with", one, other),
            _side_by_side(found.design),
            f"Modes of {SLOW:g} to {FAST:g} Hz of the first operating point.",
        ),
    ]


def _loops(found: Evidence) -> list[Part]:
    """The gain of every loop."""
    margins = ["" if np.isinf(x.phase_margin) else number(x.phase_margin, 1) for x in found.loops]
    rows = [(x.name, number(x.distance, 3), margin) for x, margin in zip(found.loops, margins, strict=True)]
    return [
        figure(
            figures.bode(found),
            "Loop gain L(jω)",
            "with the sign of a negative feedback, opened at one output, with all other loops closed; sampling and "
            "delay are exact.",
        ),
        table(("opened at", "least distance from -1", "phase margin (deg)"), rows),
    ]


def _checks(found: Evidence) -> list[Part]:
    """The clearing times of contingencies without and with the controllers."""
    own = ("with those of the case (cycles)",) if found.design.given is not None else ()
    heads = "fault", "critical clearing time without (cycles)", *own, "with (cycles)", "critical machine"
    note = (
        "Nonlinear simulation. Critical machine: the one that loses synchronism first just beyond the critical "
        "clearing time."
    )
    return [table(heads, map(_check, found.checks), note), Text(found.summary)]


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
    return pattern.write(page(found), folder)


def _numbers(found: Evidence) -> Iterator[tuple[str, str]]:
    yield f"{found.design.worst_before:z.4f}", f"smallest damping ratio of {SLOW:g} to {FAST:g} Hz without"
    yield f"{found.design.worst_after:z.4f}", "with the controllers"
    if found.design.worst_replaced is not None:
        yield f"{found.design.worst_replaced:z.4f}", "with the stabilizers of the case, which they replace"
    if found.margins:
        late = found.margins.delay
        yield "over 2 s" if np.isinf(late) else f"{1e3 * late:.4g} ms", "delay margin"
        up = found.margins.gain_up
        yield "over 1000" if np.isinf(up) else f"{up:.3g}", "times the gains are still stable"


def _controller(c: Any, gain: float | None) -> tuple[str, ...]:
    limits = "none" if np.isinf(c.limits[1]) and np.isinf(c.limits[0]) else f"{c.limits[0]:g} to {c.limits[1]:g}"
    kind, late = f"{c.rate}/s" if c.rate else "continuous", f"{1e3 * c.delay:g} ms"
    largest = number(gain, 1) if gain else ""
    return c.name, _short(c.inputs), _short(c.outputs), str(len(c.A)), kind, late, limits, largest


def _short(names: tuple[str, ...]) -> str:
    return ", ".join(names) if len(names) <= 6 else f"{', '.join(names[:4])} and {len(names) - 4} more"


def _side_by_side(design: Design) -> Iterator[tuple[str, ...]]:
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
    lost = "" if c.after.machine is None else str(c.after.machine)
    own = (c.replaced.shown,) if c.replaced else ()
    return c.label, c.before.shown, *own, c.after.shown, lost
