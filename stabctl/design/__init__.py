"""Design of controllers: power system stabilizers, oscillation dampers, linear-quadratic regulators."""

from .lqr import lqr
from .pod import pod
from .pss import pss
from .result import Design

__all__ = ["Design", "lqr", "pod", "pss"]
