"""Figures in the fonts of the style, without changing the settings of matplotlib."""

from functools import cache
from typing import TYPE_CHECKING, Any

from matplotlib import rcParams
from matplotlib.figure import Figure
from matplotlib.font_manager import fontManager
from matplotlib.text import Text

from .style import FONTS

if TYPE_CHECKING:
    from matplotlib.backend_bases import RendererBase


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
