"""Design of controllers: power system stabilizers, oscillation dampers, regulators, optimal storage schedules."""

from .gep import gep
from .lqg import lqg
from .lqr import lqr
from .optimum import optimum
from .optimum_result import Optimum
from .outages import Outages, outages
from .pairs import Pairs, pairs
from .pod import pod
from .pss import pss
from .regulator import Regulator
from .result import Design

__all__ = [
    "Design",
    "Optimum",
    "Outages",
    "Pairs",
    "Regulator",
    "gep",
    "lqg",
    "lqr",
    "optimum",
    "outages",
    "pairs",
    "pod",
    "pss",
]
