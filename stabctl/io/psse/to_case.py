"""A case from a RAW and a DYR file.

Machines and controls without a model are refused, or on request become injections and constant controls.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

from stabctl._util.errors import CaseError, StudyError, shown
from stabctl._util.validation import checks_arguments
from stabctl._util.wording import counted, enumerated, listed, named
from stabctl.model import naming, tables
from stabctl.model.case import Case
from stabctl.model.tables import Load, Machine

from .._lexer import not_utf8
from .._table_builder import AT_LIMIT, ISOLATED, without_owner
from . import dyr, network, raw
from .dyr import Dynamics, LoadScopes, Unsupported
from .network import Network, Source

Missing = Literal["refuse", "injection"]
MissingControls = Literal["refuse", "fixed"]
WITHOUT_RECORD = "generator"  # kind of a machine that no record models
CONTROLS: Mapping[str, tuple[str, Callable[[Any], object]]] = {  # of a power flow: section, and whether a record has it
    "tap changers": ("transformer", lambda t: t.head.STAT and any(w.COD in (1, 2, 4) for w in t.windings)),
    "phase shifters": ("transformer", lambda t: t.head.STAT and any(w.COD in (3, 5) for w in t.windings)),
    "switched shunts": ("switched_shunt", lambda s: s.STAT and s.MODSW),
    "interchange of areas": ("area", lambda area: area.ISW),
    "reactive limits that QG exceeds": (
        "generator", lambda g: g.STAT and not g.QB - AT_LIMIT <= g.QG <= g.QT + AT_LIMIT,
    ),
}  # fmt: skip


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
    idle : tuple of str
        Controls and limits that do not act in the power flow, with their lines.
    """

    case: Case
    raw: raw.Raw
    records: tuple[dyr.Record, ...]
    corrections: tuple[str, ...]
    unsupported: tuple[Unsupported, ...]
    idle: tuple[str, ...]


@checks_arguments
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
        With the numbers, names and identifiers of the files. What was corrected or left out is in its `notes`.

    Raises
    ------
    CaseError
        For the first mistake, with file, line and field; or with the list of machines and controls without a model.

    Examples
    --------
    >>> st.read_psse("three.raw", "three.dyr").machine("101/1").bus
    101
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
    network.read_transformers(net)
    network.read_dc_lines(net)
    sources = network.read_generators(net)
    apart = [*_isolated(file), *net.settle_islands(str(raw_path))]
    if not net.rows["machines"]:
        raise CaseError(f"{raw_path}: no generator in service is connected to a swing bus; a case needs one.")
    left = {m.machine for m in net.rows["machines"]}
    sources = {key: source for key, source in sources.items() if source.machine in left}
    known = {kind: {(one.I, one.ID) for one, _ in file.of(kind)} for kind in ("generator", "load")}
    records = tuple(dyr.read(Path(dyr_path))) if dyr_path is not None else ()
    dynamics = dyr.device_rows(records, sources, LoadScopes(net.rows["loads"], file), known)
    unsupported = _unsupported(file, net, dynamics, dyr_path)
    replaced = _settle(net, dynamics, sources, dyr_path, missing, missing_controls)
    encoded = not_utf8(raw_path, dyr_path)
    corrections = (*encoded, *filter(None, [file.cut]), *net.corrections, *dynamics.corrections, *apart, *replaced)
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
    return Import(case, file, records, corrections, unsupported, tuple(_idle(file)))


def _idle(file: raw.Raw) -> Iterator[str]:
    """The controls and limits that do not act in the power flow, those alike together, with their lines."""
    for what, (section, acts) in CONTROLS.items():
        found = [str(place.line) for record, place in file.of(section) if acts(record)]
        if found:
            yield f"{what} ({file.path.name} {named(len(found), 'line')} {listed(found)})"


def _isolated(file: raw.Raw) -> Iterator[str]:
    """What is in service at buses of type 4, a sentence for each bus."""
    at: dict[int, Counter[str]] = {bus.I: Counter() for bus, _ in file.of("bus") if bus.IDE == ISOLATED}
    for section in ("load", "shunt", "switched_shunt", "generator", "branch", "switch", "transformer", "dc"):
        for record, _ in file.of(section):
            parts = [getattr(record, k) for k in ("head", "rectifier", "inverter") if hasattr(record, k)] or [record]
            if any(getattr(parts[0], status, 0) for status in ("STATUS", "STAT", "ST", "MDC")):
                ends = {abs(getattr(part, end, 0)) for part in parts for end in ("I", "J", "K", "IP")}
                for bus in ends & at.keys():
                    at[bus]["DC line" if section == "dc" else section.replace("_", " ")] += 1
    for bus, place in file.of("bus"):
        if at.get(bus.I):
            what = ", ".join(counted(n, noun) for noun, n in at[bus.I].items())
            yield f"{place}: bus {bus.I} is isolated (type 4) and left out with what is at it, as in PSS/E: {what}."


def _unsupported(
    file: raw.Raw, net: Network, dynamics: Dynamics, dyr_path: str | Path | None
) -> tuple[Unsupported, ...]:
    """What has no model: elements of the network, machines without any record, and records."""
    found = [Unsupported(u.kind, u.place, "it is read and not modeled", u.name) for u in file.unmodeled]
    tried = {u.machine for u in dynamics.unsupported}
    places = dict(zip(net.rows["machines"], net.places["machines"], strict=True))
    if dyr_path is not None:
        for m in _without(net, dynamics):
            if m.name not in tried:
                reason = f"{Path(dyr_path).name} has no model of it"
                found.append(Unsupported(WITHOUT_RECORD, places[m], reason, f"machine {m.name}", m.name))
    return (*found, *dynamics.unsupported)


def _settle(
    net: Network,
    dynamics: Dynamics,
    sources: Mapping[tuple[int, str], Source],
    dyr: str | Path | None,
    missing: str,
    missing_controls: str,
) -> list[str]:
    """Replace or refuse what has no model; returns a sentence for everything replaced.

    Raises `CaseError` with the list if it is refused.
    """
    names = {source.machine: f"{bus}/{id}" for (bus, id), source in sources.items()}
    lacking = _without(net, dynamics) if dyr is not None else []
    gone = {names[m.machine] for m in lacking}
    controls = [u for u in dynamics.unsupported if u.machine and u.machine not in gone]
    _refuse(dyr, lacking if missing == "refuse" else [], controls if missing_controls == "refuse" else [], dynamics)
    said = [_new_swing(net, bus, lacking) for bus in _swings_without(net, lacking)]
    said += [_injection(net, dynamics, m) for m in lacking]
    return said + without_owner(dynamics.rows, dynamics.places, names)


def _refuse(
    dyr: str | Path | None, machines: Sequence[Machine], controls: Sequence[Unsupported], dynamics: Dynamics
) -> None:
    """Raise `CaseError` with the list of machines and controls without a model, if there are any."""
    tried = {u.machine: f" ({u.kind}, line {u.place.line}: {u.reason})" for u in reversed(dynamics.unsupported)}
    parts, remedies = [], []
    if machines:
        parts.append(enumerated("machine", (f"{m.name}{tried.get(m.name, '')}" for m in machines)))
        become = "it an injection" if len(machines) == 1 else "them injections"
        remedies.append(f"--missing injection makes {become} of constant power")
    if controls:
        parts.append(listed([f"{u.kind} of {u.machine} (line {u.place.line}: {u.reason})" for u in controls]))
        remedies.append("--missing-controls fixed keeps what such records control constant")
    if parts:
        raise CaseError(f"{dyr}: no model for {' and for '.join(parts)}; {', '.join(remedies)}.")


def _swings_without(net: Network, lacking: Sequence[Machine]) -> list[int]:
    """The swing buses that keep no machine."""
    kept = {m.bus for m in net.rows["machines"] if m not in lacking}
    return [b.bus for b in net.rows["buses"] if b.kind == "swing" and b.bus not in kept]


def _new_swing(net: Network, bus: int, lacking: Sequence[Machine]) -> str:
    """Make the bus of the largest machine of an island with a model its swing bus, at its stored voltage."""
    island = dict(zip((b.bus for b in net.rows["buses"]), net.islands().tolist(), strict=True))
    others = [m for m in net.rows["machines"] if m not in lacking and island[m.bus] == island[bus]]
    place = net.places["buses"][net.at[bus]]
    if not others:
        raise place.error(f"no machine of the island of swing bus {bus} has a model in the DYR file.")
    largest = max(others, key=lambda m: m.base)
    net.change(largest.bus, kind="swing")
    net.change(bus, kind="pv")
    return f"{place}: no machine at the swing bus {bus} has a model; bus {largest.bus} is the swing bus instead."


def _injection(net: Network, dynamics: Dynamics, m: Machine) -> str:
    """Replace a machine by an injection of its stored power."""
    i = net.rows["machines"].index(m)
    place = net.places["machines"].pop(i)
    del net.rows["machines"][i]
    for model, rows in dynamics.rows.items():
        if not tables.at_bus(model):
            gone = [k for k, key in enumerate(rows) if naming.number(key) == m.machine]
            for key in [list(rows)[k] for k in gone]:
                del rows[key]
            dynamics.places[model] = [p for k, p in enumerate(dynamics.places[model]) if k not in gone]
    if all(other.bus != m.bus for other in net.rows["machines"]):
        net.change(m.bus, kind="pq")
    if m.p or m.q:
        net.add("loads", Load(m.bus, -m.p, -m.q, 1.0, 1.0, v_low=net.raw.power_low, id=m.name, kind="injection"), place)
    return f"{place}: machine {m.name} has no model and is a constant-power injection of {m.p:.4g} MW, {m.q:.4g} Mvar."


def _without(net: Network, dynamics: Dynamics) -> list[Machine]:
    """The machines that no record models."""
    modeled = {
        naming.number(key) for model in tables.of_role(*tables.UNIT_ROLES) for key in dynamics.rows.get(model, {})
    }
    return [m for m in net.rows["machines"] if m.machine not in modeled]
