"""The page of a stability study: the answer, contingencies by margin, worst runs, modes, data, what would help."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from stabctl._util.wording import capitalized, counted, number
from stabctl.assessment import Study
from stabctl.assessment.result import BAND
from stabctl.clearing.index import CLEARED
from stabctl.clearing.trial import Search
from stabctl.controllers import BangBang
from stabctl.io import load, packaged
from stabctl.model.case import Case
from stabctl.simulation.contingency import Contingency
from stabctl.smallsignal.analysis import DAMPING, Selected

from ..figures import clearing, grid_strength, one_line
from ..figures import modes as eigenvalues
from ..figures import trajectory as curves
from ..figures.palette import INK
from . import pattern
from .pattern import Page, Part, Section, Text, figure, table

MOST = 500  # buses of a one-line diagram
DRAWN = 3  # of the worst runs, whose curves are shown
NEXT = 30  # contingencies that are shown before they are screened
FIRST = 25  # contingencies that are shown with their margins; the others are folded
HEADS = "contingency", "opened to clear it", "critical (cycles)", "margin (cycles)", "limited by"
FIRST_RUNS = "contingency", "a first run"
RUNS = "contingency", "outcome", "largest change of angle (deg)", "lowest voltage after clearing (pu)", "what happens"
VIOLATIONS = "contingency", "rule", "where", "at worst", "not allowed from (s)", "limit"
REMEDIES = "what", "change", "cost"
MODES = "mode", "frequency (Hz)", "damping ratio (%)", "main participants", "damped by", "undamped by"
USUAL = Search(longest_s=20.0)  # of a screen
SEARCH = {"resolution_cycles": "cyc", "limit_cycles": "cyc", "observed_s": "s", "scan_cycles": "cyc", "longest_s": "s"}
ASKED = 5  # modes whose damping is traced to the controls


def page(study: Study) -> Page:
    """Return the page of a study, as far as it is done."""
    case = study.point.case
    otherwise = study.no_modes and not study.insecure and all(one.kept for one in study.judged) and "undecided"
    verdict = (study.secure and "secure") or otherwise or "not secure" if study.complete else "in progress"
    without = "" if study.modes or study.no_modes else "modes and "
    still = [] if study.complete else [f"{without}contingencies"]
    still += ["remedies"] if len(study.remedies) < len(study.how.remedies) else []
    open_parts = [f"This page is not complete: {one} are still computed; load it again later." for one in still]
    return Page(
        f"{case.name}_study",
        f"Stability of {case.name}",
        [*pattern.about(case), *open_parts, *study.remarks()],
        [
            (
                verdict,
                "unstable at the operating point" if study.unstable else f"with a clearing time of {study.guaranteed}",
            ),
            *_numbers(study),
        ],
        [
            Section("Contingencies", list(_contingencies(study))),
            Section("What would help", list(_remedies(study))),
            Section("The worst contingencies", list(_worst(study))),
            Section("Oscillations", list(_modes(study))),
            Section("Grid strength at converters", list(_ratios(study))),
            Section("Operating point", list(_operating_point(study))),
            Section("Unusual data", [Text(sentence) for sentence in study.unusual.sentences()]),
            Section("What was studied", [Text(sentence, soft=True) for sentence in _scope(study)]),
            Section("In Python", list(_lines(study))),
        ],
    )


def write(study: Study, folder: str | Path) -> Path:
    """Write the page into a folder as CASE_study.html and return its path.

    Parameters
    ----------
    study
        The study, whole or as far as it is done.
    folder
        Folder of the page, created if it is missing.

    Raises
    ------
    StudyError
        If the folder cannot be created or written to.

    Examples
    --------
    >>> st.study(st.load("two_area"), clear="6cyc", faults="lines", worst=1).report("pages")
    PosixPath('pages/two_area_study.html')
    """
    return pattern.write(page(study), folder)


def _numbers(study: Study) -> Iterator[tuple[str, str]]:
    """The numbers at the top."""
    if study.margins:
        yield study.margins[0].shown, "cycles, the smallest margin"
        lost = f"contingencies lost with a clearing time of at most {study.guaranteed}"
        yield f"{len(study.insecure)} of {len(study.margins)}", lost
    if study.modes is not None and (worst := study.oscillations):
        yield f"{100 * study.modes.damping_ratio[worst[0]]:z.2f} %", "damping ratio of the least damped oscillation"
    if study.low_or_high:
        yield str(len(study.low_or_high)), "buses with a voltage outside the normal range"


def _contingencies(study: Study) -> Iterator[Part]:
    done = {m.found.contingency for m in study.margins}
    if left := [one for one in study.ranking if one.contingency not in done]:
        note = (
            f"{len(done)} of {len(study.ranking)} contingencies are screened. Next come those that look worst when "
            f"each is simulated once, cleared after {CLEARED:g} s."
        )
        yield table(FIRST_RUNS, [(one.contingency.label, str(one)) for one in left[:NEXT]], note)
    if study.screen is None or not study.screen.pairs:
        return
    bars = clearing.plot_screen(study.screen)
    bars.axvline(study.wanted.cycles, color=INK, linestyle="--", linewidth=1)
    yield figure(
        bars,
        "The shortest critical clearing times.",
        f"Labeled with what limits them. Dashed: the {study.wanted.cycles:g} cycles that protection guarantees.",
    )
    if len(study.point.case.buses) <= MOST:
        yield figure(one_line.plot(study.point, study.screen), "Clearing times on the network.", one_line.CAPTION)
    note = (
        f"Margin: critical clearing time minus the {study.wanted.cycles:g} cycles guaranteed, or the contingency's own "
        "clearing time. In red: lost with this time or less."
    )
    found = [(m, m.found) for m in study.margins]
    rows = [(p.place, ", ".join(p.trip), p.cell, m.shown, p.limit) for m, p in found]
    classes = ["" if m.secure else "unstable" for m in study.margins]
    yield table(HEADS, rows[:FIRST], note, classes=classes[:FIRST])
    if (rest := len(rows) - FIRST) > 0:
        others = table(HEADS, rows[FIRST:], classes=classes[FIRST:])
        yield others._replace(folded=f"The other {counted(rest, 'contingency')}, with larger margins")


def _worst(study: Study) -> Iterator[Part]:
    if not study.worst:
        return
    rows = []
    for m, run in zip(study.margins, study.worst, strict=False):
        after = run.time >= run.happened.cleared_s - 1e-9
        lowest = f"{np.abs(run.arrays.V[after])[run.energized[after]].min():.3f}" if after.any() else ""
        outcome = run.outcome.kind.value.replace("_", " ")
        rows.append(
            (m.found.contingency.label, outcome, f"{run.max_angle_from_coi_deg:.1f}", lowest, run.outcome.message)
        )
    note = f"Simulated with a clearing time of {study.guaranteed}."
    kept = [one.kept for one in study.judged] or [run.outcome.stable for run in study.worst]
    for m, ok in zip(study.margins, kept, strict=False):
        if ok and (least := m.found.lowest_unstable) is not None and least < m.required:
            note += f" {m.found.contingency.label} is survived then, but not with {least:g} cycles."
    yield table(RUNS, rows, note)
    found = [
        (m.found.contingency.label, v.rule, v.where, f"{v.extreme:.4g} {v.unit}", f"{v.from_s:.3f}", v.limit)
        for m, one in zip(study.margins, study.judged, strict=False)
        for v in one.violations
    ]
    if study.judged:
        short = sum(bool(one.undecided) for one in study.judged)
        late = f" {short} of the runs are too short to judge every rule." if short else ""
        head = study.judged[0].title
        yield table(VIOLATIONS, found, f"Violations of {head}.{late}" if found else f"{head}: kept.{late}")
    for m, run in zip(study.margins[:DRAWN], study.worst[:DRAWN], strict=False):
        yield figure(curves.overview(run), f"{m.found.contingency.label}.", run.outcome.message)


def _modes(study: Study) -> Iterator[Part]:
    modes = study.modes
    if modes is None:
        return
    yield figure(
        eigenvalues.plot_modes(modes),
        "Eigenvalues.",
        "Dashed lines mark constant damping ratios. Modes that are better damped or faster are not shown.",
    )
    red = {*study.poorly_damped, *modes.unstable}
    shown = sorted({*modes.swings(), *modes.least_damped(), *red}, key=modes.damping_ratio.__getitem__)
    rows: list[tuple[str, ...]] = []
    classes = []
    for k in shown:
        m = modes.mode(k)
        who = ", ".join(f"{p.state} {100 * p.share:.0f} %" for p in m.participation[:3])
        found = study.contributions(k) if len(rows) < ASKED else None
        sides = (found.damping, found.undamping) if found else ((), ())
        controls = (", ".join(f"{one.name} {100 * one.damping_ratio:+.2g}" for one in side[:3]) for side in sides)
        rows.append((m.label, number(m.frequency_hz, 3), number(100 * m.damping_ratio, 2), who, *controls))
        classes.append("unstable" if k in red else "")
    note = (
        f"Electromechanical modes, the least damped first, and others that grow, or of {BAND[0]:g} to {BAND[1]:g} Hz "
        f"below {100 * study.wanted.damping:g} % (in red). Participants: participation factors, in percent of the sum "
        f"of all. For the first {ASKED} modes: controls that change the damping ratio most, and by how much (%) if "
        "their effect were 1 % larger."
    )
    yield table(MODES, rows, note, classes=classes)


def _remedies(study: Study) -> Iterator[Part]:
    if not study.remedies:
        return
    same = all(r.after is None or r.after.voltages == r.before.voltages for r in study.remedies)
    shown = [dict(r.rows()[:-1] if same else r.rows()) for r in study.remedies]  # voltages only if they change
    heads = *REMEDIES, *shown[0], "secure"
    rows = []
    for r, values in zip(study.remedies, shown, strict=True):
        change = r.change.words if r.change else r.verdict
        rows.append((r.kind, change, r.price, *values.values(), "yes" if r.solves else "no"))
    note = "Without the change to with it, by the same study of the changed system. Each is looked at alone."
    yield table(heads, rows, note)
    yield from (Text(f"{r.kind.capitalize()}: {r.remark}") for r in study.remedies if r.change and r.remark)


def _ratios(study: Study) -> Iterator[Part]:
    if study.ratios is None:
        return
    found = study.ratios
    yield figure(
        grid_strength.plot_short_circuit_ratio(found),
        "Short-circuit ratios.",
        "Below the dashed line, 3, a grid is called weak (IEEE Std 1204).",
    )
    rows = [
        (name, str(bus), f"{mva:.1f}", f"{ratio:.2f}", f"{equivalent:.2f}")
        for name, bus, mva, ratio, equivalent in zip(
            found.converters, found.buses, found.rated_mva, found.ratio, found.equivalent, strict=True
        )
    ]
    yield table(("converter", "bus", "rating (MVA)", "SCR", "ESCR"), rows)


def _operating_point(study: Study) -> Iterator[Part]:
    low, high = study.wanted.voltages
    yield Text(f"{capitalized(str(study.flow))}.")
    if study.low_or_high:
        rows = [(str(bus), f"{size:.4f}") for bus, size in study.low_or_high]
        yield table(("bus", "voltage (pu)"), rows, f"Buses outside {low:g} to {high:g} pu.")


def _scope(study: Study) -> list[str]:
    """What the verdict rests on, and what was not looked at."""
    remarks = list(study.screen.remarks()) if study.screen else []
    return [
        *remarks,
        "Three-phase faults without impedance, unless a contingency says otherwise. Loading of lines is not compared "
        "with ratings, which cases do not have; protection other than the clearing of the fault is not modeled.",
        *([f"Only modes {study.modes.asked} are known; others may grow."] if isinstance(study.modes, Selected) else []),
        *(["The modes are those without storage laws and controllers."] if study.how.control else []),
    ]


def _lines(study: Study) -> Iterator[Part]:
    """The lines of Python that compute the numbers again."""
    yield Text(
        "Each number again, by the command that computes it alone. In place of ... comes what the study was given: its "
        "system, contingencies, storage, controls or criteria."
    )
    case, how, search = study.point.case, study.how, study.screen.search if study.screen else USUAL
    faults = repr(how.faults) if isinstance(how.faults, str) else "..."
    for name, unit in SEARCH.items():
        if (value := getattr(search, name)) != getattr(USUAL, name):
            faults += f", {name.rpartition('_')[0].replace('observed', 'observe')}='{value:.12g}{unit}'"
    limits = zip(search.criterion._fields, search.criterion, USUAL.criterion, strict=True)
    changed = ", ".join(f"{name}={value!r}" for name, value, default in limits if value != default)
    rules = f", criterion=st.Criterion({changed})" if changed else ""
    rules += f", step={search.step!r}" * bool(search.step)
    faults += rules + ", criteria=..." * bool(how.criteria)
    law = ", control=..." if how.control else ""
    wanted = study.wanted.dampings
    modes = f"modes(({BAND[0]:g}, {BAND[1]:g})" + f", damping={wanted}" * (wanted != DAMPING) + ")"
    every = [
        how.source or _made(case),
        "base.power_flow(); base.case.check()",
        f"base.{modes}",
        f"base.screen(faults={faults}{law})",
    ]
    for m, (_, until) in zip(study.margins, study.runs, strict=False):
        every.append(f"base.simulate({_written(m.found.contingency, m.required)}, until={until:.6g}{rules}{law})")
    for change in (r.change for r in study.remedies if r.change):
        law = ", control=st.BangBang()" if change.control == [BangBang()] else ", control=..." if change.control else ""
        every.append(f"changed = base.case.{change.code}.initialize()  # {change.words}")
        every.append(f"changed.{modes}; changed.screen(faults={faults}{law})")
    yield pattern.made("lines.html", lines=every)


def _made(case: Case) -> str:
    """The line of Python that makes the operating point of a packaged case."""
    packed = case.name in packaged() and load(case.name) == case
    return f"base = st.load({case.name!r}).initialize()" if packed else "base = ..."


def _written(c: Contingency, cycles: float) -> str:
    """A contingency as it is written in Python."""
    said = [repr(str(c.fault)), f"clear='{cycles:g}cyc'"]
    said += [f"trip={', '.join(map(str, c.trip))!r}"] * bool(c.trip) + [f"at={c.at!r}"] * (c.at != "1s")
    said += [f"impedance={c.impedance!r}"] * bool(c.impedance)
    for name, events in (("events", c.events), ("after", c.after)):
        told = ", ".join(repr(e) if isinstance(e, str) else f"st.{e!r}" for e in events)
        said += [f"{name}=[{told}]"] * bool(events)
    return f"st.Contingency({', '.join(said)})"
