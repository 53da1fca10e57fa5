"""Modal controllability Gramians: how far a megawatt of storage at each candidate moves the critical swings.

A swing s with left and right vectors w, v, and c_i = w^H b_i for candidate i, answers as z' = s z + c_i u. With the
memory e^(-a t) of the decay a, two swings have in common

    W_kl = integral of e^(-2 a t) (e^(s_k t) c_k)(e^(s_l t) c_l)* dt = c_k c_l* / (2 a - s_k - s_l*)

so that |c_k|^2 / (2 a - 2 Re s_k) is the share of one swing alone. The real coordinates p = 2 Re z, q = -2 Im z of
every swing (x = p Re v + q Im v) are scaled so that p^2 + q^2 is twice its mean kinetic energy in MW s.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StudyError
from stabctl.smallsignal import Mode, Modes, analyze, linearize

from .sensitivity import Candidate, checked

SWINGS = 6  # swings that are looked at
DECAY = 0.5  # 1/s   memory of one second, e^(-2 a t) = 1/e: the first swings
EVEN = 1e-6  # 1/s   decay rates this close are the same


@dataclass(frozen=True, repr=False, eq=False)
class Gramians:
    """Gramian of 1 MW of storage at each candidate; that of sizes s (MW) is W(s) = sum s_i W_i.

    Linear in s because a megawatt more is one more device of 1 MW with a signal of its own: inputs scale as sqrt(MW).
    """

    case: str
    candidates: tuple[Candidate, ...]
    modes: tuple[Mode, ...]  # m swings, the one that decays slowest first
    decay: float  # 1/s
    A: np.ndarray  # (2m, 2m) 1/s   z' = A z + B u, the swings alone, no decay in it
    B: np.ndarray  # (2m, candidates)   per MW, z in root(MW s)
    W: np.ndarray  # (candidates, 2m, 2m)

    @property
    def alone(self) -> np.ndarray:
        """Trace of every W_i (candidates): twice the energy of all swings that 1 MW stirs."""
        return np.trace(self.W, axis1=1, axis2=2)

    def of(self, sizes: np.ndarray) -> np.ndarray:
        """W(s) (2m, 2m) of sizes (candidates) in MW."""
        return np.tensordot(sizes, self.W, 1)

    def __str__(self) -> str:
        listed = ", ".join(f"{m.frequency_hz:.3f} Hz" for m in self.modes)
        return f"{self.case}: Gramians of {len(self.candidates)} candidates in the swings of {listed}"

    __repr__ = __str__


def gramians(
    point: OperatingPoint,
    candidates: Iterable[tuple[int, int]] | None = None,
    modes: int | Sequence[float] = SWINGS,
    decay: float = DECAY,
) -> Gramians:
    """The Gramians of every candidate at an operating point.

    Args: candidates (machine, bus), by default every machine's storage bus; the number of swings, those that decay
    slowest (of undamped ones the slowest), or the frequencies (Hz) of the swings wanted, the nearest to each; the
    decay a (1/s), 0 for the textbook Gramian. Raises `StudyError` where there is no swing, no such candidate, and
    where a swing does not decay within the memory.
    """
    found = checked(point.case, candidates)
    buses = list(dict.fromkeys(c.bus for c in found))
    all_modes = analyze(linearize(point, [f"storage:{bus}" for bus in buses]))
    chosen = critical(all_modes, modes)
    if not 0 <= decay < np.inf:
        raise StudyError(f"The decay {decay:g} 1/s is not allowed; it must be 0 or more.")
    s = all_modes.eigenvalues[chosen]
    if not (s.real - decay < -EVEN).all():
        worst = chosen[int(s.real.argmax())]
        raise StudyError(
            f"The swing of {all_modes.frequency_hz[worst]:.3f} Hz of {point.case.name} "
            f"({all_modes.label(worst)}) does not decay: it has no Gramian at a decay of {decay:g} 1/s; choose one "
            f"above {max(float(s.real.max()), 0.0) + EVEN:.3g} 1/s."
        )
    H = point.inertia * point.case.base_mva
    scale = np.sqrt(H @ np.abs(all_modes.right[all_modes.linear.speeds()][:, chosen]) ** 2)
    c = all_modes.controllability()[chosen] * scale[:, None] / point.case.base_mva
    c = c[:, [buses.index(k.bus) for k in found]]
    both, rate = np.r_[c, c.conj()], np.r_[s, s.conj()]
    W = np.einsum("ki,li->ikl", both, both.conj()) / (2 * decay - rate[:, None] - rate.conj())
    real = _real(len(s))
    A, B, W = (real @ np.diag(rate) @ np.linalg.inv(real)).real, (real @ both).real, (real @ W @ real.conj().T).real
    return Gramians(point.case.name, found, tuple(all_modes.mode(k) for k in chosen), float(decay), A, B, W)


def critical(modes: Modes, wanted: int | Sequence[float] = SWINGS) -> list[int]:
    """Numbers of the swings that decay slowest, or of those nearest to some frequencies (Hz)."""
    swings, name = modes.swings(), modes.linear.point.case.name
    if not swings:
        raise StudyError(f"{name} has no swing of machines against each other; storage can only be sited where two do.")
    if isinstance(wanted, int | np.integer):
        if wanted < 1:
            raise StudyError(f"{wanted} swings of {name} are not allowed; look at 1 to {len(swings)} of them.")
        slowest = sorted(swings, key=lambda k: (round(-modes.eigenvalues[k].real / EVEN), modes.frequency_hz[k]))
        return slowest[:wanted]
    near = [min(swings, key=lambda k: abs(modes.frequency_hz[k] - hz)) for hz in wanted]
    if not near or not np.isfinite(list(wanted)).all():
        raise StudyError(f"No swing of {name} is named; give the frequencies in Hz of those that matter.")
    return list(dict.fromkeys(near))


def _real(m: int) -> np.ndarray:
    """(2m, 2m) [z, z*] -> (p_1, q_1, p_2, ...), p = z + z*, q = j (z - z*)."""
    eye = np.eye(m)
    return np.stack([np.c_[eye, eye], 1j * np.c_[eye, -eye]], axis=1).reshape(2 * m, 2 * m)
