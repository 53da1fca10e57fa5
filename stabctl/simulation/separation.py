"""Which machines lose synchronism together: those on one side of the widest gap between the rotor angles."""

import numpy as np


def ahead(moved: np.ndarray) -> np.ndarray:
    """Which rotors are ahead of the widest gap.

    Parameters
    ----------
    moved : (rotors,) array, rad
        Changes of their angles; at least two.

    Returns
    -------
    (rotors,) array of bool
    """
    order, found = np.argsort(moved), np.zeros(len(moved), bool)
    found[order[np.argmax(np.diff(moved[order])) + 1 :]] = True
    return found


def group(moved: np.ndarray, lost: int, together: np.ndarray) -> np.ndarray:
    """The rotors on the same side as one that has lost synchronism, among those of its island.

    Parameters
    ----------
    moved : (rotors,) array, rad
        Changes of their angles.
    lost : int
        Row of the rotor that has lost synchronism.
    together : (rotors,) array of bool
        Which rotors are in its island, itself included.

    Returns
    -------
    (rotors,) array of bool
    """
    rows, found = np.flatnonzero(together), np.zeros(len(moved), bool)
    if len(rows) < 2:
        found[lost] = True
        return found
    side = ahead(moved[rows])
    found[rows] = side == side[rows == lost][0]
    return found
