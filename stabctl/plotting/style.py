"""The look of every figure, and how figures are made and saved."""

import io
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stabctl._util import files
from stabctl.errors import StudyError, shown

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.axes import Axes
    from matplotlib.colors import LinearSegmentedColormap
    from matplotlib.figure import Figure

COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000", "#8c564b")  # Okabe-Ito
GRAY, INK = "#808080", "#222222"
AREAS = (*COLORS[:5], COLORS[7], GRAY)  # of coherent areas; different from each other on light and dark paper
VOLTAGES = ((0.8, "#d55e00"), (0.9, "#e69f00"), (1.0, "#f0f0f0"), (1.1, "#0072b2"))  # pu, color; between them mixed
CLEARING = "#b3350a", "#e69f00", "#56b4e9", "#0b4f8a"  # critical clearing times, the shortest first
MARKERS = "os^Dv"
DPI = 150


def voltage_colors() -> "LinearSegmentedColormap":
    """Return the color map of voltages, from the lowest to the highest of `VOLTAGES`."""
    low, high = VOLTAGES[0][0], VOLTAGES[-1][0]
    return _mixed([((v - low) / (high - low), color) for v, color in VOLTAGES])


def clearing_colors() -> "LinearSegmentedColormap":
    """Return the color map of critical clearing times, from the shortest to the longest."""
    return _mixed([(k / (len(CLEARING) - 1), color) for k, color in enumerate(CLEARING)])


def _mixed(stops: list[tuple[float, str]]) -> "LinearSegmentedColormap":
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list("mixed", stops)


def subplots(
    width: float, height: float, rows: int = 1, columns: int = 1, **options: Any
) -> "tuple[Figure, np.ndarray]":
    """Return a pyplot figure of a size in inches and its axes (rows, columns); options are pyplot's."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(rows, columns, figsize=(width, height), layout="constrained", squeeze=False, **options)
    for ax in axes.flat:
        tidy(ax)
    return figure, axes


def single(ax: "Axes | None", width: float, height: float) -> "Axes":
    """Return the axes given, or those of a new figure of this size in inches."""
    if ax is not None and not callable(getattr(ax, "plot", None)):
        raise StudyError(f"ax = {shown(ax)} is not a pair of axes to draw on; give matplotlib Axes, or leave it out.")
    return subplots(width, height)[1][0, 0] if ax is None else ax


def tidy(ax: "Axes") -> None:
    """Apply a light grid, two spines and the color cycle."""
    ax.grid(alpha=0.25)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)
    ax.set_prop_cycle(color=COLORS)


def legend_beside(ax: "Axes", labels: Sequence[str]) -> None:
    """Put a legend to the right of the axes, if there are few enough lines to tell apart."""
    if 0 < len(labels) <= len(COLORS) + 3:
        ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize="small")


def whole(drawn: "Figure | Axes") -> "Figure":
    """The figure itself, or the one that axes are on."""
    from matplotlib.figure import SubFigure

    figure = drawn.figure
    while isinstance(figure, SubFigure):
        figure = figure.figure
    return figure


def save(drawn: "Figure | Axes", path: str | Path, dpi: int = DPI) -> Path:
    """Write a figure in the format of the file's suffix, and close it.

    Parameters
    ----------
    drawn
        The figure, or axes on it.
    path
        File to write, ending in .png, .svg, .pdf or another suffix that matplotlib knows. An existing file is replaced
        only when the new one is complete.
    dpi
        Resolution of a raster image, dots per inch.

    Returns
    -------
    Path
        The path.

    Raises
    ------
    StudyError
        If matplotlib does not know the format or the file cannot be written.
    """
    import matplotlib.pyplot as plt

    path, image = files.path_of(path), io.BytesIO()
    try:
        whole(drawn).savefig(image, format=path.suffix.removeprefix(".").lower() or None, dpi=dpi)
        files.replace(path, image.getvalue())
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error).splitlines()[0]
        raise StudyError(f"The figure {path} cannot be written: {reason}.") from None
    finally:
        plt.close(whole(drawn))
    return path
