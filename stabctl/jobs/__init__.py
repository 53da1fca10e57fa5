"""Jobs of a study -> rows: where they run, and the file that keeps their rows.

A study gives its jobs as tasks; a task runs in any process and ends in one row, also if it fails.

    Task (task) -> Row (run_task), in threads, processes (pool) or on a Dask cluster (cluster), kept in a file (store)

`Runner` joins them for studies whose next jobs depend on earlier rows.
"""

from .runner import Runner
from .task import Found, Kind, Row, Task

__all__ = ["Found", "Kind", "Row", "Runner", "Task"]
