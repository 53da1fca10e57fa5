r"""What the controls contribute to a mode: which exciter, stabilizer or governor damps it, and which one does not.

In the linearized equations, let the changes of all outputs of a control be multiplied by 1 + e where others read them.
The eigenvalue then moves by e times

$$ c = \sum l_i \, J_{ij} \, r_j $$

over the derivatives J of other devices with respect to its states and outputs; r are the changes of states, voltages
and outputs in the mode, l those of the left eigenvector (w^H v = 1).
For an output through a gain K, c = K ds/dK, the eigenvalue's sensitivity (P. Kundur, Power System Stability and
Control, sec. 12.2), so that a control with a negative real part of c damps the mode, to first order. Machines,
converters and loads act by their currents, whose changes depend on the axes in which they are seen; they have no
contribution in this sense.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from stabctl._util.tabular import Tabular
from stabctl._util.wording import listed
from stabctl.model import naming

from ._parameter_slopes import rows_of, vectors
from .modes import Mode, Modes
from .sensitivity import changes, equations_of, index

if TYPE_CHECKING:
    import pandas as pd

UNITS = "machine", "converter"  # roles of what swings, or stands in for it
LEAST = 1e-9  # 1/s   smaller contributions are rounding
SHOWN = 3  # devices in a sentence, on each side


class Contribution(NamedTuple):
    """What a control contributes to a mode: the changes if its effect on others were 1 % larger.

    Attributes
    ----------
    model, place, role : str, key, str
        Model, machine, and role: "stabilizer", "exciter", "governor", "electrical control".
    real, frequency_hz, damping_ratio : float
        Changes of the real part (1/s), of the frequency (Hz) and of the damping ratio.

    Examples
    --------
    >>> first = st.load("two_area").modes().contributions().rows[0]
    >>> first.name, first.role, round(first.damping_ratio, 5)
    ('PSS 4', 'stabilizer', 0.00034)
    """

    model: str
    place: naming.Key
    role: str
    real: float  # 1/s
    frequency_hz: float  # Hz
    damping_ratio: float

    @property
    def name(self) -> str:
        """The control: `PSS 4`."""
        return f"{self.model.upper()} {self.place}"


@dataclass(frozen=True, repr=False)
class Contributions(Tabular):
    """What the controls contribute to a mode.

    Attributes
    ----------
    name : str
        Name of the case.
    mode : Mode
        The mode.
    rows : tuple of Contribution
        A row for each control that damps or undamps it, the strongest damping first.

    Examples
    --------
    >>> found = st.load("two_area").modes().contributions()
    >>> found.damping[0].name, found.undamping[0].name
    ('PSS 4', 'SEXS 4')
    """

    name: str
    mode: Mode
    rows: tuple[Contribution, ...]

    @property
    def damping(self) -> tuple[Contribution, ...]:
        """Controls that damp the mode, the strongest first."""
        return tuple(row for row in self.rows if row.damping_ratio > 0)

    @property
    def undamping(self) -> tuple[Contribution, ...]:
        """Controls that take damping from it, the strongest first."""
        return tuple(row for row in reversed(self.rows) if row.damping_ratio < 0)

    @property
    def df(self) -> "pd.DataFrame":
        """The rows as a table."""
        import pandas as pd

        return pd.DataFrame(self.rows, columns=Contribution._fields)

    def __str__(self) -> str:
        m, said = self.mode, []
        for verb, rows in (("damped by", self.damping), ("undamped by", self.undamping)):
            if rows:
                said.append(f"{verb} {listed([f'{row.name} {row.damping_ratio:+.2g}' for row in rows], SHOWN)}")
        what = "; ".join(said) or "no control changes it"
        ratio = f"damping ratio {m.damping_ratio:z.4f}"
        return f"{self.name}: {m.frequency_hz:.3f} Hz ({m.label}), {ratio}: {what}, per 1 % of its effect."


def contributions(modes: Modes, mode: str | float | None = None) -> Contributions:
    """What each control contributes to a mode: whether it damps it, to first order.

    Parameters
    ----------
    modes : Modes
        The modes of a system without controllers, `base.modes()`.
    mode : str, float or int, optional
        Frequency ("0.6Hz", or a float in Hz) of an oscillatory mode, or index of an eigenvalue (int); by default the
        least damped electromechanical mode.

    Returns
    -------
    Contributions

    Raises
    ------
    StudyError
        If there is no such mode, the eigenvalue is zero or coincides with another one, or the modes are those of a loop
        with controllers.

    Examples
    --------
    >>> found = st.load("two_area").modes().contributions("0.6Hz")
    >>> found.df[["model", "place", "damping_ratio"]].head(2).round(5)
      model  place  damping_ratio
    0   pss      4        0.00034
    1   pss      1        0.00033
    """
    k = index(modes, mode)
    s, d = complex(modes.eigenvalues[k]), equations_of(modes)
    left, _, right = vectors(d, s, modes.right[:, k], modes.left[:, k])
    equations, lay = d.point.equations, d.point.layout
    pattern = equations.pattern
    weight = left[pattern.rows] * equations.entries(d.point.s.copy())[0] * right[pattern.columns]
    owner = np.full(lay.size, -1)
    owner[: lay.nx] = pattern.device[: lay.nx]
    owner[lay.first_output : lay.first_output + lay.outputs] = pattern.device[lay.nx : lay.nx + lay.outputs]
    reads, of = pattern.device[pattern.rows], owner[pattern.columns]
    found, others = np.zeros(1 + int(pattern.device.max(initial=0)), complex), (of >= 0) & (of != reads)
    np.add.at(found, of[others], weight[others])
    rows: list[Contribution] = []
    first = 0
    for f in equations.families:
        known = {j: key for key, j in rows_of(d.point, f.name).items()} if f.name in d.point.case.devices else {}
        for j, c in enumerate(found[first : first + len(f.w)].tolist()):
            if f.device.role not in UNITS and abs(c) > LEAST:
                place = naming.called(d.point.case, f.name, known[j]) if j in known else f.keys[j]
                rows.append(Contribution(f.name, place, f.device.role, *changes(s, 0.01 * c)))
        first += len(f.w)
    rows.sort(key=lambda row: -row.damping_ratio)
    return Contributions(d.point.case.name, modes.mode(k), tuple(rows))
