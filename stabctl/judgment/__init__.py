"""Criteria of performance as data, packaged ones and those of a TOML file, and how runs keep them."""

from .criteria import Criteria, criteria, packaged
from .judged import Judged, Violation, judge

__all__ = ["Criteria", "Judged", "Violation", "criteria", "judge", "packaged"]
