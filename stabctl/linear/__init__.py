"""Exact linearisation of an operating point, with names: matrices, python-control models, the nonlinear system."""

from .descriptor import Descriptor, descriptor
from .model import Linear, Model, linearise
from .nonlinear import nonlinear
from .signals import INPUTS, OUTPUTS, Signal

__all__ = [
    "INPUTS", "OUTPUTS", "Descriptor", "Linear", "Model", "Signal", "descriptor", "linearise", "nonlinear",
]  # fmt: skip
