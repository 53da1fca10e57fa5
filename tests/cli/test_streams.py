"""Terminals, pipes and streams of every kind, and Ctrl-C at any instant."""

import io
import os
import subprocess
import sys

import pytest

from stabctl._util import jit

INTERRUPT = """
import builtins, os, signal, sys
plain = builtins.__import__
def interrupt(name, *rest, **more):
    if name == {module!r}:
        builtins.__import__ = plain
        os.kill(os.getpid(), signal.SIGINT)
    return plain(name, *rest, **more)
signal.signal(signal.SIGINT, signal.default_int_handler)
from stabctl.__main__ import main
builtins.__import__ = interrupt
sys.argv = ["stabctl", "powerflow", "two_area"]
main()
"""


def shell(command):
    """Exit code, stdout and stderr of a shell command; "$stabctl" runs the program."""
    run = f"{sys.executable} -m stabctl"
    found = subprocess.run(["bash", "-c", command], env=os.environ | {"stabctl": run}, capture_output=True, text=True)
    return found.returncode, found.stdout, found.stderr


@pytest.mark.parametrize("columns", ["0", " 0 ", "-1", "x", ""])
def test_a_terminal_of_unknown_width_shows_everything(stabctl, monkeypatch, columns):
    monkeypatch.setenv("COLUMNS", columns)
    code, out, err = stabctl("cases")
    assert (code, err) == (0, "")
    assert "two_area_thyristor" in out


def test_a_reader_that_goes_away_is_no_error():
    code, _, err = shell("$stabctl models genrou | true; exit ${PIPESTATUS[0]}")
    assert (code, err) == (141, "")  # as if ended by SIGPIPE


def test_a_closed_stderr_does_not_send_messages_to_stdout():
    code, out, _ = shell("$stabctl tables nothing 2>&-")
    assert (code, out) == (2, "")


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="has no device that is full")
@pytest.mark.parametrize("command", ["models --json", "tables buses", "tables buses --json"])
def test_an_output_that_is_full_is_a_sentence(monkeypatch, command):
    """Also one that is shorter than the buffer, which only the end of the program writes."""
    monkeypatch.delenv("PYTHONUNBUFFERED", raising=False)
    full = "stabctl: The output cannot be written: No space left on device.\n"
    assert shell(f"$stabctl {command} >/dev/full") == (2, "", full)


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="has no device that is full")
def test_messages_that_cannot_be_written_leave_the_exit_code():
    assert shell("$stabctl tables nothing 2>/dev/full")[:2] == (2, "")


class Gone(io.StringIO):
    """A stream that nobody reads."""

    def write(self, _):
        raise BrokenPipeError


@pytest.mark.parametrize("gone", [False, True])
def test_the_note_that_equations_are_compiled_comes_once_and_not_into_the_output(monkeypatch, capsys, gone):
    monkeypatch.setattr(jit, "_told", [])
    if gone:
        monkeypatch.setattr(sys, "stderr", Gone())
    for labels in ([], ["motion"], ["motion", "outputs"]):
        with jit.compiling(labels) as done:
            done()
    out, err = capsys.readouterr()
    assert out == ""
    assert err == ("" if gone else "stabctl: compiling the equations (once for each set of models) ...\n")


@pytest.mark.slow
def test_what_the_encoding_lacks_is_escaped(tmp_path):
    code, out, err = shell(f"cd {tmp_path}; export PYTHONIOENCODING=ascii; $stabctl cases; $stabctl tables 'é\x1b'")
    assert code == 2
    assert "two_area" in out
    assert err.startswith("stabctl: There is no table or case '\\xe9\\x1b'; the tables are buses")


@pytest.mark.parametrize("module", ["click", "numpy"])
def test_ctrl_c_while_the_program_loads_is_a_sentence(module):
    run = subprocess.run([sys.executable, "-c", INTERRUPT.format(module=module)], capture_output=True, text=True)
    assert run.returncode in (130, -2)  # a shell shows 130 for both
    assert (run.stdout, run.stderr) == ("", "stabctl: interrupted.\n")


CALLBACK = """
import os, signal, sys
from importlib import _bootstrap
class Ends:  # in its callback an exception is printed and forgotten, as in those of the locks of modules
    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)
        for _ in range(1000):
            pass
plain = _bootstrap._ModuleLock.release
def release(lock):
    plain(lock)
    if lock.name == "stabctl.model.powerflow":
        _bootstrap._ModuleLock.release = plain
        Ends()
_bootstrap._ModuleLock.release = release
signal.signal(signal.SIGINT, signal.default_int_handler)
from stabctl.__main__ import main
sys.argv = ["stabctl", "powerflow", "two_area"]
main()
"""


def test_ctrl_c_in_a_callback_of_an_import_is_not_lost():
    run = subprocess.run([sys.executable, "-c", CALLBACK], capture_output=True, text=True)
    assert (run.returncode, run.stdout, run.stderr) == (130, "", "stabctl: interrupted.\n")


DROPPED = """
import os, signal, sys, weakref
def sent(*_):
    os.kill(os.getpid(), signal.SIGINT)
    for _ in range(1000):
        pass
class Ends:
    def __del__(self):
        sent()
def load(*given, **named):
    io.load = plain
    one = Ends() if {destructor} else type("One", (), {{}})()
    held = weakref.ref(one, None if {destructor} else sent)
    del one
    return plain(*given, **named)
signal.signal(signal.SIGINT, signal.default_int_handler)
import stabctl.io as io
plain, io.load = io.load, load
from stabctl.__main__ import main
sys.argv = ["stabctl", "powerflow", "two_area"]
main()
"""


@pytest.mark.parametrize("destructor", [True, False])
def test_ctrl_c_where_python_drops_errors_is_not_lost(destructor):
    """Such as in a destructor of llvmlite while equations are compiled: one of some two hundred interruptions."""
    script = DROPPED.format(destructor=destructor)
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert (run.returncode, run.stdout, run.stderr) == (130, "", "stabctl: interrupted.\n")


def test_ctrl_c_that_an_import_turned_into_another_error(stabctl, monkeypatch):
    def wrapped(*_, **__):
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt as error:
            raise RuntimeError("Error calling __set_name__") from error

    monkeypatch.setattr("stabctl.io.load", wrapped)
    assert stabctl("powerflow", "two_area") == (130, "", "stabctl: interrupted.\n")
