"""A siting study that is kept in a store: interrupted and continued, it ends with the same fleet and the same rows."""

from dataclasses import replace

import pytest

from stabctl.controllers import BangBang
from stabctl.estimation.estimator_control import EstimatorControl
from stabctl.jobs.store import rows
from stabctl.jobs.task import text
from stabctl.placement._simulated import FLEET
from stabctl.placement.place import place
from stabctl.placement.siting import Costs
from stabctl.simulation.contingency import Contingency

STUDY = {"candidates": [(9, 29), (8, 25)], "observe": "2s", "costs": Costs(1.0, 0.0, 10.0)}


@pytest.fixture(scope="module")
def study(cases):
    case, wanted = cases("ieee39").classical(), [Contingency("29", "4.7cyc", "26-29")]
    return lambda **more: place(case, wanted, **STUDY, **more)


@pytest.fixture(scope="module")
def undisturbed(study):
    return study()


def finished(folder):
    return {row["key"]: (row["what"], row["finished"]) for row in rows(folder / "place.db", FLEET)}


@pytest.mark.slow
def test_an_interrupted_study_continues(study, undisturbed, tmp_path):
    def interrupt(runs, _cost):
        if runs > undisturbed.simulations / 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        study(store=tmp_path, workers=1, progress=interrupt)
    kept = finished(tmp_path)
    assert len(kept) > 10
    found = study(store=tmp_path)
    assert replace(found, wall_s=0.0) == replace(undisturbed, wall_s=0.0)
    now = finished(tmp_path)
    assert kept.items() < now.items()  # not simulated again
    assert {what for what, _ in now.values()} == {"outcome", "peak", "energy", "critical time"}
    study(store=tmp_path)
    assert finished(tmp_path) == now


def test_a_law_is_identified_by_what_it_holds():
    laws = BangBang(), BangBang(0.2), EstimatorControl(), EstimatorControl(seed=2), EstimatorControl(BangBang(0.2))
    assert len({text(law) for law in laws}) == len(laws)
    assert text(EstimatorControl()) == text(EstimatorControl())
