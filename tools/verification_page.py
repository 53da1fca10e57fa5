"""docs/verification.md and its figure: reference numbers beside ours, as `stabctl verify` computes them.

python tools/verification_page.py [FOLDER]     # folder with the downloaded files; by default in the user's cache
"""

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from stabctl.verification import Verification, traces, verify
from stabctl.verification.compare import text
from stabctl.verification.systems import System, folder_of, systems
from stabctl.view.figures import style
from stabctl.view.figures.palette import COLORS

DOCS = Path(__file__).parent.parent / "docs"
PAGE, FIGURE = DOCS / "verification.md", DOCS / "figures" / "verification.png"
OVERLAY = DOCS / "figures" / "verification_traces.png"
SHOWN = {  # system, signal -> what it is, and until when it is drawn (s)
    ("pstess_two_area_run", "angle_deg:1"): ("Two areas, angle of machine 1 (degrees), PSTess", 10),
    ("pstess_two_area_run", "efd_pu:2"): ("Two areas, field voltage of machine 2 (pu), PSTess", 10),
    ("pstess_wnaps_run", "speed_pu:14"): ("Reduced Western system, speed of machine 14 (pu), PSTess", 10),
    ("psse_esac1a", "angle_deg:102/1"): ("Three buses, GENROU with ESAC1A, angle (degrees), PSS/E", 10),
    ("openipsl_gensal", "angle_deg:1/1"): ("One machine, GENSAL, angle (degrees), OpenIPSL", 10),
    ("openipsl_scrx", "v_pu:1"): ("One machine, GENROU with SCRX, voltage (pu), OpenIPSL", 5),
}
INTRODUCTION = """# Verification

Numbers of known systems, published or computed by other programs, beside those of stabctl. This page is written by
`tools/verification_page.py`; do not edit it. `stabctl verify` makes the same table, `stabctl verify SYSTEM` shows every
number of a system, and `st.verify()` returns them with `.df` and `.plot()`. A slow test fails if a number moves by more
than its tolerance.

Files that may not be passed on are downloaded by `stabctl verify --download`, and compared with the checksums in
`stabctl/verification/systems.toml`. Values that the data of a system give, such as the dispatch, are not counted. An
eigenvalue is compared with the nearest of ours; an oscillation counts as two numbers. A trace counts as one: the two
values at the instant of the largest difference.

![Reference oscillations and ours, and all differences](figures/verification.png)

Traces of other programs and of stabctl after a fault, or after a line has opened:

![Six traces of PSTess, PSS/E and OpenIPSL, each on top of ours](figures/verification_traces.png)
"""

NOT_COMPARED = {
    "WECC, 179 buses, forced oscillations (University of Tennessee)": "Its modes are not among the numbers collected.",
    "Power System Toolbox, d2asb, 18 eigenvalues of its manual": (
        "No file gives the printed eigenvalues: without saturation ours differ by up to 0.25 1/s."
    ),
    "Power System Toolbox, 16 machines, 15 modes of its manual": "The file of that run is not published.",
    "Rogers, a machine at an infinite bus (datasmib, Table 4.6)": (
        "Its file gives a stable swing, -0.12 ± 5.61j 1/s, the stored run an unstable one, 0.40 ± 5.57j; what that run "
        "had otherwise is not known."
    ),
    "Nordic 74": "Its tap changers with delays and its overexcitation limiters are not modeled.",
    "All-in-one system (KTH)": "Its two published runs clear the same fault in time up to 0.20 and up to 0.14 s.",
    "OpenIPSL: ESST4B, GGOV1, HYGOV, IEEEG1, IEEEST": "Their systems are not written as data files yet.",
    "Clearing times of ANDES with GENROU": "ANDES does not find the voltages after clearing.",
    "Clearing times of New England and of 145 buses (T. Athay 1979)": "No source with numbers and data was found.",
}


def page(found: Verification) -> Iterator[str]:
    """The parts of the page."""
    yield INTRODUCTION
    yield f"{found}\n"
    yield "## Systems\n"
    yield _table(("System", "Numbers", "Quantity", "Largest difference", "Tolerance"), _rows(found))
    yield "## Oscillations that differ\n"
    yield "By more than 0.01 Hz or 0.005 of the damping ratio:\n"
    yield _table(("System", "Mode", "Reference (1/s)", "Here (1/s)", "Why"), _far(found))
    yield "## Not compared, and why\n"
    yield _table(("What", "Why"), iter(NOT_COMPARED.items()))
    yield "## Sources and conventions\n"
    for name in found.by_system:
        yield f"**{name}.** {' '.join(_about(systems()[name]))}\n"


def _rows(found: Verification) -> Iterator[tuple[str, ...]]:
    last = ""
    for row, count in found.largest():
        called = f"{systems()[row.system].title} (`{row.system}`)" if row.system != last else ""
        yield called, str(count), row.quantity, f"{row.difference:.2g} {row.unit}", f"{row.tolerance:g}"
        last = row.system


def _far(found: Verification) -> Iterator[tuple[str, ...]]:
    for row in found.rows:
        if row.far:
            yield f"`{row.system}`", row.object, text(row.published), text(row.ours), row.reason


def _about(of: System) -> Iterator[str]:
    yield from of.sentences()
    if of.files:
        yield f"Data: {', '.join(f'[{one.name}]({one.url})' for one in of.files)} ({of.license})."


def overlay() -> Figure:
    """Six traces: ours as lines, those of the other programs as dots."""
    figure, axes = style.subplots(9.6, 7.2, rows=3, columns=2)
    for ax, ((name, signal), (what, until)) in zip(axes.flat, SHOWN.items(), strict=True):
        system = systems()[name]
        case = system.read(folder_of(None))
        (theirs,) = (one for one in traces.traces(system, case) if one.signal == signal)
        run, table = traces.run(system, case, until)
        ax.plot(run.time, table[signal], color=COLORS[0], linewidth=1.2, label="stabctl")
        shown = np.flatnonzero(theirs.time <= until)[::2]
        ax.plot(theirs.time[shown], theirs.theirs[shown], ".", color=COLORS[1], ms=4, label=what.rpartition(", ")[2])
        ax.set(title=what.rpartition(", ")[0], xlabel="time (s)", xlim=(0, until))
        ax.legend(loc="best")
    return figure


def _table(heads: tuple[str, ...], rows: Iterator[tuple[str, ...]]) -> str:
    lines = [heads, ("---",) * len(heads), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


if __name__ == "__main__":
    result = verify(folder=sys.argv[1] if sys.argv[1:] else None)
    if result.missing:
        sys.exit(f"Files are missing of {', '.join(result.missing)}: stabctl verify --download")
    PAGE.write_text("\n".join(page(result)), encoding="utf-8")
    result.plot().savefig(FIGURE)
    overlay().savefig(OVERLAY)
    print(f"wrote {PAGE}, {FIGURE} and {OVERLAY}")
