"""Controllers whose parameters are tuned: matrices [D C; B A] as functions of the parameters.

A chain is a gain and blocks in series, each with one input and one output; a model is a packaged stabilizer, whose own
equations give its matrices, with its own names. All parameters are positive; the search works in their logarithms. The
gain at high frequencies is a product of powers of the parameters, so its bound is linear there.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple, Protocol

import numpy as np

from stabctl import devices
from stabctl._util.errors import StudyError, shown
from stabctl.controllers.timing import duration

Range = tuple[float, float]
STEP = 1e-5  # of the logarithm of a parameter, for derivatives of the matrices
TINY = 1e-30  # step along the imaginary axis
READS = {1: "speed", 3: "pe", 5: "vt"}  # code of an input of a stabilizer -> signal of its machine
INPUTS = {"speed": "omega", "pe": "P", "vt": "vt"}  # signal -> port of the stabilizer
ANGLES, SWINGS = (10.0, 60.0), (0.6, 2.0)  # deg, Hz   lead of a stage in a random start, and where it has it
SPREAD = 0.2  # of the logarithms of the parameters around that
WIDE = 1e9  # limits while the equations are differentiated
NOISY, NODES = (0.1, 30.0), 60  # Hz   between which noise is white, and frequencies of the mean


class Variable(NamedTuple):
    """A parameter that is tuned."""

    name: str
    unit: str
    low: float
    high: float
    start: float


def checked_range(name: str, given: Any, unit: str) -> Range:
    """Two positive numbers, ascending; text with units is converted."""
    try:
        low, high = (duration(name, x) if unit == "s" else float(x) for x in given)
    except (TypeError, ValueError):
        raise StudyError(f"{name} = {shown(given)} is not a range; give two numbers, such as (0.02, 1).") from None
    if not 0 < low <= high < np.inf:
        raise StudyError(f"{name} = {shown(given)} is not a range; give two positive numbers, the smaller one first.")
    return low, high


class Structure(Protocol):
    """A controller of one output, whose matrices follow from its parameters."""

    @property
    def variables(self) -> tuple[Variable, ...]:
        """What is tuned."""
        ...

    @property
    def fast(self) -> np.ndarray:
        """Powers (parameters) of the parameters in the gain at high frequencies."""
        ...

    def matrix(self, v: np.ndarray) -> np.ndarray:
        """[D C; B A] at values v (parameters); rows [u, x'], columns [y, x]."""
        ...


def slopes(what: Structure, logs: np.ndarray) -> np.ndarray:
    """Derivatives (parameters, rows, columns) of the matrix by the logarithms of the parameters."""
    steps = STEP * np.eye(len(logs))
    up, down = ([what.matrix(np.exp(logs + sign * e)) for e in steps] for sign in (1, -1))
    return (np.array(up) - np.array(down)) / (2 * STEP)


def noise_size(what: Structure, logs: np.ndarray) -> tuple[float, np.ndarray]:
    """Standard deviation of the output with noise of 1 in every input, and the derivatives of its logarithm.

    The noise is white from 0.1 to 30 Hz, as that of 60 samples a second; what is slower is no noise:

        sigma^2 = mean of sum_y |K_y|^2 over these frequencies,  dK = [1 Y] dM [1; X],
        X = (jw - A)^-1 B,  Y = C (jw - A)^-1  of M = [D C; B A].
    """
    M, dM = what.matrix(np.exp(logs)), slopes(what, logs)
    n = len(M) - 1
    ny = M.shape[1] - n
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    hz = np.sqrt(NOISY[0] * NOISY[1]) * (NOISY[1] / NOISY[0]) ** (nodes / 2)
    weights = weights * hz / (weights @ hz)
    inverse = np.linalg.inv(2j * np.pi * hz[:, None, None] * np.eye(n) - M[1:, ny:])
    right = np.concatenate([np.broadcast_to(np.eye(ny), (NODES, ny, ny)), inverse @ M[1:, :ny]], axis=1)
    left = np.concatenate([np.ones((NODES, 1)), (M[:1, ny:] @ inverse)[:, 0]], axis=1)
    K = (M[0] @ right.transpose(1, 0, 2).reshape(ny + n, -1)).reshape(NODES, ny)
    dK = np.einsum("fr,prc,fcy->pfy", left, dM, right)
    variance = float(weights @ (np.abs(K) ** 2).sum(axis=1))
    change = np.einsum("f,pfy->p", weights, (K.conj() * dK).real)
    return float(np.sqrt(variance)), change / variance


# Chains.


@dataclass(frozen=True)
class Washout:
    """sTw / (1 + sTw)."""

    variables: tuple[Variable, ...]
    fast = (0.0,)

    def matrix(self, v: np.ndarray) -> np.ndarray:
        """[D C; B A]; the state is the slow part."""
        return np.array([[1, -1], [1 / v[0], -1 / v[0]]])


@dataclass(frozen=True)
class LeadLag:
    """(1 + sT1) / (1 + sT2)."""

    variables: tuple[Variable, ...]
    fast = (1.0, -1.0)

    def matrix(self, v: np.ndarray) -> np.ndarray:
        """[D C; B A]; the state is the lagged signal."""
        T1, T2 = v
        return np.array([[T1 / T2, 1 - T1 / T2], [1 / T2, -1 / T2]])


@dataclass(frozen=True)
class Lag:
    """1 / (1 + sT) with a given T."""

    T: float
    variables: tuple[Variable, ...] = ()
    fast = ()

    def matrix(self, v: np.ndarray) -> np.ndarray:
        """[D C; B A]."""
        return np.array([[0, 1], [1 / self.T, -1 / self.T]])


@dataclass(frozen=True)
class Integral:
    """1 + 1 / (sTi): with a gain, a PI controller."""

    variables: tuple[Variable, ...]
    fast = (0.0,)

    def matrix(self, v: np.ndarray) -> np.ndarray:
        """[D C; B A]."""
        return np.array([[1, 1], [1 / v[0], 0]])


@dataclass(frozen=True)
class Notch:
    """(s^2 + 2 z1 w s + w^2) / (s^2 + 2 z2 w s + w^2), w = 2 pi f."""

    variables: tuple[Variable, ...]
    fast = (0.0, 0.0, 0.0)

    def matrix(self, v: np.ndarray) -> np.ndarray:
        """[D C; B A] in controllable form, the second state scaled by w."""
        w, z1, z2 = 2 * np.pi * v[0], v[1], v[2]
        return np.array([[1, 0, 2 * (z1 - z2)], [0, 0, w], [w, -w, -2 * z2 * w]])


@dataclass(frozen=True)
class Chain:
    """A gain and blocks in series."""

    gain: Variable
    blocks: tuple[Any, ...]
    sign: float = 1.0

    @cached_property
    def variables(self) -> tuple[Variable, ...]:
        """The gain, then the parameters of the blocks in order."""
        return (self.gain, *(one for block in self.blocks for one in block.variables))

    @cached_property
    def fast(self) -> np.ndarray:
        """Powers of the parameters in the gain at high frequencies."""
        return np.array([1.0, *(power for block in self.blocks for power in block.fast)])

    def matrix(self, v: np.ndarray) -> np.ndarray:
        """[D C; B A] of the series."""
        whole, at = np.array([[self.sign * v[0]]]), 1
        for block in self.blocks:
            n = len(block.variables)
            whole, at = series(whole, block.matrix(v[at : at + n])), at + n
        return whole


def series(first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """[D C; B A] of two systems of one input and one output in series."""
    n, m = len(first) - 1, len(last) - 1
    whole = np.zeros((1 + n + m, 1 + n + m))
    whole[1 : 1 + n, : 1 + n], whole[1 + n :, 1 + n :] = first[1:], last[1:, 1:]
    whole[0, : 1 + n], whole[0, 1 + n :] = last[0, 0] * first[0], last[0, 1:]
    whole[1 + n :, : 1 + n] = last[1:, :1] * first[0]
    return whole


# Packaged stabilizers.


class Model(NamedTuple):
    """How a packaged stabilizer is tuned: its gain, the number of its stages, its limits, and its other parameters."""

    gain: str
    stages: int
    limits: tuple[str, str]
    typical: Callable[[float], dict[str, Any]]  # of the inertia constant (s) of its machine


def _pss(H: float) -> dict[str, Any]:
    return {"K": 1.0, "Tw": 10.0, "T1": 0.2, "T2": 0.05, "T3": 0.2, "T4": 0.05}


def _ieeest(H: float) -> dict[str, Any]:
    """No filters, the input is the speed."""
    filters = dict.fromkeys(("A1", "A2", "A3", "A4", "A5", "A6"), 0.0)
    stages = {"T1": 0.2, "T2": 0.05, "T3": 0.2, "T4": 0.05, "T5": 10.0, "T6": 10.0, "KS": 1.0}
    return filters | stages | {"VCU": 0.0, "VCL": 0.0, "code": 1}


def _pss2b(H: float) -> dict[str, Any]:
    """Speed and power: KS2 = T7 / 2H makes the second input the integral of the power, IEEE Std 421.5."""
    washouts = {"TW1": 10.0, "TW2": 10.0, "TW3": 10.0, "TW4": 0.0, "T6": 0.0, "T7": 10.0, "KS2": 10.0 / (2 * H)}
    tracking = {"KS3": 1.0, "T8": 0.5, "T9": 0.1, "M": 5, "N": 1, "code1": 1, "code2": 3}
    stages = {"KS1": 1.0, "T1": 0.2, "T2": 0.05, "T3": 0.2, "T4": 0.05, "T10": 0.0, "T11": 0.0}
    return washouts | tracking | stages | {"VS1max": 999.0, "VS1min": -999.0, "VS2max": 999.0, "VS2min": -999.0}


MODELS: Mapping[str, Model] = {
    "pss": Model("K", 2, ("Vmin", "Vmax"), _pss),
    "ieeest": Model("KS", 2, ("Lmin", "Lmax"), _ieeest),
    "pss2b": Model("KS1", 3, ("VSTmin", "VSTmax"), _pss2b),
}
STAGES = ("T1", "T2"), ("T3", "T4"), ("T10", "T11")  # lead and lag of each stage, of all of them


@dataclass(frozen=True)
class ModelBlock:
    """A packaged stabilizer at a machine: its equations, with some of its parameters tuned.

    Attributes
    ----------
    model
        Name of the device.
    given
        All parameters by name.
    variables
        Those that are tuned.
    """

    model: str
    given: Mapping[str, Any]
    variables: tuple[Variable, ...]
    sign: float = 1.0

    @cached_property
    def fast(self) -> np.ndarray:
        """Powers of the parameters in the gain at high frequencies."""
        powers = {name: power for pair in STAGES for name, power in zip(pair, (1.0, -1.0), strict=True)}
        return np.array([1.0] + [powers[one.name] for one in self.variables[1:]])

    @cached_property
    def reads(self) -> tuple[str, ...]:
        """Kinds of the signals of its machine that it reads."""
        if self.model == "pss":
            return ("speed",)
        codes = [v for k, v in self.given.items() if k.startswith("code") and v]
        return tuple(READS[code] for code in dict.fromkeys(codes))

    def values(self, v: Iterable[float]) -> dict[str, Any]:
        """All its parameters at values v of those tuned."""
        tuned = {one.name: float(x) for one, x in zip(self.variables, v, strict=True)}
        first = self.variables[0].name  # the gain
        return dict(self.given) | tuned | {first: self.sign * tuned[first]}

    @cached_property
    def states(self) -> np.ndarray:
        """Places of the states that take part at the starting values."""
        M, n = self._whole(np.array([one.start for one in self.variables])), len(self.reads)
        live = M[1:, :].any(axis=1) | M[:, n:].any(axis=0)
        return np.flatnonzero(live)

    def matrix(self, v: np.ndarray) -> np.ndarray:
        """[D C; B A] of the states that take part."""
        n = len(self.reads)
        rows, columns = np.r_[0, 1 + self.states], np.r_[np.arange(n), n + self.states]
        return self._whole(v)[np.ix_(rows, columns)]

    def _whole(self, v: np.ndarray) -> np.ndarray:
        """The same with all states, exact: complex steps of the equations."""
        device = devices.every()[self.model]
        wide = {k: np.copysign(WIDE, x) for k, x in self.given.items() if k.lower().endswith(("max", "min"))}
        p = device.Par(**(self.values(v) | wide))
        at_rest, columns = dict.fromkeys(device.Input._fields, 0j), []
        for name in (*(INPUTS[kind] for kind in self.reads), *device.State._fields):
            x, u = dict.fromkeys(device.State._fields, 0j), dict(at_rest)
            (x if name in x else u)[name] += 1j * TINY
            output, rates = device.outputs_and_rates({"x": device.State(**x), "u": device.Input(**u), "p": p})
            found = [*output, *rates]
            columns.append([complex(one).imag / TINY for one in found])
        return np.array(columns).T


def drawn(what: Structure, rng: np.random.Generator) -> np.ndarray:
    """Random parameters: the stages lead by equal angles at some frequency of electromechanical modes."""
    lead, w = np.deg2rad(rng.uniform(*ANGLES)), 2 * np.pi * rng.uniform(*SWINGS)
    a = (1 - np.sin(lead)) / (1 + np.sin(lead))
    T = 1 / (w * np.sqrt(a))
    found = []
    for k, (one, power) in enumerate(zip(what.variables, what.fast, strict=True)):
        start = rng.uniform(0.2, 1.0) * one.high if k == 0 else one.start
        start = T if k and power > 0 else a * T if power < 0 else start
        found.append(np.clip(np.log(start) + SPREAD * rng.standard_normal(), np.log(one.low), np.log(one.high)))
    return np.array(found)


# All controllers of a system.


class Placed(NamedTuple):
    """A controller with the rows of the outputs that it reads, and the column of the input that it drives."""

    structure: Any
    reads: Sequence[int]
    drives: int


class Laws:
    """Controllers of a plant with `nu` inputs and `ny` outputs; their parameters are stacked."""

    def __init__(self, placed: Sequence[Placed], nu: int, ny: int) -> None:
        self.placed, self.nu, self.ny = list(placed), nu, ny
        sizes = [len(one.structure.variables) for one in placed]
        self.at = np.r_[0, np.cumsum(sizes)].astype(int)
        starts = [np.array([v.start for v in one.structure.variables]) for one in placed]
        orders = [len(one.structure.matrix(v)) - 1 for one, v in zip(placed, starts, strict=True)]
        first = np.r_[0, np.cumsum(orders)].astype(int)
        self.order, self.size = int(first[-1]), int(self.at[-1])
        states = [np.arange(a, b) for a, b in pairwise(first)]
        self.places = [
            (np.r_[one.drives, nu + x], np.r_[list(one.reads), ny + x]) for one, x in zip(placed, states, strict=True)
        ]

    def parts(self, logs: np.ndarray) -> list[np.ndarray]:
        """The parameters of each controller."""
        return [logs[a:b] for a, b in pairwise(self.at)]

    def blocks(self, logs: np.ndarray) -> list[np.ndarray]:
        """[D C; B A] of each controller."""
        return [one.structure.matrix(np.exp(part)) for one, part in zip(self.placed, self.parts(logs), strict=True)]

    def matrix(self, blocks: Sequence[np.ndarray], factors: np.ndarray) -> np.ndarray:
        """[D C; B A] of all, their outputs multiplied by factors (controllers)."""
        K = np.zeros((self.nu + self.order, self.ny + self.order))
        for M, (rows, columns), k in zip(blocks, self.places, factors, strict=True):
            K[rows[0], columns] += k * M[0]
            K[rows[1:, None], columns] = M[1:]
        return K

    def slopes(self, logs: np.ndarray) -> list[np.ndarray]:
        """Derivatives of the matrix of each controller."""
        return [slopes(one.structure, part) for one, part in zip(self.placed, self.parts(logs), strict=True)]

    def gradient(
        self, left: np.ndarray, right: np.ndarray, slopes: Sequence[np.ndarray], factors: np.ndarray
    ) -> np.ndarray:
        """left dK/dp right (modes, parameters), of rows (modes, u + states) and columns (y + states, modes)."""
        found = np.empty((len(left), self.size), complex)
        for k, (d, (rows, columns)) in enumerate(zip(slopes, self.places, strict=True)):
            l, r = left[:, rows].T, right[columns]
            l[0] *= factors[k]
            found[:, self.at[k] : self.at[k + 1]] = (l * (d @ r)).sum(axis=1).T
        return found
