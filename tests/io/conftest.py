"""A folder to spoil."""

import pytest
from case_folder import copied


@pytest.fixture
def folder(tmp_path):
    """A copy of two_area to spoil, with a storage and a link table."""
    return copied("two_area", tmp_path / "mine")
