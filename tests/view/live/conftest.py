"""The page of two_area in a browser, for the tests of this folder."""

import pytest
from live_page import START, browser, served, tab


@pytest.fixture(scope="module")
def address():
    with served("two_area") as found:
        yield found


@pytest.fixture(scope="module")
def chromium():
    with browser() as started:
        yield started


@pytest.fixture
def page(chromium, address):
    opened = tab(chromium, address + START)
    yield opened
    assert opened.logged == []
    opened.context.close()
