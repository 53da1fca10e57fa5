"""A job: one clearing time or one simulation, as plain values. Its fields are the keys of a study file.

The table columns of a job carry their units, as those of a case do: `until_s`, `deadband_hz`, `step_s`.
"""

from typing import Annotated, Any, Literal, NamedTuple

from annotated_types import Interval

from stabctl.model.tables import Characteristic
from stabctl.schema import NOT_NEGATIVE, POSITIVE, SHARE, Field, fields

Kind = Literal["clearing-time", "simulate"]
FORMAT = 1  # of keys and rows; one more whenever a job or a result changes its meaning


class Job(NamedTuple):
    """What is asked; a text left empty asks for nothing."""

    kind: Annotated[Kind, "-", "what is computed"]
    case: Annotated[str, "-", "packaged case, or folder (from the study file)"]
    machines: Annotated[Literal["full", "classical"], "-", "models of the case, or classical machines"] = "full"
    fault: Annotated[str, "-", "place of the fault: 83, 7-8@0.4"] = ""
    trip: Annotated[str, "-", "circuits opened at clearing: 83-33, 7-8#2"] = ""
    fault_r: Annotated[float, "pu", "resistance of the fault", NOT_NEGATIVE] = 0.0
    fault_x: Annotated[float, "pu", "reactance of the fault"] = 0.0
    clear: Annotated[str, "-", "clearing time: 6cyc, 0.1s, 100ms"] = ""
    at: Annotated[float, "s", "instant of the fault", NOT_NEGATIVE] = 1.0
    until: Annotated[float, "s", "end of the run", POSITIVE] = 10.0
    resolution: Annotated[str, "-", "grid of clearing times"] = "0.125cyc"
    limit: Annotated[str, "-", "longest clearing time tried"] = "60cyc"
    observe: Annotated[float, "s", "time watched after clearing", POSITIVE] = 5.0
    storage: Annotated[str, "-", "devices: none, 50MW, 5%mva, 5%dispatch, 14=50MW,13@33=20MW (empty: the case's)"] = ""
    characteristic: Annotated[Characteristic, "-", "what is constant in a device"] = "power"
    lag: Annotated[float, "s", "time constant from order to power", NOT_NEGATIVE] = 0.0
    control: Annotated[Literal["bang-bang", "none"], "-", "storage law"] = "bang-bang"
    deadband: Annotated[float, "Hz", "speed deviation without action", NOT_NEGATIVE] = 0.1
    min_voltage: Annotated[float, "pu", "voltage below which a device idles", NOT_NEGATIVE] = 0.8
    estimator: Annotated[Literal["ideal", "frequency", "kinematic", "kalman"], "-", "what the law sees"] = "ideal"
    pmu_rate: Annotated[int, "-", "PMU reports per second", POSITIVE] = 60
    pmu_noise: Annotated[float, "mrad", "noise of angles; magnitudes per mille", NOT_NEGATIVE] = 2.0
    latency: Annotated[float, "ms", "latency of remote reports", NOT_NEGATIVE] = 50.0
    loss: Annotated[float, "-", "share of the reports that never arrive", SHARE] = 0.02
    seed: Annotated[int, "-", "of noise and losses", Interval(ge=0, le=2**53)] = 1
    max_angle: Annotated[float, "rad", "change of angle that loses synchronism", POSITIVE] = 3.5
    step: Annotated[float, "s", "time step (0: at most 1/120 s)", NOT_NEGATIVE] = 0.0

    def given(self) -> dict[str, Any]:
        """Column -> value, of the columns that this kind of job has."""
        return {f.column: getattr(self, name) for name, f in columns(self.kind).items()}


ONLY = {
    "clear": "simulate",
    "at": "simulate",
    "until": "simulate",
    "resolution": "clearing-time",
    "limit": "clearing-time",
    "observe": "clearing-time",
}  # field -> the kind of job that has it, where not both do


def columns(kind: Kind) -> dict[str, Field]:
    """Fields of the jobs of a kind, by name."""
    return {name: f for name, f in fields(Job).items() if ONLY.get(name, kind) == kind}
