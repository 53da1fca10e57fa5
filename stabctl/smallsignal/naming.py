"""Names of modes: which machines swing against each other, why an eigenvalue is zero, the dominant state."""

from collections.abc import Sequence

import numpy as np

from stabctl.dynamics.assembly import INFINITE
from stabctl.errors import StudyError

from .loops import loop
from .model import Linear

SWING = 1 / 3  # least participation of angles and speeds in a swing mode: n - 1 in every packaged case of n machines
NAMED = 0.2  # participation, relative to the largest, from which a machine is named
TOGETHER = 0.7  # |sum H s| / sum H |s| above which the machines move together
STANDING = 1e-4 * INFINITE  # s   inertia of an infinite bus, whatever its MVA
MOST = 4  # largest number of machines named on each side


def swings(values: np.ndarray, shares: np.ndarray, speeds: np.ndarray, rotor: np.ndarray, H: np.ndarray) -> np.ndarray:
    """Which modes are electromechanical: oscillatory, with rotor angles and speeds, machines against each other.

    `speeds` (machines, modes) are the speed parts of the right eigenvectors, `rotor` the indices of angles and speeds.
    """
    return (values.imag != 0) & (shares[rotor].sum(axis=0) > SWING) & (_together(speeds, H) < TOGETHER)


def _together(speeds: np.ndarray, H: np.ndarray) -> np.ndarray:
    """|sum H s| / sum H |s| (modes); 0 with an infinite bus, which stands still while the others move."""
    if H.max(initial=0.0) >= STANDING:
        return np.zeros(speeds.shape[1])
    whole = H @ np.abs(speeds)
    return np.divide(np.abs(H @ speeds), whole, out=np.zeros(speeds.shape[1]), where=whole > 0)


def sides(shape: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Machines in phase with the dominant one, and those against it, largest `weight` (participation) first."""
    strong = np.argsort(-weight)
    strong = strong[weight[strong] >= NAMED * weight.max()]
    ahead = (shape[strong] * shape[strong[0]].conjugate()).real >= 0
    return strong[ahead], strong[~ahead]


def against(shape: np.ndarray, weight: np.ndarray, names: Sequence[int | str], virtual: np.ndarray) -> str:
    """Which machines swing against which: "machine 34 against the rest", "1, 2 against 3, converter 4"."""
    both = sorted((side for side in sides(shape, weight) if len(side)), key=min)
    called = [f"converter {name}" if is_virtual else name for name, is_virtual in zip(names, virtual, strict=True)]
    front, *back = (_listed(side, called) for side in both)
    if back:
        return f"{front} against {back[0]}"
    return f"machine {front} against the rest" if front == str(names[both[0][0]]) else f"{front} against the rest"


def _listed(side: np.ndarray, names: Sequence[int | str]) -> str:
    named = ", ".join(str(names[i]) for i in sorted(side[:MOST]))
    return named + (f" and {len(side) - MOST} more" if len(side) > MOST else "")


def zero(linear: Linear, right: np.ndarray, left: np.ndarray, first: bool) -> str:
    """Why an eigenvalue is zero; none of these is an instability."""
    if first:
        return "angle reference (rotating all angles together changes nothing)"
    fixed = [k for k in range(len(left)) if not linear.A[k].any() and abs(left[k]) > 0.5 * np.abs(left).max()]
    if fixed:
        return f"constant state {linear.states[fixed[0]]} (open circuit)"
    if (
        len(linear.speeds())
        and np.abs(left[linear.speeds()]).max() >= 0.5 * np.abs(left[np.r_[linear.speeds(), linear.angles()]]).max()
    ):
        return "frequency reference (no governor or damping restores the common speed)"
    return f"integral of {linear.states[int(np.abs(right).argmax())]}"


def leader(linear: Linear, share: np.ndarray, speeds: np.ndarray, H: np.ndarray, oscillates: bool) -> str:
    """Name of a mode that is not a swing mode: the common frequency, a loop of converters, or its dominant state."""
    rotor = np.r_[linear.speeds(), linear.angles()]
    if oscillates and share[rotor].sum() > SWING and _together(speeds[:, None], H)[0] >= TOGETHER:
        return "common frequency: all machines together"
    return loop(linear, share) or linear.states[int(share.argmax())]


def index(labels: tuple[str, ...], wanted: str | int, what: str) -> int:
    """Place of an input or output, given by its label or as a number."""
    if isinstance(wanted, int) and 0 <= wanted < len(labels):
        return wanted
    if wanted not in labels:
        raise StudyError(f"{wanted!r} is not an {what} of the model; its {what}s are {', '.join(labels) or 'none'}.")
    return labels.index(wanted)
