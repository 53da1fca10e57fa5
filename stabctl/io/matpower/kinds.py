"""Kinds and ratings of generators, by the fuel and type that some files give (genfuels and gentypes of MATPOWER)."""

import math

from stabctl.model.typical import POWER_FACTOR, Kind, Known

from . import mpc
from .network import Network

FUELS: dict[str, Kind] = {
    "nuclear": "nuclear",
    "hydro": "hydro",
    "hydrops": "hydro",
    "ng": "gas",
    "wind": "converter",
    "solar": "converter",
    "ess": "converter",
    "battery": "converter",
    "coal": "steam",
    "biomass": "steam",
    "geothermal": "steam",
    "refuse": "steam",
    "wood": "steam",
}
TYPES: dict[str, Kind] = {
    "HY": "hydro",
    "PS": "hydro",
    "GT": "gas",
    "CT": "gas",
    "IC": "gas",
    "JE": "gas",
    "ST": "steam",
    "CA": "steam",
    "WT": "converter",
    "WS": "converter",
    "PV": "converter",
    "BA": "converter",
    "SC": "condenser",
}


def known(net: Network) -> dict[int, Known]:
    """What the file says about every machine, by its number."""
    fuels, types = (net.file.labels.get(name, []) for name in ("genfuel", "gentype"))
    found = {}
    for number, row in net.row_of.items():
        g = net.file.tables["gen"][row][0]
        of_fuel = FUELS.get(fuels[row].lower()) if fuels else None
        of_type = TYPES.get(types[row].upper()) if types else None
        kind = of_type if of_fuel in (None, "gas", "steam") and of_type else of_fuel
        found[number] = Known(kind or ("steam" if g.PMAX > 0 else None), _rating(g, net.file.base_mva))
    return found


def _rating(g: mpc.Gen, base_mva: float) -> float:
    """MBASE, unless it is left at the base of the system; then what PMAX needs at the usual power factor."""
    if g.MBASE not in (0, base_mva):
        return max(g.MBASE, 0.0)
    return g.PMAX / POWER_FACTOR if 0 < g.PMAX < math.inf else 0.0
