"""Design of controllers: power system stabilizers, oscillation dampers, linear-quadratic regulators."""

from .gep import gep
from .lqr import lqr
from .outages import Outages, outages
from .pairs import Pairs, pairs
from .pod import pod
from .pss import pss
from .result import Design

__all__ = ["Design", "Outages", "Pairs", "gep", "lqr", "outages", "pairs", "pod", "pss"]
