"""Labels of states, unique and in words, and of signals, which they name."""

import numpy as np
import pytest

from stabctl import io
from stabctl._util.errors import StudyError
from stabctl.dynamics import layout
from stabctl.dynamics.signals import INPUTS, OUTPUTS, chosen
from stabctl.smallsignal import analyze, feedback_locus


@pytest.mark.parametrize("name", io.packaged())
def test_labels_of_states_are_unique_words(point, name):
    labels = layout.unique(place.label for place in point(name).layout.states)
    assert len(set(labels)) == len(labels)
    assert not any("." in text for text in labels)


def test_a_repeated_label_is_numbered():
    assert layout.unique(["a", "b", "a", "a"]) == ("a", "b", "a (2)", "a (3)")


@pytest.mark.parametrize("name", ["two_area", "ieee39", "wscc9"])
def test_the_label_that_a_result_shows_names_the_same_signal(point, name):
    case = point(name).case
    for kinds in (INPUTS, OUTPUTS):
        for kind in kinds:
            if kinds[kind].place not in ("state", "device"):
                every = chosen(case, kind, kinds)
                assert chosen(case, [s.label for s in every], kinds) == every


def test_labels_of_groups_and_storage_devices_name_them(point):
    case = point("two_area").case.initialize(storage="50MW").case
    for names, kinds in ((["deviation:3+4", "absorbed:1@5", "flow:8-7"], OUTPUTS), (["order:1@5"], INPUTS)):
        signals = chosen(case, names, kinds)
        assert chosen(case, ", ".join(s.label for s in signals), kinds) == signals
    with pytest.raises(StudyError, match="is not an output"):
        chosen(case, "speed SEXS 1", OUTPUTS)  # no label: the machine is a GENROU


def test_residues_and_loci_take_names_and_labels(point):
    model = point("two_area").linearize(inputs="vref:2", outputs="speed:2, speed:1")
    modes, read, driven = analyze(model), "speed:1", "vref:2"
    by_label = modes.residues(model.outputs[1], model.inputs[0])
    assert np.array_equal(modes.residues(read, driven), by_label)
    assert np.array_equal(modes.residues(1, 0), by_label)
    assert str(feedback_locus(model, read, driven, [0, 1])) == str(feedback_locus(model, 1, 0, [0, 1]))
    with pytest.raises(StudyError, match="'speed:3' is not an output of the model"):
        modes.residues("speed:3", driven)
