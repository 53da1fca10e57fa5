"""Which loads a record of a load model applies to: one load, those of an owner, of a zone or of an area, or all."""

from collections import defaultdict
from collections.abc import Iterable, Mapping

from stabctl.model import keys
from stabctl.model.tables import Load

from .dyr import Record
from .raw import Raw

SCOPES = ("AL", "AR", "ZN", "OW", "BL")  # endings of the kinds, from the widest to the narrowest
ANY = "*"  # identifier for all loads of a scope


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
        self._keys: dict[tuple[int, str], list[keys.Key]] = defaultdict(list)
        for row, key in zip(loads, keys.numbered(row.bus for row in loads), strict=True):
            if row.kind == "load":
                self._keys[row.bus, row.id].append(key)

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

    def within(self, record: Record) -> list[keys.Key]:
        """Keys of the loads in the scope of a record."""
        return [key for where in self.named(record) for key in self._keys[where]]

    def owners(self, records: Iterable[Record]) -> Mapping[int, list[keys.Key]]:
        """Place of a record among all -> keys of the loads that it models: the narrowest scope holds, then the last."""
        chosen: dict[keys.Key, tuple[int, int]] = {}
        for n, record in enumerate(records):
            rank = SCOPES.index(record.kind[-2:]) if record.kind[-2:] in SCOPES else len(SCOPES)
            for key in self.within(record):
                chosen[key] = max(chosen.get(key, (-1, -1)), (rank, n))
        found: dict[int, list[keys.Key]] = defaultdict(list)
        for key, (_, n) in chosen.items():
            found[n].append(key)
        return found
