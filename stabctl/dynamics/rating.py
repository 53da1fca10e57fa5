"""Power flows that no machine of the given rating can supply."""

import numpy as np

from stabctl.errors import EquilibriumError
from stabctl.model.case import Case

MOST = 10.0  # times its rating
DROP = 1.0  # pu of the voltage


def check(case: Case, V: np.ndarray, current: np.ndarray, admittance: np.ndarray) -> None:
    """Check that no machine supplies many times its rating.

    Equivalents of other systems often have a nominal rating of 100 MVA, with a large inertia and a small reactance on
    it. What shows a wrong rating or power is the voltage drop across the source impedance: it depends on no base.

    Parameters
    ----------
    case
        The case, for ratings and names.
    V, current
        Terminal voltages and currents of the units (units), complex, pu on the system base.
    admittance
        Of their sources (units), complex, pu on the system base; 0 for a unit that is no voltage source.

    Raises
    ------
    EquilibriumError
        If a unit supplies more than `MOST` times its rating with a drop of more than `DROP`; names the worst one.
    """
    S = V * current.conj() * case.base_mva
    times = np.abs(S) / np.array([m.base for m in case.machines])
    wrong = (times > MOST) & (np.abs(current) > DROP * np.abs(admittance))
    if wrong.any():
        k = int(np.where(wrong, times, 0).argmax())
        m = case.machines[k]
        raise EquilibriumError(
            f"Machine {m.called} of {case.name} supplies {S[k].real:.4g} MW and {S[k].imag:.4g} Mvar, {times[k]:.0f} "
            f"times its rating of {m.base:g} MVA; correct its power or its rating (base_mva)."
        )
