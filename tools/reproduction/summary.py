"""The top of the page: how many results agree, which ones differ, and where each table and figure is."""

import re
from collections.abc import Sequence
from typing import NamedTuple

from .comparison import Comparison, Verdict
from .paper import RESULTS
from .study import Study


class Entry(NamedTuple):
    """A table or figure of the paper, and the study that reproduces it."""

    name: str
    shows: str
    study: Study | None


class Found(NamedTuple):
    """A comparison and the study it belongs to."""

    comparison: Comparison
    study: Study


def with_verdict(studies: Sequence[Study], verdict: Verdict) -> list[Found]:
    """Return the comparisons with a verdict."""
    return [Found(c, s) for s in studies for c in s.comparisons if c.verdict is verdict]


def counts(studies: Sequence[Study]) -> list[tuple[int, str]]:
    """Return how many results agree, and how well."""
    close = with_verdict(studies, Verdict.CLOSE)
    within = max((100 * abs(c.relative) for c, _ in close), default=0.0)
    return [
        (len(with_verdict(studies, Verdict.AS_PRINTED)), "results equal the paper's in every digit or word"),
        (len(close), f"more agree within {within:.2g} %" if within else "more agree within 1 %"),
        (len(with_verdict(studies, Verdict.DIFFERS)), "differ"),
        (len(with_verdict(studies, Verdict.GIVEN)), "inputs taken from the paper"),
    ]


def agreement(study: Study) -> str:
    """Return how many results of a study agree; empty if it compares none."""
    results = [c.verdict for c in study.comparisons if c.verdict is not Verdict.GIVEN]
    agree = len(results) - results.count(Verdict.DIFFERS)
    return f"{agree} of {len(results)} agree" if results else ""


def entries(studies: Sequence[Study]) -> list[Entry]:
    """Return every table and figure of the paper that has results, each with the first study that shows it."""
    places: dict[str, Study] = {}
    for study in studies:
        shown = {c.printed.where for c in study.comparisons} | {name for p in study.pictures for name in p.of}
        for name in RESULTS:
            if any(re.match(rf"{name}\b", where) for where in shown):
                places.setdefault(name, study)
    return [Entry(name, shows, places.get(name)) for name, shows in RESULTS.items()]
