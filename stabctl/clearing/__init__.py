"""Critical clearing times: of one contingency, and of every line fault of a case."""

from .critical_time import clearing_time
from .lines import Lines, lines
from .result import ClearingTime
from .screen import screen
from .screen_result import Screen
from .search import Search
from .trial import Run, Trial

__all__ = ["ClearingTime", "Lines", "Run", "Screen", "Search", "Trial", "clearing_time", "lines", "screen"]
