"""An import report as text: tables and sentences to be pasted into a study."""

import textwrap
from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from stabctl._util.wording import counted, named
from stabctl.dynamics.violations import Violation
from stabctl.io.psse.devices import Unsupported
from stabctl.model.case import Case

from .checks import DRIFT_S

if TYPE_CHECKING:
    from .report import ImportReport

HEAD = "kind", "role", "records", "supported", "MVA"
LONGEST = 100  # characters of a line
WIDTH = 44  # characters of the first column of the checks


def machine(case: Case, v: Violation) -> int | str | None:
    """What the machine of a limit is called; None for a device at a bus."""
    return case.machines[v.unit].called if v.unit >= 0 else None


def page(report: "ImportReport") -> str:
    """The report."""
    parts = [_head(report), _kinds(report), _complete(report), _unsupported(report), _corrections(report)]
    return "\n\n".join("\n".join(lines) for part in (*parts, _checks(report)) if (lines := list(part)))


def _head(report: "ImportReport") -> Iterator[str]:
    case = report.case
    sizes = {"bus": case.buses, "branch": case.branches, "machine": case.machines, "load": case.loads}
    parts = ", ".join(counted(len(rows), noun) for noun, rows in sizes.items())
    yield f"Import of {' and '.join(path.name for path in report.files)}"
    yield f"{parts}; {case.frequency_hz:g} Hz, {case.base_mva:g} MVA"
    if case.title:
        yield case.title


def _kinds(report: "ImportReport") -> Iterator[str]:
    if report.kinds:
        mva = [f"{k.mva:.0f}" if k.mva else "" for k in report.kinds]
        rows = [(k.kind, k.role, str(k.records), str(k.supported), m) for k, m in zip(report.kinds, mva, strict=True)]
        yield from table(HEAD, rows, left=2)


def _complete(report: "ImportReport") -> Iterator[str]:
    if report.kinds:
        yield f"{report.supported} of {counted(report.records, 'record')} supported."
    if len(report.files) == 1:
        psse = report.files[0].suffix.lower() == ".raw"
        yield f"There are no dynamic models, only power-flow data{': no DYR file was given or found' if psse else ''}."
    if report.complete:
        yield "The import is complete: all data of the files are represented."
    else:
        yield "The import is incomplete: some data of the files are not represented."
    if report.stored and not report.complete:
        yield "For the checks below, machines without a model are constant-power injections, and the outputs"
        yield "of controls without a model are constant."


def _unsupported(report: "ImportReport") -> Iterator[str]:
    alike: dict[tuple[str, str, Path], list[Unsupported]] = defaultdict(list)
    for u in report.unsupported:
        alike[u.kind, u.reason, u.place.path].append(u)
    if alike:
        yield "Not supported"
    for (kind, reason, path), found in alike.items():
        lines = ", ".join(str(u.place.line) for u in found)
        owners = ", ".join(dict.fromkeys(u.owner for u in found if u.owner))
        where = f"{path.name} {named(len(found), 'line')} {lines}"
        yield from _wrapped(f"{kind}: {reason} ({where}{f'; {owners}' if owners else ''})")


def _corrections(report: "ImportReport") -> Iterator[str]:
    if report.corrections:
        yield "Corrections"
    for sentence in report.corrections:
        for path in report.files:
            sentence = sentence.replace(str(path), path.name)
        yield from _wrapped(sentence)


def _wrapped(sentence: str) -> list[str]:
    return textwrap.wrap(sentence, LONGEST, initial_indent="  ", subsequent_indent="    ", break_long_words=False)


def _checks(report: "ImportReport") -> Iterator[str]:
    stored, flow, start = report.stored, report.flow, report.start
    if stored:
        value = f"{_number(stored.mw)} MW (bus {stored.bus}), {_number(stored.mvar)} Mvar"
        yield _row("Power mismatch at the stored voltages", value)
    if flow:
        value = f"{_number(flow.dv)} pu, {_number(flow.dangle)} degrees"
        yield _row("Power flow minus stored voltages", value)
    if start:
        at = f" ({start.state})" if start.rate > 1e-8 else ""
        yield _row("Largest |dx/dt| at the start", f"{_number(start.rate)} 1/s{at}")
        text = f"{_number(start.drift)} pu" if np.isfinite(start.drift) else "the run ends before"
        yield _row(f"Drift over {DRIFT_S:g} s without a fault", text)
        yield _row("Limits exceeded at the start", "" if start.violations else "none")
        yield from (f"  {_violation(v)}" for v in start.violations)
    yield from (line for sentence in report.failures for line in textwrap.wrap(sentence, LONGEST))


def _violation(v: Violation) -> str:
    if not v.device:
        return f"{v.owner} is not in equilibrium at the power flow"
    needs = f", the power flow needs {v.needed:.4g} pu" if np.isfinite(v.needed) else ""
    return f"{v.device} of {v.owner}: {v.limit} = {v.value:g} pu{needs}"


def _row(what: str, value: str) -> str:
    return f"{what:{WIDTH}}{value}".rstrip()


def _number(value: float) -> str:
    """Two digits."""
    return "below 1e-9" if abs(value) < 1e-9 else f"{value:.2g}" if abs(value) < 10 else f"{value:.0f}"


def table(head: Sequence[str], rows: Sequence[Sequence[str]], left: int) -> Iterator[str]:
    """Rows of cells in columns; the first `left` of them are aligned to the left."""
    widths = [max(map(len, column)) for column in zip(head, *rows, strict=True)]
    for row in (head, *rows):
        cells = [f"{c:<{w}}" if i < left else f"{c:>{w}}" for i, (c, w) in enumerate(zip(row, widths, strict=True))]
        yield "  ".join(cells).rstrip()
