"""Reading and writing cases."""

from .folder import load, packaged
from .writer import write

__all__ = ["load", "packaged", "write"]
