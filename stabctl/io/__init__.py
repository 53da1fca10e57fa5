"""Reading and writing cases."""

from .folder import packaged
from .load_case import load
from .writer import write

__all__ = ["load", "packaged", "write"]
