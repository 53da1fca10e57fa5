"""The fleets in the table of docs/placement.md, computed and kept: python tools/placement_results.py [NAME].

The record is tests/placement/results.json; with a NAME only that row is computed again. Tests compare the page with the
record, and new fleets with it.
"""

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import stabctl as st
from stabctl._util import files
from stabctl.clearing.trial import QUIET
from stabctl.io.contingencies.toml import read
from stabctl.placement.contingencies import packaged
from stabctl.placement.evidence import MARGINS
from stabctl.placement.siting import Siting

RECORD = Path(__file__).parents[1] / "tests" / "placement" / "results.json"


class Study(NamedTuple):
    """A packaged case and how many of its contingencies are survived."""

    case: str
    classical: bool
    contingencies: int


STUDIES = {
    "nine, classical": Study("ieee39", True, 9),
    "six, classical": Study("ieee39", True, 6),
    "nine, full order": Study("ieee39", False, 9),
}


ESTIMATED = {"nine, full order"}  # also with a Kalman filter


def placed(study: Study) -> Siting:
    """The fleet of a study."""
    case = st.load(study.case)
    case = case.classical() if study.classical else case
    return st.place(case, read(packaged(study.case, study.classical) or "", case)[: study.contingencies])


def record(found: Siting) -> dict[str, Any]:
    """The numbers of a fleet that the page shows."""
    return {
        "uniform_mw": found.uniform_mw,
        "total_mw": found.total_mw,
        "sites": len(found.sites),
        "cuts_mw": found.cuts_mw,
        "refined": next(row.scale for row in found.evidence if row.refined and not row.lost),
    }


def with_kalman(study: Study, found: Siting) -> float | None:
    """The smallest multiple of a fleet that survives with a Kalman filter of PMU reports; None if none tried does."""
    case = st.load(study.case)
    control = st.EstimatorControl(engine="batched")
    for more in MARGINS:
        fleet = [s._replace(rating=more * s.rating) for s in found.storage()]
        point = case.with_storage(fleet).initialize()
        runs = (
            point.simulate(
                replace(row.contingency, at=QUIET),
                QUIET + (row.target_cycles or 0.0) / case.frequency_hz + found.observed_s,
                control=control,
                record=False,
            )
            for row in found.contingencies
        )
        if all(run.outcome.stable for run in runs):
            return more
    return None


def main(names: list[str]) -> None:
    """Compute the rows and write the record."""
    known = json.loads(RECORD.read_text(encoding="utf-8")) if RECORD.exists() else {}
    for name in names or STUDIES:
        study = STUDIES[name]
        found = placed(study)
        known[name] = record(found)
        if name in ESTIMATED:
            known[name]["with_kalman"] = with_kalman(study, found)
        files.replace(RECORD, json.dumps(known, indent=1) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
