"""Case readers: from files to a `Case`, and back."""

from .folder import load, packaged, write

__all__ = ["load", "packaged", "write"]
