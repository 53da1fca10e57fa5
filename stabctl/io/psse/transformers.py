"""Transformers as branches: turns ratios and impedances from their codes CW, CZ and CM, the star of three windings."""

import cmath
import math
from collections.abc import Sequence
from typing import Any

from stabctl.model.tables import Branch, Bus

from .lexer import Place
from .network import Network
from .sections import Transformer

OUT = {0: (1, 2, 3), 1: (), 2: (2,), 3: (3,), 4: (1,)}  # STAT -> windings out of service


def read(net: Network) -> None:
    """Add the transformers of a RAW file. Raises `CaseError` with line and field for the first mistake."""
    for t, place in net.raw.of("transformer"):
        for name, allowed in (("CW", (1, 2, 3)), ("CZ", (1, 2, 3)), ("CM", (1, 2)), ("STAT", tuple(OUT))):
            if (code := getattr(t.head, name)) not in allowed:
                choices = ", ".join(map(str, allowed))
                raise place.error(f"{code} is not allowed; it must be one of {choices}.", name)
        for w in t.windings:
            if w.TAB:
                net.corrections.append(
                    f"{place}: the impedance correction table {w.TAB} is not used; the impedance is the nominal one."
                )
        (_three_windings if t.head.K else _two_windings)(net, t, place)


def _two_windings(net: Network, t: Transformer, place: Place) -> None:
    i, j = abs(t.head.I), abs(t.head.J)
    in_service = net.has(i, place) and net.has(j, place, "J") and t.head.STAT
    if not in_service:
        return
    first, second = (_ratio(net, t.head, w, bus, place) for w, bus in zip(t.windings, (i, j), strict=True))
    z = _impedance(net, t.head, place, t.z.R12, t.z.X12, t.z.SBASE12) * second**2
    phase = t.windings[0].ANG - t.windings[1].ANG
    magnetizing = _magnetizing(net, t, i, place)
    net.circuit(
        Branch(i, j, z.real, z.imag, 0.0, first / second, phase, t.head.CKT, magnetizing.real, magnetizing.imag), place
    )


def _three_windings(net: Network, t: Transformer, place: Place) -> None:
    buses = abs(t.head.I), abs(t.head.J), abs(t.head.K)
    inside = [net.has(bus, place, name) for bus, name in zip(buses, "IJK", strict=True)]
    on = [k for k in range(3) if inside[k] and k + 1 not in OUT[t.head.STAT]]
    if not on:
        return
    z = t.z
    pairs = ((z.R12, z.X12, z.SBASE12), (z.R23, z.X23, z.SBASE23), (z.R31, z.X31, z.SBASE31))
    z12, z23, z31 = (_impedance(net, t.head, place, *pair) for pair in pairs)
    star, name = net.new_number(), "-".join(map(str, buses))
    branches = []
    for k, own in enumerate(((z12 + z31 - z23) / 2, (z12 + z23 - z31) / 2, (z23 + z31 - z12) / 2)):
        if k not in on:
            continue
        winding, bus = t.windings[k], buses[k]
        ratio = _ratio(net, t.head, winding, bus, place)
        ends = _magnetizing(net, t, bus, place) if k == 0 else 0j
        values = (0.0, ratio, winding.ANG, t.head.CKT, ends.real, ends.imag)
        branches.append(Branch(bus, star, own.real, own.imag, *values))
    V = _star_voltage(net, branches)
    labels = (f"star {name}", *net.bus(buses[on[0]])[8:])
    what = f"star point of transformer {name} ckt {t.head.CKT}"
    net.new_bus(Bus(star, "pq", abs(V), math.degrees(cmath.phase(V)), 0.0, 0.0, 0.0, *labels), what, place)
    for branch in branches:
        net.circuit(branch, place)


def _star_voltage(net: Network, branches: Sequence[Branch]) -> complex:
    """Voltage of a star point (pu) at which its currents sum to zero. The stored VMSTAR is not always a solution."""
    sources, total = 0j, 0j
    for k in branches:
        y = 1 / (complex(k.r, k.x) or 1j * net.no_impedance)
        bus = net.bus(k.from_bus)
        sources += y * cmath.rect(bus.v / k.tap, math.radians(bus.angle - k.phase))
        total += y
    V = sources / total if total else 1 + 0j
    return V if 0.01 <= abs(V) <= 100 else 1 + 0j


def _base_kv(net: Network, bus: int, place: Place, why: str) -> float:
    kv = net.bus(bus).rated
    if not kv > 0:
        raise place.error(f"bus {bus} has no base voltage (BASKV), which {why} needs.")
    return kv


def _ratio(net: Network, head: Any, w: Any, bus: int, place: Place) -> float:
    """Turns ratio of a winding, pu of the base voltage of its bus."""
    if head.CW == 1 or not w.WINDV:
        ratio = w.WINDV or 1.0
    elif head.CW == 2:
        ratio = w.WINDV / _base_kv(net, bus, place, "CW = 2")
    else:
        ratio = w.WINDV * (w.NOMV / _base_kv(net, bus, place, "CW = 3") if w.NOMV else 1.0)
    if not 0.01 <= ratio <= 100:
        raise place.error(
            f"the turns ratio {ratio:g} at bus {bus} is not allowed; it must be from 0.01 to 100.", "WINDV"
        )
    return ratio


def _impedance(net: Network, head: Any, place: Place, r: float, x: float, base: float) -> complex:
    """Impedance between two windings, pu on the system base."""
    system = net.raw.base_mva
    base = base or system
    if not base > 0:
        raise place.error(f"{base:g} MVA is not allowed; it must be more than 0.", "SBASE")
    if head.CZ == 1:
        return complex(r, x)
    if head.CZ == 3:  # r is the load loss in W, x the size of the impedance
        r = r * 1e-6 / base
        if x * x < r * r:
            raise place.error("the load loss gives a resistance above the impedance.", "R")
        x = math.copysign(math.sqrt(x * x - r * r), x)
    return complex(r, x) * system / base


def _magnetizing(net: Network, t: Transformer, bus: int, place: Place) -> complex:
    """Magnetizing admittance at the bus of the first winding, pu on the system base."""
    g, b = t.head.MAG1, t.head.MAG2
    if t.head.CM == 1 or not (g or b):
        return complex(g, b)
    system, nominal = net.raw.base_mva, t.windings[0].NOMV
    g = g * 1e-6 / system  # the no-load loss in W; b is the exciting current on the winding's own base
    size = b * (t.z.SBASE12 or system) / system
    if size < g:
        raise place.error("the no-load loss gives a conductance above the exciting admittance.", "MAG1")
    scale = (_base_kv(net, bus, place, "CM = 2") / nominal) ** 2 if nominal else 1.0
    return scale * complex(g, -math.sqrt(size * size - g * g))
