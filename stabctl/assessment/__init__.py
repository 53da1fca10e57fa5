"""Security assessment: power flow, modes, fault screen, worst faults and remedies, in one answer; criteria; prices."""

from .criteria import Criteria, Judged, criteria, judge
from .prices import Prices
from .remedy import Remedy
from .result import Study
from .study import study

__all__ = ["Criteria", "Judged", "Prices", "Remedy", "Study", "criteria", "judge", "study"]
