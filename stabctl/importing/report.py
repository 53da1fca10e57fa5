"""The import report of a PSS/E system: what is represented, and whether it starts in steady state."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from stabctl._util.tabular import Tabular
from stabctl.errors import StabctlError, StudyError
from stabctl.io import matpower, psse
from stabctl.io.load_case import matching_dyr
from stabctl.io.psse.devices import Unsupported
from stabctl.model.case import Case

from . import checks, text
from .checks import FlowDifference, InitialState, Stored
from .kinds import Kind, by_kind

if TYPE_CHECKING:
    import pandas as pd

    from stabctl.model.characteristic import Loads

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
    failures : tuple of str
        Why a check has no result, one sentence each.
    """

    case: Case
    files: tuple[Path, ...]
    kinds: tuple[Kind, ...]
    unsupported: tuple[Unsupported, ...]
    corrections: tuple[str, ...]
    stored: Stored | None = None
    flow: FlowDifference | None = None
    start: InitialState | None = None
    failures: tuple[str, ...] = ()

    @property
    def complete(self) -> bool:
        """Whether every record of the files is represented."""
        return not self.unsupported

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
            "records": self.records,
            "supported": self.supported,
            "complete": self.complete,
            "unsupported": [
                {"kind": u.kind, "file": str(u.place.path), "line": u.place.line, "reason": u.reason}
                for u in self.unsupported
            ],
            "corrections": list(self.corrections),
            "mismatch_mw": stored and stored.mw,
            "mismatch_mvar": stored and stored.mvar,
            "mismatch_bus": stored and stored.bus,
            "dv_pu": flow and flow.dv,
            "dangle_deg": flow and flow.dangle,
            "dxdt": start and start.rate,
            "violations": [
                {"device": v.device, "machine": text.machine(self.case, v), "limit": v.limit, "value": v.value}
                for v in exceeded
            ],
            "drift_pu": start and start.drift,
        }

    def __str__(self) -> str:
        return text.page(self)


def import_report(
    raw: str | Path,
    dyr: str | Path | None = None,
    *,
    check: bool = True,
    loads: "Loads | None" = None,
) -> ImportReport:
    """Read a PSS/E or MATPOWER system and report what is represented.

    Parameters
    ----------
    raw : str or Path
        The RAW file, or a MATPOWER file ending in .m.
    dyr : str or Path, optional
        The DYR file of a RAW file; by default the one with the same name in the same folder.
    check : bool
        Also compare the network with the stored voltages, start the dynamic models and simulate 2 s without a fault.
    loads : {"impedance", "current", "power"}, optional
        What all loads keep constant in this simulation; by default what the file says.

    Returns
    -------
    ImportReport

    Raises
    ------
    CaseError
        For the first mistake in a file, with line and field.
    StudyError
        If the first file ends in neither .raw nor .m, or if a DYR file is given with a MATPOWER file.
    """
    read: psse.Import | matpower.Import
    kinds: tuple[Kind, ...] = ()
    ending = Path(raw).suffix.lower()
    if ending not in (".raw", ".m"):
        raise StudyError(f"{raw} is not a file ending in .raw or .m; other cases need no import.")
    if ending == ".m":
        if dyr is not None:
            raise StudyError(f"{dyr} cannot be used: a DYR file belongs to a PSS/E file ending in .raw.")
        read = matpower.read(raw)
    else:
        dyr = matching_dyr(Path(raw)) if dyr is None else dyr
        read = psse.read(raw, dyr, missing="injection", missing_controls="fixed")
        kinds = by_kind(read)
    case = read.case.with_loads(loads) if loads is not None else read.case
    files = tuple(Path(path) for path in (raw, dyr) if path is not None)
    report = ImportReport(case, files, kinds, read.unsupported, read.corrections)
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
    flow = tried(checks.flow_difference, network)
    start = tried(checks.initial_state, report.case) if flow and report.case.devices else None
    return replace(report, stored=checks.mismatch(network), flow=flow, start=start, failures=tuple(failures))
