"""Cases from files, and back."""

from .folder import load, packaged
from .writer import write

__all__ = ["load", "packaged", "write"]
