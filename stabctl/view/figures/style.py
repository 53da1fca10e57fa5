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

from matplotlib import rcParams
from matplotlib.figure import Figure, SubFigure
from matplotlib.font_manager import fontManager
from matplotlib.text import Text

from stabctl._util import files
from stabctl._util.errors import StudyError, shown

from .palette import COLORS, FONTS

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.backend_bases import RendererBase


MARKERS = "os^Dv"
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
