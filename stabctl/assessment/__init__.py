"""Security assessment: power flow, modes, fault screen, worst faults and remedies, in one answer; prices."""

from .prices import Prices
from .remedy import Remedy
from .result import Study
from .study import study

__all__ = ["Prices", "Remedy", "Study", "study"]
