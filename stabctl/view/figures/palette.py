"""Fonts, colors and labels of figures and pages, read from `style.toml`; without matplotlib."""

import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.colors import LinearSegmentedColormap


LOOK: dict[str, Any] = tomllib.loads((Path(__file__).parent / "style.toml").read_text(encoding="utf-8"))
FONTS: tuple[str, ...] = tuple(LOOK["fonts"])
LABELS: dict[str, str] = LOOK["labels"]
COLORS: tuple[str, ...] = tuple(LOOK["figures"]["cycle"])
GRAY, INK, MANY = (LOOK["figures"][name] for name in ("gray", "ink", "many"))
AREAS = (*COLORS[:5], COLORS[7], GRAY)  # of coherent areas; different from each other on light and dark paper
VOLTAGES: list[tuple[float, str]] = [(v, color) for v, color in LOOK["figures"]["voltages"]]
CLEARING: list[str] = LOOK["figures"]["clearing"]


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
