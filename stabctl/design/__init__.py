"""Design of controllers: stabilizers, oscillation dampers, regulators, storage laws, optimal storage schedules."""

from .evidence import Evidence, evidence
from .law import law
from .law_result import LawDesign, LawLimits
from .lqg import lqg
from .lqr import lqr
from .optimum import Optimum, optimum
from .outages import Outages, outages
from .pairs import Pairs, pairs
from .pod import pod
from .pss import gep, pss
from .quadratic import Regulator
from .result import Design
from .tuning import Tuned, damper, pi, stabilizers, tune, values

__all__ = [
    "Design",
    "Evidence",
    "LawDesign",
    "LawLimits",
    "Optimum",
    "Outages",
    "Pairs",
    "Regulator",
    "Tuned",
    "damper",
    "evidence",
    "gep",
    "law",
    "lqg",
    "lqr",
    "optimum",
    "outages",
    "pairs",
    "pi",
    "pod",
    "pss",
    "stabilizers",
    "tune",
    "values",
]
