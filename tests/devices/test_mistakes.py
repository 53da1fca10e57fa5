"""Mistakes in a user's device file: each is one sentence with the file, before anything is compiled."""

from pathlib import Path

import pytest
from systems import OWN, registered

from stabctl import devices
from stabctl._util.errors import StudyError
from stabctl.devices import trial
from stabctl.devices.device import AT_BUS
from stabctl.model import tables

GOOD = (OWN / "wide_area.py").read_text()
SEXS = Path(devices.every()["sexs"].file).read_text("utf-8").replace("from .", "from stabctl.devices.exciters.")
MISTAKES = {
    "no states": ("class State(", "class States(", "it defines derivatives but not State"),
    "a number in place of an equation": ('ROLE = "stab', 'elsewhere = 3.0\nROLE = "stab', "elsewhere is no function"),
    "no rates": ("def derivatives", "def rates", "it defines State but not derivatives"),
    "no output": ("def output", "def outcome", "it defines Output but not output"),
    "misspelt equation": (
        "def derivatives",
        "def derivative",
        "it defines derivative, which nothing reads; did you mean derivatives?",
    ),
    "misspelt constant": (
        'ROLE = "stab',
        'DEADBAND = ("Kv",)\nROLE = "stab',
        "it defines DEADBAND, which nothing reads; did you mean DEADBANDS?",
    ),
    "misspelt equation beside the others": (
        "@inline\ndef output",
        "def elsewher(p):\n    return p.T\n\n\n@inline\ndef output",
        "it defines elsewher, which nothing reads; did you mean elsewhere?",
    ),
    "no such role": (
        'ROLE = "stabilizer"',
        'ROLE = "stabiliser"',
        "'stabiliser' is not known; did you mean",
    ),
    "another output than that of the role": (
        'ROLE = "stabilizer"',
        'ROLE = "governor"',
        "the role governor gives Pm, but Output has no such field",
    ),
    "a parameter called as the key": ("    other: Ann", "    machine: Ann", "machine is the column that says"),
    "no such limit": (
        'ROLE = "stab',
        'LIMITS = {"slaw": ("Vmin", "Vmax")}\nROLE = "stab',
        "LIMITS contains 'slaw', which is not a field of State; did you mean slow?",
    ),
    "no such edge of a limit": (
        'ROLE = "stab',
        'LIMITS = {"slow": ("Vmin", "Vmx")}\nROLE = "stab',
        "LIMITS contains 'Vmx', which is not a field of Par; did you mean Vmax?",
    ),
    "no such scale of a limit": (
        'ROLE = "stab',
        'LIMITS = {"slow": ("Vmin", "Vmax", "W")}\nROLE = "stab',
        "LIMITS contains 'W', which is not a field of Input",
    ),
    "one limit": ('ROLE = "stab', 'LIMITS = {"slow": ("Vmin",)}\nROLE = "stab', "LIMITS of slow has 1 entries"),
    "a stop without a limit": (
        'ROLE = "stab',
        'STOPS = ("slow",)\nROLE = "stab',
        "STOPS contains 'slow', which",
    ),
    "a text in place of names": ('ROLE = "stab', 'UPPER = "Vmax"\nROLE = "stab', "UPPER = 'Vmax' is no collection of"),
    "no such state of a phasor": (
        'ROLE = "stab',
        'PHASORS = (("slow", "fast"),)\nROLE = "stab',
        "PHASORS contains 'fast', which is not a field of State",
    ),
    "no such state of a loop": (
        'ROLE = "stab',
        'LOOPS = {"washout": ("slow", "fast")}\nROLE = "stab',
        "LOOPS contains 'fast', which is not a field of State",
    ),
    "no such parameter of a record": (
        'ROLE = "stab',
        'DYR = {"WIDE": "bus other Kz"}\nROLE = "stab',
        "DYR WIDE contains 'Kz', which is not a field of Par",
    ),
    "no such state": ("u.V - x.slow)", "u.V - x.fast)", "output: 'State' object has no attribute 'fast'"),
    "a value too many": ("u.V, x.slow))", "u.V, x.slow), 0.0)", "derivatives: State.__new__() takes 2 positional"),
    "no derivative": ("(p.T, u.V", "(p.T, abs(u.V)", "derivatives uses abs, which cannot be differentiated"),
    "a real part": ("(p.T, u.V", "(p.T, u.V.real", "derivatives loses the derivative by u.V"),
    "a rounded state": ("u.V, x.slow))", "u.V, round(x.slow.real, 6)))", "derivatives loses the derivative by x.slow"),
    "an argument of no meaning": ("def output(x, u, p)", "def output(x, u, q)", "output has an unknown argument 'q'"),
    "an argument that nothing gives": (
        "def derivatives(x, u, p)",
        "def derivatives(x, u, p, _y)",
        "derivatives has an unknown argument '_y'; it may take x, i, u, v, v1, v2, y, p",
    ),
    "a voltage as a starting value": (
        "@inline\ndef output",
        "def guess(V, J, p):\n    return State(V)\n\n\n@inline\ndef output",
        "guess has an unknown argument 'J'; it may take V, I, p",
    ),
    "an input in a starting value": (
        "@inline\ndef output",
        "def guess(V, far, p):\n    return State(V + far)\n\n\n@inline\ndef output",
        "guess has an unknown argument 'far'; it may take V, I, p",
    ),
    "a record that is none": ("class State(NamedTuple)", "class State", "State"),
    "no record": ("return State(", "return (", "derivatives returns complex instead of State"),
    "no unit": (
        'Kv: Annotated[float, "pu", "gain on the voltage"]',
        "Kv: float",
        "write every field as name: Annotated",
    ),
    "an equation that is not compiled": ("@inline\ndef output", "def output", "output is not compiled; write @inline"),
    "a helper that is not compiled": (
        "@inline\ndef output(x, u, p):\n",
        "def helper(z):\n    return z\n\n\n@inline\ndef output(x, u, p):\n    helper(x.slow)\n",
        "helper is not compiled; write @inline",
    ),
    "it exits": ('ROLE = "stab', 'raise SystemExit(3)\nROLE = "stab', "cannot be run: SystemExit: 3"),
}


TOGETHER = {  # in SEXS, whose outputs and rates are one function
    "a second function of the outputs": (
        "@inline\ndef equations",
        "@inline\ndef output(x, u, p):\n    return Output(x.efd)\n\n\n@inline\ndef equations",
        "it defines equations and also output, which equations gives",
    ),
    "equations without states": ("class State(", "class States(", "it defines equations but not State"),
    "outputs alone": (
        ", State(vm=d_vm, va=d_va, efd=d_efd)",
        "",
        "equations returns Output instead of Output, State",
    ),
    "the rates first": (
        "return Output(clip(efd, p.Efdmin, p.Efdmax)), State(vm=d_vm, va=d_va, efd=d_efd)",
        "return State(vm=d_vm, va=d_va, efd=d_efd), Output(clip(efd, p.Efdmin, p.Efdmax))",
        "equations returns State, Output instead of Output, State",
    ),
    "a rate that is a pair": ("efd=d_efd", "efd=(d_efd, 0.0)", "equations returns tuple instead of a number"),
}


@pytest.mark.parametrize("name", [*MISTAKES, *TOGETHER])
def test_a_mistake_in_a_device_is_a_sentence_with_its_file(name, tmp_path):
    good = GOOD if name in MISTAKES else SEXS
    old, new, told = (MISTAKES | TOGETHER)[name]
    file = tmp_path / "wrong.py"
    assert good.count(old) == 1
    file.write_text(good.replace(old, new))
    with registered(), pytest.raises(StudyError) as error:
        devices.register(file)
    assert told in str(error.value)
    assert not str(error.value).endswith("?.")
    assert str(file) in str(error.value)
    assert "\n" not in str(error.value)


def test_what_another_file_does_to_a_derivative_is_told(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "sizes_of_a_test.py").write_text(
        "from stabctl._util.jit import inline\n\n@inline\ndef size(x):\n    return abs(x)\n"
    )
    file = tmp_path / "wrong.py"
    text = GOOD.replace("from stabctl._util.jit", "from sizes_of_a_test import size\nfrom stabctl._util.jit", 1)
    file.write_text(text.replace("(p.T, u.V", "(p.T, size(u.V)"))
    with registered(), pytest.raises(StudyError, match=r"derivatives loses the derivative by u\.V"):
        devices.register(file)


def test_the_keys_that_no_parameter_may_be_called_are_those_of_the_tables():
    for name in devices.models():
        key = "bus" if tables.role(name) in AT_BUS else "machine"
        assert tables.key_field(name).name == key
        assert trial.mistake(devices.every()[name]) is None


@pytest.mark.parametrize("name", devices.every())
def test_no_device_of_the_package_is_taken_for_a_mistake(name):
    assert trial.mistake(devices.every()[name]) is None


def test_what_is_no_file_name_of_a_table_is_refused(tmp_path):
    (tmp_path / "my-exciter.py").write_text(GOOD)
    with pytest.raises(StudyError, match="'my-exciter' is not a table name"):
        devices.register(tmp_path / "my-exciter.py")
    with pytest.raises(StudyError, match="None is not a device file"):
        devices.register(None)
