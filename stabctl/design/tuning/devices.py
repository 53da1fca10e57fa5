"""What is tuned: stabilizers, dampers, PI controllers, and parameters that a case already has."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from stabctl import devices
from stabctl._util.errors import StudyError, shown
from stabctl.controllers.controller import Controller, checked_limits
from stabctl.controllers.timing import duration
from stabctl.model import naming, tables
from stabctl.model.case import Case

from . import blocks
from .blocks import (
    MODELS,
    Chain,
    Integral,
    Lag,
    LeadLag,
    ModelBlock,
    Notch,
    Range,
    Variable,
    Washout,
    checked_range,
    noise_size,
)
from .case_values import Device

SMALLEST = 1e-3  # of the largest gain
STAGES = 5  # at most
INERTIA = 4.0  # s   of a machine whose model has none
USUAL_WASHOUT = 1.0, 20.0  # s   bounds
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
    noise
        Standard deviation of the noise of each signal that it reads, in its unit.
    shared
        Whether another controller drives the same input.
    """

    structure: Any
    inputs: tuple[str, ...]
    output: str
    fast: float
    delays: tuple[float, ...] = (0.0,)
    limits: tuple[float, float] = (-np.inf, np.inf)
    machine: int | None = None
    noise: float = 0.0
    shared: bool = False

    @property
    def name(self) -> str:
        """What it is called."""
        return (f"{self.output} tuned" + f" ({', '.join(self.inputs)})" * self.shared).replace(":", " ")

    def controller(self, v: np.ndarray) -> Controller:
        """The controller at values v of its parameters, with its first delay."""
        M, n = self.structure.matrix(v), len(self.inputs)
        parts = M[1:, n:], M[1:, :n], M[:1, n:], M[:1, :n]
        return Controller(self.inputs, (self.output,), *parts, delay=self.delays[0], limits=self.limits, name=self.name)

    def reserve(self, logs: np.ndarray) -> float:
        """Share of the nearer limit that three standard deviations of the noise in the output leave."""
        return 1 - noise_size(self.structure, logs)[0] / self.loudest(0.0)

    def loudest(self, reserve: float) -> float:
        """Largest standard deviation of the output, with noise of 1 in every input, that leaves a share."""
        return (1 - reserve) * float(np.abs(self.limits).min()) / (3 * self.noise)

    @property
    def quietest(self) -> np.ndarray:
        """Logarithms of the parameters of the least noise: small gains, leads and washouts, large lags and resets.

        Those of a notch, which may be anywhere, are where they start.
        """
        ends = {"Tw": "low", "Ti": "high", "f": "start", "z1": "start", "z2": "start"}
        pairs = zip(self.structure.variables, self.structure.fast, strict=True)
        return np.log([getattr(v, ends.get(v.name, "low" if power > 0 else "high")) for v, power in pairs])


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
            parts: list[Any] = [Washout((variable("Tw", "s", self.washout, WASHOUT),))]
        else:
            parts = [Integral((variable("Ti", "s", integral, float(np.sqrt(np.prod(integral)))),))]
        for k in range(self.stages):
            lead, lag = variable(f"T{2 * k + 1}", "s", self.lead, 0.2), variable(f"T{2 * k + 2}", "s", self.lag, 0.05)
            parts.append(LeadLag((lead, lag)))
        return Chain(Variable("K", "pu", SMALLEST * size, size, size / 4), (*parts, *more), float(np.sign(gain)))


def variable(name: str, unit: str, bounds: Range, start: float) -> Variable:
    """A parameter with its start within the bounds."""
    return Variable(name, unit, *bounds, float(np.clip(start, *bounds)))


def checked_gain(name: str, given: Any) -> float:
    """A gain other than 0, of either sign."""
    if isinstance(given, bool) or not isinstance(given, int | float) or not 0 < abs(given) < np.inf:
        raise StudyError(f"{name} = {shown(given)} is not allowed; give a number other than 0.")
    return float(given)


def checked_fast(given: Any) -> float:
    """A largest gain at high frequencies."""
    if isinstance(given, bool) or not isinstance(given, int | float) or not given > 0:
        raise StudyError(f"fast = {shown(given)} is not allowed; give a number above 0.")
    return float(given)


def checked_noise(given: Any) -> float:
    """A standard deviation."""
    if isinstance(given, bool) or not isinstance(given, int | float) or not 0 <= given < np.inf:
        raise StudyError(f"noise = {shown(given)} is no standard deviation; give a number such as 1e-4.")
    return float(given)


# Stabilizers.


def with_exciter(case: Case, machines: Iterable[int | str] | None) -> list[int]:
    """The machines that get a stabilizer: those named, or all with an exciter."""
    if machines is not None and (isinstance(machines, str) or not isinstance(machines, Iterable)):
        raise StudyError(f"machines = {shown(machines)} is not a list of machines; give [1, 2], for example.")
    found = [m.machine for m in case.machines if case.model(m.machine, "exciter")]
    numbers = found if machines is None else list(dict.fromkeys(case.machine(n).machine for n in machines))
    if others := [n for n in numbers if n not in found]:
        what = f"Machine {case.called[others[0]]} of {case.name} has no exciter"
        raise StudyError(f"{what}, so it can have no stabilizer; choose other machines.")
    if not numbers and found:
        raise StudyError("machines names no machine; leave it out for all with an exciter.")
    if not numbers:
        raise StudyError(f"{case.name} has no machine with an exciter, so it can have no stabilizer.")
    return numbers


def without_stabilizers(case: Case, numbers: Sequence[int]) -> Case:
    """The case without the stabilizers that some machines have; the case itself if they have none."""
    for model in tables.of_role("stabilizer"):
        places = set(numbers) & set(map(naming.number, case.devices.get(model, ())))
        case = case.without_device(model, sorted(places)) if places else case
    return case


@dataclass(frozen=True)
class Stabilizers(Device):
    """Stabilizers of exciters; see `stabilizers`."""

    machines: Iterable[int | str] | None
    model: str | None
    gain: float
    fast: float
    shape: Stages
    limits: tuple[float, float]
    noise_filter: float
    noise: float

    def prepared(self, case: Case) -> Case:
        """The case without the stabilizers that its machines have."""
        return without_stabilizers(case, with_exciter(case, self.machines))

    def tunables(self, case: Case) -> list[Tunable]:
        """A stabilizer for every machine; `case` has those that it has now."""
        return [self._at(case, n) for n in with_exciter(case, self.machines)]

    def _at(self, case: Case, n: int) -> Tunable:
        at = case.called[n]
        if self.model is None:
            filters = (Lag(self.noise_filter),) if self.noise_filter else ()
            structure: Any = self.shape.chain(self.gain, *filters)
            return Tunable(structure, (f"speed:{at}",), f"vs:{at}", self.fast, limits=self.limits, noise=self.noise)
        given = self._given(case, n)
        gain = MODELS[self.model].gain
        bounds = {gain: (SMALLEST * abs(self.gain), abs(self.gain))}
        for lead, lag in blocks.STAGES[: self.shape.stages]:
            bounds |= {lead: self.shape.lead, lag: self.shape.lag}
        starts = {k: abs(given[k]) or np.sqrt(np.prod(bounds[k])) for k in bounds}
        tuned = tuple(variable(k, "pu" if k == gain else "s", bounds[k], starts[k]) for k in bounds)
        structure = ModelBlock(self.model, given, tuned, float(np.sign(self.gain)))
        inputs = tuple(f"{kind}:{at}" for kind in structure.reads)
        return Tunable(structure, inputs, f"vs:{at}", self.fast, (0.0,), self.limits, n, self.noise)

    def _given(self, case: Case, n: int) -> dict[str, Any]:
        """Parameters of the model at a machine: those of the case, or typical ones."""
        assert self.model is not None
        own, machine = parameters(case, self.model, n), parameters(case, case.model(n, "machine"), n)
        if own is not None:
            return dict(own._asdict())
        H = float(getattr(machine, "H", INERTIA))
        return MODELS[self.model].typical(H) | dict(zip(MODELS[self.model].limits, self.limits, strict=True))


def parameters(case: Case, model: str | None, n: int) -> Any:
    """The parameters of the first device of a model at a machine; None if it has none."""
    rows = case.devices.get(model or "", {})
    return next((par for key, par in rows.items() if naming.number(key) == n), None)


def stabilizers(
    machines: Iterable[int | str] | None = None,
    *,
    model: str | None = None,
    stages: int = 2,
    gain: float = 20.0,
    fast: float = 300.0,
    washout: Range = USUAL_WASHOUT,
    lead: Range = (0.02, 1.0),
    lag: Range = (0.02, 0.5),
    noise_filter: str | float = 0.0,
    limits: tuple[float, float] | float = 0.1,
    noise: float = 0.0,
) -> Stabilizers:
    r"""Stabilizers to be tuned, in place of those of the case.

    $$ K \frac{s T_w}{1 + s T_w} \prod_k \frac{1 + s T_{2k-1}}{1 + s T_{2k}} $$

    from the speed deviation to the stabilizer input of the exciter, or a packaged model with the same parameters under
    its own names.

    Parameters
    ----------
    machines : iterable of int or str, optional
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
    noise_filter : str or float, s
        Time constant of a lag 1/(1+sTf) of the speed, which is not tuned; 0: none. A model has its own.
    limits : pair of float, pu
        Limits of the output.
    noise : float, pu
        Standard deviation of the noise of the speed, white from 0.1 to 30 Hz; for `reserve` of `tune`.

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
    >>> st.design.stabilizers([1, 2], model="ieeest").machines
    (1, 2)
    """
    if model is not None and model not in MODELS:
        raise StudyError(f"model = {shown(model)} cannot be tuned; choose one of {', '.join(MODELS)}.")
    shape = Stages(stages, washout, lead, lag)
    if model is not None and stages > MODELS[model].stages:
        raise StudyError(f"{devices.every()[model].name} has {MODELS[model].stages} stages, not {stages}.")
    if model is not None and shape.washout != USUAL_WASHOUT:
        raise StudyError(f"{devices.every()[model].name} keeps its own washout; leave out washout.")
    numbers = tuple(machines) if isinstance(machines, Iterable) and not isinstance(machines, str) else machines
    low_high, filter_s = checked_limits("stabilizers", limits), duration("noise_filter", noise_filter)
    if model is not None and filter_s:
        raise StudyError(f"{devices.every()[model].name} has its own filters; leave out noise_filter.")
    most = checked_gain("gain", gain), checked_fast(fast)
    return Stabilizers(numbers, model, *most, shape, low_high, filter_s, checked_noise(noise))


# Other controllers.


@dataclass(frozen=True)
class Single(Device):
    """One controller from a signal to an input; see `damper` and `pi`."""

    tunable: Tunable

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
    washout: Range = USUAL_WASHOUT,
    lead: Range = (0.02, 1.0),
    lag: Range = (0.02, 0.5),
    limits: tuple[float, float] | float | None = None,
    noise: float = 0.0,
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
    noise : float
        Standard deviation of the noise of the signal, in its unit, white from 0.1 to 30 Hz; for `reserve` of `tune`.

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
    >>> wanted = st.design.damper("deviation:1", "order:1@5", stages=1, delay="100ms")
    >>> wanted.tunable.inputs, wanted.tunable.output, wanted.tunable.delays
    (('deviation:1',), 'order:1@5', (0.1,))
    """
    more: tuple[Any, ...] = ()
    if notch is not None:
        band = checked_range("notch", notch, "Hz")
        width = variable("z1", "-", (0.05, 1.0), 0.3), variable("z2", "-", (0.05, 1.0), 0.3)
        more = (Notch((variable("f", "Hz", band, float(np.sqrt(np.prod(band)))), *width)),)
    chain = Stages(stages, washout, lead, lag).chain(checked_gain("gain", gain), *more)
    return _single(input, output, chain, fast, delay, limits, noise)


def pi(
    input: str,
    output: str,
    *,
    gain: float = 20.0,
    reset: Range = (0.1, 100.0),
    delay: str | float | Sequence[str | float] = 0.0,
    limits: tuple[float, float] | float | None = None,
    noise: float = 0.0,
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
    noise : float
        Standard deviation of the noise of the signal, in its unit, white from 0.1 to 30 Hz; for `reserve` of `tune`.

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
    >>> wanted = st.design.pi("voltage:7", "vref:2", gain=-5)
    >>> wanted.tunable.inputs, wanted.tunable.output
    (('voltage:7',), 'vref:2')
    """
    unused = (1.0, 1.0)
    shape = Stages(0, unused, unused, unused)
    chain = shape.chain(checked_gain("gain", gain), integral=checked_range("reset", reset, "s"))
    return _single(input, output, chain, np.inf, delay, limits, noise)


def _single(input: str, output: str, chain: Chain, fast: float, delay: Any, limits: Any, noise: float) -> Single:
    several = delay if isinstance(delay, list | tuple) else (delay,)
    delays = tuple(duration("delay", one) for one in several)
    if not delays:
        raise StudyError("delay names no time; give one or several.")
    fast = checked_fast(fast)
    for name, value in (("input", input), ("output", output)):
        if not isinstance(value, str) or not value.strip():
            raise StudyError(f"{name} = {shown(value)} does not name a signal; give one, such as 'deviation:1'.")
    bounds = checked_limits(f"{input} to {output}", np.inf if limits is None else limits)
    return Single(Tunable(chain, (input,), output, fast, delays, bounds, noise=checked_noise(noise)))
