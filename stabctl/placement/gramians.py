"""Modal controllability Gramians: how strongly a megawatt of storage at each candidate acts on the critical modes.

An electromechanical mode s with left and right eigenvectors w, v, and c_i = w^H b_i for candidate i, responds as
z' = s z + c_i u. With the exponential weight e^(-a t) of decay rate a, two modes have in common

    W_kl = integral of e^(-2 a t) (e^(s_k t) c_k)(e^(s_l t) c_l)* dt = c_k c_l* / (2 a - s_k - s_l*)

so that |c_k|^2 / (2 a - 2 Re s_k) is the contribution of one mode alone. The real coordinates p = 2 Re z, q = -2 Im z
of every mode (x = p Re v + q Im v) are scaled so that p^2 + q^2 is twice its mean kinetic energy in MW s.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StudyError
from stabctl.smallsignal import Mode, Modes, analyze, linearize

from .sensitivity import Candidate, checked

MODES = 6  # number of modes considered
DECAY = 0.5  # 1/s   e^(-2 a t) = 1/e after one second, so the first swings dominate
EQUAL = 1e-6  # 1/s   decay rates this close count as equal


@dataclass(frozen=True, repr=False, eq=False)
class Gramians:
    """Gramian of 1 MW of storage at each candidate; that of sizes s (MW) is W(s) = sum s_i W_i.

    Linear in s because every further megawatt is a device of 1 MW with a signal of its own: inputs scale as sqrt(MW).
    """

    case: str
    candidates: tuple[Candidate, ...]
    modes: tuple[Mode, ...]  # m modes, the one that decays slowest first
    decay: float  # 1/s
    A: np.ndarray  # (2m, 2m) 1/s   z' = A z + B u, the modes alone, without the decay
    B: np.ndarray  # (2m, candidates)   per MW, z in root(MW s)
    W: np.ndarray  # (candidates, 2m, 2m)

    @property
    def alone(self) -> np.ndarray:
        """Trace of every W_i (candidates): twice the energy of all modes that 1 MW excites."""
        return np.trace(self.W, axis1=1, axis2=2)

    def of(self, sizes: np.ndarray) -> np.ndarray:
        """W(s) (2m, 2m) of sizes (candidates) in MW."""
        return np.tensordot(sizes, self.W, 1)

    def __str__(self) -> str:
        listed = ", ".join(f"{m.frequency_hz:.3f} Hz" for m in self.modes)
        return f"{self.case}: Gramians of {len(self.candidates)} candidates in the modes of {listed}"

    __repr__ = __str__


def gramians(
    point: OperatingPoint,
    candidates: Iterable[tuple[int, int]] | None = None,
    modes: int | Sequence[float] = MODES,
    decay: float = DECAY,
) -> Gramians:
    """The Gramians of every candidate at an operating point.

    Parameters
    ----------
    point : OperatingPoint
        The system.
    candidates : iterable of (machine, bus), optional
        Possible storage sites; by default every machine's storage bus.
    modes : int or sequence of float
        Number of electromechanical modes, those that decay slowest (of undamped ones the slowest), or frequencies
        (Hz): the nearest mode to each.
    decay : float, 1/s
        a above; 0 for the textbook Gramian.

    Raises
    ------
    StudyError
        If there is no electromechanical mode or no such candidate, or if a mode does not decay within the memory.
    """
    found = checked(point.case, candidates)
    buses = list(dict.fromkeys(c.bus for c in found))
    all_modes = analyze(linearize(point, [f"storage:{bus}" for bus in buses]))
    chosen = critical_modes(all_modes, modes)
    if not 0 <= decay < np.inf:
        raise StudyError(f"The decay {decay:g} 1/s is not allowed; it must be 0 or more.")
    s = all_modes.eigenvalues[chosen]
    if not (s.real - decay < -EQUAL).all():
        worst = chosen[int(s.real.argmax())]
        raise StudyError(
            f"The mode of {all_modes.frequency_hz[worst]:.3f} Hz of {point.case.name} ({all_modes.label(worst)}) does "
            f"not decay, so it has no Gramian with a decay of {decay:g} 1/s; choose one above "
            f"{max(float(s.real.max()), 0.0) + EQUAL:.3g} 1/s."
        )
    H = point.inertia * point.case.base_mva
    scale = np.sqrt(H @ np.abs(all_modes.speeds[:, chosen]) ** 2)
    c = all_modes.controllability()[chosen] * scale[:, None] / point.case.base_mva
    c = c[:, [buses.index(k.bus) for k in found]]
    both, rate = np.r_[c, c.conj()], np.r_[s, s.conj()]
    W = np.einsum("ki,li->ikl", both, both.conj()) / (2 * decay - rate[:, None] - rate.conj())
    real = _real(len(s))
    A, B, W = (real @ np.diag(rate) @ np.linalg.inv(real)).real, (real @ both).real, (real @ W @ real.conj().T).real
    return Gramians(point.case.name, found, tuple(all_modes.mode(k) for k in chosen), float(decay), A, B, W)


def critical_modes(modes: Modes, wanted: int | Sequence[float] = MODES) -> list[int]:
    """Numbers of the electromechanical modes that decay slowest, or of those nearest to some frequencies (Hz)."""
    swings, name = modes.swings(), modes.linear.point.case.name
    if not swings:
        raise StudyError(f"{name} has no electromechanical mode; siting by Gramians needs at least two rotor units.")
    if isinstance(wanted, int | np.integer):
        if wanted < 1:
            raise StudyError(f"{wanted} modes of {name} are not allowed; choose 1 to {len(swings)}.")
        slowest = sorted(
            swings, key=lambda k: (round(float(-modes.eigenvalues[k].real) / EQUAL), modes.frequency_hz[k])
        )
        return slowest[:wanted]
    near = [min(swings, key=lambda k: abs(modes.frequency_hz[k] - hz)) for hz in wanted]
    if not near or not np.isfinite(list(wanted)).all():
        raise StudyError(f"No mode of {name} is selected; give the frequencies of the modes in Hz.")
    return list(dict.fromkeys(near))


def _real(m: int) -> np.ndarray:
    """(2m, 2m) [z, z*] -> (p_1, q_1, p_2, ...), p = z + z*, q = j (z - z*)."""
    eye = np.eye(m)
    return np.stack([np.c_[eye, eye], 1j * np.c_[eye, -eye]], axis=1).reshape(2 * m, 2 * m)
