"""Security assessment: power flow, modes, fault screen and the worst faults of a system, in one answer."""

from .study import Study, study

__all__ = ["Study", "study"]
