"""A case from a RAW and a DYR file."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

from stabctl.errors import CaseError, StudyError, shown
from stabctl.model.case import Case

from . import dc, devices, dyr, generators, missing_models, network, raw, transformers
from .devices import Dynamics, Unsupported
from .load_scopes import LoadScopes

Missing = Literal["refuse", "injection"]
MissingControls = Literal["refuse", "fixed"]
WITHOUT_RECORD = "generator"  # kind of a machine that no record models


@dataclass(frozen=True)
class Import:
    """What was read from a RAW and a DYR file.

    Attributes
    ----------
    case : Case
        The system.
    raw : Raw
        The records of the RAW file.
    records : tuple of dyr.Record
        The records of the DYR file.
    corrections : tuple of str
        What was changed or replaced, one sentence each.
    unsupported : tuple of Unsupported
        What has no model: elements of the network, machines without a record, records.
    """

    case: Case
    raw: raw.Raw
    records: tuple[dyr.Record, ...]
    corrections: tuple[str, ...]
    unsupported: tuple[Unsupported, ...]


def read_psse(
    raw: str | Path,
    dyr: str | Path | None = None,
    *,
    missing: Missing = "refuse",
    missing_controls: MissingControls = "refuse",
) -> Case:
    """Read a system from a PSS/E RAW file (versions 30 to 35) and a DYR file.

    Parameters
    ----------
    raw : str or Path
        The RAW file.
    dyr : str or Path, optional
        The DYR file. Without one the case has no dynamic models: its power flow can be solved.
    missing : {"refuse", "injection"}
        A machine without a model is refused, or becomes a constant-power injection.
    missing_controls : {"refuse", "fixed"}
        A control without a model is refused, or left out: field voltage or mechanical power stay constant.

    Returns
    -------
    Case
        With the numbers, names and identifiers of the files. What was corrected or left out is in its `warnings`.

    Raises
    ------
    CaseError
        For the first mistake, with file, line and field; or with the list of machines and controls without a model.
    """
    return read(raw, dyr, missing=missing, missing_controls=missing_controls).case


def read(
    raw_path: str | Path,
    dyr_path: str | Path | None = None,
    *,
    missing: Missing = "refuse",
    missing_controls: MissingControls = "refuse",
) -> Import:
    """What `read_psse` reads, with what was corrected and left out."""
    for name, value, allowed in (
        ("missing", missing, Missing),
        ("missing_controls", missing_controls, MissingControls),
    ):
        if value not in get_args(allowed):
            raise StudyError(f"{name} = {shown(value)} is not allowed; choose one of {', '.join(get_args(allowed))}.")
    file = raw.read(Path(raw_path))
    net = network.read(file)
    transformers.read(net)
    sources = generators.read(net)
    dc.read(net)
    apart = net.settle_islands(str(raw_path))
    if not net.rows["machines"]:
        raise CaseError(f"{raw_path}: no generator in service is connected to a swing bus; a case needs one.")
    left = {m.machine for m in net.rows["machines"]}
    sources = {key: source for key, source in sources.items() if source.machine in left}
    known = {(g.I, g.ID) for g, _ in file.of("generator")} | {(load.I, load.ID) for load, _ in file.of("load")}
    records = tuple(dyr.read(Path(dyr_path))) if dyr_path is not None else ()
    dynamics = devices.read(records, sources, LoadScopes(net.rows["loads"], file), known)
    unsupported = _unsupported(file, net, dynamics, dyr_path)
    replaced = missing_models.settle(net, dynamics, sources, dyr_path, missing, missing_controls)
    corrections = (*net.corrections, *dynamics.corrections, *apart, *replaced)
    notes = (*corrections, *(str(u) for u in unsupported if u.kind != WITHOUT_RECORD))
    case = net.case(
        Path(raw_path),
        dynamics.places,
        devices=dynamics.rows,
        base_mva=file.base_mva,
        frequency_hz=file.frequency_hz,
        title=file.title,
        source=f"PSS/E {Path(raw_path).name}",
        notes=notes,
    )
    return Import(case, file, records, corrections, unsupported)


def _unsupported(
    file: raw.Raw, net: network.Network, dynamics: Dynamics, dyr_path: str | Path | None
) -> tuple[Unsupported, ...]:
    """What has no model: elements of the network, machines without any record, and records."""
    found = [Unsupported(u.kind, u.place, "it is read and not modeled", u.name) for u in file.unmodeled]
    named = {u.machine for u in dynamics.unsupported}
    places = dict(zip(net.rows["machines"], net.places["machines"], strict=True))
    if dyr_path is not None:
        for m in missing_models.without(net, dynamics):
            if m.name not in named:
                reason = f"{Path(dyr_path).name} has no model of it"
                found.append(Unsupported(WITHOUT_RECORD, places[m], reason, f"machine {m.name}", m.name))
    return (*found, *dynamics.unsupported)
