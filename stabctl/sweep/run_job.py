"""What a job of a sweep finds."""

from typing import Any

import numpy as np

from stabctl.clearing import clearing_time
from stabctl.controllers import BangBang
from stabctl.dynamics import operating_point
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StudyError
from stabctl.estimation.estimate import estimate
from stabctl.estimation.estimator_control import EstimatorControl
from stabctl.estimation.estimators import Engine
from stabctl.jobs import Found, Task
from stabctl.model import powerflow
from stabctl.model.case import Case
from stabctl.schema import fields
from stabctl.simulation.simulate import simulate
from stabctl.simulation.trajectory import Trajectory

from .job import Job
from .result import Result


def run_job(task: Task) -> Found:
    """Run the job of a task, whose shared data is the case."""
    result, text = {"clearing-time": _clearing_time, "simulate": _simulate}[task.job.kind](task.job, _point(task))
    return Found({f.column: value for f, value in zip(fields(Result).values(), result, strict=True)}, text)


def _point(task: Task) -> OperatingPoint:
    """The operating point with the storage of the job."""
    job, case = task.job, task.shared
    flow = powerflow.solve(case)
    if job.storage:
        case = case.with_storage(job.storage, flow, characteristic=job.characteristic, lag=job.lag)
    return operating_point.solve(case, flow)


def _control(job: Job, point: OperatingPoint) -> BangBang | EstimatorControl | None:
    """The control law if there is storage; an estimator is evaluated without storage too."""
    law = BangBang(job.deadband, job.min_voltage)
    if job.estimator == "ideal":
        return law if point.case.storage and job.control != "none" else None
    if job.control == "none":
        raise StudyError(f"The estimator {job.estimator!r} needs a control law; remove control = 'none'.")
    engine: Engine = "batched" if job.kind == "clearing-time" else "filterpy"
    return EstimatorControl(law, job.estimator, job.pmu, seed=job.seed, engine=engine)


def _clearing_time(job: Job, point: OperatingPoint) -> tuple[Result, str]:
    found = clearing_time(
        point,
        job.contingency,
        control=_control(job, point),
        resolution=job.resolution,
        limit=job.limit,
        observe=job.observe,
        longest=job.longest,
        scan=job.scan,
        step=job.step or None,
        criterion=job.criterion,
    )
    result = Result(
        found.status,
        cycles=found.cycles,
        seconds=found.seconds,
        monotone=int(not found.stable_above),
        runs=len(found.runs),
        machine=_number(found.machine, point.case),
    )
    return result, str(found)


def _simulate(job: Job, point: OperatingPoint) -> tuple[Result, str]:
    control = _control(job, point)
    arguments = point, job.contingency, job.until
    record = bool(point.case.storage)
    options: Any = {"step": job.step or None, "criterion": job.criterion, "record": record}
    if not isinstance(control, EstimatorControl):
        run = simulate(*arguments, control=control, **options)
        return _ended(run, record), run.outcome.message
    found = estimate(*arguments, control=control, seeds=job.seed, **options)
    result, text = _ended(found.runs[0], record), found.runs[0].outcome.message
    try:
        accuracy = found.accuracy
    except StudyError:  # synchronism was lost before the estimates could be judged
        return result, text
    result = result._replace(
        rmse=accuracy.rmse_mhz,
        p99=accuracy.p99_mhz,
        delay=accuracy.delay_ms,
        wrong_command_share=accuracy.wrong_command_share,
        opposite_command_share=accuracy.opposite_command_share,
    )
    return result, text


def _number(machine: int | str | None, case: Case) -> int | None:
    """Number of the machine called so."""
    return None if machine is None else case.machine(machine).machine


def _ended(run: Trajectory, record: bool) -> Result:
    end = run.outcome
    return Result(
        end.kind.value,
        machine=_number(end.machine, run.point.case),
        bus=end.bus,
        time=end.time_s,
        max_angle_from_coi=run.max_angle_from_coi_deg,
        energy=float(np.ptp(run.arrays.energy, axis=0).sum()) if record else None,
    )
