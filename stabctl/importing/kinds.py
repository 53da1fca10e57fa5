"""Records of a DYR file by kind."""

from collections import Counter, defaultdict
from typing import NamedTuple

from stabctl import devices
from stabctl.io.psse import Import
from stabctl.io.psse.constants import kinds
from stabctl.io.psse.devices import OF_LOADS
from stabctl.io.psse.dyr import Record
from stabctl.io.psse.load_scopes import LoadScopes
from stabctl.model import catalog

NO_ROLE = "not modeled"


class Kind(NamedTuple):
    """The records of one kind.

    Attributes
    ----------
    kind : str
        PSS/E's name of the model.
    role : str
        What its model is here: machine, exciter, governor ...
    records, supported : int
        Records in the files, and those of them that the case holds.
    mva : float, MVA
        Sum of the ratings of the machines, and of the powers of the loads, that the records belong to.
    """

    kind: str
    role: str
    records: int
    supported: int
    mva: float


def by_kind(read: Import) -> tuple[Kind, ...]:
    """The records by kind, those of machines first."""
    count, mva = Counter[str](), defaultdict[str, float](float)
    ratings = _Ratings(read)
    for record in read.records:
        count[record.kind] += 1
        mva[record.kind] += ratings.of(record)
    lost = Counter(u.kind for u in read.unsupported if u.place.path != read.raw.path)
    order = {role: k for k, role in enumerate((*devices.ROLES, NO_ROLE))}
    found = [
        Kind(kind, catalog.role(kinds()[kind][0]) if kind in kinds() else NO_ROLE, n, n - lost[kind], mva[kind])
        for kind, n in count.items()
    ]
    found.sort(key=lambda one: (order[one.role], one.kind))
    return tuple(found)


class _Ratings:
    """MVA of machines and loads."""

    def __init__(self, read: Import) -> None:
        self._machines = {(g.I, g.ID): g.MBASE or read.raw.base_mva for g, _ in read.raw.of("generator")}
        self._loads = {(load.I, load.ID): abs(complex(load.PL, load.QL)) for load, _ in read.raw.of("load")}
        self._scopes = LoadScopes(read.case.loads, read.raw)

    def of(self, record: Record) -> float:
        """MVA of the machine that a record belongs to, or of the loads in its scope."""
        role = catalog.role(kinds()[record.kind][0]) if record.kind in kinds() else NO_ROLE
        where = record.bus or 0, record.id
        if where in self._machines and role != "load" and not (role == NO_ROLE and record.kind.endswith(OF_LOADS)):
            return self._machines[where]
        return sum(self._loads.get(one, 0.0) for one in self._scopes.named(record))
