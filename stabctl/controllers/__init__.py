"""Control laws of the storage devices, and the signals they see."""

from .bang_bang import BangBang

__all__ = ["BangBang"]
