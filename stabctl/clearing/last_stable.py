"""The last stable clearing time of a grid in few runs: extrapolated from unstable runs, which end early."""

from collections.abc import Callable, Iterable, Mapping
from typing import Literal, NamedTuple

from .margin import Margin
from .search import NO_SCAN, Scan
from .trial import Run

Status = Literal["found", "unstable_at_zero", "stable_at_limit"]
FORETOLD = 10  # runs after which the interval is only bisected
HELD = 3.0  # energy the network absorbs, relative to that of the run at clearing; errs on the unstable side
REACH = 2.0  # how far below two unstable runs their extrapolation is trusted, in multiples of their spacing
PATIENCE = 5  # unstable runs without a stable one, after which the fault cleared immediately is tried
UPPER = 2 / 3  # where an interval is divided: an unstable run costs about a third of a stable one


class Found(NamedTuple):
    """The answer on the grid."""

    status: Status
    critical: int  # last stable point; 0 if there is none
    runs: dict[int, Run]  # by point of the grid

    @property
    def machine(self) -> int | str | None:
        """Machine that loses synchronism first just beyond."""
        beyond = self.runs.get(0 if self.status == "unstable_at_zero" else self.critical + 1)
        return beyond.machine if beyond else None


def last_stable(
    attempt: Callable[[int], Run],
    last: int,
    guess: int,
    stride: int,
    *,
    always: Scan,
    lasting: Scan = NO_SCAN,
    coarse: int = 1,
) -> Found:
    """The last stable point of the grid 0 ... `last` before the lowest unstable one found: a run at each of the two.

    Starts at a guess and moves up in growing steps. The excess energy of unstable runs is extrapolated to zero over the
    square of the clearing time; if that does not help, the interval is divided. Shorter faults are tried as well: if
    one is unstable, in a later swing, the answer lies below it. They are those of `always`, and those of `lasting`
    unless the swings of the answer are calm; the nearer half of them if the swings have settled, and none if the answer
    is the last point of the grid, too. Multiples of `coarse` come before the points between them, so that a finer grid
    gives the same answer, only finer.
    """
    tried: dict[int, Run] = {}
    low, high = -1, last + 1
    k = min(max(guess, 0), last)
    while True:
        tried[k] = attempt(k)
        if tried[k].stable:
            low = max(low, k)
        else:
            high = k
            low = max((s for s, run in tried.items() if run.stable and s < k), default=-1)
        if high - low > 1:
            k, stride = _multiple(_next(low, high, last, tried, stride), low, high, coarse), 2 * stride
        elif low < 1:
            break
        else:
            swings = tried[low].swings
            settled, calm = swings is not None and swings.settled, swings is not None and swings.calm
            number = 0 if calm or (settled and low == last) else -(-lasting.number // 2) if settled else lasting.number
            gap = _gap(low, tried, always) or _gap(low, tried, lasting._replace(number=number))
            if not gap:
                break
            k = max(low - gap, 0)
    if low < 0:
        return Found("unstable_at_zero", 0, tried)
    return Found("stable_at_limit" if low == last else "found", low, tried)


def _multiple(k: int, low: int, high: int, spacing: int) -> int:
    """The multiple of the spacing nearest to k between low and high; k itself if there is none."""
    least, most = (low // spacing + 1) * spacing, (high - 1) // spacing * spacing
    return min(max(round(k / spacing) * spacing, least), most) if least <= most else k


def _gap(low: int, tried: Iterable[int], scan: Scan) -> int:
    """The first distance below the answer near which nothing was tried, 0 if there is none."""
    for n in range(1, scan.number + 1):
        far, near = low - n * scan.spacing, low - (n - 1) * scan.spacing
        if near > 0 and not any(far <= s < near for s in tried):
            return low - far
    return 0


def _next(low: int, high: int, last: int, tried: Mapping[int, Run], stride: int) -> int:
    """The point to try: the lowest that is predicted to be unstable."""
    if high > last:
        return min(last, low + stride)
    if low < 0 and len(tried) >= PATIENCE:
        return 0
    cut = min(low + max(1, round(UPPER * (high - low))), high - 1)
    if tried[high].margin is None or len(tried) > FORETOLD:
        return max(cut, high - stride) if low < 0 else cut
    foretold = _critical({k: run.margin for k, run in tried.items() if run.margin and k >= high})
    return min(max(int(foretold) + 1, low + 1), high - 1) if foretold > low else cut


def _critical(lost: Mapping[int, Margin]) -> float:
    """Where the excess of the unstable runs goes to zero, on the grid."""
    near, *others = sorted(lost)
    excess, given = lost[near]
    slope, least = (HELD * given / near**2 if near else 0.0), 0.0
    if others and lost[others[0]].excess > excess:
        further = others[0]
        slope = (lost[further].excess - excess) / (further**2 - near**2)
        least = max(near - REACH * (further - near), 0.0)
    return max(near**2 - excess / slope, least**2) ** 0.5 if slope > 0 else float(near)
