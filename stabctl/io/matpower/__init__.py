"""MATPOWER case files (.m) as a case."""

from .to_case import FREQUENCY, read_matpower

__all__ = ["FREQUENCY", "read_matpower"]
