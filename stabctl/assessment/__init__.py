"""Security assessment: power flow, modes, fault screen and the worst faults of a system, in one answer; criteria."""

from .criteria import Criteria, Judged, criteria, judge
from .result import Study
from .study import study

__all__ = ["Criteria", "Judged", "Study", "criteria", "judge", "study"]
