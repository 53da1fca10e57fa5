"""Simultaneous tuning of stabilizers, dampers and other controllers over many operating points."""

from .case_values import values
from .devices import damper, pi, stabilizers
from .result import Tuned
from .tune import tune

__all__ = ["Tuned", "damper", "pi", "stabilizers", "tune", "values"]
