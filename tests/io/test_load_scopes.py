"""Records of load models of a bus, an owner, a zone, an area, or all: the narrowest scope holds."""

from itertools import pairwise
from types import SimpleNamespace

from stabctl.io.psse.dyr import LoadScopes, Record, _without_model
from stabctl.model.tables import Load

BUSES = [SimpleNamespace(I=i, AREA=i, ZONE=1, OWNER=5, VM=1.0) for i in (1, 2, 3)]
LOADS = [
    SimpleNamespace(I=1, ID="1", AREA=0, ZONE=0, OWNER=0),
    SimpleNamespace(I=2, ID="1", AREA=0, ZONE=7, OWNER=0),
    SimpleNamespace(I=2, ID="2", AREA=1, ZONE=0, OWNER=0),
    SimpleNamespace(I=3, ID="1", AREA=0, ZONE=0, OWNER=9),
]
ROWS = [
    Load(1, 1, 0, id="1"),
    Load(2, 1, 0, id="1"),
    Load(2, 1, 0, id="1"),
    Load(2, 1, 0, id="2"),
    Load(3, 1, 0, id="1"),
]


def scopes():
    sections = {"bus": BUSES, "load": LOADS}
    return LoadScopes(ROWS, SimpleNamespace(of=lambda name: [(row, None) for row in sections[name]]))


def record(number, kind, id="*"):
    return Record(None, number, kind, id, ())


def test_loads_of_a_scope():
    found = scopes()
    assert found.within(record(0, "IEELAL")) == [1, 2, "2#2", "2#3", 3]
    assert found.within(record(1, "IEELAR")) == [1, "2#3"]
    assert found.within(record(7, "IEELZN")) == [2, "2#2"]
    assert found.within(record(9, "IEELOW")) == [3]
    assert found.within(record(2, "IEELBL", "1")) == [2, "2#2"]
    assert found.within(record(2, "IEELBL", "3")) == []


def test_the_narrowest_scope_holds_and_then_the_last_record():
    records = [
        record(2, "IEELBL", "1"),
        record(0, "IEELAL"),
        record(5, "IEELOW"),
        record(5, "CIM6OW"),
        record(1, "IEELAR"),
    ]
    assert scopes().owners(records) == {0: [2, "2#2"], 1: [3], 3: [1, "2#3"]}


def test_every_scope_is_narrower_than_the_one_before():
    """All loads, an area, a zone, an owner, a bus: the narrower record holds whichever is last."""
    kinds = [(0, "IEELAL"), (1, "IEELAR"), (1, "IEELZN"), (5, "IEELOW"), (1, "IEELBL")]
    for wide, narrow in pairwise(kinds):
        for records in ([record(*wide), record(*narrow)], [record(*narrow), record(*wide)]):
            (holding,) = (n for n, keys in scopes().owners(records).items() if 1 in keys)
            assert records[holding].kind == narrow[1]


def test_a_record_of_all_loads_does_not_name_the_machine_of_the_same_bus_and_id():
    for kind in ("CLODBL", "CLODAR", "CLODAL"):
        record = Record(SimpleNamespace(file="x.dyr", line=1), 1, kind, "1", ())
        assert _without_model(record, "no model", {(1, "1"): None}, {}).owner == "1/1"
