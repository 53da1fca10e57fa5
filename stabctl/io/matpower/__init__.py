"""MATPOWER case files (.m) as a case."""

from .to_case import FREQUENCY, Import, read, read_matpower

__all__ = ["FREQUENCY", "Import", "read", "read_matpower"]
