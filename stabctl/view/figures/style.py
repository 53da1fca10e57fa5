"""Style of all figures: their axes and fonts, names of their parts for tooltips, and how they are saved.

The fonts are set when a figure is drawn, without changing the settings of matplotlib. The names of parts are kept
beside the artists; a page shows them under the pointer.
"""

import io
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np
from matplotlib import rcParams
from matplotlib.figure import Figure, SubFigure
from matplotlib.font_manager import fontManager
from matplotlib.text import Text

from stabctl._util import files
from stabctl._util.errors import StudyError, shown

from .palette import COLORS, FONTS

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.backend_bases import RendererBase
    from matplotlib.lines import Line2D


MARKERS = "os^Dv"
GAP = 0.145  # inches   between two names at the ends of curves
DPI = 150
_texts: "WeakKeyDictionary[Artist, tuple[str, ...]]" = WeakKeyDictionary()


def subplots(
    width: float, height: float, rows: int = 1, columns: int = 1, **options: Any
) -> "tuple[Figure, np.ndarray]":
    """Return a pyplot figure of a size in inches and its axes (rows, columns); options are pyplot's."""
    import matplotlib.pyplot as plt

    figure = plt.figure(FigureClass=StyledFigure, figsize=(width, height), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, **options)
    for ax in axes.flat:
        tidy(ax)
    return figure, axes


class StyledFigure(Figure):
    """A figure whose texts have our fonts when it is drawn, unless they were given others."""

    def draw(self, renderer: "RendererBase") -> None:
        """Draw the figure, as matplotlib does."""
        for text in self.findobj(Text):
            _letter(text)
        super().draw(renderer)


def _letter(text: Any) -> None:
    if text.get_fontfamily() == rcParams["font.family"]:
        text.set_fontfamily(_installed())
        text.set_math_fontfamily("stixsans")


@cache
def _installed() -> tuple[str, ...]:
    """Those of our fonts that this machine has; matplotlib warns of all others."""
    known = {font.name for font in fontManager.ttflist}
    return tuple(name for name in FONTS if name in known)


def tidy(ax: "Axes") -> None:
    """Apply a light grid, two spines and the color cycle."""
    ax.grid(alpha=0.25)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)
    ax.set_prop_cycle(color=COLORS)


def single(ax: "Axes | None", width: float, height: float) -> "Axes":
    """Return the axes given, or those of a new figure of this size in inches."""
    if ax is not None and not callable(getattr(ax, "plot", None)):
        raise StudyError(f"ax = {shown(ax)} is not a pair of axes to draw on; give matplotlib Axes, or leave it out.")
    return subplots(width, height)[1][0, 0] if ax is None else ax


def ranked(ax: "Axes", names: Sequence[str]) -> None:
    """Name the rows of a ranking, at y = 0, 1 ..., the first on top."""
    ax.set_yticks(range(len(names)), names)
    ax.set_ylim(len(names) - 0.4, -0.6)
    ax.grid(visible=False, axis="y")


def apart(places: Sequence[float], gap: float) -> list[float]:
    """Move places, in ascending order, until they are at least `gap` apart, each group about its middle."""
    groups: list[tuple[float, int]] = []  # first place, number
    for place in places:
        groups.append((place, 1))
        while len(groups) > 1 and groups[-2][0] + gap * groups[-2][1] > groups[-1][0]:
            (a, m), (b, n) = groups[-2:]
            middle = (m * (a + gap * (m - 1) / 2) + n * (b + gap * (n - 1) / 2)) / (m + n)
            groups[-2:] = [(middle - gap * (m + n - 1) / 2, m + n)]
    return [first + gap * k for first, count in groups for k in range(count)]


def name_at_ends(ax: "Axes", lines: "Sequence[Line2D]", texts: Sequence[str], *, height: float) -> None:
    """Write a text at the right end of every curve, in its color; the axes are so many inches high."""
    low, high = ax.get_ylim()
    ends = []
    for line in lines:
        y = np.asarray(line.get_ydata(), float)
        ends.append(float(y[np.isfinite(y)][-1:].sum() - low) / (high - low))
    order = sorted(range(len(ends)), key=ends.__getitem__)
    for k, place in zip(order, apart([min(max(ends[k], 0.0), 1.0) for k in order], GAP / height), strict=True):
        look: Any = {"color": lines[k].get_color(), "va": "center", "fontsize": "small"}
        ax.text(1.01, place, texts[k], transform=ax.transAxes, **look)


def legend_below(ax: "Axes") -> None:
    """Put a legend of what has a label below the right end of the axes, under the name of the axis."""
    if handles := ax.get_legend_handles_labels()[0]:
        look: Any = {"frameon": False, "fontsize": "small", "columnspacing": 1.0, "handlelength": 1.2}
        ax.legend(loc="upper right", bbox_to_anchor=(1.0, 0.0), ncols=len(handles), borderaxespad=3.6, **look)


def legend_beside(ax: "Axes", labels: Sequence[str]) -> None:
    """Put a legend to the right of the axes, if there are few enough lines to tell apart."""
    if 0 < len(labels) <= len(COLORS) + 3:
        ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize="small")


def name(artist: "Artist", texts: str | Iterable[str]) -> None:
    """Name an artist, or each of its last markers, lines or segments in the order in which it draws them."""
    _texts[artist] = (texts,) if isinstance(texts, str) else tuple(texts)


def named(artists: "Iterable[Artist]") -> "list[tuple[Artist, tuple[str, ...]]]":
    """Those of the artists that have names, with these."""
    return [(a, _texts[a]) for a in artists if a in _texts]


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


def whole(drawn: "Figure | Axes") -> "Figure":
    """The figure itself, or the one that axes are on."""
    figure = drawn.figure
    while isinstance(figure, SubFigure):
        figure = figure.figure
    return figure
