"""The order of a screen: are its ten worst faults among the first thirty of one short run each?"""

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import stabctl as st
from reproduction.study import Study, Table, present
from stabctl.clearing import Search, Severity, Trial
from stabctl.simulation.contingency import Contingency

FULL = True
WORST, FIRST = 10, 30
STORED: dict[str, Any] = {"storage": "5%mva", "control": st.BangBang()}
SYSTEMS: dict[str, tuple[str, bool, dict[str, Any]]] = {  # name -> case, whether machines are classical, storage
    "ieee39": ("ieee39", False, {}),
    "ieee39, classical": ("ieee39", True, {}),
    "ieee39, storage": ("ieee39", False, STORED),
    "wnaps": ("wnaps", False, {}),
    "wnaps, storage": ("wnaps", False, STORED),
}
HEADS = "system", "faults", "found", "last at", "by lasting faults", "last at", "share of the runs", "share of the time"
TEXT = (
    f"The {WORST} faults with the shortest clearing times in a screen of lines and buses, and those that tie with the "
    f"last of them: how many are among the first {FIRST} of the index, and the place of the last one there. Faults "
    "that tie in the index all have the place of their last. Beside it the same for the time at which a lasting fault "
    "causes loss of synchronism, which knows the place of a fault, but not the circuits opened. Storage is 5 % of the "
    "MVA of every machine with the paper's law."
)


class Ranking(NamedTuple):
    """How well an order finds the worst faults."""

    worst: int
    found: int  # among the first
    last: int  # place of the last of the worst


class Measured(NamedTuple):
    """The order of one screen."""

    faults: int
    by_index: Ranking
    by_lasting: Ranking  # by the time at which a lasting fault causes loss of synchronism
    runs: float  # share of the runs that are those of the index
    time: float  # the same of the time


def study(reports: Path) -> Study:
    """The table of all systems."""
    every = {name: measured(*how) for name, how in SYSTEMS.items()}
    rows = tuple((name, *counts(one), f"{100 * one.time:.0f} %") for name, one in every.items())
    found, worst = (sum(getattr(one.by_index, what) for one in every.values()) for what in ("found", "worst"))
    tables = (Table(f"The worst faults among the first {FIRST}", HEADS, rows),)
    return Study("Order of a screen", text=(TEXT, f"The index finds {found} of {worst}."), tables=tables)


def counts(one: Measured) -> tuple[str, ...]:
    """The numbers of a row that every machine gives."""
    found = (cell for of in (one.by_index, one.by_lasting) for cell in (f"{of.found} of {of.worst}", str(of.last)))
    return str(one.faults), *found, f"{100 * one.runs:.0f} %"


def measured(case: str, classical: bool = False, given: Mapping[str, Any] | None = None) -> Measured:
    """Screen a case, and compare the orders with its clearing times."""
    control, loaded = (given or {}).get("control"), st.load(case)
    base = (loaded.classical() if classical else loaded).initialize((given or {}).get("storage"))
    told: list[tuple[float, list[Severity]]] = []
    began = time.perf_counter()
    found = base.screen(
        faults="lines, buses",
        control=control,
        workers=1,
        ranking=lambda severities: told.append((time.perf_counter(), [*severities])),
    )
    ended, ((ranked_at, severities),) = time.perf_counter(), told
    cycles = {
        p.contingency: {"unstable_at_zero": -1.0}.get(p.status, p.cycles or found.search.limit_cycles)
        for p in found.pairs
    }
    first = Trial(base, severities[0].contingency, control, Search())
    places = {one.contingency.fault: first.of(one.contingency).guess() for one in severities}
    return Measured(
        len(cycles),
        ranking(cycles, {one.contingency: one.order for one in severities}),
        ranking(cycles, {one: (places[one.fault],) for one in cycles}),
        len(cycles) / (len(cycles) + found.simulations),
        (ranked_at - began) / (ended - began),
    )


def ranking(cycles: Mapping[Contingency, float], order: Mapping[Contingency, tuple[Any, ...]]) -> Ranking:
    """The places of the worst faults in an order."""
    longest = sorted(cycles.values())[WORST - 1]
    places = [sum(other <= order[one] for other in order.values()) for one, c in cycles.items() if c <= longest]
    return Ranking(len(places), sum(place <= FIRST for place in places), max(places))


if __name__ == "__main__":
    present(study)
