"""Data of the rotor units used by the estimators, and the phasors at their terminals, measured by the PMUs."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Interval

from stabctl._util.errors import StudyError, shown
from stabctl._util.validation import guard
from stabctl.dynamics import family
from stabctl.dynamics.assembly import INFINITE
from stabctl.dynamics.operating_point import OperatingPoint, source_admittances
from stabctl.simulation.simulation import Simulation

from ._swing import GOVERNOR

Factor = float | tuple[float, ...]
AMOUNT = Interval(ge=0, le=1e3)
REACTANCES = ("x2", "x1d")  # behind which the internal voltage is formed: x'' where the machine has one, else x'd
FLUX = ("xl", "xd", "xq", "x1q", "x2", "T1q", "T2q", "SA", "SB", "speed_factor", "exponential", "salient")  # q axis
MODELS = ("gencls", "genrou", "genroe", "gensal", "gensae")  # whose equations the filters have
EXPONENTIAL = ("genroe", "gensae")  # whose saturation is SB |psi''|^SA, not quadratic


@dataclass(frozen=True)
class ProcessNoise:
    """What the filters assume about a machine beyond the noise of its phasors: with more, they trust its data less.

    Parameters
    ----------
    walk : float, pu/s^0.5
        Of the power reference, on the machine base, which moves as a random walk.
    share : float
        Error of the swing equation, as a share of the accelerating power.
    jerk : float, pu/s/s^0.5
        Of the acceleration, in the kinematic model.

    Examples
    --------
    >>> doubtful = st.EstimatorControl(process=st.ProcessNoise(walk=0.02, share=0.05))
    >>> print(st.load("two_area").estimate("7-8@1s", "2s", storage="50MW", control=doubtful))
    two_area, kalman estimator: 120 frames at 60 per second, 1 seed
    """

    walk: Annotated[float, "-", "random walk of the power reference", AMOUNT] = 0.005
    share: Annotated[float, "-", "error of the swing equation", AMOUNT] = 0.01
    jerk: Annotated[float, "-", "noise of the acceleration", AMOUNT] = 0.05

    def __post_init__(self) -> None:
        guard(self)


USUAL_NOISE = ProcessNoise()


@dataclass(frozen=True, repr=False, eq=False)
class RotorUnits:
    """Parameters of the rotor units used by the estimators: arrays (machines) on the machine base.

    `x` is the reactance behind which the internal voltage is formed: x'd of a classical machine, x'' of a full one.
    """

    bus: np.ndarray  # rows of the terminals
    inertia: np.ndarray  # s     H on the system base
    mva: np.ndarray  # -     machine MVA over system MVA
    H: np.ndarray  # s
    D: np.ndarray  # pu
    ra: np.ndarray  # pu
    x: np.ndarray  # pu
    flux: dict[str, np.ndarray]  # constants of the q-axis circuits; 0 for classical machines
    governor: dict[str, np.ndarray]  # constants of the governors; K = 0 without one
    frequency_hz: float

    @property
    def impedance(self) -> np.ndarray:
        """Impedance ra + j x (machines) on the system base, behind which the internal voltages are."""
        return (self.ra + 1j * self.x) / self.mva

    def __str__(self) -> str:
        return f"{len(self.H)} rotor units, {np.count_nonzero(self.flux['xq'])} of them with flux dynamics"

    __repr__ = __str__


def rotor_units(point: OperatingPoint, inertia: Factor = 1.0, reactance: Factor = 1.0) -> RotorUnits:
    """The rotor units of an operating point; `inertia` and `reactance` multiply every H and x (1: exact)."""
    m = len(point.case.machines)
    for factor in (inertia, reactance):
        if np.shape(factor) not in ((), (m,)) or not np.all(np.asarray(factor) > 0):
            raise StudyError(f"The factor {shown(factor)} is not possible; give a positive number, or one per machine.")
    without = sorted(set(range(m)) - set(point.rotors.real.unit.tolist()))
    if without:
        raise StudyError(
            f"The speed of machine {point.case.machines[without[0]].called} of {point.case.name} cannot be estimated, "
            "because it is a converter without a rotor; use a case with synchronous machines only."
        )
    for f in point.system.families:
        if f.device.role == "machine" and f.name not in MODELS:
            raise StudyError(
                f"The speed of {f.keys[0]} of {point.case.name} cannot be estimated, because the filters do not have "
                f"the equations of {f.device.name}; use a case with {', '.join(MODELS).upper()}."
            )
    columns = {name: np.zeros(m) for name in ("mva", "H", "D", "ra", "x")}
    flux, governor = ({name: np.zeros(m) for name in names} for names in (FLUX, GOVERNOR))
    for table in (f.name for f in point.system.families if f.device.role == "machine"):
        at, par = point.constants(table)
        given = par | {"x": par[next(name for name in REACTANCES if name in par)]}
        _fill(columns, at, given)
        if "xq" in par:
            _fill(flux, at, _q_axis(table, given))
    for table in (f.name for f in point.system.families if f.device.role == "governor"):
        at, par = point.constants(table)
        if set(GOVERNOR) <= set(par):
            _fill(governor, at, par)
    columns["H"] = np.where(columns["H"] > 0, columns["H"] * np.asarray(inertia), INFINITE)
    columns["x"] = columns["x"] * np.asarray(reactance)
    bus, H = point.system.unit_bus, columns["H"] * columns["mva"]
    return RotorUnits(bus, H, **columns, flux=flux, governor=governor, frequency_hz=point.case.frequency_hz)


def _q_axis(table: str, par: dict[str, np.ndarray]) -> dict[str, np.ndarray | float]:
    """The parameters with all of `FLUX`; a salient pole has one damper circuit, and x'q = xq."""
    salient: dict[str, np.ndarray | float] = {"x1q": par["xq"], "T1q": 0.0, "speed_factor": 0.0}
    own = {"SB": 0.0} if table == "gensal" else {}  # its saturation is that of E'q, of the other axis
    return {**salient, "salient": "x1q" not in par, "exponential": table in EXPONENTIAL, **par, **own}


def _fill(columns: dict[str, np.ndarray], at: np.ndarray, given: Mapping[str, np.ndarray | float]) -> None:
    for name, column in columns.items():
        column[at] = given[name]


class Terminals:
    """True phasors at the terminals of a simulation: V, and I = Norton current - y V (pu, out of the machine).

    The machines' own equations are evaluated on whole columns of the simulation's signals.
    """

    def __init__(self, simulation: Simulation) -> None:
        self.simulation, system = simulation, simulation.point.system
        self._bus = system.unit_bus
        self._admittance = np.where(system.forming, source_admittances(system), 0)
        self._sources = [f for f in system.families if f.device.source is not None]

    def phasors(self, bus_voltages: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Voltages and currents (machines), pu, now, of the bus voltages."""
        V, source, s = bus_voltages[self._bus], np.zeros(len(self._admittance), complex), self.simulation.s
        for f in self._sources:
            states, inputs = (f.device.fields(record) for record in ("State", "Input"))
            signals = {
                "x": f.device.State(*(s[f.w[:, family.STATE] + i] for i in range(len(states)))),
                "p": f.device.Par(*f.k.T),
                **{name: s[f.w[:, family.INPUTS + i]] for i, name in enumerate(inputs)},
            }
            if f.device.internal is not None:
                signals["i"] = f.device.internal(signals["x"], signals["p"])
            at = f.w[:, family.UNIT]
            source.real[at], source.imag[at] = f.device.evaluate("source", signals)
        return V, np.where(self.simulation.island >= 0, source - self._admittance * V, 0)
