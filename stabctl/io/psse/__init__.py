"""PSS/E files: a RAW file and its DYR file as a case."""

from .to_case import Import, read, read_psse

__all__ = ["Import", "read", "read_psse"]
