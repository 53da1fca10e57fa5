"""Counting and searching at the same time: the same modes, and nothing left behind."""

import threading
import time

import numpy as np
import pytest

from stabctl.smallsignal import _band_search, analyze, descriptor, eigen
from stabctl.smallsignal._band_search import Background


@pytest.fixture
def two_threads(monkeypatch):
    monkeypatch.setattr(_band_search, "TWO_THREADS", 1)
    monkeypatch.setattr("stabctl._util.process.available", lambda: 2)


def alike(one, two):
    return all(np.array_equal(getattr(one, part), getattr(two, part)) for part in ("eigenvalues", "right", "left"))


@pytest.mark.parametrize("first", ["count", "search"])
def test_two_threads_find_the_same_modes_as_one(point, monkeypatch, two_threads, first):
    """To the last bit, also if the count ends long before or after the search."""
    with monkeypatch.context() as patch:
        patch.setattr(_band_search, "TWO_THREADS", 10**9)
        one = analyze(descriptor(point("ieee39")), (0.1, 2.5))
    slow = (_band_search, "_counted") if first == "search" else (eigen, "near")
    monkeypatch.setattr(*slow, delayed(getattr(*slow)))
    two = analyze(descriptor(point("ieee39")), (0.1, 2.5))
    assert one.certified
    assert two.counted == one.counted
    assert alike(one, two)


def delayed(work):
    def later(*arguments):
        time.sleep(0.5)
        return work(*arguments)

    return later


def test_two_threads_with_a_mode_on_the_edge(point, modes, monkeypatch, two_threads):
    """The band is made wider by the count, after the search began."""
    every = modes("ieee39")
    k = every.swings()[3]
    band = (float(every.frequency_hz[k]) * (1 - 1e-9), 2.5)
    two = analyze(descriptor(point("ieee39")), band)
    monkeypatch.setattr(_band_search, "TWO_THREADS", 10**9)
    assert two.certified
    assert alike(analyze(descriptor(point("ieee39")), band), two)


def test_progress_of_both_grows(point, two_threads):
    said = []
    analyze(descriptor(point("ieee39")), (0.1, 2.5), said=said.append)
    assert said == sorted(said)
    assert 0 <= said[0] <= said[-1] <= 1


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_an_interrupt_ends_the_other_thread(point, monkeypatch, two_threads, error):
    before = threading.active_count()

    def near(*_):
        raise error

    monkeypatch.setattr(eigen, "near", near)
    with pytest.raises(error):
        analyze(descriptor(point("ieee39")), (0.1, 2.5))
    until = time.monotonic() + (20 if error is KeyboardInterrupt else 0)  # Ctrl-C does not wait for it
    while threading.active_count() > before and time.monotonic() < until:
        time.sleep(0.05)
    assert threading.active_count() == before


def test_an_error_of_the_count_is_raised(point, monkeypatch, two_threads):
    before = threading.active_count()

    def count(*_):
        raise ValueError("count")

    monkeypatch.setattr(_band_search, "count", count)
    with pytest.raises(ValueError, match="count"):
        analyze(descriptor(point("ieee39")), (0.1, 2.5))
    assert threading.active_count() == before


def test_a_computation_left_ends_when_it_reports():
    def endless(said):
        while True:
            said(0.5)
            time.sleep(0.001)

    with Background(endless) as work:
        while work.part == 0:
            time.sleep(0.001)
        assert not work.ended()
    assert work.ended()
