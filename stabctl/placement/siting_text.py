"""A siting result in sentences."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from stabctl._util.wording import counted
from stabctl.controllers import BangBang

from .siting_rows import REFINED, Evidence, Infeasible, Survived

if TYPE_CHECKING:
    from .siting import Siting

SLACK = 1e-6  # largest violation of a cut that is rounding


def remarks(siting: "Siting") -> tuple[str, ...]:
    """The fleet, what it is compared with, and what is left open."""
    survived = counted(len(siting.contingencies), "contingency")
    rows: list[Survived | Infeasible] = [*siting.contingencies, *siting.infeasible]
    if any(row.operating_point or row.out for row in rows):
        survived = counted(len(siting.contingencies), "scenario")
    if siting.infeasible:
        survived += f" of {len(siting.contingencies) + len(siting.infeasible)}"
    first = (
        f"{siting.case}: {counted(len(siting.sites), 'site')} with {siting.total_mw:.1f} MW and "
        f"{1e3 * siting.total_mwh:.0f} kWh survive {survived}, each observed {siting.observed_s:g} s after clearing "
        f"({counted(siting.simulations, 'simulation')} in {siting.wall_s:.1f} s)."
    )
    if siting.infeasible:
        left_out = "; ".join(one.label for one in siting.infeasible)
        first += f" No fleet within the caps was found that survives {left_out}."
    targets = (siting.targets,) if siting.targets else ()
    return (
        first,
        *targets,
        *_converters(siting),
        *_existing(siting),
        *_controllers(siting),
        *_comparisons(siting),
        *_bound(siting),
        *reservations(siting),
    )


def sites(siting: "Siting") -> Iterator[str]:
    """The rows of the table of sites, with MVA where there are converters."""
    rated = bool(siting.converters) or any(s.mva not in (0.0, s.mw) for s in siting.sites)
    heads = "      MVA " if rated else "", "  MVA set by" if siting.converters else ""
    yield f"   bus machine        MW {heads[0]}      kWh{heads[1]}"
    for s in siting.sites:
        mva = f"{s.mva or s.mw:9.2f} " if rated else ""
        yield f"{s.bus:6d} {s.machine:7d} {s.size:>9s} {mva}{1e3 * s.mwh:9.1f}{'  ' if s.set_by else ''}{s.set_by}"


def _converters(siting: "Siting") -> Iterator[str]:
    """The MVA of the converters, and how far the contingencies use them."""
    found = siting.converters
    if not found:
        return
    limited, rest = [s for s in found if s.limited], [s for s in found if not s.limited]
    share = siting.total_mva / siting.total_mw
    yield f"The converters have {siting.total_mva:.1f} MVA in all, {100 * share:.0f} % of the MW."
    if limited:
        voltages = sorted(s.voltage or 0.0 for s in limited)
        given = sorted(100 * (s.limit or 0.0) * (s.voltage or 0.0) * (s.mva or s.mw) / s.mw for s in limited)
        yield (
            f"The current limit is reached at {len(limited)} of {counted(len(found), 'site')}, down to voltages of "
            f"{_range(voltages, '.2f')} pu, at which it allows {_range(given, '.0f')} % of the MW."
        )
    if rest:
        free = min(1 - (s.current or 0.0) / (s.limit or 1.0) for s in rest)
        others = "The others have" if limited else "All have"
        yield f"{others} at least {100 * free:.2g} % of the current to spare in every contingency."


def _range(values: list[float], form: str) -> str:
    """The least and the largest of ascending values, or the only one."""
    ends = list(dict.fromkeys(f"{x:{form}}" for x in (values[0], values[-1])))
    return " to ".join(ends)


def _existing(siting: "Siting") -> Iterator[str]:
    if siting.existing:
        total = sum(s.rating for s in siting.existing)
        yield f"{counted(len(siting.existing), 'existing device')} with {total:.1f} MW in all are kept."


def _controllers(siting: "Siting") -> Iterator[str]:
    if siting.law and siting.law != str(BangBang()):
        yield f"The devices follow the law {siting.law}."
    if siting.controllers:
        yield f"In every simulation act {'; '.join(siting.controllers)}."


def _comparisons(siting: "Siting") -> Iterator[str]:
    """The uniform fleet and the allocation by linear analysis."""
    if siting.uniform_mw == 0:
        yield f"The system survives every contingency even without {'further ' * bool(siting.existing)}storage."
    elif siting.uniform_mw:
        yield (
            f"A uniform fleet would need at least {siting.uniform_mw:.1f} MW ({siting.uniform_percent:.2f} % of every "
            f"machine's MVA); this fleet needs {siting.percent_of_uniform:.0f} % of that."
        )
    else:
        yield "No uniform fleet within the caps is sufficient."
    if siting.linear_mw:
        yield f"The allocation by linear analysis needs {siting.linear_mw:.1f} MW."
    elif siting.linear_mw is None:
        yield "No multiple of the allocation by linear analysis within the caps is sufficient."
    if siting.tolerance is not None and (siting.uniform_mw or siting.linear_mw):
        yield "The uniform fleet and the linear allocation are sized without the tolerance."


def _bound(siting: "Siting") -> Iterator[str]:
    if not siting.cost:
        return
    if siting.lower_bound is None or siting.gap is None:
        yield f"Cost {siting.cost:.5g}, without a lower bound, because the solver failed."
        return
    yield (
        f"Cost {siting.cost:.5g}, estimated lower bound {siting.lower_bound:.5g} ({100 * siting.gap:.1f} % lower). "
        "The bound is an estimate, because the set of surviving fleets need not be convex."
    )


def reservations(siting: "Siting") -> tuple[str, ...]:
    """What the fleet does not survive, what the solver missed, and which smaller fleets are sufficient."""
    said = [*(f"Not survived: {one}" for one in siting.infeasible), *_solver(siting)]
    for row in siting.evidence:
        if row.refined:
            fleet = "this fleet" if row.scale == 1 else f"{row.scale:g} times this fleet"
            fleet = fleet if siting.sites else "the system without storage"
            lost = _lost(siting, row)
            said.append(
                f"With {REFINED}, {fleet} does not survive {lost}; use a longer observation window."
                if lost
                else f"With {REFINED}, {fleet} survives every contingency."
            )
    said += _other_sizes(siting)
    also = "survives every contingency too, so a smaller fleet is possible"
    said += [f"The fleet {row.fleet} {also}." for row in siting.smaller]
    return tuple(said)


def _other_sizes(siting: "Siting") -> Iterator[str]:
    """What the fleet does not survive if one device alone is smaller or larger."""
    rows = [row for row in siting.evidence if row.site]
    if rows and not any(row.lost for row in rows):
        changed = 100 * abs(rows[0].scale - 1)
        yield f"The fleet survives every contingency also if any one site has {changed:g} % less or more."
        return
    for less in (False, True):
        tried = [row for row in rows if (row.scale < 1) == less]
        if lost := [row for row in tried if row.lost]:
            changed, count = 100 * abs(lost[0].scale - 1), counted(len(tried), "site")
            named = "; ".join(f"{row.site} loses {_lost(siting, row)}" for row in lost)
            yield (
                f"With {changed:g} % {'less' if less else 'more'} at one site alone, the fleet is not sufficient for "
                f"{len(lost)} of {count}: {named}."
            )


def _lost(siting: "Siting", row: Evidence) -> str:
    """The scenarios that a variant of the fleet does not survive."""
    return ", ".join(c.label for c, ok in zip(siting.contingencies, row.stable, strict=True) if not ok)


def _solver(siting: "Siting") -> Iterator[str]:
    """Programs that the solver did not solve accurately, could not solve, or solved with violated cuts."""
    count = counted(len(siting.history), "iteration")
    for i, row in enumerate(siting.history, start=1):
        if row.failed:
            yield (
                f"The solver failed in iteration {i} ({row.status}); the search ended there, and the fleet is the best "
                "one found until then."
            )
    inaccurate = sum(row.status == "optimal_inaccurate" for row in siting.history)
    if inaccurate:
        yield (
            f"In {inaccurate} of {count} the solver did not reach its tolerances (optimal_inaccurate); each fleet was "
            "simulated nevertheless, but the bound may be inaccurate."
        )
    slack = [row.slack for row in siting.history if row.slack > SLACK]
    if slack:
        yield (
            f"In {len(slack)} of {count} no fleet within the caps, sites and trust region satisfied every cut (largest "
            f"violation {100 * max(slack):.3g} % of the contribution of one device)."
        )
