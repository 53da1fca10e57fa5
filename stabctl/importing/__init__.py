"""What an import understood, and whether the imported system stands still where its file says it stood."""

from .checks import Standstill, Stored
from .kinds import Kind
from .report import ImportReport, import_report

__all__ = ["ImportReport", "Kind", "Standstill", "Stored", "import_report"]
