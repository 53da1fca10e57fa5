"""A task and its row. Any error of a job is recorded in its row."""

import os
import pickle
import platform
import time
from typing import Any

import numpy as np

from stabctl import devices
from stabctl.clearing import clearing_time
from stabctl.controllers import BangBang
from stabctl.dynamics import operating_point
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StabctlError, StudyError
from stabctl.estimation.estimate import estimate
from stabctl.estimation.estimator_control import EstimatorControl
from stabctl.estimation.estimators import Engine
from stabctl.model import powerflow
from stabctl.model.case import Case
from stabctl.simulation.simulate import simulate
from stabctl.simulation.trajectory import Trajectory

from .job import Job
from .result import Result, Row, signed
from .task import Task, contingency, pmu


def run_job(task: Task) -> Row:
    """Run the job of a task."""
    began = time.perf_counter()
    try:
        result = {"clearing-time": _clearing_time, "simulate": _simulate}[task.job.kind](task.job, _point(task))
    except StabctlError as error:
        result = Result("error", message=" ".join(str(error).split()))
    except Exception as error:
        text = f"{type(error).__name__}: {error}. This is a bug in stabctl; please report it with the study file."
        result = Result("bug", message=" ".join(text.split()))
    where = f"{platform.node()}:{os.getpid()}"
    return Row(task.key, task.job, signed(result, wall=time.perf_counter() - began, worker=where))


def run_received(files: tuple[str, ...], task: bytes) -> Row:
    """Register the user's devices in `files`, which unpickling the case may need, and run a pickled task."""
    devices.register_missing(files)
    return run_job(pickle.loads(task))  # from the process that made the sweep


def _point(task: Task) -> OperatingPoint:
    """The operating point with the storage of the job."""
    job, case = task.job, task.case
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
    return EstimatorControl(law, job.estimator, pmu(job), seed=job.seed, engine=engine)


def _clearing_time(job: Job, point: OperatingPoint) -> Result:
    found = clearing_time(
        point,
        contingency(job),
        control=_control(job, point),
        resolution=job.resolution,
        limit=job.limit,
        observe=job.observe,
        longest=job.longest,
        scan=job.scan,
        step=job.step or None,
        criterion=job.criterion,
    )
    return Result(
        "ok",
        found.status,
        cycles=found.cycles,
        seconds=found.seconds,
        monotone=int(not found.stable_above),
        runs=len(found.runs),
        machine=_number(found.machine, point.case),
        message=str(found),
    )


def _simulate(job: Job, point: OperatingPoint) -> Result:
    control = _control(job, point)
    arguments = point, contingency(job), job.until
    record = bool(point.case.storage)
    options: Any = {"step": job.step or None, "criterion": job.criterion, "record": record}
    if not isinstance(control, EstimatorControl):
        return _ended(simulate(*arguments, control=control, **options), record)
    found = estimate(*arguments, control=control, seeds=job.seed, **options)
    result = _ended(found.runs[0], record)
    try:
        accuracy = found.accuracy
    except StudyError:  # synchronism was lost before the estimates could be judged
        return result
    return result._replace(
        rmse=accuracy.rmse_mhz,
        p99=accuracy.p99_mhz,
        delay=accuracy.delay_ms,
        wrong_command_share=accuracy.wrong_command_share,
        opposite_command_share=accuracy.opposite_command_share,
    )


def _number(machine: int | str | None, case: Case) -> int | None:
    """Number of the machine called so."""
    return None if machine is None else case.machine(machine).machine


def _ended(run: Trajectory, record: bool) -> Result:
    end = run.outcome
    return Result(
        "ok",
        end.kind.value,
        machine=_number(end.machine, run.point.case),
        bus=end.bus,
        time=end.time_s,
        max_angle_from_coi=run.max_angle_from_coi_deg,
        energy=float(np.ptp(run.arrays.energy, axis=0).sum()) if record else None,
        message=end.message,
    )
