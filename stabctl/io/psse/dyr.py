"""A DYR file: its records, their constants as parameters, and rows of the device tables.

A record is a bus, a kind of model, an ID and constants, up to a slash. The constants of a record become parameters of a
device by the `DYR` data of the device modules. A record of a load model applies to one load, to those of an owner, of a
zone or of an area, or to all.
"""

import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from stabctl._util.errors import CaseError
from stabctl._util.schema import fields
from stabctl.devices.blocks.lags import SHORT
from stabctl.devices.converters.electrical import NO_LIMIT
from stabctl.devices.loads import zip_load
from stabctl.model import naming, tables
from stabctl.model.tables import Load

from .._lexer import NUMBER, Place, lines, number, split, whole
from .._table_builder import NO_IMPEDANCE
from .network import Source
from .raw import Raw

USER = "USRMDL"  # a record of a user-written model: its name, six numbers that describe it, then its constants
HEAD = 7
WHERE = 3  # fields of a record before its constants: bus, kind, ID
_QUOTED = r"""(?:'[^'/]*'|"[^"/]*")"""
_NEXT = re.compile(  # another record after a slash
    rf"""[\s,]*+(?=\d+[\s,]+['"][^\s,]*+[\s,]+\S
    | (?:\d+|{_QUOTED})[\s,]+(?:{_QUOTED}|[A-Z][A-Z0-9_]{{2,}})(?:[\s,]++[^\s,/]++){{2}}[^/]*/)""",
    re.VERBOSE,
)
_BEGINS = re.compile(r"""\s*\d+[\s,]+(['"]?)[A-Z]\w{2,}\s*\1[\s,]+\S""", re.IGNORECASE)  # a line with a record's begin
SCOPES = ("AL", "AR", "ZN", "OW", "BL")  # endings of the kinds of loads, from the widest to the narrowest
OF_LOADS = "BL", "OW", "ZN", "AR", "AL"  # endings of the kinds of loads: at a bus, of an owner, a zone, an area, all
ANY = "*"  # identifier for all loads of a scope
REACTANCES = "x1d", "Xe"  # parameters that are the source reactance of a generator where no constant gives them


class Record(NamedTuple):
    """A record of a DYR file; the constants are texts."""

    place: Place
    bus: int | None  # None for a record that does not begin with a bus number
    kind: str
    id: str
    constants: tuple[str, ...]


def read(path: Path) -> list[Record]:
    """The records of a DYR file. Raises `CaseError` with the line for the first that cannot be read.

    A slash ends a record, or begins a comment where there is none; the rest of the line is a comment, or begins with
    another record. It does if it begins with a bus number, a kind in quotes and an ID, or if a slash ends it, it has
    four words or more, and begins with a bus number or a name in quotes and a kind in quotes or capitals.
    """
    found: list[Record] = []
    fields: list[str] = []
    start: Place | None = None
    filled = False  # whether no comma follows the last field
    for i, text in enumerate(lines(path), 1):
        if not text.strip() or (not fields and text.lstrip().startswith(("@!", "/"))):
            continue
        if start and len(fields) >= WHERE and _BEGINS.match(text):
            raise start.error(f"the record has no slash at its end, and line {i} begins another.")
        place, at = Place(path, i), 0
        while True:
            line = split(text, place, at, filled)
            start = start if fields else place
            fields += line.fields
            filled = line.filled
            if line.end is None:
                break
            if fields and start:
                found.append(_record(start, fields))
            fields, filled = [], False
            further = _NEXT.match(text, line.end)
            if further is None:
                break
            at = further.end()
    if fields and start:
        raise start.error("the record has no slash at its end.")
    return found


def _record(place: Place, fields: list[str]) -> Record:
    numeric = NUMBER.fullmatch(fields[0]) is not None
    if not numeric:  # such as the name of a DC line
        kind = next((f for f in fields[1:2]), fields[0])
        return Record(place, None, kind.upper(), "", tuple(fields[2:]))
    if len(fields) < WHERE:
        raise CaseError(f"{place}: a record needs a bus number, the name of a model and an ID.")
    kind, constants = fields[1].upper(), fields[3:]
    if kind == USER and len(constants) >= HEAD:
        kind, constants = constants[0].upper(), constants[HEAD:]
    return Record(place, whole(fields[0], place, "bus"), kind, fields[2] or "1", tuple(constants))


class Unsupported(NamedTuple):
    """A record without a model here."""

    kind: str
    place: Place
    reason: str
    owner: str = ""  # what it belongs to
    machine: str = ""  # the machine in service whose control or model it is

    def __str__(self) -> str:
        """The sentence of a warning."""
        what = f"{self.kind} ({self.owner})" if self.owner else self.kind
        return f"{self.place}: {what} is left out: {self.reason}."


class Dynamics:
    """Rows of the device tables while they are collected, each with its place in the file."""

    def __init__(self) -> None:
        self.rows: dict[str, dict[naming.Key, Any]] = defaultdict(dict)
        self.places: dict[str, list[Place]] = defaultdict(list)
        self.corrections: list[str] = []
        self.supported: list[Record] = []
        self.unsupported: list[Unsupported] = []

    def add(self, model: str, key: naming.Key, par: Any, place: Place) -> None:
        """Add a device; the second of a model at machine 2 has the key 2#2."""
        own, count = key, 1
        while own in self.rows[model]:
            count += 1
            own = f"{key}#{count}"
        self.rows[model][own] = par
        self.places[model].append(place)

    def has(self, role: str, key: naming.Key) -> bool:
        """Whether there is a device of a role at a machine."""
        return any(key in self.rows[model] for model in tables.of_role(role))


class LoadScopes:
    """The loads of a system with their areas, zones and owners.

    Parameters
    ----------
    loads
        Rows of the loads, in the order of the table.
    raw
        The RAW file, for area, zone and owner of each load; those that it leaves out are those of the bus.
    """

    def __init__(self, loads: Iterable[Load], raw: Raw) -> None:
        loads = tuple(loads)
        buses = {bus.I: bus for bus, _ in raw.of("bus")}
        self._scopes: dict[tuple[int, str], dict[str, int | None]] = {}
        for load, _ in raw.of("load"):
            bus = buses[load.I]
            numbers = {"AR": load.AREA or bus.AREA, "ZN": load.ZONE or bus.ZONE, "OW": load.OWNER or bus.OWNER}
            self._scopes[load.I, load.ID] = {**numbers, "BL": load.I, "AL": None}
        self._keys: dict[tuple[int, str], list[naming.Key]] = defaultdict(list)
        self._parts: dict[naming.Key, list[naming.Key]] = {}  # of the same load
        self._drawn: dict[naming.Key, float] = {}
        for row, key in zip(loads, naming.numbered(row.bus for row in loads), strict=True):
            if row.kind == "load":
                self._keys[row.bus, row.id].append(key)
                self._parts[key] = self._keys[row.bus, row.id]
                self._drawn[key] = zip_load.drawn(row, buses[row.bus].VM).real

    def __contains__(self, where: tuple[int, str]) -> bool:
        return where in self._keys

    def named(self, record: Record) -> list[tuple[int, str]]:
        """Bus and ID of the loads in the scope of a record."""
        scope = record.kind[-2:]
        return [
            where
            for where in self._keys
            if record.id in (ANY, where[1]) and self._scopes[where].get(scope, where[0]) in (record.bus, None)
        ]

    def within(self, record: Record) -> list[naming.Key]:
        """Keys of the loads in the scope of a record."""
        return [key for where in self.named(record) for key in self._keys[where]]

    def part(self, key: naming.Key, par: Any) -> Any:
        """The parameters for one row of a load: its share of the motor MVA, if they are given."""
        rows = self._parts[key]
        if len(rows) == 1 or not getattr(par, "Mbase", 0.0):
            return par
        return par._replace(Mbase=par.Mbase * self._drawn[key] / sum(self._drawn[row] for row in rows))

    def owners(self, records: Iterable[Record]) -> Mapping[int, list[naming.Key]]:
        """Place of a record among all -> keys of the loads that it models: the narrowest scope holds, then the last."""
        chosen: dict[naming.Key, tuple[int, int]] = {}
        for n, record in enumerate(records):
            rank = SCOPES.index(record.kind[-2:]) if record.kind[-2:] in SCOPES else len(SCOPES)
            for key in self.within(record):
                chosen[key] = max(chosen.get(key, (-1, -1)), (rank, n))
        found: dict[int, list[naming.Key]] = defaultdict(list)
        for key, (_, n) in chosen.items():
            found[n].append(key)
        return found


def device_rows(
    records: Iterable[Record],
    machines: Mapping[tuple[int, str], Source],
    loads: LoadScopes,
    known: Mapping[str, set[tuple[int, str]]],
) -> Dynamics:
    """The devices that the records describe.

    Parameters
    ----------
    records
        Records of the DYR file.
    machines
        The machines in service, by bus and ID.
    loads
        The loads, with the scopes of records.
    known
        Bus and ID of every "generator" and "load" of the RAW file, in service or not.

    Raises
    ------
    CaseError
        With line and field for the first constant that cannot be read.
    """
    found, records = Dynamics(), tuple(records)
    of_loads = [n for n, r in enumerate(records) if r.kind in kinds() and tables.role(kinds()[r.kind][0]) == "load"]
    modeled = loads.owners([records[n] for n in of_loads])
    owners = {n: modeled.get(k, []) for k, n in enumerate(of_loads)}
    for n, record in enumerate(records):
        if record.kind not in kinds():
            found.unsupported.append(_without_model(record, "there is no model of this kind", machines, loads))
            continue
        _read(found, record, owners.get(n), machines, loads, known)
    return found


def _read(
    found: Dynamics,
    record: Record,
    modeled: list[naming.Key] | None,
    machines: Mapping[tuple[int, str], Source],
    loads: LoadScopes,
    known: Mapping[str, set[tuple[int, str]]],
) -> None:
    model, order = kinds()[record.kind]
    role, where = tables.role(model), (record.bus or 0, record.id)
    source = machines.get(where)
    if modeled is not None:
        owners = modeled
    elif tables.at_bus(model):
        owners = [where[0]]
    else:
        owners = [source.machine] if source else []
    if not owners:
        if role == "load" and loads.within(record):
            found.supported.append(record)  # records of narrower scopes hold for all of its loads
        elif where not in known["load" if role == "load" else "generator"]:
            what = "load" if role == "load" else "machine"
            reason = f"the RAW file has no {what} {record.bus}/{record.id}"
            found.unsupported.append(Unsupported(record.kind, record.place, reason))
        return
    try:
        par, sentences = parameters(record, model, order, source)
    except ValueError as error:
        found.unsupported.append(_without_model(record, str(error).rstrip("."), machines, loads))
        return
    found.corrections += [f"{record.place}, {record.kind} of {record.bus}/{record.id}: {s}" for s in sentences]
    found.supported.append(record)
    if role == "stabilizer" and found.has(role, owners[0]):
        found.corrections.append(
            f"{record.place}, {record.kind} of {record.bus}/{record.id}: the machine has a stabilizer already; "
            "their outputs are added."
        )
    for key in owners:
        found.add(model, key, loads.part(key, par) if role == "load" else par, record.place)


def kinds() -> Mapping[str, tuple[str, str]]:
    """Kind of record -> name of the device model, and its constants in order."""
    return tables.models().records


def parameters(record: Record, model: str, order: str, source: Source | None) -> tuple[Any, list[str]]:
    """Parameters of a device and what was corrected in them; `ValueError` with a sentence for an unsupported code."""
    device, names = tables.models()[model], order.split()
    values: dict[str, Any] = {}
    if len(record.constants) < len(names):
        given = len(record.constants)
        text = f"the record has {given} constants, {record.kind} of {record.bus}/{record.id} needs {len(names)}."
        raise record.place.error(text)
    for k, (name, text) in enumerate(zip(names, record.constants, strict=False), 1):
        plain = name.lstrip("+_'")
        if name.startswith("'"):
            values[plain] = text.strip()
            continue
        value = (whole if name.startswith("+") else number)(
            text or "0", record.place, f"constant {k} ({plain or 'unused'})"
        )
        if not name.startswith("_"):
            values[plain] = value
    sentences: list[str] = []
    if device.from_record is not None:
        made, sentences = device.from_record(record.kind, values)
        values = made if isinstance(made, dict) else made._asdict()
    allowed = fields(device.Par)
    values = {name: value for name, value in values.items() if name in allowed}
    if source is not None:
        behind = next((name for name in REACTANCES if name in allowed and name not in names), None)
        if behind and source.x == 0:
            source = source._replace(x=NO_IMPEDANCE)
            sentences = [*sentences, f"ZX = 0: the source reactance is {NO_IMPEDANCE:g} pu."]
        for name, value in (("ra", source.ra), ("Re", source.ra), *((name, source.x) for name in REACTANCES)):
            if name in allowed and name not in names:
                values[name] = value
    extra = len(record.constants) - len(names)
    if extra > 0 and any(number(text or "0", record.place, "constant") for text in record.constants[len(names) :]):
        sentences = [*sentences, f"{extra} further constants are not used."]
    par = tables.parameters(model, **values)
    return par, [*sentences, *_short_lags(par, tables.role(model))]


def _short_lags(par: Any, role: str) -> Iterator[str]:
    """A sentence for every time constant of a control that is too short to be simulated."""
    if role in tables.UNIT_ROLES:
        return
    kind: type = type(par)
    for name, of in fields(kind).items():
        if of.unit == "s" and 0 < getattr(par, name) < SHORT:
            yield f"{name} = {getattr(par, name):g} s is below {1e3 * SHORT:g} ms, where a lag is bypassed."
    bypassed = role == "electrical control" and getattr(par, "Tpord", SHORT) < SHORT
    if bypassed and (min(par.dPmax, -par.dPmin) < NO_LIMIT or par.Vdip > 0):
        yield f"Tpord = {par.Tpord:g} s: no lag of the power order, so dPmin, dPmax and Vdip do not hold it."


def _without_model(
    record: Record,
    reason: str,
    machines: Mapping[tuple[int, str], Source],
    loads: LoadScopes,
) -> Unsupported:
    where, name = (record.bus or 0, record.id), f"{record.bus}/{record.id}"
    if where in machines and not record.kind.endswith(OF_LOADS):
        return Unsupported(record.kind, record.place, reason, f"machine {name}", name)
    owner = f"load {name}" if where in loads else name if record.bus else ""
    return Unsupported(record.kind, record.place, reason, owner)
