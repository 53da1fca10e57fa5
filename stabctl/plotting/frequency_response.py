"""Figure of a linear model: magnitude and phase of its frequency response."""

from typing import TYPE_CHECKING

import numpy as np

from stabctl.errors import StudyError
from stabctl.smallsignal.model import Model

from .style import LABELS, legend_beside, subplots

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BAND = (0.05, 5.0)  # Hz
POINTS = 400


def plot(model: Model, *, band: tuple[float, float] = BAND) -> "Figure":
    """Plot the frequency response from each input to each output of a linear model.

    Parameters
    ----------
    model
        The linear model, with inputs and outputs.
    band
        Lowest and highest frequency, Hz.

    Returns
    -------
    matplotlib.figure.Figure
        The magnitude, in output units per input unit, and below it the phase.

    Raises
    ------
    StudyError
        If the model has no inputs or no outputs.
    """
    if not model.inputs or not model.outputs:
        raise StudyError(
            "A frequency response needs inputs and outputs; linearize with inputs='vref:2' and outputs='speed:2', for "
            "example."
        )
    hz = np.geomspace(*band, POINTS)
    response = model.response(hz)
    figure, axes = subplots(8, 5, 2, 1, sharex=True)
    magnitude, phase = axes[:, 0]
    for i, output in enumerate(model.outputs):
        for j, name in enumerate(model.inputs):
            magnitude.loglog(hz, np.abs(response[:, i, j]), label=f"{name} to {output}")
            phase.semilogx(hz, np.rad2deg(np.unwrap(np.angle(response[:, i, j]))))
    magnitude.set_ylabel("magnitude")
    phase.set(xlabel=LABELS["frequency"], ylabel="phase (deg)")
    legend_beside(magnitude, magnitude.get_legend_handles_labels()[1])
    figure.align_ylabels(axes)
    return figure
