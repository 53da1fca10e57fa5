"""Inertia and reactance of the machines from recorded PMU reports, by maximum likelihood.

The Kalman filter of a machine with the factors f = (inertia, reactance) on its data makes innovations y of the variance
S; the logarithm of their likelihood is

    l(f) = -1/2 sum over the reports (ln S + min(y^2/S, gate)).

Every machine has a filter of its own, so that each is fitted alone. l is evaluated on a grid around the best factors so
far, which becomes finer; the paraboloid through the top of the last grid gives the maximum, and its curvature the
covariance.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from stabctl._util.errors import StudyError
from stabctl._util.tabular import Tabular, machine_column

from ._filter_bank import GATE, Batched
from .estimators import Filtered
from .pmu import Frame, Pmu
from .rotor_units import ProcessNoise, RotorUnits, rotor_units

if TYPE_CHECKING:
    import pandas as pd

    from .estimates import Estimates

SPAN = np.log(2)  # of the first grid, on both sides
FINER = (1.0, 0.3, 0.1, 0.05)  # spans of the grids, in units of the first
POINTS = 9  # of a grid in every direction
UNKNOWN = 0.2  # standard deviation beyond which the recording does not tell


@dataclass(frozen=True, repr=False, eq=False)
class Fit(Tabular):
    """Factors on the machine data that the estimators were given, arrays (machines).

    They are 1 where the data are right, and where the recording does not tell.
    """

    machines: tuple[int | str, ...]
    inertia: np.ndarray
    inertia_sigma: np.ndarray  # standard deviation; NaN if the recording does not tell
    reactance: np.ndarray
    reactance_sigma: np.ndarray

    @property
    def df(self) -> "pd.DataFrame":
        """A row per machine: factors and their standard deviations."""
        import pandas as pd

        columns = "inertia", "inertia_sigma", "reactance", "reactance_sigma"
        return machine_column(
            pd.DataFrame({"machine": self.machines} | {name: getattr(self, name) for name in columns})
        )

    def __str__(self) -> str:
        def text(value: float, sigma: float) -> str:
            return f"{value:.3f} +- {sigma:.3f}" if np.isfinite(sigma) else "unknown"

        rows = zip(self.inertia, self.inertia_sigma, self.reactance, self.reactance_sigma, strict=True)
        return "\n".join(
            f"machine {machine}: inertia x {text(h, of_h)}, reactance x {text(x, of_x)}"
            for machine, (h, of_h, x, of_x) in zip(self.machines, rows, strict=True)
        )


def fit(found: "Estimates") -> Fit:
    """Inertia and reactance (x'd, x'' of full-order machines) from the reports of a run with a disturbance.

    Parameters
    ----------
    found : Estimates
        Reports of one or more seeds; the factors are those on the data that its filters used.

    Returns
    -------
    Fit

    Raises
    ------
    StudyError
        Without reports.

    Examples
    --------
    >>> wrong = st.EstimatorControl(inertia_factor=1.2)
    >>> fault = st.Contingency("7", clear="11cyc", trip="7-8")
    >>> print(st.load("two_area").estimate(fault, "2.5s", storage="50MW", control=wrong).fit())
    machine 1: inertia x 0.839 +- 0.017, reactance x 0.971 +- 0.039
    machine 2: inertia x 0.839 +- 0.010, reactance x 1.010 +- 0.018
    machine 3: inertia x 0.833 +- 0.013, reactance x 0.999 +- 0.030
    machine 4: inertia x 0.865 +- 0.020, reactance x 0.955 +- 0.041
    """
    if not found.frames:
        raise StudyError("There are no reports to fit; call estimate(...).fit().")
    control, case = found.control, found.point.case
    known = rotor_units(found.point, control.inertia_factor, control.reactance_factor)
    frames, best, n = _in_operation(found), np.zeros((2, len(known.H))), len(known.H)
    for finer in FINER:
        steps = np.linspace(-1, 1, POINTS) * SPAN * finer
        shifts = np.array(list(product(steps, steps))).T  # (2, candidates)
        tried = best[:, None, :] + shifts[:, :, None]
        values = likelihood(known, np.exp(tried), frames, pmu=control.pmu, process=control.process)
        top = values.argmax(0)
        centers, best = best, best + shifts[:, top]
    peaks = [paraboloid(shifts, values[:, i]) for i in range(n)]
    at = np.array([peak for peak, _ in peaks]).T
    sigma = np.array([of_peak for _, of_peak in peaks]).T
    factors = np.exp(np.where(np.abs(at) <= SPAN * FINER[-1], centers + at, best))
    told = sigma < UNKNOWN
    factors, sigma = np.where(told, factors, 1.0), np.where(told, sigma * factors, np.nan)
    return Fit(tuple(m.called for m in case.machines), factors[0], sigma[0], factors[1], sigma[1])


def _in_operation(found: "Estimates") -> list[Frame]:
    """The reports of machines that are on, in runs that go on; at first, the system at rest, all are."""
    rest = len(found.frames) - len(found.on)
    return [f._replace(received=f.received & found.on[max(k - rest, 0)]) for k, f in enumerate(found.frames)]


def likelihood(
    known: RotorUnits, factors: np.ndarray, frames: Sequence[Frame], *, pmu: Pmu, process: ProcessNoise
) -> np.ndarray:
    """Logarithm of the likelihood (candidates, machines) of factors (2, candidates, machines), over all seeds."""
    count, n = factors.shape[1:]
    flux, governor = ({k: np.tile(v, count) for k, v in part.items()} for part in (known.flux, known.governor))
    H, x = (factors * np.stack([known.H, known.x])[:, None, :]).reshape(2, -1)
    bus, mva, D, ra = (np.tile(part, count) for part in (known.bus, known.mva, known.D, known.ra))
    tiled = RotorUnits(bus, H * mva, mva, H, D, ra, x, flux, governor, known.frequency_hz)
    filters, total = (
        Filtered(tiled, pmu, swing=True, process=process, engine="batched"),
        np.zeros(count * n),
    )
    for report in frames:
        own = report.received if report.parts is None else report.received & ~report.parts.computed
        frame = report._replace(received=own)
        V, I, frequency, rocof, received, slip = (np.tile(part, count) for part in frame[:6])
        nis = filters.step(Frame(V, I, frequency, rocof, received, slip)).nis
        if np.isfinite(nis).any():
            assert isinstance(filters.bank, Batched)
            surprise = np.log(filters.bank.S) + np.minimum(nis, GATE)
            total -= np.where(np.isfinite(nis), surprise, 0.0).sum(0) / 2
    return total.reshape(count, n)


def paraboloid(shifts: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Maximum (2) of the paraboloid through values (candidates) at shifts (2, candidates), and standard deviations.

    The values near the largest one count most.
    """
    (u, v), drop = shifts, values.max() - values
    weight = 1 / (1 + drop)
    terms = np.stack([np.ones(len(u)), u, v, u * u, u * v, v * v], -1)
    c = np.linalg.lstsq(terms * weight[:, None], -drop * weight, rcond=None)[0]
    bend = -np.array([[2 * c[3], c[4]], [c[4], 2 * c[5]]])
    if np.linalg.eigvalsh(bend)[0] <= 0:
        return np.full(2, np.inf), np.full(2, np.inf)
    covariance = np.linalg.inv(bend)
    return covariance @ c[1:3], np.sqrt(covariance.diagonal())
