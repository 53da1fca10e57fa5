"""docs/verification.md and its figure: reference numbers beside ours, as `stabctl verify` computes them.

python tools/verification_page.py [FOLDER]     # folder with the downloaded files; by default in the user's cache
"""

import sys
from collections.abc import Iterator
from pathlib import Path

from stabctl.verification import Verification, verify
from stabctl.verification.compare import text
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
    yield _table(("System", "Numbers", "Quantity", "Largest difference", "Tolerance"), _rows(found))
    yield "## Oscillations that differ\n"
    yield "By more than 0.01 Hz or 0.005 of the damping ratio:\n"
    yield _table(("System", "Mode", "Reference (1/s)", "Here (1/s)", "Why"), _far(found))
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
