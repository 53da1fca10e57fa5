"""Generators as machines, the kinds of their buses, and their step-up transformers."""

import cmath
import math
from collections import defaultdict
from typing import Any, NamedTuple

from stabctl.model.tables import Branch, Bus, Machine

from .lexer import Place
from .network import Network

AT_LIMIT = 1e-3  # Mvar   distance from a reactive limit
SAME_VOLTAGE = 1e-4  # pu


class Source(NamedTuple):
    """What the records of dynamic models need of a generator: its machine and source impedance, pu on MBASE."""

    machine: int
    ra: float
    x: float
    place: Place


def read(net: Network) -> dict[tuple[int, str], Source]:
    """Add the generators in service. Returns them by bus and ID.

    Raises `CaseError` with line and field for the first mistake.
    """
    at: dict[int, list[tuple[Any, Place]]] = defaultdict(list)
    seen: dict[tuple[int, str], Place] = {}
    for g, place in net.raw.of("generator"):
        if (g.I, g.ID) in seen:
            raise place.error(f"machine {g.I}/{g.ID} appears twice, first in line {seen[g.I, g.ID].line}.", "ID")
        seen[g.I, g.ID] = place
        if net.has(g.I, place) and g.STAT:
            at[g.I].append((g, place))
    found: dict[tuple[int, str], Source] = {}
    for bus, units in at.items():
        _bus_kind(net, bus, units)
        for k, (g, place) in enumerate(units):
            number = net.new_number() if k else bus
            base = g.MBASE or net.raw.base_mva
            terminal = _terminal(net, g, base, place) if g.XT or g.RT else None
            p, q = (g.PG, g.QG) if terminal is None else terminal[1:]
            where = bus if terminal is None else terminal[0]
            net.add("machines", Machine(number, where, base, p, where, q, f"{bus}/{g.ID}"), place)
            found[bus, g.ID] = Source(number, g.ZR, g.ZX, place)
    net.idle()
    net.storage_buses()
    return found


def _bus_kind(net: Network, bus: int, units: list[tuple[Any, Place]]) -> None:
    """The voltage held at a bus with machines, or that their reactive power is fixed."""
    row, (first, place) = net.bus(bus), units[0]
    if row.kind == "pq":
        return
    remote = first.IREG not in (0, bus)
    if remote or abs(first.VS - row.v) <= SAME_VOLTAGE:
        if remote:
            net.corrections.append(
                f"{place}: machine {bus}/{first.ID} regulates bus {first.IREG}; it holds its stored terminal voltage."
            )
        return
    limits = zip(*((g.QT - g.QG, g.QG - g.QB) for g, _ in units), strict=True)
    if row.kind == "pv" and any(max(map(abs, distance)) <= AT_LIMIT for distance in limits):
        net.change(bus, kind="pq")
        net.corrections.append(
            f"{place}: the machines at bus {bus} are at their reactive limit, so their reactive power is fixed."
        )
    else:
        net.change(bus, v=first.VS)


def _terminal(net: Network, g: Any, base: float, place: Place) -> tuple[int, float, float]:
    """Add the terminal behind a step-up transformer (RT + jXT, GTAP) that delivers PG and QG to the bus.

    Returns its number, and the active and reactive power produced there (MW, Mvar).
    """
    row, system = net.bus(g.I), net.raw.base_mva
    if not g.GTAP > 0:
        raise place.error(f"{g.GTAP:g} is not allowed; it must be more than 0.", "GTAP")
    z = complex(g.RT, g.XT) * system / base
    V = cmath.rect(row.v, math.radians(row.angle)) / g.GTAP
    I = (complex(g.PG, g.QG) / system / V).conjugate()
    behind = V + z * I
    S = behind * I.conjugate() * system
    number, held = net.new_number(), row.kind
    labels = (f"terminal {g.I}/{g.ID}", *row[8:])
    angle = math.degrees(cmath.phase(behind))
    net.new_bus(
        Bus(number, held, abs(behind), angle, 0.0, 0.0, 0.0, *labels), f"terminal of machine {g.I}/{g.ID}", place
    )
    net.step_up.add(g.I)
    net.circuit(Branch(g.I, number, z.real, z.imag, 0.0, g.GTAP, circuit=g.ID), place)
    return number, S.real, S.imag
