"""Figure of a mode shape: the speeds of the machines as arrows."""

import math
from typing import TYPE_CHECKING, Any

from stabctl.smallsignal import Mode, Part

from . import tooltips
from .style import COLORS, GRAY

if TYPE_CHECKING:
    from matplotlib.projections.polar import PolarAxes

NAMED = 4  # arrows with a number, on each side
SMALLEST_NAMED, SMALLEST_DRAWN = 0.1, 0.02
GAP = 17.0  # deg between numbers


def plot(mode: Mode, *, ax: "PolarAxes | None" = None) -> "PolarAxes":
    """Plot a mode shape as arrows, the largest of length 1, colored by the side of the swing.

    Parameters
    ----------
    mode
        The mode.
    ax
        Polar axes to draw on. Default: a new figure.

    Returns
    -------
    matplotlib.projections.polar.PolarAxes
        The largest arrows of each side carry the numbers of their machines.
    """
    ax = _new() if ax is None else ax
    ax.set(ylim=(0, 1), yticks=(0.5, 1), xticks=[math.pi * k / 2 for k in range(4)])
    ax.tick_params(labelbottom=False, labelleft=False)
    ax.grid(alpha=0.4)
    ax.spines["polar"].set_visible(False)
    parts = sorted(mode.shape, key=lambda p: -p.magnitude)
    lead = parts[0].angle_deg if parts else 0.0
    for p in reversed([p for p in parts if p.magnitude >= SMALLEST_DRAWN]):
        angle = math.radians(p.angle_deg)
        ax.plot((0, angle), (0, p.magnitude), color=_color(p, lead), linewidth=1.6, zorder=3)
        dot = ax.plot(angle, p.magnitude, "o", color=_color(p, lead), markersize=4, clip_on=False, zorder=3)[0]
        tooltips.name(dot, f"machine {p.machine}: {p.magnitude:.2f}, {p.angle_deg:.0f} degrees")
    large = [p for p in parts if p.magnitude >= SMALLEST_NAMED]
    named = [p for side in (True, False) for p in [p for p in large if _with(p, lead) is side][:NAMED]]
    for p, at in zip(named, spread([p.angle_deg for p in named], GAP), strict=True):
        rim, angle = math.radians(at), math.radians(p.angle_deg)
        ax.plot((angle, rim), (p.magnitude, 1.06), color=GRAY, linewidth=0.6, clip_on=False, zorder=2)
        text: Any = {"color": _color(p, lead), "ha": "center", "va": "center", "fontsize": "small"}
        ax.text(rim, 1.17, str(p.machine), **text)
    return ax


def spread(angles: list[float], gap: float) -> list[float]:
    """Move angles (deg) apart around the circle until they are at least `gap` apart, each group about its middle."""
    order = sorted(range(len(angles)), key=lambda i: angles[i] % 360)
    if not order:
        return []
    around = [angles[i] % 360 for i in order]
    widest = max(range(len(around)), key=lambda i: (around[i] - around[i - 1]) % 360 or 360)
    order = order[widest:] + order[:widest]
    groups: list[tuple[float, int]] = []  # first angle, number
    start = angles[order[0]] % 360
    for i in order:
        groups.append((start + (angles[i] % 360 - start) % 360, 1))
        while len(groups) > 1 and groups[-2][0] + gap * groups[-2][1] > groups[-1][0]:
            (a, m), (b, n) = groups[-2:]
            middle = (m * (a + gap * (m - 1) / 2) + n * (b + gap * (n - 1) / 2)) / (m + n)
            groups[-2:] = [(middle - gap * (m + n - 1) / 2, m + n)]
    placed = [first + gap * k for first, count in groups for k in range(count)]
    return [at for _, at in sorted(zip(order, placed, strict=True))]


def _new() -> "PolarAxes":
    """Polar axes with room for the numbers around the rim."""
    import matplotlib.pyplot as plt

    axes: Any = plt.figure(figsize=(3, 3)).add_axes((0.12, 0.12, 0.76, 0.76), projection="polar")
    return axes


def _with(p: Part, lead: float) -> bool:
    """Whether the machine moves with the largest arrow."""
    return math.cos(math.radians(p.angle_deg - lead)) >= 0


def _color(p: Part, lead: float) -> str:
    return COLORS[0] if _with(p, lead) else COLORS[1]
