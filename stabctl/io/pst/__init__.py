"""Data files of the Power System Toolbox (.m) as a case."""

from .to_case import read, read_pst

__all__ = ["read", "read_pst"]
