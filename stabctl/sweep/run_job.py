"""What a job of a sweep finds."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from stabctl.clearing import clearing_time
from stabctl.controllers import BangBang, Controller, Law
from stabctl.dynamics import operating_point
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StudyError
from stabctl.estimation.estimate import estimate
from stabctl.estimation.estimator_control import EstimatorControl
from stabctl.jobs import Found, Task
from stabctl.model import labels, powerflow
from stabctl.model.case import Case
from stabctl.schema import fields
from stabctl.simulation.control import Control, with_law
from stabctl.simulation.simulate import simulate
from stabctl.simulation.trajectory import Trajectory

from .job import Job
from .result import Result


def run_job(task: Task) -> Found:
    """Run the job of a task, whose shared data are the case and the controllers."""
    run = {"clearing-time": _clearing_time, "simulate": _simulate}[task.job.kind]
    job, (case, controllers) = task.job, task.shared
    point = _point(job, case)
    result, text = run(job, point, _control(job, point, controllers))
    return Found({f.column: value for f, value in zip(fields(Result).values(), result, strict=True)}, text)


def _point(job: Job, case: Case) -> OperatingPoint:
    """The operating point with the storage of the job."""
    flow = powerflow.solve(case)
    if job.storage:
        case = case.with_storage(job.storage, flow, **job.devices)
    return operating_point.solve(case, flow)


def _control(
    job: Job, point: OperatingPoint, own: Sequence[Controller | Law]
) -> list[Law | Controller] | EstimatorControl:
    """Law and controllers; a law if there is storage that no controller orders, or for an estimator to evaluate."""
    needed = point.case.storage if job.estimator == "ideal" or own else True
    acts = list(own)
    if needed and job.control != "none":
        acts = with_law(own, BangBang(job.deadband, job.min_voltage))
    if job.estimator == "ideal":
        return acts
    if not acts:
        raise StudyError(f"The estimator {job.estimator!r} needs a control law; remove control = 'none'.")
    return EstimatorControl(acts, job.estimator, job.pmu, seed=job.seed)


def _clearing_time(job: Job, point: OperatingPoint, control: Control) -> tuple[Result, str]:
    found = clearing_time(
        point,
        job.contingency,
        control=control,
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


def _simulate(job: Job, point: OperatingPoint, control: Control) -> tuple[Result, str]:
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
    """Number of the machine called so; None for a storage device."""
    return None if machine is None or str(machine).startswith(labels.STORAGE) else case.machine(machine).machine


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
