"""docs/verification.md and its figure: reference numbers beside ours, as `stabctl verify` computes them.

python tools/verification_page.py [FOLDER]     # folder with the downloaded files; by default in the user's cache
"""

import sys
from collections.abc import Iterator
from pathlib import Path

from stabctl.cli.verify import nearest_to_tolerance, number
from stabctl.verification import Comparison, Verification, verify
from stabctl.verification.compare import PAIRS
from stabctl.verification.systems import System, systems

DOCS = Path(__file__).parent.parent / "docs"
PAGE, FIGURE = DOCS / "verification.md", DOCS / "figures" / "verification.png"
INTRODUCTION = """# Verification

Numbers of known systems, published or computed by other programs, beside those of stabctl. This page is written by
`tools/verification_page.py`; do not edit it. `stabctl verify` makes the same table, `stabctl verify SYSTEM` shows every
number of a system, and `st.verify()` returns them with `.df` and `.plot()`. A slow test fails if a number moves by more
than its tolerance.

Files that may not be passed on are downloaded by `stabctl verify --download`, and compared with the checksums in
`stabctl/verification/systems.toml`. Values that the data of a system give, such as the dispatch, are not counted. An
eigenvalue is compared with the nearest of ours; an oscillation counts as two numbers.

![Reference oscillations and ours, and all differences](figures/verification.png)
"""


def page(found: Verification) -> Iterator[str]:
    """The parts of the page."""
    yield INTRODUCTION
    yield f"{found}\n"
    yield "## Systems\n"
    known = systems()
    yield _table(("System", "Numbers", "Quantity", "Largest difference", "Tolerance"), _rows(found, known))
    yield "## Oscillations that differ\n"
    yield "By more than 0.01 Hz or 0.005 of the damping ratio:\n"
    yield _table(("System", "Mode", "Reference (1/s)", "Here (1/s)", "Why"), _far(found))
    yield "## Sources and conventions\n"
    for name in found.by_system:
        yield f"**{name}.** {' '.join(_about(known[name]))}\n"


def _rows(found: Verification, known: "dict[str, System]") -> Iterator[tuple[str, ...]]:
    for name, rows in found.by_system.items():
        called = f"{known[name].title} (`{name}`)"
        for row in nearest_to_tolerance(rows):
            count = sum(one.numbers for one in rows if one.quantity == row.quantity)
            yield called, str(count), row.quantity, f"{row.difference:.2g} {row.unit}", f"{row.tolerance:g}"
            called = ""


def far(row: Comparison) -> bool:
    """Whether an oscillation differs by more than 0.01 Hz or 0.005 of the damping ratio."""
    hz, damping = row.hz_and_damping
    return row.quantity in PAIRS and row.swing and (abs(hz) > 0.01 or abs(damping) > 0.005)


def _far(found: Verification) -> Iterator[tuple[str, ...]]:
    for row in filter(far, found.rows):
        yield f"`{row.system}`", row.object, number(row.published), number(row.ours), row.reason


def _about(of: System) -> Iterator[str]:
    yield f"{of.source}."
    if of.conventions:
        yield f"Assumed: {of.conventions}."
    if of.reason:
        yield of.reason
    if of.files:
        yield f"Data: {', '.join(f'[{one.name}]({one.url})' for one in of.files)} ({of.license})."


def _table(heads: tuple[str, ...], rows: Iterator[tuple[str, ...]]) -> str:
    lines = [heads, ("---",) * len(heads), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


if __name__ == "__main__":
    result = verify(folder=sys.argv[1] if sys.argv[1:] else None)
    if result.missing:
        sys.exit(f"Files are missing of {', '.join(result.missing)}: stabctl verify --download")
    PAGE.write_text("\n".join(page(result)), encoding="utf-8")
    result.plot().savefig(FIGURE)
    print(f"wrote {PAGE} and {FIGURE}")
