"""Sensitivities: how a mode changes with every parameter of the devices of a case."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from numbers import Integral
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from stabctl import devices
from stabctl._util import units
from stabctl._util.errors import StudyError, shown
from stabctl._util.schema import fields
from stabctl._util.tabular import Tabular
from stabctl._util.verbs import verb
from stabctl._util.wording import counted, listed
from stabctl.devices.blocks.lags import SHORT
from stabctl.dynamics.operating_point import solve
from stabctl.model import edit, naming
from stabctl.model.case import Case

from ._parameter_slopes import ParameterSlopes
from .analysis import Selected
from .closed_loop import ClosedLoop
from .descriptor import Descriptor, descriptor
from .modes import Mode, Modes

if TYPE_CHECKING:
    import pandas as pd

STEP = 2e-4  # of a finite difference, relative to the parameter, or in its own unit if it is 0
BENT = 1e-3  # difference of the slopes on both sides, relative to them, from which a kink is looked for
KINK = 0.75  # of this difference that remains with half the step: curvature leaves a half
NOISE = 1e-9  # change of the eigenvalue per 1 %, relative to it, that may be rounding
TWICE = 1e-6  # eigenvalues this close (relative) may be one that rounding has split, which has no derivative
OFF = 0.1  # relative distance of a frequency asked for from that of the mode
SHOWN = 3  # parameters in the sentence


class Effect(NamedTuple):
    """How a parameter changes a mode, per `step`: 1 % of its value, or 0.01 of its unit if it is 0.

    Attributes
    ----------
    model, place, parameter : str, key, str
        Model, machine, bus or load, and parameter.
    value, unit, step : float, str, float
        Its value and unit, and the step in this unit.
    real, frequency_hz, damping_ratio : float
        Changes of the real part (1/s), of the frequency (Hz) and of the damping ratio.

    Examples
    --------
    >>> first = st.load("two_area").modes().sensitivity("pss.K").rows[0]
    >>> first.path, first.value, round(first.damping_ratio, 5)
    ('pss.4.K', 10.0, 0.00034)
    """

    model: str
    place: naming.Key  # machine, bus or load
    parameter: str
    value: float
    unit: str
    step: float  # in its unit
    real: float  # 1/s   change of the real part
    frequency_hz: float  # Hz   change of the frequency
    damping_ratio: float  # change of the damping ratio

    @property
    def path(self) -> str:
        """Its path: "exst3.2.KA"."""
        return f"{self.model}.{self.place}.{self.parameter}"


class LeftOut(NamedTuple):
    """A parameter without a derivative, and why it has none."""

    path: str
    reason: str


@dataclass(frozen=True, repr=False)
class Sensitivity(Tabular):
    """How the parameters of the devices change a mode.

    Attributes
    ----------
    name : str
        Name of the case.
    mode : Mode
        The mode.
    rows : tuple of Effect
        A row for each parameter, by the size of the change of the damping ratio; those of value 0, whose changes are
        not those per 1 %, come last.
    left_out : tuple of LeftOut
        Parameters without a derivative, with the reason.

    Examples
    --------
    >>> found = st.load("two_area").modes().sensitivity("pss.K")
    >>> found.mode.label, found.rows[0].path
    ('1, 2 against 3, 4', 'pss.4.K')
    """

    name: str
    mode: Mode
    rows: tuple[Effect, ...]
    left_out: tuple[LeftOut, ...]

    plot = verb("stabctl.view.figures.modes:plot_sensitivity")

    @property
    def df(self) -> "pd.DataFrame":
        """The rows as a table."""
        import pandas as pd

        return pd.DataFrame(self.rows, columns=Effect._fields)

    def __str__(self) -> str:
        m = self.mode
        text = f"{self.name}: {counted(len(self.rows), 'parameter')} of the mode {m.frequency_hz:.3f} Hz ({m.label})"
        real = [row for row in self.rows if abs(row.damping_ratio) > NOISE]
        first = [f"{row.path} {row.damping_ratio:+.2g}" for row in real if bool(row.value) == bool(real[0].value)]
        text += f"; {'largest changes of' if real else 'none changes'} its damping ratio, {m.damping_ratio:z.4f}"
        if real:
            step = "1 %" if real[0].value else "0.01 of their unit, as they are 0"
            text += f": {', '.join(first[:SHOWN])} per {step}"
        left = listed([f"{one.path} ({one.reason})" for one in self.left_out], SHOWN)
        return f"{text}; left out: {left}." if left else f"{text}."


def sensitivity(
    modes: Modes, parameters: str | Iterable[str] = "all", *, mode: str | float | None = None
) -> Sensitivity:
    r"""Derivatives of a mode with respect to parameters of the devices.

    For an eigenvalue $\lambda$ with $w^H v = 1$ and a parameter $p$,

    $$ \frac{d\lambda}{dp} = w^H \frac{dA}{dp} v $$

    (P. Kundur, *Power System Stability and Control*, sec. 12.2), where $A$ changes with the parameter and with the
    equilibrium of the devices; the power flow stays. Changes are those per 1 % of a parameter, or per 0.01 of its unit
    if it is 0. Limits that are not reached change nothing: 0.

    Parameters
    ----------
    modes : Modes
        The modes of a system without controllers, `base.modes()`.
    parameters : str or iterable of str
        "exst3.KA": at every machine, each with its own row; "exst3.2.KA": at machine 2; "exst3": every parameter of
        the model; or "all".
    mode : str, float or int, optional
        Frequency ("0.6Hz", or a float in Hz) of an oscillatory mode, or index of an eigenvalue (int); by default the
        least damped electromechanical mode.

    Returns
    -------
    Sensitivity

    Raises
    ------
    StudyError
        If there is no such mode or parameter, the eigenvalue is zero or coincides with another one, or the modes are
        those of a loop with controllers.

    Examples
    --------
    >>> found = st.load("two_area").modes().sensitivity("pss.K", mode="0.6Hz")
    >>> found.df[["model", "place", "parameter", "damping_ratio"]].head(2).round(5)
      model  place parameter  damping_ratio
    0   pss      4         K        0.00034
    1   pss      1         K        0.00033
    """
    k = index(modes, mode)
    wanted = _wanted(modes.linear.point.case, parameters)
    found = ParameterSlopes(equations_of(modes), complex(modes.eigenvalues[k]), modes.right[:, k], modes.left[:, k])
    rows: list[Effect] = []
    left: list[LeftOut] = []
    for (model, name), keys in wanted.items():
        more, without = _one_parameter(found, modes.eigenvalues[k], model, name, keys)
        rows += more
        left += without
    rows.sort(key=lambda row: (not row.value, -abs(row.damping_ratio), -abs(row.real)))
    return Sensitivity(modes.linear.point.case.name, modes.mode(k), tuple(rows), tuple(left))


def index(modes: Modes, mode: Any) -> int:
    """Index of the mode, which must be simple and not zero."""
    if mode is None:
        if not modes.swings():
            where = f" {modes.asked}; search a wider band, or" if isinstance(modes, Selected) else ";"
            raise StudyError(
                f"{modes.linear.point.case.name} has no electromechanical mode{where} choose another mode in Python "
                "with mode=, a frequency such as '5Hz' or the index of an eigenvalue."
            )
        k = modes.least_damped()[-1]
    elif isinstance(mode, Integral) and not isinstance(mode, bool):
        modes.mode(int(mode))
        k = int(mode) % len(modes)
    else:
        hz = units.hertz(mode)
        upper = np.flatnonzero(modes.eigenvalues.imag > 0)
        k = int(min(upper, key=lambda k: abs(modes.frequency_hz[k] - hz), default=-1))
        if k < 0 or abs(modes.frequency_hz[k] - hz) > OFF * hz:
            nearest = f"the nearest is at {modes.frequency_hz[k]:.4g} Hz" if k >= 0 else "no mode oscillates"
            raise StudyError(f"There is no mode near {hz:g} Hz; {nearest}.")
    s = modes.eigenvalues[k]
    if s == 0:
        raise StudyError(f"Eigenvalue {k} is zero ({modes.label(k)}) whatever the parameters; choose another mode.")
    if (np.abs(np.delete(modes.eigenvalues, k) - s) <= TWICE * max(1.0, abs(s))).any():
        raise StudyError(
            f"Eigenvalue {k} ({modes.label(k)}) coincides with another one, so it has no derivative; change one of the "
            "equal devices a little."
        )
    return k


def _wanted(case: Case, parameters: Any) -> dict[tuple[str, str], list[naming.Key]]:
    """Model and parameter -> keys of the devices, in the order of the case."""
    found: dict[tuple[str, str], dict[naming.Key, None]] = {}
    for text in [parameters] if isinstance(parameters, str) else _texts(parameters):
        models = list(case.devices) if text == "all" else [naming.known_table(case, text.partition(".")[0].strip())]
        if models[0] not in case.devices:
            raise StudyError(
                f"{text} is no parameter of a device; sensitivities are those at a given power flow, with respect to "
                f"parameters of {', '.join(case.devices)}."
            )
        for model in models:
            known = fields(devices.models()[model].Par)
            keys, names = list(case.devices[model]), [name for name, f in known.items() if f.kind is float]
            if text.count(".") == 1:
                names = [edit.resolve(case, text.replace(".", ".any."))[2].name]
            elif text.count(".") > 1:
                _, key, f = edit.resolve(case, text)
                names, keys = [f.name], [keys[naming.row(case, model, key)]]
            for name in names:
                if known[name].kind is not float:
                    raise StudyError(
                        f"{model}.{name} is a whole number or text, which has no derivative; leave it out."
                    )
                found.setdefault((model, name), {}).update(dict.fromkeys(keys))
    return {pair: list(keys) for pair, keys in found.items()}


def _texts(parameters: Any) -> list[str]:
    given = list(parameters) if isinstance(parameters, Iterable) else [parameters]
    if not all(isinstance(one, str) for one in given):
        raise StudyError(
            f"{shown(parameters)} are no parameters; give 'all', or names such as ['exst3.KA', 'pss.2.K']."
        )
    return given


def equations_of(modes: Modes) -> Descriptor:
    """The linearized equations of modes; signals that were added to the model are left out again."""
    linear = modes.linear
    if isinstance(linear, ClosedLoop):
        raise StudyError(
            "Sensitivities are those of a system without controllers; take base.modes() in place of those of a loop."
        )
    point = solve(linear.point.case, linear.point.flow) if linear.inputs or linear.outputs else linear.point
    d = linear if isinstance(linear, Descriptor) and point is linear.point else descriptor(point)
    if len(d.rows) != len(modes.right):
        raise StudyError("The model of these modes has states of added signals; take the modes of base.modes().")
    return d


def _one_parameter(
    of: ParameterSlopes, s: complex, model: str, name: str, keys: Sequence[naming.Key]
) -> tuple[list[Effect], list[LeftOut]]:
    """The rows of one parameter of some devices of a model, and those of the devices at which it has no derivative."""
    rows: list[Effect] = []
    left: list[LeftOut] = []
    f, case = fields(devices.models()[model].Par)[name], of.point.case
    whole, half = (of.slopes(model, name, keys, step) for step in (STEP, STEP / 2))
    for key in keys:
        a, b, place = whole[key], half[key], naming.called(case, model, key)
        value = float(getattr(case.devices[model][key], name))
        step = 0.01 * value if value else 0.01
        if isinstance(a, str) or isinstance(b, str):
            left.append(LeftOut(f"{model}.{place}.{name}", str(a if isinstance(a, str) else b)))
            continue
        ds = (4 * b.slope - a.slope) / 3 * step  # without the error of the second order
        bent = a.bend * abs(step) > BENT * abs(ds) + NOISE * abs(s)
        if bent and b.bend >= KINK * a.bend:
            left.append(LeftOut(f"{model}.{place}.{name}", f"it has no derivative at {value:g}, a threshold"))
        elif f.unit == "s" and 0 <= value < SHORT and ds == 0:
            left.append(LeftOut(f"{model}.{place}.{name}", f"{value:g} s bypasses its block"))
        else:
            rows.append(Effect(model, place, name, value, f.unit, step, *changes(s, ds)))
    return rows, left


def changes(s: complex, ds: complex) -> tuple[float, float, float]:
    """Changes of the real part, the frequency and the damping ratio of an eigenvalue that changes by ds."""
    hertz = np.sign(s.imag) * ds.imag / (2 * np.pi)
    ratio = s.imag * (s.real * ds.imag - s.imag * ds.real) / abs(s) ** 3
    return float(ds.real) + 0.0, float(hertz) + 0.0, float(ratio) + 0.0
