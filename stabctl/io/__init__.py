"""Reading and writing cases."""

from .folder import packaged, write
from .load_case import load

__all__ = ["load", "packaged", "write"]
