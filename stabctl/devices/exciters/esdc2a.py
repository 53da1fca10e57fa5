"""ESDC2A: DC exciter with a regulator supplied by the terminals (IEEE type DC2A), whose voltage is never negative.

Vt -> [1/(1+sTR)] -> (-)
Vref + Vs -----------> + -> [(1+sTC)/(1+sTB)] -> [KA/(1+sTA)], held Vt VRmin..Vt VRmax -> (+) -> [1/(sTE)] >= 0 -> Efd
       (-) [sKF/(1+sTF)] <- Efd                                                           (-) (KE + SE(Efd)) Efd

An EXDC2 with a lower limit; its gate for an underexcitation limiter is not represented.
Source: IEEE Std 421.5, type DC2A; PSS/E Model Library, ESDC2A.
"""

import numpy as np

from .dc import State, automatic, output
from .exdc2 import Par, derivatives, from_record
from .shared import Input, Output, prepare

NAME = "ESDC2A"
ROLE = "exciter"
LIMITS = {"vr": ("VRmin", "VRmax", "vt"), "efd": (0.0, np.inf)}
DYR = {"ESDC2A": "TR KA TA TB TC VRmax VRmin KE TE KF TF _switch E1 SE1 E2 SE2"}
__all__ = [
    "DYR", "LIMITS", "NAME", "ROLE", "Input", "Output", "Par",
    "State", "automatic", "derivatives", "from_record", "output", "prepare",
]  # fmt: skip
