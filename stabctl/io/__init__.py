"""Reading and writing cases."""

from .by_ending import load
from .folder import packaged
from .writer import write

__all__ = ["load", "packaged", "write"]
