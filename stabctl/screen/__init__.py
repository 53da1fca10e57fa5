"""Clearing times of all line faults, the shortest first: where a system is critical, and which machine goes first."""

from .lines import Lines, lines
from .study import Pair, Screen, screen

__all__ = ["Lines", "Pair", "Screen", "lines", "screen"]
