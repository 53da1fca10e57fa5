"""Islands of the network: each keeps one swing bus, and what is not connected to any is left out."""

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from .network import Network


def islands(net: Network) -> np.ndarray:
    """The island (from 0) of every bus."""
    place = {b.bus: i for i, b in enumerate(net.rows["buses"])}
    ends = np.array([(place[k.from_bus], place[k.to_bus]) for k in net.rows["branches"]], int).reshape(-1, 2)
    links = sp.csr_matrix((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(len(place),) * 2)
    return connected_components(links, directed=False)[1]


def settle(net: Network) -> list[str]:
    """Keep one swing bus in every island, and leave out islands without one.

    Returns a sentence for every island left out.
    """
    of_bus = {b.bus: int(i) for b, i in zip(net.rows["buses"], islands(net), strict=True)}
    swing: dict[int, int] = {}
    for bus, place in zip(list(net.rows["buses"]), net.places["buses"], strict=True):
        if bus.kind != "swing":
            continue
        first = swing.setdefault(of_bus[bus.bus], bus.bus)
        if first != bus.bus:
            net.change(bus.bus, kind="pv")
            net.corrections.append(
                f"{place}: bus {bus.bus} is a second swing bus beside {first}; it holds its voltage and stored power."
            )
    left_out: dict[int, list[int]] = {}
    for bus_number, island in of_bus.items():
        if island not in swing:
            left_out.setdefault(island, []).append(bus_number)
    gone = {bus for buses in left_out.values() for bus in buses}
    if gone and len(gone) < len(of_bus):
        net.leave_out(gone)
    sentences = []
    for buses in left_out.values():
        shown = ", ".join(map(str, buses[:5])) + (f" and {len(buses) - 5} more" if len(buses) > 5 else "")
        noun = "bus" if len(buses) == 1 else "buses"
        sentences.append(f"{net.raw.path}: {noun} {shown} left out: not connected to a swing bus.")
    return sentences
