"""Style of all figures, and how they are created and saved. Fonts, colors and labels are those of `style.toml`."""

import io
import tomllib
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

LOOK: dict[str, Any] = tomllib.loads((Path(__file__).parent / "style.toml").read_text(encoding="utf-8"))
FONTS: tuple[str, ...] = tuple(LOOK["fonts"])
LABELS: dict[str, str] = LOOK["labels"]
COLORS: tuple[str, ...] = tuple(LOOK["figures"]["cycle"])
GRAY, INK, MANY = (LOOK["figures"][name] for name in ("gray", "ink", "many"))
AREAS = (*COLORS[:5], COLORS[7], GRAY)  # of coherent areas; different from each other on light and dark paper
VOLTAGES: list[tuple[float, str]] = [(v, color) for v, color in LOOK["figures"]["voltages"]]
CLEARING: list[str] = LOOK["figures"]["clearing"]
MARKERS = "os^Dv"
DPI = 150


def css() -> str:
    """Return the colors and fonts of pages as CSS variables, in light, dark and printed pages."""
    fonts = ", ".join((*(f"'{name}'" for name in FONTS), "sans-serif"))
    light = f"--font: {fonts}; color-scheme: light dark; {variables('light')}"
    dark, paper = variables("dark"), variables("print")
    return (
        f":root {{{light}}}\n@media (prefers-color-scheme: dark) {{:root {{{dark}}}}}\n"
        f"@media print {{:root {{{paper}}}}}\n"
    )


def variables(scheme: str) -> str:
    """Return the CSS variables of the colors of a scheme: light, dark, or print."""
    return " ".join(f"--{name}: {color};" for name, color in LOOK[scheme].items())


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

    from .figure import StyledFigure

    figure = plt.figure(FigureClass=StyledFigure, figsize=(width, height), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, **options)
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
