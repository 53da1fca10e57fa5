"""Two-terminal DC lines as injections of the power that their converters draw at the stored voltages.

Voltage of a converter: Vdc = N (1.35 E cos(angle) - 3/pi Xc I - 2 Rc I), with E = EBAS V TR / TAP, and 1.35 short for
3 sqrt(2)/pi. Its power factor is Vdc / (1.35 N E).
Source: Kundur, Power System Stability and Control, section 10.2.
"""

import math

from stabctl.model.tables import Load

from ..table_builder import POWER_LOW
from .lexer import Place
from .network import Network
from .records import Converter
from .sections import DcLine

BLOCKED, POWER, CURRENT = 0, 1, 2


def read(net: Network) -> None:
    """Add the DC lines of a RAW file. Raises `CaseError` with line and field for the first mistake."""
    for line, place in net.raw.of("dc"):
        if line.head.MDC not in (BLOCKED, POWER, CURRENT):
            raise place.error(f"{line.head.MDC} is not allowed; it must be 0, 1 or 2.", "MDC")
        both = [net.has(end.IP, place, name) for end, name in ((line.rectifier, "IPR"), (line.inverter, "IPI"))]
        if line.head.MDC == BLOCKED or not all(both):
            continue
        current, at_rectifier, at_inverter = _operation(line, place)
        for end, power, voltage in (
            (line.rectifier, at_rectifier * current, at_rectifier),
            (line.inverter, -at_inverter * current, at_inverter),
        ):
            q = _reactive(net, end, abs(power), voltage)
            if power or q:
                name = f"DC {line.head.NAME}"
                net.add("loads", Load(end.IP, power, q, 1.0, 1.0, v_low=POWER_LOW, id=name, kind="injection"), place)
        net.corrections.append(
            f"{place}: DC line {line.head.NAME} is a constant-power injection at buses {line.rectifier.IP} and "
            f"{line.inverter.IP}, {at_rectifier * current:.4g} MW drawn and {at_inverter * current:.4g} MW delivered."
        )


def _operation(line: DcLine, place: Place) -> tuple[float, float, float]:
    """Current (kA), and voltages at rectifier and inverter (kV)."""
    head = line.head
    if not head.VSCHD > 0:
        raise place.error(f"{head.VSCHD:g} kV is not allowed; it must be more than 0.", "VSCHD")
    at_inverter, rise = head.VSCHD, head.RDC  # the inverter's voltage is VSCHD - RCOMP I, the rectifier's RDC I higher
    drop = head.RCOMP
    if head.MDC == CURRENT:
        current = abs(head.SETVL) / 1000
    else:
        power, slope = abs(head.SETVL), (rise - drop if head.SETVL > 0 else -drop)
        square = at_inverter**2 + 4 * slope * power
        if square < 0:
            raise place.error(f"{power:g} MW cannot be transmitted at {at_inverter:g} kV.", "SETVL")
        current = 2 * power / (at_inverter + math.sqrt(square))
    at_inverter -= drop * current
    return current, at_inverter + rise * current, at_inverter


def _reactive(net: Network, end: Converter, power: float, voltage: float) -> float:
    """Reactive power (Mvar) that a converter draws; 0 if its transformer data do not give its power factor."""
    ideal = 3 * math.sqrt(2) / math.pi * end.NB * end.EBAS * net.bus(end.IP).v * end.TR / (end.TAP or 1.0)
    if not 0 < voltage < ideal:
        return 0.0
    return power * math.tan(math.acos(voltage / ideal))
