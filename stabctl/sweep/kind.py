"""The table of a sweep, and what runs its jobs."""

from stabctl.jobs import Kind
from stabctl.schema import fields

from .job import FORMAT, Job
from .result import Result
from .run_job import run_job

JOB = {f.column: f.kind for f in fields(Job).values()}
RESULT = {f.column: f.kind for f in fields(Result).values()}
SWEEP = Kind("results", JOB, RESULT, run_job, FORMAT)
