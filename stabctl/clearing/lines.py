"""The faults of a screen: the lines of a case, one by one, with a fault at each end."""

from typing import NamedTuple

from stabctl.model import circuits, network
from stabctl.model.case import Branch, Case
from stabctl.model.network import Switching

OPEN = network.BranchState(from_closed=False, to_closed=False)


class Lines(NamedTuple):
    """The lines of a case by their names (`7-8`, `7-8#2`)."""

    screened: tuple[str, ...]
    bridges: tuple[str, ...]  # whose opening splits the network
    twins: tuple[str, ...]  # left out for an equal circuit that is screened


def lines(case: Case) -> Lines:
    """The lines at the high-voltage buses of a case, in the order of its table.

    A line is a branch of turns ratio 1 without phase shift and of positive reactance that does not end at a machine
    with a step-up transformer (a terminal whose storage belongs to another bus), and that either joins buses of one
    rated voltage or has charging.
    """
    stepped_up = {m.bus for m in case.machines if m.storage_bus != m.bus}
    rated = {b.bus: b.rated for b in case.buses}
    net = network.build(case)
    whole = network.islands(net).max()
    screened, bridges, twins = [], [], []
    beside: dict[frozenset[int], list[Branch]] = {}
    for row, (k, name) in enumerate(zip(case.branches, circuits.names(case.branches), strict=True)):
        parallel = beside.setdefault(frozenset((k.from_bus, k.to_bus)), [])
        parallel.append(k)
        if not _is_line(k, rated, stepped_up):
            continue
        if network.islands(net, Switching(branches=((row, OPEN),))).max() > whole:
            bridges.append(name)
        elif any(_same(k, other) for other in parallel[:-1]):
            twins.append(name)
        else:
            screened.append(name)
    return Lines(tuple(screened), tuple(bridges), tuple(twins))


def _is_line(k: Branch, rated: dict[int, float], stepped_up: set[int]) -> bool:
    plain = k.tap == 1 and k.phase == 0 and k.x > 0 and not {k.from_bus, k.to_bus} & stepped_up
    return plain and (rated[k.from_bus] == rated[k.to_bus] or k.b > 0)


def _same(one: Branch, other: Branch) -> bool:
    same = other._replace(from_bus=one.from_bus, to_bus=one.to_bus, circuit=one.circuit)
    return one == same
