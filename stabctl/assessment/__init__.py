"""Security assessment: power flow, modes, fault screen and the worst faults of a system, in one answer."""

from .result import Study
from .study import study

__all__ = ["Study", "study"]
