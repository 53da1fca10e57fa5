"""A job of a sweep: one clearing time or one simulation, as plain values; what it finds, and how.

The fields of a job are the keys of a study file, those of a result the columns of the results file. Columns carry their
units, as those of a case do: `until_s`, `deadband_hz`, `step_s`.
"""

import json
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from annotated_types import Gt, Interval

from stabctl._util.errors import StudyError
from stabctl._util.schema import NOT_NEGATIVE, POSITIVE, SHARE, Field, fields
from stabctl.clearing import clearing_time
from stabctl.controllers import BangBang, Controller, Law
from stabctl.dynamics import operating_point
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.estimation.estimate import estimate
from stabctl.estimation.estimator_control import EstimatorControl
from stabctl.estimation.estimators import EstimatorName
from stabctl.estimation.pmu import Pmu
from stabctl.jobs import Found, Kind, Task
from stabctl.model import naming, powerflow
from stabctl.model.case import Case
from stabctl.model.tables import Characteristic, StorageModel
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.control import Control, with_law
from stabctl.simulation.criterion import DEFAULT, Coi, Criterion
from stabctl.simulation.simulate import simulate
from stabctl.simulation.trajectory import Trajectory

JobKind = Literal["clearing-time", "simulate"]
FORMAT = 15  # of keys and rows; raised when a job or a result changes its meaning


class Job(NamedTuple):
    """What is computed; an empty text means that nothing is given."""

    kind: Annotated[JobKind, "-", "what is computed"]
    case: Annotated[str, "-", "packaged case, or folder relative to the study file"]
    machines: Annotated[Literal["full", "classical"], "-", "models of the case, or classical machines"] = "full"
    motor_share: Annotated[
        float | None, "-", "share of every load that induction motors draw (none: as in the case)", SHARE
    ] = None
    set: Annotated[str, "-", "changes of the case, a JSON object of paths and values"] = ""
    fault: Annotated[str, "-", "fault location: 83, 7-8@0.4"] = ""
    trip: Annotated[str, "-", "circuits opened to clear the fault: 83-33, 7-8#2"] = ""
    fault_r: Annotated[float, "pu", "fault resistance", NOT_NEGATIVE] = 0.0
    fault_x: Annotated[float, "pu", "fault reactance"] = 0.0
    clear: Annotated[str, "-", "clearing time: 6cyc, 0.1s, 100ms"] = ""
    at: Annotated[float, "s", "time of the fault", NOT_NEGATIVE] = 1.0
    until: Annotated[float, "s", "end of the simulation", POSITIVE] = 10.0
    resolution: Annotated[str, "-", "spacing of the clearing times tried"] = "0.125cyc"
    limit: Annotated[str, "-", "longest clearing time tried"] = "60cyc"
    observe: Annotated[float, "s", "observation window after the last event", POSITIVE] = 5.0
    longest: Annotated[float, "s", "longest time observed, while the swings do not decay", NOT_NEGATIVE] = 20.0
    scan: Annotated[str, "-", "how far below and above the answer other faults are tried"] = "auto"
    storage: Annotated[str, "-", "none, 50MW, 5%mva, 5%dispatch, or 14=50MW,13@33=20MW (empty: that of the case)"] = ""
    characteristic: Annotated[Characteristic, "-", "what a storage device holds constant"] = "power"
    lag: Annotated[float, "s", "time constant from order to power", NOT_NEGATIVE] = 0.0
    storage_model: Annotated[StorageModel, "-", "ideal devices, or behind converters"] = "ideal"
    storage_energy: Annotated[float, "MWh", "energy capacity of a device (0: no limit)", NOT_NEGATIVE] = 0.0
    storage_mva: Annotated[
        str, "-", "MVA of a device: 60MVA, 120% of its power rating (empty: 100%), or for its power at 0.8pu"
    ] = ""
    converter: Annotated[str, "-", "parameters of the converters that are not the default"] = ""
    control: Annotated[
        Literal["bang-bang", "none"], "-", "storage control law, where no controller gives the orders"
    ] = "bang-bang"
    controller: Annotated[str, "-", "controller files (TOML) relative to the study file: pod.toml, pss.toml"] = ""
    deadband: Annotated[float, "Hz", "deadband of the speed deviation", NOT_NEGATIVE] = 0.1
    min_voltage: Annotated[float, "pu", "voltage below which a device idles", NOT_NEGATIVE] = 0.8
    estimator: Annotated[EstimatorName, "-", "speeds that the control law uses"] = "ideal"
    pmu_rate: Annotated[int, "-", "PMU reports per second", POSITIVE] = 60
    pmu_noise: Annotated[float, "mrad", "noise of the phasor angles; magnitudes per mille", NOT_NEGATIVE] = 2.0
    latency: Annotated[float, "ms", "latency of remote reports", NOT_NEGATIVE] = 50.0
    loss: Annotated[float, "-", "fraction of the reports that are lost", SHARE] = 0.02
    seed: Annotated[int, "-", "seed of noise and losses", Interval(ge=0, le=2**53)] = 1
    max_angle: Annotated[float, "rad", "change of a rotor angle that counts as loss of synchronism", POSITIVE] = 3.5
    min_frequency: Annotated[float, "pu", "lowest frequency of an island", Interval(ge=0, lt=1)] = DEFAULT.min_frequency
    max_frequency: Annotated[float, "pu", "highest frequency of an island", Gt(1)] = DEFAULT.max_frequency
    frequency_delay: Annotated[float, "s", "time outside that counts as unstable (0: none)", NOT_NEGATIVE] = 1.0
    coi: Annotated[Coi, "-", "center of inertia: of all, or of machines without grid-forming converters"] = "all"
    step: Annotated[float, "s", "time step (0: at most 1/120 s)", NOT_NEGATIVE] = 0.0

    def given(self) -> dict[str, Any]:
        """Column -> value, of the columns that this kind of job has."""
        return {f.column: getattr(self, name) for name, f in columns(self.kind).items()}

    @property
    def devices(self) -> dict[str, Any]:
        """Columns of the devices of `storage` that are not the usual ones."""
        given = {name: getattr(self, name) for name in OF_DEVICES}
        return {OF_DEVICES[name]: value for name, value in given.items() if value != self._field_defaults[name]}

    @property
    def criterion(self) -> Criterion:
        """The criterion of stability."""
        return DEFAULT._replace(
            max_angle=self.max_angle,
            min_frequency=self.min_frequency,
            max_frequency=self.max_frequency,
            frequency_delay_s=self.frequency_delay,
            coi=self.coi,
        )

    @property
    def contingency(self) -> Contingency:
        """The contingency; a clearing time has its own duration of the fault."""
        clear = self.clear if self.kind == "simulate" else None
        impedance = complex(self.fault_r, self.fault_x)
        return Contingency(self.fault or None, clear or None, self.trip, at=self.at, impedance=impedance)

    @property
    def law(self) -> BangBang:
        """The law of the storage devices that no controller drives."""
        return BangBang(self.deadband, self.min_voltage)

    @property
    def pmu(self) -> Pmu:
        """The PMUs."""
        return Pmu.noisy(self.pmu_rate, self.pmu_noise, self.latency, self.loss)

    @property
    def changes(self) -> dict[str, Any]:
        """Changes of the case: path -> value."""
        return json.loads(self.set) if self.set else {}


OF_DEVICES = {
    "characteristic": "characteristic",
    "lag": "lag",
    "storage_model": "storage_model",
    "storage_energy": "energy",
    "storage_mva": "mva",
    "converter": "converter",
}  # field of a job -> column of the devices of `storage`
ONLY: dict[str, JobKind] = {
    "clear": "simulate",
    "at": "simulate",
    "until": "simulate",
    "resolution": "clearing-time",
    "limit": "clearing-time",
    "observe": "clearing-time",
    "longest": "clearing-time",
    "scan": "clearing-time",
}  # field -> the only kind of job that has it


def columns(kind: JobKind) -> dict[str, Field]:
    """Fields of the jobs of a kind, by name."""
    return {name: f for name, f in fields(Job).items() if ONLY.get(name, kind) == kind}


def changed(values: Mapping[str, Any]) -> str:
    """Changes of a case as the text of `Job.set`, in which 10.0 is 10."""
    whole = {path: int(x) if isinstance(x, float) and x.is_integer() else x for path, x in values.items()}
    return json.dumps(whole, sort_keys=True) if values else ""


class Result(NamedTuple):
    """What a job finds; None if not applicable."""

    outcome: Annotated[str | None, "-", "how the simulation or the search ended"] = None
    cycles: Annotated[float | None, "-", "critical clearing time in cycles"] = None
    seconds: Annotated[float | None, "-", "critical clearing time in seconds"] = None
    monotone: Annotated[int | None, "-", "1: no longer fault that was tried was stable"] = None
    runs: Annotated[int | None, "-", "simulations of the search"] = None
    machine: Annotated[int | None, "-", "machine that loses synchronism first"] = None
    bus: Annotated[int | None, "-", "bus whose voltage collapsed"] = None
    time: Annotated[float | None, "s", "end of the simulation"] = None
    max_angle_from_coi: Annotated[float | None, "deg", "largest change of an angle relative to the COI"] = None
    energy: Annotated[float | None, "MWh", "range of the charge, summed over the devices"] = None
    rmse: Annotated[float | None, "mHz", "rms error of the estimated deviations"] = None
    p99: Annotated[float | None, "mHz", "99th percentile of the absolute error"] = None
    delay: Annotated[float | None, "ms", "of the estimates"] = None
    wrong_command_share: Annotated[float | None, "-", "of machine-frames"] = None
    opposite_command_share: Annotated[float | None, "-", "of machine-frames"] = None


def run_job(task: Task) -> Found:
    """Run the job of a task, whose shared data are the case and the controllers."""
    run = {"clearing-time": _clearing_time, "simulate": _simulate}[task.job.kind]
    job, (case, controllers) = task.job, task.shared
    point = _point(job, case)
    result, text = run(job, point, control_of(job, bool(point.case.storage), controllers))
    return Found({f.column: value for f, value in zip(fields(Result).values(), result, strict=True)}, text)


def _point(job: Job, case: Case) -> OperatingPoint:
    """The operating point with the storage of the job."""
    flow = powerflow.solve(case)
    if job.storage:
        case = case.with_storage(job.storage, flow, **job.devices)
    return operating_point.solve(case, flow)


def acting(job: Job, storage: bool, own: Sequence[Controller | Law]) -> list[Controller | Law]:
    """Its controllers, with its law if storage has no other orders, or for an estimator without controllers."""
    needed = storage if job.estimator == "ideal" or own else True
    return with_law(own, job.law) if needed and job.control != "none" else list(own)


def control_of(job: Job, storage: bool, own: Sequence[Controller | Law]) -> list[Controller | Law] | EstimatorControl:
    """What acts in the job, behind its estimator."""
    acts = acting(job, storage, own)
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
        delay=None if np.isnan(accuracy.delay_ms) else accuracy.delay_ms,
        wrong_command_share=accuracy.wrong_command_share,
        opposite_command_share=accuracy.opposite_command_share,
    )
    return result, text


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


def _number(machine: int | str | None, case: Case) -> int | None:
    """Number of the machine called so; None for a storage device."""
    return None if machine is None or str(machine).startswith(naming.STORAGE) else case.machine(machine).machine


JOB = {f.column: f.kind for f in fields(Job).values()}
RESULT = {f.column: f.kind for f in fields(Result).values()}
SWEEP = Kind("results", JOB, RESULT, run_job, FORMAT, labels=("case", "set", "controller"))
