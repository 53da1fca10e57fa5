"""A controller: named inputs and outputs, its own states, sampling rate, delay, limits and gate.

    continuous   x' = A x + B y,  u = shape(C x + D y),   delayed by a Pade approximation
    sampled      the same once per frame with x+ in place of x'; u is held, and acts `delay` later

y are the inputs and u the outputs, as deviations from the operating point, so a controller gives nothing at rest. An
output is added to what the driven input has without the controller.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from stabctl._util.errors import StudyError, check_line, shown
from stabctl._util.validation import checks_arguments
from stabctl._util.verbs import verb

from .python_law import checked_law
from .timing import Gate, checked_frames, duration

if TYPE_CHECKING:
    import control

PADE = 4  # order of the approximation of a continuous delay
UNLIMITED = math.inf


@dataclass(frozen=True, eq=False, repr=False)
class Controller:
    """A controller of any inputs of a system, the same in simulation and linear model.

    Parameters
    ----------
    inputs : tuple of str
        Signals that it reads, such as "speed:2" or "flow:7-8"; see `stabctl.smallsignal.OUTPUTS`. A kind alone means
        all signals of that kind.
    outputs : tuple of str
        Inputs of the system that it drives, such as "vs:2" or "order:1@5"; see `stabctl.smallsignal.INPUTS`.
    A, B, C, D : ndarray
        Matrices (states, states), (states, inputs), (outputs, states), (outputs, inputs); 1/s if continuous.
    name : str
        Name in labels and messages.
    rate : int, 1/s, optional
        Frames per second; None if it is continuous.
    delay : str or float, s
        Time from measurement to output; a multiple of the frame of a sampled controller.
    limits : pair of float
        Lowest and highest output, in the unit of the driven input.
    deadband : float
        Output below which it gives nothing, and which is subtracted beyond, without a jump, in the same unit; a relay
        switches beyond it.
    relay : bool
        Give the lowest or highest output, or nothing.
    ramp : float, 1/s
        Largest change of the output of a sampled controller per second; 0 is unlimited.
    tracking : str or float, s, optional
        Time constant Tt of the anti-windup: x' also has C+ (limited - unlimited output) / Tt, both behind the delay,
        C+ the pseudoinverse of C, as in a PI controller (K. Astrom, T. Hagglund, Advanced PID Control, 2006, section
        3.5). Below 2/pi of the delay its oscillation grows.
    gate : Gate, optional
        When it acts.
    law : callable, optional
        Python function in place of the matrices; see `from_function`.
    start : tuple of float
        States of the function at rest.

    Raises
    ------
    StudyError
        If the matrices do not fit, or a value is not allowed.

    Examples
    --------
    >>> pod = st.Controller("deviation:1", "order:1@5", [], [], [], [[100.0]], rate=60, delay="50ms", limits=1)
    >>> print(pod)
    controller: deviation:1 -> order:1@5 (0 states, 60/s, delay 50 ms)
    >>> st.load("two_area").closed_loop(pod, storage="50MW").modes().stable
    True
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    _: KW_ONLY
    name: str = "controller"
    rate: int | None = None
    delay: float = 0.0
    limits: tuple[float, float] = (-UNLIMITED, UNLIMITED)
    deadband: float = 0.0
    relay: bool = False
    ramp: float = 0.0
    tracking: float | None = None
    gate: Gate | None = None
    law: Callable[..., Any] | None = None
    start: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        for key in ("inputs", "outputs"):
            object.__setattr__(self, key, _names(key, getattr(self, key)))
        if self.law is None:
            _matrix("A", self.A, (None, None))
        order = "ABCD" if np.size(self.A) else "DABC"  # of a gain alone, D says how many signals there are
        for key in order if self.law is None else "":
            object.__setattr__(self, key, _matrix(key, getattr(self, key), self._shape(key)))
        object.__setattr__(self, "delay", duration("delay", self.delay))
        if self.tracking is not None:
            object.__setattr__(self, "tracking", duration("tracking", self.tracking))
        self._check()

    def _shape(self, key: str) -> tuple[int | None, int | None]:
        """Shape of a matrix; None where the names are kinds, whose number depends on the case."""
        n = len(np.atleast_2d(np.asarray(self.A, float))) if np.size(self.A) else 0
        m, p = (None if any(":" not in k for k in names) else len(names) for names in (self.inputs, self.outputs))
        if not n and key in "BC":
            p, m = self.D.shape
        return {"A": (n, n), "B": (n, m), "C": (p, n), "D": (p, m)}[key]

    def _check(self) -> None:
        rate = self.rate
        check_line("name", self.name)
        if rate is not None:
            object.__setattr__(self, "delay", checked_frames(self.name, rate, self.delay) / rate)
        if self.gate is not None and not isinstance(self.gate, Gate):
            raise StudyError(f"{self.name}: gate = {shown(self.gate)} is not a gate; give Gate('voltage:7', low=0.8).")
        if self.law is not None and rate is None:
            raise StudyError(f"{self.name}: a Python function is called at a fixed rate; give it, such as rate=60.")
        low, high = checked_limits(self.name, self.limits)
        object.__setattr__(self, "limits", (low, high))
        if not low <= 0 <= high or (math.isnan(low + high) and low == high):
            raise StudyError(f"{self.name}: the limits {low:g} to {high:g} must include 0, its output in steady state.")
        for key in ("deadband", "ramp"):
            value = getattr(self, key)
            if not (isinstance(value, int | float) and 0 <= value < math.inf):
                raise StudyError(f"{self.name}: {key} = {shown(value)} is not allowed; give a number of at least 0.")
        if self.relay and not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise StudyError(f"{self.name}: a relay switches between its limits; give finite ones, such as limits=0.1.")
        if self.start and self.law is None:
            raise StudyError(f"{self.name}: start gives the states of a Python function; matrices start at rest.")
        if self.tracking is not None and not np.size(self.A):
            raise StudyError(f"{self.name}: tracking keeps states of matrices from winding up, and there are none.")
        if self.ramp and rate is None:
            raise StudyError(f"{self.name}: a ramp limit needs a sampled controller; give a rate, such as rate=60.")

    @property
    def frames(self) -> int:
        """Delay in frames; 0 for a continuous controller."""
        return round(self.delay * self.rate) if self.rate else 0

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is unusual, in sentences: whether it is unstable by itself."""
        z = np.linalg.eigvals(self.A) if self.law is None and np.size(self.A) else np.zeros(0)
        growth = np.log(np.maximum(np.abs(z), 1e-300)) * self.rate if self.rate else z.real
        if not growth.max(initial=-np.inf) > 1e-6:
            return ()
        return (
            f"{self.name} is unstable in open loop: without feedback, or at its limits, its states grow at "
            f"{growth.max():.3g} 1/s.",
        )

    @property
    def linear(self) -> bool:
        """Whether it acts linearly on small deviations: no deadband and no relay."""
        return not (self.relay or self.deadband)

    @classmethod
    def from_control(
        cls,
        system: "control.StateSpace | control.TransferFunction",
        inputs: str | Sequence[str] | None = None,
        outputs: str | Sequence[str] | None = None,
        *,
        rate: int | None = None,
        **more: Any,
    ) -> "Controller":
        """A controller from a python-control system.

        Parameters
        ----------
        system : control.StateSpace or control.TransferFunction
            Continuous, or sampled with dt in seconds.
        inputs, outputs : str or sequence of str, optional
            Names of the signals; by default the labels of the system.
        rate : int, 1/s, optional
            Sample a continuous system at this rate (Tustin's method).
        **more
            The other fields of `Controller`: delay, limits, ...

        Returns
        -------
        Controller

        Raises
        ------
        StudyError
            If the system is improper, has no labels that name signals, or its rate does not agree.

        Examples
        --------
        >>> import control
        >>> lead = control.tf([20, 20], [0.02, 1])
        >>> print(st.Controller.from_control(lead, "speed:2", "vs:2", delay="20ms", limits=0.1, name="lead"))
        lead: speed:2 -> vs:2 (1 states, continuous, delay 20 ms)
        """
        from .from_control import parts

        found = parts(system, inputs, outputs, rate)
        return cls(**found, **more)

    @classmethod
    def from_function(
        cls,
        law: Callable[..., Any] | type,
        inputs: str | Sequence[str],
        outputs: str | Sequence[str],
        *,
        rate: int = 60,
        start: Sequence[float] = (),
        **more: Any,
    ) -> "Controller":
        """A controller from a Python function, called once per frame.

        Parameters
        ----------
        law : callable
            `law(seen)` returns the outputs, one number for all or one for each; `seen` is a `Seen`. With states,
            `law(seen, x)` returns the outputs and the states at the next frame. A class is instantiated for every
            run, and the instance is called; it has no linear model.
        inputs, outputs : str or sequence of str
            Names of the signals.
        rate : int, 1/s
            Frames per second.
        start : sequence of float
            States at rest; empty if it has none.
        **more
            The other fields of `Controller`: delay, limits, ...

        Returns
        -------
        Controller

        Raises
        ------
        StudyError
            If `law` cannot be called, or a value is not allowed.

        Examples
        --------
        >>> law = st.Controller.from_function(lambda seen: 500 * seen["deviation"], "deviation", "order", delay="50ms")
        >>> st.load("two_area").clearing_time("7-8@0.4", storage="50MW", control=law, resolution="1cyc").cycles
        31.0
        """
        names, none = (_split(inputs), _split(outputs)), np.zeros((0, 0))
        try:
            start = tuple(map(float, start))
        except (TypeError, ValueError):
            raise StudyError(f"start = {shown(start)} are not states; give a list of numbers: [0.0].") from None
        law = checked_law(law, bool(start))
        return cls(*names, none, none, none, none, rate=rate, law=law, start=start, **more)

    def delayed(self, delay: str | float) -> "Controller":
        """The same controller with another delay.

        Parameters
        ----------
        delay : str or float, s
            The new delay, such as "50ms".

        Returns
        -------
        Controller

        Raises
        ------
        StudyError
            If the delay is not a time, or not a whole number of frames of a sampled controller.

        Examples
        --------
        >>> pod = st.Controller("deviation:1", "order:1@5", [], [], [], [[100.0]], rate=60)
        >>> pod.delayed("100ms").delay
        0.1
        """
        return replace(self, delay=duration("delay", delay))

    @checks_arguments
    def scaled(self, gain: float) -> "Controller":
        """The same controller with its C and D multiplied by a gain; limits, deadband, relay and ramp stay as they are.

        Parameters
        ----------
        gain : float
            The factor.

        Returns
        -------
        Controller

        Raises
        ------
        StudyError
            If the controller is a Python function.

        Examples
        --------
        >>> st.Controller("deviation:1", "order:1@5", [], [], [], [[100.0]]).scaled(0.5).D
        array([[50.]])
        """
        if self.law is not None:
            raise StudyError(f"{self.name} is a Python function; multiply its result instead.")
        return replace(self, C=gain * self.C, D=gain * self.D)

    def sampled(self, rate: int, delay: str | float | None = None) -> "Controller":
        """A continuous controller as a sampled one, by Tustin's method.

        Its states are those of the trapezoidal rule, in the units of the continuous ones.

        Parameters
        ----------
        rate : int, 1/s
            Frames per second.
        delay : str or float, s, optional
            Delay, a whole number of frames; by default that of this controller.

        Returns
        -------
        Controller

        Raises
        ------
        StudyError
            If the controller is sampled already, or the rate or delay is not allowed.

        Examples
        --------
        >>> washout = st.Controller("deviation:1", "order:1@5", [[-1.0]], [[1.0]], [[-1.0]], [[1.0]])
        >>> print(washout.sampled(60, delay="100ms"))
        controller: deviation:1 -> order:1@5 (1 states, 60/s, delay 100 ms)
        """
        if self.rate is not None:
            raise StudyError(f"{self.name} is sampled already, at {self.rate}/s.")
        from .from_control import tustin

        late = self.delay if delay is None else duration("delay", delay)
        checked_frames(self.name, rate, late)
        A, B, C, D = tustin(self.A, self.B, self.C, self.D, rate)
        return replace(self, A=A, B=B, C=C, D=D, rate=rate, delay=late)

    def to_control(self) -> "control.StateSpace":
        """The matrices as a python-control system with names, without delay, limits, deadband and gate.

        States are called as in closed loops, "x1 pod"; signals of a kind alone are numbered, "speed 1".

        Returns
        -------
        control.StateSpace

        Raises
        ------
        StudyError
            If the controller is a Python function.

        Examples
        --------
        >>> washout = st.Controller("deviation:1", "order:1@5", [[-1.0]], [[1.0]], [[-1.0]], [[1.0]])
        >>> washout.to_control().input_labels
        ['deviation:1']
        """
        import control

        if self.law is not None:
            raise StudyError(
                f"{self.name} is a Python function, which cannot become a python-control system; use a "
                "controller with matrices."
            )
        sizes = {"inputs": self.D.shape[1], "outputs": self.D.shape[0]}
        labels = {key: _numbered(getattr(self, key), size) for key, size in sizes.items()}
        labels["states"] = [f"x{i + 1} {self.name}" for i in range(len(self.A))]
        labels = {key: [k.replace(".", " ") for k in names] for key, names in labels.items()}
        dt, name = 1 / self.rate if self.rate else 0, self.name.replace(".", " ")
        return control.ss(self.A, self.B, self.C, self.D, dt, name=name, **labels)

    save = verb("stabctl.io.control_files:save_controller")

    def __str__(self) -> str:
        kind = f"{self.rate}/s" if self.rate else "continuous"
        what = "Python function" if self.law else f"{len(self.A)} states"
        late = f", delay {1e3 * self.delay:g} ms" if self.delay else ""
        late += ", unstable in open loop" * bool(self.warnings)
        return f"{self.name}: {', '.join(self.inputs)} -> {', '.join(self.outputs)} ({what}, {kind}{late})"

    __repr__ = __str__


def _numbered(names: Sequence[str], size: int) -> list[str]:
    """Names of `size` signals; kinds alone, which mean several, are numbered."""
    return list(names) if len(names) == size else [f"{', '.join(names)} {k + 1}" for k in range(size)]


def _split(names: str | Sequence[str]) -> tuple[str, ...]:
    return tuple(n.strip() for n in names.split(",")) if isinstance(names, str) else tuple(names)


def _names(key: str, names: Any) -> tuple[str, ...]:
    found = _split(names) if isinstance(names, str | list | tuple) else ()
    if not found or not all(isinstance(n, str) and n for n in found):
        raise StudyError(f"{key} = {shown(names)} does not name signals; give names such as 'speed:2' or 'vs:2'.")
    if len(set(found)) < len(found):
        raise StudyError(f"{key} = {shown(names)} names a signal twice; give each once.")
    return found


def _matrix(key: str, value: Any, shape: tuple[int | None, int | None]) -> np.ndarray:
    try:
        found = np.array(value, float)
    except (TypeError, ValueError):
        raise StudyError(f"The matrix {key} of the controller is not made of numbers: {shown(value)}.") from None
    if found.size == 0 and 0 in shape and found.ndim != 2:
        found = found.reshape([0 if k is None else k for k in shape])
    found = np.atleast_2d(found) if found.ndim < 2 else found
    if found.ndim != 2 or any(want is not None and n != want for n, want in zip(found.shape, shape, strict=True)):
        wanted = " x ".join("any" if n is None else str(n) for n in shape)
        raise StudyError(
            f"The matrix {key} of the controller is {' x '.join(map(str, found.shape))}, but must be {wanted}."
        )
    if not np.isfinite(found).all():
        raise StudyError(f"The matrix {key} of the controller has entries that are not finite numbers.")
    found.setflags(write=False)
    return found


def checked_limits(name: str, value: Any) -> tuple[float, float]:
    """The lowest and the highest output; a number stands for both, the lowest negative."""
    try:
        low, high = (-abs(value), abs(value)) if isinstance(value, int | float) else value
        low, high = float(low), float(high)
    except (TypeError, ValueError):
        raise StudyError(
            f"{name}: limits = {shown(value)} is not allowed; give (-0.1, 0.1), or 0.1 for both."
        ) from None
    if low == high == 0:
        raise StudyError(f"{name}: with limits of 0 the output is always 0; give others, or leave the controller out.")
    return low, high
