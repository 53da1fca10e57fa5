"""Names of states: unique, and in words."""

import pytest

from stabctl import io
from stabctl.dynamics import layout


@pytest.mark.parametrize("name", io.packaged())
def test_labels_of_states_are_unique_words(point, name):
    labels = layout.unique(place.label for place in point(name).layout.states)
    assert len(set(labels)) == len(labels)
    assert not any("." in text for text in labels)


def test_a_repeated_label_is_numbered():
    assert layout.unique(["a", "b", "a", "a"]) == ("a", "b", "a (2)", "a (3)")
