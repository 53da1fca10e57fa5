"""What objects consist of: different where they do different things, and the same in every process."""

import math
import os
import subprocess
import sys
from dataclasses import dataclass

import pytest

from stabctl._util.content import content


class Curve:
    def __init__(self, func, gain):
        self.func, self.gain = func, gain


@dataclass(slots=True)
class Base:
    value: float


@dataclass(slots=True)
class Derived(Base):
    pass


def closed_over(value):
    return lambda: value


def empty():
    if False:
        missing = 1
    return lambda: missing


PAIRS = [
    (math.sin, math.cos),
    ({"shape": math.sin}, {"shape": math.atan}),
    (Curve(math.sin, 1), Curve(math.sin, 2)),
    (Curve(math.sin, 1), Curve(math.cos, 1)),
    (Derived(1.0), Derived(2.0)),
    (closed_over(1), closed_over(2)),
    ({1, 2}, {1, 3}),
    ({1, 2}, frozenset({1, 2})),
]


@pytest.mark.parametrize(("one", "other"), PAIRS, ids=range(len(PAIRS)))
def test_what_does_another_thing_has_another_text(one, other):
    assert content(one, None).text == content(one, None).text != content(other, None).text


def test_a_closure_that_holds_nothing_yet_is_read():
    assert content(empty(), None).text


@pytest.mark.slow
def test_sets_have_the_same_text_in_every_process():
    """Their order depends on the seed of hashes, which is another in every process."""
    code = (
        "import enum; from stabctl._util.content import content\n"
        "Kind = enum.Enum('Kind', 'A B C D', module='__main__')\n"
        "print(content([{Kind.A, Kind.B, Kind.C, Kind.D}, {'x', 'y', 'z'}], None).text)"
    )
    found = {
        subprocess.run(
            [sys.executable, "-c", code], env=os.environ | {"PYTHONHASHSEED": seed}, capture_output=True, check=True
        ).stdout
        for seed in "1234"
    }
    assert len(found) == 1
