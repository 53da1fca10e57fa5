"""What is tuned: stabilizers, dampers, PI controllers, and parameters that a case already has."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from stabctl import devices
from stabctl._util.errors import StudyError, shown
from stabctl.controllers.controller import Controller
from stabctl.controllers.timing import duration
from stabctl.model import naming
from stabctl.model.case import Case
from stabctl.model.edit import resolve

from ..machines import with_exciter, without_stabilizers
from .blocks import MODELS, Chain, Integral, LeadLag, ModelBlock, Notch, Variable, Washout

Range = tuple[float, float]
SMALLEST = 1e-3  # of the largest gain
STAGES = 5  # at most
PAIRS = ("T1", "T2"), ("T3", "T4"), ("T10", "T11")  # lead and lag of the stages of packaged stabilizers
WASHOUT = 10.0  # s   of a packaged stabilizer that the case does not have


@dataclass(frozen=True)
class Tunable:
    """A controller that is tuned.

    Attributes
    ----------
    structure
        Its matrices as functions of its parameters.
    inputs, output
        Signals that it reads and the input that it drives.
    fast
        Largest gain at high frequencies; inf: no bound.
    delays
        Time from measurement to output, s: one, or several that are all served.
    limits
        Limits of the output.
    machine
        Machine of a packaged stabilizer; None for another controller.
    """

    structure: Any
    inputs: tuple[str, ...]
    output: str
    fast: float
    delays: tuple[float, ...] = (0.0,)
    limits: tuple[float, float] = (-np.inf, np.inf)
    machine: int | None = None

    @property
    def name(self) -> str:
        """What it is called."""
        return f"{self.output.replace(':', ' ')} tuned"

    def controller(self, v: np.ndarray) -> Controller:
        """The controller at values v of its parameters, with its first delay."""
        M, n = self.structure.matrix(v), len(self.inputs)
        parts = M[1:, n:], M[1:, :n], M[:1, n:], M[:1, :n]
        return Controller(self.inputs, (self.output,), *parts, delay=self.delays[0], limits=self.limits, name=self.name)


@dataclass(frozen=True)
class Stages:
    """Bounds of washout and lead-lag stages, s."""

    stages: int
    washout: Range
    lead: Range
    lag: Range

    def __post_init__(self) -> None:
        if isinstance(self.stages, bool) or not isinstance(self.stages, int) or not 0 <= self.stages <= STAGES:
            raise StudyError(f"stages = {shown(self.stages)} is not allowed; give 0 to {STAGES}.")
        for name in ("washout", "lead", "lag"):
            object.__setattr__(self, name, checked_range(name, getattr(self, name), "s"))

    def chain(self, gain: float, *more: Any, integral: Range | None = None) -> Chain:
        """Gain, washout or integral, stages, and more blocks."""
        size = abs(gain)
        if integral is None:
            blocks: list[Any] = [Washout((variable("Tw", "s", self.washout, WASHOUT),))]
        else:
            blocks = [Integral((variable("Ti", "s", integral, float(np.sqrt(np.prod(integral)))),))]
        for k in range(self.stages):
            lead, lag = variable(f"T{2 * k + 1}", "s", self.lead, 0.2), variable(f"T{2 * k + 2}", "s", self.lag, 0.05)
            blocks.append(LeadLag((lead, lag)))
        return Chain(Variable("K", "pu", SMALLEST * size, size, size / 4), (*blocks, *more), float(np.sign(gain)))


def variable(name: str, unit: str, bounds: Range, start: float) -> Variable:
    """A parameter with its start within the bounds."""
    return Variable(name, unit, *bounds, float(np.clip(start, *bounds)))


def checked_range(name: str, given: Any, unit: str) -> Range:
    """Two positive numbers, ascending; text with units is converted."""
    try:
        low, high = (duration(name, x) if unit == "s" else float(x) for x in given)
    except (TypeError, ValueError):
        raise StudyError(f"{name} = {shown(given)} is not a range; give two numbers, such as (0.02, 1).") from None
    if not 0 < low <= high < np.inf:
        raise StudyError(f"{name} = {shown(given)} is not a range; give two positive numbers, the smaller one first.")
    return low, high


def checked_gain(name: str, given: Any) -> float:
    """A gain other than 0, of either sign."""
    if isinstance(given, bool) or not isinstance(given, int | float) or not 0 < abs(given) < np.inf:
        raise StudyError(f"{name} = {shown(given)} is not allowed; give a number other than 0.")
    return float(given)


# Stabilizers.


@dataclass(frozen=True)
class Stabilizers:
    """Stabilizers of exciters; see `stabilizers`."""

    machines: Iterable[int] | None
    model: str | None
    gain: float
    fast: float
    shape: Stages
    limits: tuple[float, float] | float

    def prepared(self, case: Case) -> Case:
        """The case without the stabilizers that its machines have."""
        return without_stabilizers(case, with_exciter(case, self.machines))

    def tunables(self, case: Case) -> list[Tunable]:
        """A stabilizer for every machine; `case` has those that it has now."""
        return [self._at(case, n) for n in with_exciter(case, self.machines)]

    def _at(self, case: Case, n: int) -> Tunable:
        low, high = (-abs(self.limits), abs(self.limits)) if isinstance(self.limits, int | float) else self.limits
        if self.model is None:
            structure: Any = self.shape.chain(self.gain)
            return Tunable(structure, (f"speed:{n}",), f"vs:{n}", self.fast, limits=(low, high))
        given = self._given(case, n, (low, high))
        gain = MODELS[self.model].gain
        bounds = {gain: (SMALLEST * abs(self.gain), abs(self.gain))}
        for lead, lag in PAIRS[: self.shape.stages]:
            bounds |= {lead: self.shape.lead, lag: self.shape.lag}
        starts = {k: abs(given[k]) or np.sqrt(np.prod(bounds[k])) for k in bounds}
        tuned = tuple(variable(k, "pu" if k == gain else "s", bounds[k], starts[k]) for k in bounds)
        structure = ModelBlock(self.model, given, tuned, float(np.sign(self.gain)))
        inputs = tuple(f"{kind}:{n}" for kind in structure.reads)
        return Tunable(structure, inputs, f"vs:{n}", self.fast, limits=(low, high), machine=n)

    def _given(self, case: Case, n: int, limits: tuple[float, float]) -> dict[str, Any]:
        """Parameters of the model at a machine: those of the case, or typical ones."""
        assert self.model is not None
        for key, par in case.devices.get(self.model, {}).items():
            if naming.number(key) == n:
                return dict(par._asdict())
        H = _inertia(case, n)
        return MODELS[self.model].typical(H) | dict(zip(MODELS[self.model].limits, limits, strict=True))


def _inertia(case: Case, n: int) -> float:
    """Inertia constant of a machine on its own base, s."""
    model = case.model(n, "machine")
    rows = case.devices[model] if model else {}
    return float(next((par.H for key, par in rows.items() if naming.number(key) == n and hasattr(par, "H")), 4.0))


def stabilizers(
    machines: Iterable[int] | None = None,
    *,
    model: str | None = None,
    stages: int = 2,
    gain: float = 20.0,
    fast: float = 300.0,
    washout: Range = (1.0, 20.0),
    lead: Range = (0.02, 1.0),
    lag: Range = (0.02, 0.5),
    limits: tuple[float, float] | float = 0.1,
) -> Stabilizers:
    r"""Stabilizers to be tuned, in place of those of the case.

    $$ K \frac{s T_w}{1 + s T_w} \prod_k \frac{1 + s T_{2k-1}}{1 + s T_{2k}} $$

    from the speed deviation to the stabilizer input of the exciter, or a packaged model with the same parameters under
    its own names.

    Parameters
    ----------
    machines : iterable of int, optional
        Machines that get one; by default all with an exciter.
    model : {"pss", "ieeest", "pss2b"}, optional
        Packaged model: its gain and its stages are tuned, its other parameters stay as in the case, or typical.
    stages : int
        Number of lead-lag stages; at most 2 of `pss` and `ieeest`, 3 of `pss2b`.
    gain : float, pu
        Largest K; negative if the output shall have the other sign.
    fast : float, pu
        Largest gain at high frequencies, K T1/T2 T3/T4 ...
    washout, lead, lag : pair of float, s
        Bounds of Tw, of the leads, and of the lags.
    limits : pair of float, pu
        Limits of the output.

    Returns
    -------
    Stabilizers
        For `tune`.

    Raises
    ------
    StudyError
        If an argument is invalid.

    Examples
    --------
    >>> st.design.stabilizers(stages=3, gain=20, fast=300)
    >>> st.design.stabilizers([1, 2], model="ieeest")
    """
    if model is not None and model not in MODELS:
        raise StudyError(f"model = {shown(model)} cannot be tuned; choose one of {', '.join(MODELS)}.")
    if model is not None and stages > MODELS[model].stages:
        raise StudyError(f"{devices.every()[model].name} has {MODELS[model].stages} stages, not {stages}.")
    numbers = tuple(machines) if isinstance(machines, Iterable) and not isinstance(machines, str) else machines
    shape = Stages(stages, washout, lead, lag)
    fast = abs(checked_gain("fast", fast))
    return Stabilizers(numbers, model, checked_gain("gain", gain), fast, shape, limits)


# Other controllers.


@dataclass(frozen=True)
class Single:
    """One controller from a signal to an input; see `damper` and `pi`."""

    tunable: Tunable

    def prepared(self, case: Case) -> Case:
        """The case: nothing is replaced."""
        return case

    def tunables(self, case: Case) -> list[Tunable]:
        """The controller."""
        return [self.tunable]


def damper(
    input: str,
    output: str,
    *,
    stages: int = 2,
    gain: float = 20.0,
    fast: float = 100.0,
    delay: str | float | Sequence[str | float] = 0.0,
    notch: tuple[float, float] | None = None,
    washout: Range = (1.0, 20.0),
    lead: Range = (0.02, 1.0),
    lag: Range = (0.02, 0.5),
    limits: tuple[float, float] | float | None = None,
) -> Single:
    r"""A damper to be tuned: gain, washout and lead-lag stages from a signal to an input.

    $$ K \frac{s T_w}{1 + s T_w} \prod_k \frac{1 + s T_{2k-1}}{1 + s T_{2k}} $$

    Parameters
    ----------
    input, output : str
        The signal that is read and the input that is driven: "deviation:1", "order:1@5".
    stages : int
        Number of lead-lag stages.
    gain : float
        Largest K, output over input; negative if the output shall have the other sign.
    fast : float
        Largest gain at high frequencies, K T1/T2 T3/T4 ...
    delay : str or float or sequence, s
        Time from measurement to output; of several, all are served.
    notch : pair of float, Hz, optional
        Bounds of the frequency of a notch (s^2 + 2 z1 w s + w^2) / (s^2 + 2 z2 w s + w^2), which is tuned too.
    washout, lead, lag : pair of float, s
        Bounds of Tw, of the leads, and of the lags.
    limits : pair of float, optional
        Limits of the output, in the unit of the input driven.

    Returns
    -------
    Single
        For `tune`.

    Raises
    ------
    StudyError
        If an argument is invalid.

    Examples
    --------
    >>> st.design.damper("deviation:1", "order:1@5", delay="100ms")
    """
    more: tuple[Any, ...] = ()
    if notch is not None:
        band = checked_range("notch", notch, "Hz")
        width = variable("z1", "-", (0.05, 1.0), 0.3), variable("z2", "-", (0.05, 1.0), 0.3)
        more = (Notch((variable("f", "Hz", band, float(np.sqrt(np.prod(band)))), *width)),)
    chain = Stages(stages, washout, lead, lag).chain(checked_gain("gain", gain), *more)
    return _single(input, output, chain, fast, delay, limits)


def pi(
    input: str,
    output: str,
    *,
    gain: float = 20.0,
    reset: Range = (0.1, 100.0),
    delay: str | float | Sequence[str | float] = 0.0,
    limits: tuple[float, float] | float | None = None,
) -> Single:
    r"""A PI controller to be tuned, $K (1 + 1 / (s T_i))$, from a signal to an input.

    Parameters
    ----------
    input, output : str
        The signal that is read and the input that is driven.
    gain : float
        Largest K, output over input; negative if the output shall have the other sign.
    reset : pair of float, s
        Bounds of Ti.
    delay : str or float or sequence, s
        Time from measurement to output; of several, all are served.
    limits : pair of float, optional
        Limits of the output, in the unit of the input driven.

    Returns
    -------
    Single
        For `tune`.

    Raises
    ------
    StudyError
        If an argument is invalid.

    Examples
    --------
    >>> st.design.pi("voltage:7", "vref:2", gain=-5)
    """
    shape = Stages(0, (1.0, 1.0), (1.0, 1.0), (1.0, 1.0))
    chain = shape.chain(checked_gain("gain", gain), integral=checked_range("reset", reset, "s"))
    return _single(input, output, chain, np.inf, delay, limits)


def _single(input: str, output: str, chain: Chain, fast: float, delay: Any, limits: Any) -> Single:
    several = delay if isinstance(delay, list | tuple) else (delay,)
    delays = tuple(duration("delay", one) for one in several)
    if not delays:
        raise StudyError("delay names no time; give one or several.")
    low, high = (
        (-np.inf, np.inf) if limits is None else limits if not isinstance(limits, int | float) else (-limits, limits)
    )
    fast = abs(checked_gain("fast", fast)) if np.isfinite(fast) else fast
    for name, value in (("input", input), ("output", output)):
        if not isinstance(value, str) or not value.strip():
            raise StudyError(f"{name} = {shown(value)} does not name a signal; give one, such as 'deviation:1'.")
    return Single(Tunable(chain, (input,), output, fast, delays, (low, high)))


# Parameters of the case.


def value(case: Case, path: str) -> float:
    """The value of a parameter of a device."""
    table, key, f = resolve(case, path)
    if table not in case.devices:
        raise StudyError(f"{path} is no parameter of a device; tune one such as exst3.KA or tgov.1.R.")
    found = getattr(list(case.devices[table].values())[naming.row(case, table, key)], f.name)
    if isinstance(found, bool) or not isinstance(found, int | float):
        raise StudyError(f"{path} = {shown(found)} is not a number that can be tuned.")
    return float(found)


@dataclass(frozen=True)
class Values:
    """Parameters that the case has; see `values`."""

    path: str
    within: Range
    together: bool

    def of(self, case: Case) -> list[tuple[tuple[str, ...], Variable]]:
        """Paths that share a variable, and the variable."""
        paths = self._paths(case)
        held = [value(case, path) for path in paths]
        for path, own in zip(paths, held, strict=True):
            if not own > 0:
                raise StudyError(f"{path} = {own:g} of {case.name} cannot be tuned; only positive values can.")
        low, high = self.within
        if self.together:
            return [(paths, Variable(self.path, "x", low, high, 1.0))]
        return [((path,), Variable(path, "", low * v, high * v, v)) for path, v in zip(paths, held, strict=True)]

    def _paths(self, case: Case) -> tuple[str, ...]:
        """The path itself, or that of every row of its table."""
        table, *rest = self.path.split(".")
        if len(rest) == 1 and table in case.devices:
            return tuple(f"{table}.{key}.{rest[0]}" for key in case.devices[table])
        return (self.path,)


def values(path: str, *, within: Range = (0.5, 2.0), together: bool = False) -> Values:
    """Parameters of the case to be tuned.

    Parameters
    ----------
    path : str
        "exst3.KA" for every row of a table, or "exst3.2.KA" for one.
    within : pair of float
        Bounds, relative to the value that the case has.
    together : bool
        Multiply all by one common factor; by default each is tuned.

    Returns
    -------
    Values
        For `tune`.

    Raises
    ------
    StudyError
        If an argument is invalid.

    Examples
    --------
    >>> st.design.values("exst3.KA", within=(0.5, 2), together=True)
    """
    if not isinstance(path, str) or path.count(".") not in (1, 2):
        raise StudyError(f"{shown(path)} is no parameter of a device; give one such as exst3.KA or tgov.1.R.")
    low, high = checked_range("within", within, "-")
    if not low <= 1 <= high:
        raise StudyError(f"within = {shown(within)} leaves out the value of the case; give a range around 1.")
    return Values(path, (low, high), together)


Device = Stabilizers | Single | Values  # what may be tuned
