"""Critical clearing times: of one fault, and of every line fault of a case."""

from .critical_time import Clearing, clearing_time
from .lines import Lines, lines
from .screen import Pair, Screen, screen

__all__ = ["Clearing", "Lines", "Pair", "Screen", "clearing_time", "lines", "screen"]
