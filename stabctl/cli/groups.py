"""Groups of options, as records that create the objects they describe."""

import shlex
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from . import options, shared

if TYPE_CHECKING:
    from stabctl.controllers import BangBang, Controller, Law
    from stabctl.dynamics.operating_point import OperatingPoint
    from stabctl.estimation.estimator_control import EstimatorControl
    from stabctl.estimation.pmu import Pmu
    from stabctl.model.case import Case
    from stabctl.model.unusual import UnusualData
    from stabctl.simulation.criterion import Criterion


class CaseOptions(NamedTuple):
    """A case, and its changes."""

    case: options.CaseName
    settings: options.Set = None
    device: options.Device = None
    classical: options.Classical = False
    verbose: options.Verbose = False
    dyr: options.Dyr = None
    loads: options.Loads = None
    machines: options.Machines = None
    frequency: options.Frequency = None
    missing: options.Missing = "refuse"
    missing_controls: options.MissingControls = "refuse"
    motor_share: options.MotorShare = None
    conventions: options.Conventions = None

    def load(self) -> "Case":
        """The case with its settings (`pss.1.K=10`) applied; what is noted or unusual goes to stderr."""
        case = self.read()
        unusual = self.check(case)
        told = unusual.sentences() if self.verbose else [unusual.told(self.words)]
        shared.warn(case.notes, self.verbose, list(filter(None, told)))
        return case

    def check(self, case: "Case") -> "UnusualData":
        """Its unusual data; loads or a dispatch that were set do not balance at the stored voltages."""
        return case.check(balance=not self.settings)

    @property
    def words(self) -> str:
        """The case and its options as on the command line."""
        found = [self.case]
        for name, default in self._field_defaults.items():
            option, value = f"--{name.replace('_', '-').replace('settings', 'set')}", getattr(self, name)
            if value != default and name != "verbose":
                for one in value if isinstance(value, list) else [value]:
                    found += [option] if one is True else [option, str(one)]
        return shlex.join(found)

    def read(self) -> "Case":
        """The case with its settings applied."""
        from stabctl import io
        from stabctl._util.errors import StudyError

        names = ("dyr", "loads", "machines", "frequency", "conventions", "missing", "missing_controls")
        case = io.load(self.case, **{name: getattr(self, name) for name in names})
        values = {}
        for text in self.settings or ():
            path, given, value = text.partition("=")
            if not given:
                raise StudyError(f"--set {text!r} is not allowed; write PATH=VALUE, such as --set pss.1.K=10.")
            values[path.strip()] = value.strip()
        case = case if self.motor_share is None else case.with_motors(self.motor_share)
        case = case.set(values) if values else case
        return case.classical() if self.classical else case


class StorageOptions(NamedTuple):
    """Storage devices in place of the case's own."""

    storage: options.Size = None
    storage_at: options.SizeAt = None
    characteristic: options.Characteristic = "power"
    lag: options.Lag = "0s"
    storage_model: options.StorageModel = "ideal"
    storage_energy: options.StorageEnergy = 0.0
    storage_mva: options.Mva = None
    converter: options.Converter = ""

    def initialize(self, case: "Case") -> "OperatingPoint":
        """The operating point of the case with these devices."""
        from stabctl._util.errors import StudyError
        from stabctl.dynamics.operating_point import initialize

        if self.storage is not None and self.storage_at is not None:
            raise StudyError("--storage and --storage-at cannot be used together; give one of them.")
        sizes = self.storage if self.storage is not None else self.storage_at
        if sizes is not None:
            connected = connection(self.storage_model, self.storage_energy, self.storage_mva, self.converter)
            lag = shared.lag(self.lag, case)
            case = case.with_storage(sizes, characteristic=self.characteristic, lag=lag, **connected)
        elif self != StorageOptions():
            raise StudyError(
                "--characteristic, --lag, --storage-model, --storage-energy, --storage-mva and --converter are for "
                "devices given with --storage or --storage-at; give one of these, or fill the columns of storage.csv."
            )
        return initialize(case)


def connection(model: str, energy: float, mva: str | None, converter: str) -> dict[str, Any]:
    """Columns of storage devices: how they are connected, of what energy and MVA."""
    given = {"storage_model": model, "energy": energy, "converter": converter, "mva": mva}
    return {name: value for name, value in given.items() if value not in ("ideal", 0.0, "", None)}


def law_of(files: "Iterable[Controller | Law]") -> "Law | None":
    """The storage law among what files of --controller contain."""
    from stabctl._util.errors import StudyError
    from stabctl.controllers import Law

    laws = [one for one in files if isinstance(one, Law)]
    if len(laws) > 1:
        raise StudyError("Two files of --controller contain a storage law; give only one.")
    return laws[0] if laws else None


class LawOptions(NamedTuple):
    """The control law of the storage devices."""

    deadband: options.Deadband = 0.1
    min_voltage: options.MinVoltage = 0.8

    def law(self) -> "BangBang":
        """Bang-bang with these settings."""
        from stabctl.controllers import BangBang

        return BangBang(self.deadband, self.min_voltage)

    def chosen(
        self, storage: bool, control: str | None, files: "Sequence[Controller | Law]" = ()
    ) -> "tuple[Law | None, list[Controller]]":
        """The law of the storage devices, and the controllers.

        The law is that of a file, or bang-bang if there are storage devices that no controller orders, unless --control
        says otherwise.
        """
        from stabctl._util.errors import StudyError
        from stabctl.controllers import Law
        from stabctl.simulation.control import ordered

        law, controllers = law_of(files), [c for c in files if not isinstance(c, Law)]
        if law and (control is not None or self != LawOptions()):
            raise StudyError(
                "--control, --deadband and --min-voltage have no effect with a storage law from a file; leave them out."
            )
        if law and not storage:
            raise StudyError("A storage law needs storage devices; give --storage or --storage-at.")
        if law:
            return law, controllers

        if control == "bang-bang" and not storage:
            raise StudyError("--control bang-bang needs storage devices; give --storage or --storage-at.")
        bang_bang = control == "bang-bang" or (control is None and storage and not ordered(controllers))
        if not bang_bang and self != LawOptions():
            raise StudyError(
                "--deadband and --min-voltage have no effect, because no storage device has the bang-bang law; leave "
                "them out."
            )
        return (self.law() if bang_bang else None), controllers


class StabilityOptions(NamedTuple):
    """What counts as loss of stability."""

    max_angle: options.Angle = 3.5
    min_frequency: options.MinFrequency = None
    max_frequency: options.MaxFrequency = None
    frequency_delay: options.FrequencyDelay = "1s"
    coi: options.CenterOfInertia = "all"

    def criterion(self, case: "Case") -> "Criterion":
        """The criterion, its frequencies in pu of the case's."""
        from stabctl._util.errors import StudyError
        from stabctl._util.units import seconds
        from stabctl.simulation.criterion import DEFAULT

        if not self.max_angle > 0:
            raise StudyError(f"--max-angle {self.max_angle:g} rad is not allowed; it must be more than 0.")
        hz, given = case.frequency_hz, {"min_frequency": self.min_frequency, "max_frequency": self.max_frequency}
        limits: dict[str, Any] = {name: value / hz for name, value in given.items() if value is not None}
        delay = seconds(self.frequency_delay, hz)
        return DEFAULT._replace(max_angle=self.max_angle, frequency_delay_s=delay, coi=self.coi, **limits)


class SearchOptions(NamedTuple):
    """The search for a critical clearing time."""

    resolution: options.Resolution = "0.125cyc"
    limit: options.OwnLimit = "60cyc"
    observe: options.Observe = "5s"
    longest: options.Longest = "20s"
    scan: options.Scan = "auto"
    step: options.Step = None


class PmuOptions(NamedTuple):
    """The PMUs."""

    pmu_rate: options.PmuRate = 60
    pmu_noise_mrad: options.PmuNoise = 2.0
    latency_ms: options.Latency = 50.0
    loss: options.Loss = 0.02
    seed: options.Seed = 1

    def pmu(self) -> "Pmu":
        """PMUs with this noise."""
        from stabctl.estimation.pmu import Pmu

        return Pmu.noisy(self.pmu_rate, self.pmu_noise_mrad, self.latency_ms, self.loss)

    def steering(
        self, law: "Law | None", controllers: "Sequence[Controller]", estimator: options.Estimator
    ) -> "list[Law | Controller | EstimatorControl]":
        """Law and controllers: themselves with the ideal estimator, otherwise behind PMUs and an estimator."""
        from stabctl._util.errors import StudyError

        behind: list[Any] = [*([law] if law else []), *controllers]
        if estimator == "ideal":
            if self != PmuOptions():
                raise StudyError(
                    "--pmu-rate, --pmu-noise-mrad, --latency-ms, --loss and --seed are for an estimator; give "
                    "--estimator kalman, for example."
                )
            return behind
        from stabctl.estimation.estimator_control import EstimatorControl

        if not behind:
            raise StudyError(
                f"--estimator {estimator} needs controllers, or storage devices with a control law; give --storage or "
                "--controller."
            )
        return [EstimatorControl(behind, estimator, self.pmu(), seed=self.seed)]
