"""Jobs of a study -> rows: where they run, and the file that keeps their rows.

A study gives its jobs as tasks; a task runs in any process and ends in one row, also if it fails (task). Tasks run in
threads (runner) or on a Dask cluster (cluster), and their rows are kept in a file (store). `Runner` joins these for
studies whose next jobs depend on earlier rows.
"""

from .runner import Runner
from .task import Found, Kind, Row, Task

__all__ = ["Found", "Kind", "Row", "Runner", "Task"]
