"""How many workers a study uses."""

import os

import pytest

from stabctl._util import process
from stabctl._util.errors import StudyError


def test_workers_are_those_asked_for_or_one_per_core() -> None:
    assert process.used(3) == 3
    assert 1 <= process.used(None) == process.available() <= os.cpu_count()


@pytest.mark.parametrize("workers", [0, -1])
def test_no_workers_are_refused(workers: int) -> None:
    with pytest.raises(StudyError, match="workers are not allowed"):
        process.used(workers)
