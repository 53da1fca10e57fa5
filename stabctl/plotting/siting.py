"""Figures of a siting study: megawatts by site beside the uniform fleet's, cost by round."""

from typing import TYPE_CHECKING

from stabctl.placement.siting import Siting

from .style import COLOURS, figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH = 5.2  # inches   letters stay readable on a phone
FOUND, UNIFORM = COLOURS[0], "0.72"


def sizes(siting: Siting) -> "Figure":
    """Megawatts at every candidate, largest first, and those of the uniform fleet at the same place."""
    mw = {(s.bus, s.machine): s.mw for s in siting.sites}
    places = sorted(siting.places, key=lambda p: (mw.get((p.bus, p.machine), 0.0), p.uniform_mw or 0.0), reverse=True)
    rows = range(len(places))
    fig, axes = figure(WIDTH, 1.1 + 0.27 * len(places))
    ax = axes[0, 0]
    found = [mw.get((p.bus, p.machine), 0.0) for p in places]
    ax.barh([k - 0.2 for k in rows], found, 0.4, color=FOUND, label="found")
    if siting.uniform_mw is not None:
        even = [p.uniform_mw or 0.0 for p in places]
        ax.barh([k + 0.2 for k in rows], even, 0.4, color=UNIFORM, label="uniform")
    ax.set_yticks(list(rows), [f"machine {p.machine} at {p.bus}" for p in places])
    ax.set_ylim(len(places) - 0.4, -0.6)
    ax.grid(visible=False, axis="y")
    ax.set_xlabel("MW")
    fig.legend(loc="outside upper right", ncols=2, frameon=False)
    return fig


def history(siting: Siting) -> "Figure":
    """Cost by round: what the master planned, what it took to survive everything, the best so far."""
    rounds = range(1, len(siting.history) + 1)
    fig, axes = figure(WIDTH, 3.4)
    ax = axes[0, 0]
    drawn = {
        "planned": ([r.planned for r in siting.history], {"marker": "v", "color": COLOURS[4]}),
        "scaled until it survives": ([r.reached for r in siting.history], {"marker": "o", "color": COLOURS[1]}),
        "best so far": ([r.best for r in siting.history], {"drawstyle": "steps-post", "color": COLOURS[0]}),
    }
    for name, (costs, look) in drawn.items():
        ax.plot(rounds, costs, label=name, markersize=4, linewidth=1.3, **look)
    ax.axhline(siting.lower_bound, color="0.4", linestyle="--", linewidth=1, label="estimated bound")
    ax.xaxis.get_major_locator().set_params(integer=True)
    ax.set_xlabel("round")
    ax.set_ylabel("cost" if siting.lower_bound_mw is None or siting.costs.mw != 1 else "MW")
    fig.legend(loc="outside upper center", ncols=2, frameon=False, fontsize="small")
    return fig
