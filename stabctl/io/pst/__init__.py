"""Data files of the Power System Toolbox (.m) as a case."""

from .to_case import Import, read, read_pst

__all__ = ["Import", "read", "read_pst"]
