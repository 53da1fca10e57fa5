"""A task -> its row. Whatever goes wrong in a job stays in its row."""

import os
import platform
import time

import numpy as np

from stabctl.clearing import clearing_time
from stabctl.controllers import BangBang
from stabctl.dynamics import operating_point
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StabctlError, StudyError
from stabctl.estimation.estimate import estimate
from stabctl.estimation.estimator_control import EstimatorControl
from stabctl.model import fleet, powerflow
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.criterion import DEFAULT, Criterion
from stabctl.simulation.simulation import run
from stabctl.simulation.trajectory import Trajectory

from .job import Job
from .result import Result, Row, signed
from .task import Task, circuits, pmu


def perform(task: Task) -> Row:
    """Do the job of a task."""
    began = time.perf_counter()
    try:
        result = {"clearing-time": _clearing_time, "simulate": _simulate}[task.job.kind](task.job, _point(task))
    except StabctlError as error:
        result = Result("error", message=" ".join(str(error).split()))
    except Exception as error:
        text = f"{type(error).__name__}: {error}. This is a mistake in stabctl; please report it with the study file."
        result = Result("bug", message=" ".join(text.split()))
    where = f"{platform.node()}:{os.getpid()}"
    return Row(task.key, task.job, signed(result, wall=time.perf_counter() - began, worker=where))


def _point(task: Task) -> OperatingPoint:
    """The operating point with the storage of the job."""
    job, case = task.job, task.case
    flow = powerflow.solve(case)
    if job.storage:
        options = {"characteristic": job.characteristic, "lag": job.lag}
        make = fleet.chosen if "=" in job.storage else fleet.everywhere
        case = case.with_storage(() if job.storage == "none" else make(case, job.storage, flow, **options))
    return operating_point.solve(case, flow)


def _steering(job: Job, point: OperatingPoint) -> BangBang | EstimatorControl | None:
    """The law where there is storage; under an estimator also without storage, to see how well it does."""
    law = BangBang(job.deadband, job.min_voltage)
    if job.estimator == "ideal":
        return law if point.case.storage and job.control != "none" else None
    if job.control == "none":
        raise StudyError(f"The estimator {job.estimator!r} drives a control law; leave out control = 'none'.")
    engine = "batched" if job.kind == "clearing-time" else "filterpy"
    return EstimatorControl(law, job.estimator, pmu(job), seed=job.seed, engine=engine)


def _clearing_time(job: Job, point: OperatingPoint) -> Result:
    fault = Contingency(job.fault, trip=circuits(job.trip), impedance=complex(job.fault_r, job.fault_x))
    found = clearing_time(
        point,
        fault,
        control=_steering(job, point),
        resolution=job.resolution,
        limit=job.limit,
        observe=job.observe,
        step=job.step or None,
        criterion=_criterion(job),
    )
    return Result(
        "ok",
        found.status,
        cycles=found.cycles,
        seconds=found.seconds,
        monotone=int(found.monotone),
        runs=len(found.runs),
        machine=found.machine,
        message=str(found),
    )


def _simulate(job: Job, point: OperatingPoint) -> Result:
    impedance = complex(job.fault_r, job.fault_x)
    happens = Contingency(job.fault or None, job.clear or None, circuits(job.trip), at=job.at, impedance=impedance)
    steering, keep = _steering(job, point), bool(point.case.storage)
    arguments = point, happens, job.until, steering
    if not isinstance(steering, EstimatorControl):
        return _ended(run(*arguments, job.step or None, _criterion(job), keep))
    options = {"step": job.step or None, "criterion": _criterion(job), "record": keep}
    seen = estimate(point, happens, job.until, control=steering, seeds=job.seed, **options)
    result = _ended(seen.runs[0])
    try:
        score = seen.accuracy
    except StudyError:  # synchronism was lost before there was anything to judge
        return result
    return result._replace(
        rmse=score.rmse_mhz,
        p99=score.p99_mhz,
        delay=score.delay_ms,
        wrong_command_share=score.wrong_command_share,
        opposite_command_share=score.opposite_command_share,
    )


def _ended(run: Trajectory) -> Result:
    end, kept = run.outcome, len(run.rows) > 0
    return Result(
        "ok",
        end.kind.value,
        machine=end.machine,
        bus=end.bus,
        time=end.time_s,
        max_angle_from_coi=run.max_angle_from_coi_deg,
        energy=float(np.ptp(run.arrays.energy, axis=0).sum()) if kept else None,
        message=end.message,
    )


def _criterion(job: Job) -> Criterion:
    return DEFAULT._replace(max_angle=job.max_angle)
