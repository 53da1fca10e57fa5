"""docs/coverage.md: how much of a collection of PSS/E systems is supported, from their import reports.

python tools/coverage_page.py [FOLDER]    by default ../shared/reference/import
"""

import sys
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

import stabctl as st
from stabctl._util.errors import CaseError
from stabctl._util.wording import counted

ROOT = Path(__file__).parent.parent
COLLECTION = ROOT.parent / "shared" / "reference" / "import"
PAGE = ROOT / "docs" / "coverage.md"
INTRODUCTION = """# Coverage

This page is written by `make coverage` from the import reports (`stabctl import`) of a collection of public PSS/E
systems; do not edit it. Their sources are
[PowerSimulationsDynamics.jl](https://github.com/NREL-Sienna/PowerSimulationsDynamics.jl) (`psid`),
[STEPS](https://github.com/changgang/steps) (`steps`) and [TOPS](https://github.com/hallvar-h/TOPS) (`tops`).
"""
SYSTEMS = """\
A system is *complete* if all that is in service and connected to a swing bus is represented. The power mismatch is the
largest at any bus, at the stored voltages; it is large if a file was changed after its power flow was solved. The drift
is the largest change of a voltage or a speed in 2 s without a fault; it is large if the initial state exceeds the
limits in the column before it.
"""
HEADS = ["System", "Buses", "Machines", "Records", "Supported", "Complete"]
HEADS += ["Mismatch, MW", "Limits exceeded", "Drift, pu"]
STILL = 1e-6  # pu   drift that is not shown


def reports(collection: Path) -> Iterator[tuple[str, st.ImportReport | str]]:
    """The report of every DYR file, with the RAW file of its folder that most of its records belong to."""
    for path in sorted(collection.rglob("*.[dD][yY][rR]")):
        best, wrong = None, ""
        for raw in sorted(path.parent.glob("*.[rR][aA][wW]")):
            try:
                report = st.import_report(raw, path, check=False)
            except CaseError as error:
                wrong = str(error).replace(f"{path.parent}/", "")
                continue
            best = report if best is None or report.supported > best.supported else best
        yield _name(path, collection), wrong if best is None else st.import_report(*best.files)


def page(collection: Path) -> str:
    """The text of the page."""
    found = dict(reports(collection))
    read = {name: one for name, one in found.items() if isinstance(one, st.ImportReport)}
    records, supported = (sum(getattr(one, what) for one in read.values()) for what in ("records", "supported"))
    whole = sum(one.complete for one in read.values())
    parts = [
        INTRODUCTION,
        f"Complete: {whole} of {counted(len(found), 'system')}.",
        f"Supported: {supported} of {counted(records, 'dynamic record')}.\n",
        "## Systems\n",
        SYSTEMS,
        _table(HEADS, (_row(name, one) for name, one in read.items())),
        *(f"`{name}` cannot be read: {one}\n" for name, one in found.items() if isinstance(one, str)),
        "## Kinds of records\n",
        _table(("Kind", "Role", "Records", "Supported"), _kinds(read.values())),
        "## Not supported\n",
        *_unsupported(read),
    ]
    return "\n".join(parts)


def _name(path: Path, collection: Path) -> str:
    return str(path.relative_to(collection).with_suffix(""))


def _row(name: str, one: st.ImportReport) -> tuple[object, ...]:
    case, start = one.case, one.start
    exceeded = "-" if start is None else ", ".join(f"{v.device} {v.limit}" for v in start.violations) or "none"
    drift = "-" if start is None else f"{start.drift:.1g}" if start.drift > STILL else "0"
    sizes = len(case.buses), len(case.machines), one.records, one.supported
    mw = one.stored.mw if one.stored else 0.0
    mismatch = f"{mw:.0f}" if mw >= 10 else f"{mw:.2g}"
    return f"`{name}`", *sizes, "yes" if one.complete else "no", mismatch, exceeded, drift


def _kinds(read: Iterable[st.ImportReport]) -> list[tuple[object, ...]]:
    records, supported, roles = Counter[str](), Counter[str](), {}
    for one in read:
        for kind in one.kinds:
            records[kind.kind] += kind.records
            supported[kind.kind] += kind.supported
            roles[kind.kind] = kind.role
    order = sorted(records, key=lambda kind: (supported[kind] == 0, roles[kind], kind))
    return [(kind, roles[kind], records[kind], supported[kind]) for kind in order]


def _unsupported(read: dict[str, st.ImportReport]) -> Iterator[str]:
    for name, one in read.items():
        reasons: dict[str, list[str]] = {}
        for kind, count in Counter((u.kind, u.reason) for u in one.unsupported).items():
            reasons.setdefault(kind[1], []).append(f"{kind[0]} ({count})")
        for reason, kinds in reasons.items():
            yield f"- `{name}`, {reason}: {', '.join(kinds)}"
    yield ""


def _table(head: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    head = tuple(head)
    lines = (head, ("---",) * len(head), *rows)
    return "\n".join("| " + " | ".join(map(str, row)) + " |" for row in lines) + "\n"


if __name__ == "__main__":
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else COLLECTION
    if not any(folder.rglob("*.dyr")):
        sys.exit(f"{folder}: there are no DYR files; give the folder of the collection.")
    PAGE.write_text(page(folder), encoding="utf-8")
    print(PAGE, file=sys.stderr)
