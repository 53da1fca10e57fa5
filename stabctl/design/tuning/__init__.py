"""Simultaneous tuning of stabilizers, dampers and other controllers over many operating points."""

from .devices import damper, pi, stabilizers, values
from .result import Tuned
from .tune import tune

__all__ = ["Tuned", "damper", "pi", "stabilizers", "tune", "values"]
