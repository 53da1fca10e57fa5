"""The residue method: phase compensation of a feedback so that it only damps a mode.

A feedback u = k H(s) y moves an eigenvalue by k H(s) R for small k, R the residue of the transfer function from u to y.
The compensator H turns H(s) exp(-s delay) R into the negative real axis, so that the gain adds damping alone. Source:
M. Aboul-Ela et al., Damping Controller Design for Power System Oscillations Using Global Signals, IEEE Trans. Power
Systems 11, 1996.
"""

from typing import Any

import numpy as np

from stabctl.controllers.controller import Controller
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StudyError
from stabctl.smallsignal.closed_loop import closed_loop
from stabctl.smallsignal.modes import Modes

from .lead_lag import compensator

UNSEEN = 1e-9  # residue of a mode that a feedback cannot move
ASIDE = 0.2  # of the frequency given, within which a mode is taken for the one that is meant


def damper(
    point: OperatingPoint, input: str, output: str, hz: float | None, washout: float, more: dict[str, Any]
) -> tuple[Controller, float, float]:
    """The compensator of one signal for one input; the gain that counts as 1; frequency (Hz) of the mode.

    Parameters
    ----------
    point
        The operating point.
    input, output
        The signal that is read and the input that is driven.
    hz
        Frequency of the mode; None is the least damped electromechanical one.
    washout
        Time constant of the washout, s.
    more
        Other fields of the controller.
    """
    modes = closed_loop(point, inputs=output, outputs=input).modes()
    k = meant(modes, hz)
    residue, s = complex(modes.residues()[k]), complex(modes.eigenvalues[k])
    if abs(residue) < UNSEEN:
        raise StudyError(
            f"The mode at {modes.frequency_hz[k]:.3f} Hz is not seen in {input}, or not moved by {output}; "
            "choose others."
        )
    held = more["delay"] + (0.5 / more["rate"] if more["rate"] else 0.0)
    H = compensator(np.pi - float(np.angle(residue)) + s.imag * held, s.imag, washout)
    return Controller.from_control(H, input, output, **more), abs(s) / abs(residue), float(modes.frequency_hz[k])


def meant(modes: Modes, hz: float | None) -> int:
    """Index of the electromechanical mode nearest to a frequency, or of the least damped one."""
    swings = modes.swings()
    if not swings:
        raise StudyError(f"{modes.linear.name} has no electromechanical mode to damp.")
    if hz is None:
        return min(swings, key=lambda k: modes.damping_ratio[k])
    k = min(swings, key=lambda k: abs(modes.frequency_hz[k] - hz))
    if abs(modes.frequency_hz[k] - hz) > ASIDE * hz:
        known = ", ".join(f"{modes.frequency_hz[k]:.3f}" for k in swings)
        raise StudyError(f"{modes.linear.name} has no electromechanical mode near {hz:g} Hz; they are at {known} Hz.")
    return k
