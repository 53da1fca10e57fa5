"""Records of a DYR file as rows of the device tables."""

from collections import defaultdict
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from stabctl.model import catalog, keys

from .constants import kinds, parameters
from .dyr import Record
from .generators import Source
from .lexer import Place
from .load_scopes import LoadScopes

OF_LOADS = "BL", "OW", "ZN", "AR"  # endings of the kinds of loads: at a bus, of an owner, of a zone, of an area


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
        self.rows: dict[str, dict[keys.Key, Any]] = defaultdict(dict)
        self.places: dict[str, list[Place]] = defaultdict(list)
        self.corrections: list[str] = []
        self.supported: list[Record] = []
        self.unsupported: list[Unsupported] = []

    def add(self, model: str, key: keys.Key, par: Any, place: Place) -> None:
        """Add a device; the second of a model at machine 2 has the key 2#2."""
        own, count = key, 1
        while own in self.rows[model]:
            count += 1
            own = f"{key}#{count}"
        self.rows[model][own] = par
        self.places[model].append(place)


def read(
    records: Iterable[Record],
    machines: Mapping[tuple[int, str], Source],
    loads: LoadScopes,
    known: set[tuple[int, str]],
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
        Bus and ID of every machine of the RAW file, in service or not.

    Raises
    ------
    CaseError
        With line and field for the first constant that cannot be read.
    """
    found, records = Dynamics(), tuple(records)
    of_loads = [n for n, r in enumerate(records) if r.kind in kinds() and catalog.role(kinds()[r.kind][0]) == "load"]
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
    modeled: list[keys.Key] | None,
    machines: Mapping[tuple[int, str], Source],
    loads: LoadScopes,
    known: set[tuple[int, str]],
) -> None:
    model, order = kinds()[record.kind]
    role, where = catalog.role(model), (record.bus or 0, record.id)
    source = machines.get(where)
    if modeled is not None:
        owners = modeled
    elif catalog.at_bus(model):
        owners = [where[0]]
    else:
        owners = [source.machine] if source else []
    if not owners:
        if role == "load" and loads.within(record):
            found.supported.append(record)  # records of narrower scopes hold for all of its loads
        elif where not in known:
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
    for key in owners:
        found.add(model, key, par, record.place)


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
