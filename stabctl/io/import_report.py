"""The import report of a PSS/E, PST or MATPOWER system, as a record and as text to be pasted into a study."""

import textwrap
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from stabctl._util.errors import StabctlError, StudyError
from stabctl._util.tabular import Tabular
from stabctl._util.validation import checks_arguments
from stabctl._util.verbs import verb
from stabctl._util.wording import counted, named, together
from stabctl.dynamics.violations import Violation
from stabctl.model import conventions
from stabctl.model.case import Case
from stabctl.model.unusual import UnusualData

from . import _import_checks, matpower, psse, pst
from ._import_checks import DRIFT_S, FlowDifference, InitialState, Kind, Stored, by_kind
from ._matlab import assigns
from .load_case import matching_dyr, refuse
from .psse.dyr import Unsupported

if TYPE_CHECKING:
    import pandas as pd

    from stabctl.model.conventions import Conventions
    from stabctl.model.loads import Loads

__all__ = ["ImportReport", "InitialState", "Kind", "Stored", "import_report"]
HEAD = "kind", "role", "records", "supported", "MVA"  # of the table of kinds
LONGEST = 100  # characters of a line
WIDTH = 44  # characters of the first column of the checks
_T = TypeVar("_T")


@dataclass(frozen=True, repr=False, eq=False)
class ImportReport(Tabular):
    """What is represented of a PSS/E system, and whether it starts in steady state at its stored solution.

    Attributes
    ----------
    case : Case
        The system: machines without a model are constant-power injections, controls without a model are constant.
    files : tuple of Path
        The RAW file, and the DYR file if there is one.
    kinds : tuple of Kind
        The records by kind.
    unsupported : tuple of Unsupported
        Records without a model, with file, line and reason.
    corrections : tuple of str
        What was changed, with file and line, one sentence each.
    stored : Stored or None
        Power mismatch at the stored voltages; None if nothing was checked.
    flow : FlowDifference or None
        The power flow compared with the stored one; None if it has no solution.
    start : InitialState or None
        The start of the dynamic models; None without a DYR file, or if there is none.
    unusual : UnusualData
        Data outside the usual ranges.
    idle : tuple of str
        Controls and limits of a RAW file that do not act in the power flow, with their lines.
    failures : tuple of str
        Why a check has no result, one sentence each.

    Examples
    --------
    >>> report = st.import_report("three.raw", check=False)
    >>> report.complete, report.records, report.supported, len(report.corrections)
    (True, 5, 5, 2)
    """

    case: Case
    files: tuple[Path, ...]
    kinds: tuple[Kind, ...]
    unsupported: tuple[Unsupported, ...]
    corrections: tuple[str, ...]
    unusual: UnusualData
    stored: Stored | None = None
    flow: FlowDifference | None = None
    start: InitialState | None = None
    idle: tuple[str, ...] = ()
    failures: tuple[str, ...] = ()

    report = verb("stabctl.view.pages.pattern:report")

    @property
    def complete(self) -> bool:
        """Whether all that is in service and connected to a swing bus is represented."""
        return not self.unsupported

    @property
    def starts(self) -> bool:
        """Whether no check failed, and the start exceeds no limit; nothing is known without checks."""
        return not self.failures and not (self.start and self.start.violations)

    @property
    def records(self) -> int:
        """Number of records of dynamic models."""
        return sum(kind.records for kind in self.kinds)

    @property
    def supported(self) -> int:
        """Number of these records that the case holds."""
        return sum(kind.supported for kind in self.kinds)

    @property
    def df(self) -> "pd.DataFrame":
        """The records by kind."""
        import pandas as pd

        return pd.DataFrame(self.kinds, columns=list(Kind._fields))

    def plain(self) -> dict[str, Any]:
        """The report as a dictionary of numbers, texts and lists, as `stabctl import --json` prints it."""
        stored, flow, start = self.stored, self.flow, self.start
        exceeded = start.violations if start else ()
        return {
            "conventions": conventions.of(self.case),
            "records": self.records,
            "supported": self.supported,
            "complete": self.complete,
            "unsupported": [
                {"kind": u.kind, "file": str(u.place.path), "line": u.place.line, "reason": u.reason}
                for u in self.unsupported
            ],
            "corrections": list(self.corrections),
            "idle": list(self.idle),
            "unusual": self.unusual.plain()["unusual"],
            "mismatch_mw": stored and stored.mw,
            "mismatch_mvar": stored and stored.mvar,
            "mismatch_bus": stored and stored.bus,
            "dv_pu": flow and flow.dv,
            "dangle_deg": flow and flow.dangle,
            "dxdt": start and start.rate,
            "violations": [
                {"device": v.device, "machine": machine(self.case, v), "limit": v.limit, "value": v.value}
                for v in exceeded
            ],
            "drift_pu": start and start.drift,
        }

    def __str__(self) -> str:
        return page(self)


@checks_arguments
def import_report(
    raw: str | Path,
    dyr: str | Path | None = None,
    *,
    check: bool = True,
    loads: "Loads | None" = None,
    frequency: float | str | None = None,
    conventions: "Conventions | None" = None,
) -> ImportReport:
    """Read a PSS/E, PST or MATPOWER system and report what is represented.

    Parameters
    ----------
    raw : str or Path
        The RAW file, or a file of PST or MATPOWER ending in .m.
    dyr : str or Path, optional
        The DYR file of a RAW file; by default the one with the same name in the same folder.
    check : bool
        Also compare the network with the stored voltages, start the dynamic models and simulate 2 s without a fault.
    loads : {"impedance", "current", "power"}, optional
        What all loads keep constant in this simulation; by default what the file says.
    frequency, conventions
        As in `load`.

    Returns
    -------
    ImportReport

    Raises
    ------
    CaseError
        For the first mistake in a file, with line and field.
    StudyError
        If the first file ends in neither .raw nor .m, or if a DYR file is given with the latter.

    Examples
    --------
    >>> report = st.import_report("three.raw", "three.dyr", check=False)
    >>> report.complete
    True
    """
    read: psse.Import | pst.Import | matpower.Import
    kinds: tuple[Kind, ...] = ()
    ending = Path(raw).suffix.lower()
    if ending not in (".raw", ".m"):
        raise StudyError(f"{raw} is not a file ending in .raw or .m, which comes first; a folder needs no import.")
    if ending == ".m":
        if dyr is not None:
            raise StudyError(f"{dyr} cannot be used: a DYR file belongs to a PSS/E file ending in .raw.")
        if assigns(Path(raw), "mac_con"):
            read = pst.read(raw, frequency=frequency)
            kinds = tuple(Kind(*kind, mva=0.0) for kind in read.kinds)
        else:
            read = matpower.read(raw, **({} if frequency is None else {"frequency": frequency}))
    else:
        refuse(raw, {"frequency": frequency}, "a file ending in .m")
        dyr = matching_dyr(Path(raw)) if dyr is None else dyr
        read = psse.read(raw, dyr, missing="injection", missing_controls="fixed")
        kinds = by_kind(read)
    case = read.case.with_loads(loads) if loads is not None else read.case
    case = case.with_conventions(conventions) if conventions is not None else case
    files = tuple(Path(path) for path in (raw, dyr) if path is not None)
    idle = read.idle if isinstance(read, psse.Import) else ()
    report = ImportReport(case, files, kinds, read.unsupported, read.corrections, case.check(), idle=idle)
    return _checked(report) if check else report


def _checked(report: ImportReport) -> ImportReport:
    """The report with its checks; those that fail leave a sentence."""
    failures: list[str] = []

    def tried(check: Callable[[Case], _T], case: Case) -> _T | None:
        try:
            return check(case)
        except StabctlError as error:
            failures.append(str(error))
            return None

    network = psse.read(report.files[0]).case if len(report.files) > 1 else report.case
    flow = tried(_import_checks.flow_difference, network)
    start = tried(_import_checks.initial_state, report.case) if flow and report.case.devices else None
    return replace(report, stored=_import_checks.mismatch(network), flow=flow, start=start, failures=tuple(failures))


def machine(case: Case, v: Violation) -> int | str | None:
    """What the machine of a limit is called; None for a device at a bus."""
    return case.machines[v.unit].called if v.unit >= 0 else None


def page(report: ImportReport) -> str:
    """The report as text."""
    lines = [f"Import of {' and '.join(path.name for path in report.files)}", *about(report)]
    complete = [line for sentence in completeness(report) for line in textwrap.wrap(sentence, LONGEST)]
    checked = [f"{what:{WIDTH}}{value}".rstrip() for what, value in checks(report)]
    parts = [
        lines,
        _section("Unusual data", report.unusual.sentences()),
        list(_kinds(report)),
        complete,
        _section("Not supported", unsupported(report)),
        _section("Without effect on the power flow", report.idle),
        _section("Corrections", corrections(report)),
        [*checked, *(line for sentence in report.failures for line in textwrap.wrap(sentence, LONGEST))],
    ]
    return "\n\n".join("\n".join(part) for part in parts if part)


def about(report: ImportReport) -> Iterator[str]:
    """Size, title and conventions of the system."""
    case = report.case
    loads = {(row.bus, row.id) for row in case.loads if row.kind == "load"}
    sizes = {"bus": case.buses, "branch": case.branches, "machine": case.machines, "load": loads}
    parts = ", ".join(counted(len(rows), noun) for noun, rows in sizes.items())
    yield f"{parts}; {case.frequency_hz:g} Hz, {case.base_mva:g} MVA"
    if case.title:
        yield case.title
    if said := conventions.of(case):
        yield f"Machine equations: {said}; --conventions chooses others"


def _kinds(report: ImportReport) -> Iterator[str]:
    if report.kinds:
        mva = [f"{k.mva:.0f}" if k.mva else "" for k in report.kinds]
        rows = [(k.kind, k.role, str(k.records), str(k.supported), m) for k, m in zip(report.kinds, mva, strict=True)]
        yield from table(HEAD, rows, left=2)


def table(head: Sequence[str], rows: Sequence[Sequence[str]], left: int) -> Iterator[str]:
    """Rows of cells in columns; the first `left` of them are aligned to the left."""
    widths = [max(map(len, column)) for column in zip(head, *rows, strict=True)]
    for row in (head, *rows):
        cells = [f"{c:<{w}}" if i < left else f"{c:>{w}}" for i, (c, w) in enumerate(zip(row, widths, strict=True))]
        yield "  ".join(cells).rstrip()


def completeness(report: ImportReport) -> Iterator[str]:
    """Whether all is represented, one sentence each."""
    if report.kinds:
        yield f"{report.supported} of {counted(report.records, 'record')} supported."
    if not report.case.devices:
        missed = ": no DYR file was given or found" if report.files[0].suffix.lower() == ".raw" else ""
        yield f"There are no dynamic models, only power-flow data{missed}."
    if report.complete:
        yield "The import is complete: all that is in service and connected to a swing bus is represented."
    else:
        yield "The import is incomplete: some data of the files are not represented."
    if report.stored and not report.complete and report.files[0].suffix.lower() == ".raw":
        yield (
            "For the checks below, machines without a model are constant-power injections, and the outputs of controls "
            "without a model are constant."
        )


def unsupported(report: ImportReport) -> Iterator[str]:
    """What is not represented, those alike together, one sentence each."""
    alike: dict[tuple[str, str, Path], list[Unsupported]] = defaultdict(list)
    for u in report.unsupported:
        alike[u.kind, u.reason, u.place.path].append(u)
    for (kind, reason, path), found in alike.items():
        lines = ", ".join(str(u.place.line) for u in found)
        owners = ", ".join(dict.fromkeys(u.owner for u in found if u.owner))
        where = f"{path.name} {named(len(found), 'line')} {lines}"
        yield f"{kind}: {reason} ({where}{f'; {owners}' if owners else ''})"


def corrections(report: ImportReport) -> list[str]:
    """What was changed, with the names of the files, those alike together."""
    sentences = list(report.corrections)
    for path in report.files:
        sentences = [sentence.replace(str(path), path.name) for sentence in sentences]
    return together(sentences)


def _section(title: str, sentences: Iterable[str]) -> list[str]:
    """The title and the sentences below it, if there are any."""
    how: Any = {"initial_indent": "  ", "subsequent_indent": "    ", "break_long_words": False}
    lines = [line for sentence in sentences for line in textwrap.wrap(sentence, LONGEST, **how)]
    return [title, *lines] if lines else []


def checks(report: ImportReport) -> Iterator[tuple[str, str]]:
    """What was checked, and the result."""
    stored, flow, start = report.stored, report.flow, report.start
    if stored:
        value = f"{_number(stored.mw)} MW (bus {stored.bus}), {_number(stored.mvar)} Mvar"
        yield "Power mismatch at the stored voltages", value
    if flow:
        value = f"{_number(flow.dv)} pu, {_number(flow.dangle)} degrees"
        yield "Power flow minus stored voltages", value
    if start:
        at = f" ({start.state})" if start.rate > 1e-8 else ""
        yield "Largest |dx/dt| at the start", f"{_number(start.rate)} 1/s{at}"
        text = f"{_number(start.drift)} pu" if np.isfinite(start.drift) else "the run ends before"
        yield f"Drift over {DRIFT_S:g} s without a fault", text
        yield "Limits exceeded at the start", "" if start.violations else "none"
        yield from ((f"  {_violation(v)}", "") for v in start.violations)


def _violation(v: Violation) -> str:
    if not v.device:
        return f"{v.owner} is not in equilibrium at the power flow"
    needs = f", the power flow needs {v.needed:.4g}{v.suffix}" if np.isfinite(v.needed) else ""
    return f"{v.device} of {v.owner}: {v.limit} = {v.value:g}{v.suffix}{needs}"


def _number(value: float) -> str:
    """Two digits."""
    return "below 1e-9" if abs(value) < 1e-9 else f"{value:.2g}" if abs(value) < 10 else f"{value:.0f}"
