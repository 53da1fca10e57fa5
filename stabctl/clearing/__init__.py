"""Critical clearing times: of one contingency, and of every line fault of a case."""

from .critical_time import clearing_time
from .index import Severity
from .result import ClearingTime
from .screen import screen
from .screen_result import Lines, Screen, lines
from .trial import Run, Search, Trial

__all__ = ["ClearingTime", "Lines", "Run", "Screen", "Search", "Severity", "Trial", "clearing_time", "lines", "screen"]
