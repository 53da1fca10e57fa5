"""Records of a DYR file by kind."""

from collections import Counter, defaultdict
from typing import NamedTuple

from stabctl import devices
from stabctl.io.psse import Import
from stabctl.io.psse.devices import kinds
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
    mva, count, sums = _ratings(read), Counter[str](), defaultdict[str, float](float)
    for record in read.records:
        count[record.kind] += 1
        sums[record.kind] += mva.get((record.bus or 0, record.id), 0.0)
    lost = Counter(u.kind for u in read.unsupported if u.place.path != read.raw.path)
    order = {role: k for k, role in enumerate((*devices.ROLES, NO_ROLE))}
    found = [
        Kind(kind, catalog.role(kinds()[kind][0]) if kind in kinds() else NO_ROLE, n, n - lost[kind], sums[kind])
        for kind, n in count.items()
    ]
    found.sort(key=lambda one: (order[one.role], one.kind))
    return tuple(found)


def _ratings(read: Import) -> dict[tuple[int, str], float]:
    """MVA of machines, and of loads that no machine has the identifier of, by bus and ID."""
    found = {(load.I, load.ID): abs(complex(load.PL, load.QL)) for load, _ in read.raw.of("load")}
    return found | {(g.I, g.ID): g.MBASE or read.raw.base_mva for g, _ in read.raw.of("generator")}
