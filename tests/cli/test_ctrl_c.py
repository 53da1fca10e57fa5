"""Ctrl-C ends a command at once, whatever it computes, and a long command says how far it is."""

import os
import signal
import subprocess
import sys
import time

import pytest

import stabctl as st
from stabctl.cli import shared

SOON = """
from stabctl.cli import shared
from stabctl.__main__ import main
shared.EVERY = 0.5  # s   between two lines of progress; 30 otherwise
main()
"""
AT_ONCE = 2 + 4  # s   and what a loaded machine may add; without the cause of this test 45 s


def interrupted(*words, after):
    """A command that gets SIGINT once `after(process)` returns: exit code, the last line on stderr, time to the end."""
    ran = subprocess.Popen([sys.executable, "-c", SOON, *words], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    try:
        after(ran)
        assert ran.poll() is None, "it ended by itself"
        sent = time.monotonic()
        os.kill(ran.pid, signal.SIGINT)
        _, said = ran.communicate(timeout=120)
        return ran.returncode, said.decode().splitlines()[-1], time.monotonic() - sent
    finally:
        ran.kill()


def running(ran):
    """Wait for the line that says how far a simulation, or a screen, is."""
    while not any(word in ran.stderr.readline() for word in (b"simulating", b"screening")):
        assert ran.poll() is None


@pytest.mark.slow
def test_ctrl_c_in_the_middle_of_a_simulation():
    """Numba crashed when it was raised while a result of the compiled loop became a Python object (exit code -11)."""
    code, said, took = interrupted("simulate", "wnaps", "--loads", "power", "--until", "200000s", after=running)
    assert (code, said) == (130, "stabctl: interrupted.")
    assert took < AT_ONCE  # 0.3 s


@pytest.mark.slow
@pytest.mark.parametrize("kept", [False, True])
def test_ctrl_c_in_a_screen_whose_jobs_are_long(tmp_path, kept):
    st.write(st.replicate(st.load("wnaps"), 6), tmp_path / "case")
    store = ("--store", str(tmp_path / "store")) if kept else ()
    words = "screen", str(tmp_path / "case"), "--loads", "power", "--observe", "20s", *store
    st.load(tmp_path / "case").with_loads("power").initialize().simulate(st.Contingency("83", clear="1cyc"), "2s")
    code, said, took = interrupted(*words, after=running)
    assert code == 130
    assert (f"kept in {tmp_path / 'store' / 'screen.db'}" if kept else "with --store FOLDER") in said
    assert took < AT_ONCE  # 0.1 s


def test_where_there_is_no_terminal_progress_is_a_line_now_and_then(monkeypatch, capsys):
    monkeypatch.setattr(shared, "EVERY", 0.05)
    with shared.progress("siting", None) as tell:
        tell(None, "12 simulations")
        time.sleep(0.3)
    assert "stabctl: siting 12 simulations: after 0 s" in capsys.readouterr().err.splitlines()
    time.sleep(0.1)
    assert capsys.readouterr().err == ""


def test_a_long_search_says_how_long_after_the_first_runs(monkeypatch, capsys):
    now = [0.0]
    monkeypatch.setattr(shared.time, "monotonic", lambda: now[0])
    with shared.progress("screening", 1.0) as tell:
        for now[0], done in ((0.5, 0.5), (8.5, 0.54), (9.0, 0.55)):  # what a store has comes at once
            tell(done)
    assert capsys.readouterr().err == "stabctl: screening: 54 % after 8 s, about 92 s left\n"
