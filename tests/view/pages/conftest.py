"""Pages in a browser; no figure outlives the test that draws it."""

import matplotlib.pyplot as plt
import pytest
from browser import browse  # noqa: F401


@pytest.fixture(autouse=True)
def closed():
    """Close all figures."""
    yield
    plt.close("all")
