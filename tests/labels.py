"""Labels of a figure that lie over each other or reach out of it."""

from itertools import combinations

import pytest
from matplotlib.text import Text

SLACK = 0.5  # pixels


def crowded(drawn):
    """Texts of a figure (or of the figure of axes) that overlap, in pairs, and those that are cut off, as drawn."""
    figure, texts, original = drawn.figure, [], Text.draw

    def draw(text, renderer):
        if text.get_visible() and text.get_text():
            texts.append((text.get_text(), Text.get_window_extent(text, renderer)))
        original(text, renderer)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Text, "draw", draw)
        figure.canvas.draw()
    pairs = ((a, b) for a, b in combinations(texts, 2) if _over(a[1], b[1]))
    return [(a[0], b[0]) for a, b in pairs] + [text for text, box in texts if _out(box, figure.bbox)]


def _over(a, b):
    return min(a.x1, b.x1) - max(a.x0, b.x0) > SLACK and min(a.y1, b.y1) - max(a.y0, b.y0) > SLACK


def _out(box, page):
    return box.x0 < page.x0 - SLACK or box.y0 < page.y0 - SLACK or box.x1 > page.x1 + SLACK or box.y1 > page.y1 + SLACK
