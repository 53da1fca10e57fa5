"""The page of `stabctl live` in a headless Chromium."""

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from contextlib import contextmanager

import pytest
from browser import PROGRAMS


def program():
    """The system's browser. Without one the test is skipped, but on CI it fails."""
    found = next(filter(None, map(shutil.which, PROGRAMS)), None)
    if found is None:
        said = f"no browser: none of {', '.join(PROGRAMS)} is installed"
        (pytest.fail if os.environ.get("CI") else pytest.skip)(said)
    return found


START = "#fault=7-8%400.5&trip=&clear=6"  # of two_area


@contextmanager
def served(*words):
    """Run `stabctl live` with these arguments; gives the address of the page."""
    command = [sys.executable, "-m", "stabctl", "live", *words, "--no-browser"]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        address = server.stdout.readline().strip()
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/[\w-]{20,}/", address), server.stderr.read()
        yield address
    finally:
        server.send_signal(signal.SIGINT)
        server.wait(20)
        server.stdout.close()
        server.stderr.close()


@contextmanager
def browser():
    """A headless browser."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as play:
        started = play.chromium.launch(executable_path=program(), args=["--no-sandbox"])
        try:
            yield started
        finally:
            started.close()


@contextmanager
def opened(address, width=1280, height=900, scheme="light"):
    """The page of an address in a browser of its own."""
    with browser() as started:
        yield tab(started, address, width, height, scheme)


def tab(started, address, width=1280, height=900, scheme="light"):
    """The interactive page of an address, with its first run drawn."""
    page = page_of(started, address, width, height, scheme)
    until(page, "typeof live === 'object' && !!live.run")
    return page


def page_of(started, address, width=1280, height=900, scheme="light"):
    """A page of an address; what it logs is in `logged`."""
    context = started.new_context(viewport={"width": width, "height": height}, color_scheme=scheme)
    page = context.new_page()
    page.logged = []
    page.on("console", lambda message: page.logged.append(message.text))
    page.on("pageerror", lambda error: page.logged.append(str(error)))
    page.goto(address)
    return page


def until(page, condition, seconds=30):
    """Wait for a condition; the page forbids to evaluate text, so it is asked from outside."""
    end = time.monotonic() + seconds
    while not page.evaluate(condition):
        assert time.monotonic() < end, f"not within {seconds} s: {condition}; {page.logged}"
        page.wait_for_timeout(10)
