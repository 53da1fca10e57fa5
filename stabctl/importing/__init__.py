"""Import reports: what is represented of a file, and whether the system starts in steady state."""

from .checks import InitialState, Stored
from .kinds import Kind
from .report import ImportReport, import_report

__all__ = ["ImportReport", "InitialState", "Kind", "Stored", "import_report"]
