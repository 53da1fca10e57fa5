"""Figures of a siting study: ratings by site compared with the uniform fleet, and cost by iteration."""

import math
from typing import TYPE_CHECKING, Any

from stabctl.placement.siting import Siting

from . import style
from .palette import COLORS, GRAY
from .style import ranked, single

if TYPE_CHECKING:
    from matplotlib.axes import Axes


WIDTH = 5.2  # inches; letters stay readable on a phone


def plot(siting: Siting, *, ax: "Axes | None" = None) -> "Axes":
    """Plot the rating at every candidate site, largest first, and that of the uniform fleet.

    Parameters
    ----------
    siting
        The result of a siting study.
    ax
        Axes to draw on. Default: a new figure.

    Returns
    -------
    matplotlib.axes.Axes

    Examples
    --------
    >>> wanted = st.Contingency("7-8@0.4", clear="22cyc")
    >>> found = st.place(st.load("two_area"), wanted, candidates=[(1, 5)], observe="2s")
    >>> found.plot().figure.savefig("siting.png")
    """
    mw = {(s.bus, s.machine): s.mw for s in siting.sites}
    size = {p: (mw.get((p.bus, p.machine), 0.0), p.uniform_mw or 0.0) for p in siting.candidates}
    places = sorted(size, key=size.__getitem__, reverse=True)
    rows = range(len(places))
    ax = single(ax, WIDTH, 1.2 + 0.27 * len(places))
    found = [mw.get((p.bus, p.machine), 0.0) for p in places]
    _bars(ax, [k - 0.2 for k in rows], found, color=COLORS[0], label="optimized")
    if siting.uniform_mw is not None:
        even = [p.uniform_mw or 0.0 for p in places]
        _bars(ax, [k + 0.2 for k in rows], even, color=GRAY, alpha=0.5, label="uniform")
    ranked(ax, [f"machine {p.machine}, bus {p.bus}" for p in places])
    ax.set_xlabel("storage rating (MW)")
    ax.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=2, frameon=False)
    return ax


def _bars(ax: "Axes", rows: list[float], mw: list[float], **look: Any) -> None:
    """Bars that name their megawatts."""
    for bar, size in zip(ax.barh(rows, mw, 0.4, **look), mw, strict=True):
        style.name(bar, f"{look['label']}: {size:.1f} MW")


def convergence(siting: Siting, *, ax: "Axes | None" = None) -> "Axes":
    """Plot the cost of the fleet at each iteration of the siting program; arguments as for `plot`."""
    rounds = range(1, len(siting.history) + 1)
    ax = single(ax, WIDTH, 3.4)
    drawn: dict[str, tuple[list[float], Any]] = {
        "plan": ([r.planned for r in siting.history], {"marker": "v", "color": COLORS[4]}),
        "plan scaled until stable": ([r.reached for r in siting.history], {"marker": "o", "color": COLORS[1]}),
        "best so far": ([r.best for r in siting.history], {"drawstyle": "steps-post", "color": COLORS[0]}),
    }
    for name, (costs, look) in drawn.items():
        line = ax.plot(rounds, costs, label=name, markersize=4, linewidth=1.3, **look)[0]
        if "marker" in look:
            pairs = [(k, c) for k, c in zip(rounds, costs, strict=True) if math.isfinite(c)]
            style.name(line, [f"{name}, iteration {k}: {c:.4g}" for k, c in pairs])
    if siting.cuts_cost is not None:
        ax.axhline(siting.cuts_cost, color=GRAY, linestyle="--", linewidth=1, label="cost that the cuts allow")
    ax.locator_params(axis="x", integer=True)
    ax.set_xlabel("iteration")
    ax.set_ylabel("cost" if siting.cuts_mw is None or siting.costs.mw != 1 else "total rating (MW)")
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=2, frameon=False, fontsize="small")
    return ax
