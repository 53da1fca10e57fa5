"""A control law as a Python function: the signals it reads at a frame."""

import inspect
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any
from warnings import catch_warnings

import numpy as np

from stabctl._util.errors import StudyError, shown


@dataclass(frozen=True)
class Seen:
    """The inputs of a controller at one frame.

    Attributes
    ----------
    names
        Names of the inputs.
    values
        Deviations from the operating point (inputs).
    rest
        Values at the operating point (inputs); `rest + values` are the values themselves.
    time
        Instant, s.
    """

    names: tuple[str, ...]
    values: np.ndarray
    rest: np.ndarray
    time: float = 0.0

    def __getitem__(self, name: str) -> Any:
        """Deviation of one input ("speed:2"), or of all inputs of a kind ("speed"), as an array."""
        return _of(self.names, self.values, name)

    def actual(self, name: str) -> Any:
        """Value of one input, or of all inputs of a kind, as an array."""
        return _of(self.names, self.rest + self.values, name)


def _of(names: Sequence[str], values: np.ndarray, name: str) -> Any:
    if name in names and ":" in name:
        return values[names.index(name)]
    rows = [i for i, n in enumerate(names) if n.partition(":")[0] == name]
    if not rows:
        raise StudyError(f"The controller does not read {shown(name)}; its inputs are {', '.join(names)}.")
    return values[rows]


def checked_law(law: Any, states: bool) -> Callable[..., Any]:
    """The law. `StudyError` if it cannot be called with what is seen and, if there are any, the states."""
    if not callable(law):
        raise StudyError(f"{shown(law)} is not a control law; give a function: lambda seen: 500 * seen['deviation'].")
    own = isinstance(law, type)  # its instances are called
    with suppress(ValueError):  # the signature of a built-in function may be unknown
        try:
            inspect.signature(law.__call__ if own else law).bind(*(own + 1 + states) * [None])
        except TypeError:
            name = shown(getattr(law, "__name__", law))
            if states:
                raise StudyError(f"The law {name} takes no states; write law(seen, x), or leave out start.") from None
            raise StudyError(f"The law {name} cannot be called as law(seen); with states, give start=[0.0].") from None
    return law


def answer(
    law: Callable[..., Any], seen: Seen, x: np.ndarray, outputs: int, name: str
) -> tuple[np.ndarray, np.ndarray]:
    """Outputs and next states of a law, checked."""
    given = law(seen, x) if len(x) else law(seen)
    try:
        u, following = given if len(x) else (given, x)
        u, following = np.asarray(u) + np.zeros(outputs), np.asarray(following).reshape(x.shape)
        right = np.iscomplexobj(u) <= np.iscomplexobj(np.r_[x, seen.values])  # complex only for slopes
        right &= u.shape == (outputs,) and np.isfinite(u).all() and np.isfinite(following).all()
    except (TypeError, ValueError):
        right = False
    if not right:
        wanted = f"{outputs} outputs" if outputs > 1 else "an output"
        states = f" and {len(x)} states" if len(x) else ""
        raise StudyError(
            f"The law {name} returned {shown(given)} at {seen.time:.3f} s; it must return {wanted}{states}."
        )
    return u, following


def slopes(
    law: Callable[..., Any], names: tuple[str, ...], rest: np.ndarray, start: Sequence[float], outputs: int, name: str
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Matrices A, B, C, D of a law at the operating point.

    A slope is that of a complex step, where differences agree with it; otherwise, as where the law drops the imaginary
    part, it is that of differences. Raises `StudyError` if the law is a class, does not rest there (outputs 0 and
    states unchanged), or has no slope: differences on both sides, with two steps, do not agree.
    """
    if isinstance(law, type):
        raise StudyError(
            f"{name} is a class, so it has no linear model, which does not see what its instances remember; write it "
            "as a function of its states, law(seen, x), with start=[0.0], or as matrices."
        )
    x0, n, m = np.array(start, float), len(start), len(names)

    def ask(z: np.ndarray) -> np.ndarray:
        u, x = answer(law, Seen(names, z[n:], rest), x0 + z[:n], outputs, name)
        return np.r_[x - x0, u]

    still = ask(np.zeros(n + m))
    if np.abs(still).max(initial=0.0) > 1e-9:
        raise StudyError(
            f"The law {name} is not in steady state at the operating point: it returns {shown(still.tolist())} for "
            "deviations of 0; it must return 0 and leave its states unchanged there."
        )
    above, below = (
        np.array([4 * ask(h / 2 * e) - ask(h * e) - 3 * still for e in np.eye(n + m)]) / h for h in (1e-6, -5e-7)
    )
    J = (above + below) / 2
    if not np.allclose(above, below, 1e-3, 1e-6 * np.abs(J).max(initial=0.0)):
        raise StudyError(
            f"The law {name} has no linear model: at the operating point it jumps or bends, or its answers depend on "
            "earlier calls; simulate it."
        )
    with suppress(TypeError, StudyError), catch_warnings(action="ignore", category=np.exceptions.ComplexWarning):
        exact = np.array([ask(1e-30j * e).imag / 1e-30 for e in np.eye(n + m)])
        J = np.where(np.isclose(exact, J, 1e-3, 1e-6 * np.abs(J).max(initial=0.0)), exact, J)
    J = J.T.reshape(n + outputs, n + m)
    return J[:n, :n], J[:n, n:], J[n:, :n], J[n:, n:]
