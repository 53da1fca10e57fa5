"""ESDC1A: DC exciter with a continuously acting regulator (IEEE type DC1A), whose voltage is never negative.

Vt -> [1/(1+sTR)] -> (-)
Vref + Vs -----------> + -> [(1+sTC)/(1+sTB)] -> [KA/(1+sTA)], held VRmin..VRmax -> (+) -> [1/(sTE)] >= 0 -> Efd
       (-) [sKF/(1+sTF)] <- Efd                                                     (-) (KE + SE(Efd)) Efd

An IEEEX1 with a lower limit; its gate for an underexcitation limiter is not represented.
Source: IEEE Std 421.5, type DC1A; PSS/E Model Library, ESDC1A.
"""

import numpy as np

from .dc import State, automatic, output
from .ieeex1 import Par, derivatives, from_record
from .shared import Input, Output, prepare

NAME = "ESDC1A"
ROLE = "exciter"
LIMITS = {"vr": ("VRmin", "VRmax"), "efd": (0.0, np.inf)}
DYR = {"ESDC1A": "TR KA TA TB TC VRmax VRmin KE TE KF TF _switch E1 SE1 E2 SE2"}
__all__ = [
    "DYR", "LIMITS", "NAME", "ROLE", "Input", "Output", "Par",
    "State", "automatic", "derivatives", "from_record", "output", "prepare",
]  # fmt: skip
