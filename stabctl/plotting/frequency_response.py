"""Figure of a linear model: magnitude and phase of its frequency response."""

from typing import TYPE_CHECKING

import numpy as np

from stabctl.smallsignal.model import Model

from .style import subplots

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BAND = (0.05, 5.0)  # Hz
POINTS = 400


def plot(model: Model, *, band: tuple[float, float] = BAND) -> "np.ndarray[Axes]":
    """Plot the frequency response from every input to every output of a linear model.

    Parameters
    ----------
    model
        The linear model; it needs inputs and outputs.
    band
        Frequencies (Hz) from and to.

    Returns
    -------
    numpy.ndarray of matplotlib.axes.Axes
        Magnitude above, phase below.
    """
    hz = np.geomspace(*band, POINTS)
    response = model.response(hz)
    _, axes = subplots(7, 5, 2, 1, sharex=True)
    for i, output in enumerate(model.outputs):
        for j, name in enumerate(model.inputs):
            axes[0, 0].loglog(hz, np.abs(response[:, i, j]), label=f"{name} to {output}")
            axes[1, 0].semilogx(hz, np.rad2deg(np.unwrap(np.angle(response[:, i, j]))))
    axes[0, 0].set_ylabel("magnitude")
    axes[1, 0].set_ylabel("phase (degrees)")
    axes[1, 0].set_xlabel("frequency (Hz)")
    if model.inputs and model.outputs:
        axes[0, 0].legend(frameon=False, fontsize="small")
    return axes[:, 0]
