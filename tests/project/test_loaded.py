"""What is loaded when the program starts: the libraries and the device files that a command needs, and no others."""

import os
import subprocess
import sys

import pytest

FAULT = "two_area", "--fault", "7-8@0.4", "--clear", "6cyc"
CASE = {"annotated_types", "charset_normalizer", "numpy", "pydantic_core", "scipy", "typing_extensions"}
RUNS = CASE | {"llvmlite", "platformdirs"}  # charset_normalizer by scipy; llvmlite by what is not in a wheel
MODELS = {"esd", "genrou", "hvdc", "pss", "sexs", "tgov", "zip_load"}
SENSORS = {"bus_angle", "bus_frequency", "bus_voltage", "line_current", "line_power", "rocof"}
LOADED = """
import sys
sys.argv[0] = "stabctl"
from stabctl.__main__ import main
try:
    main()
finally:
    files = {name: getattr(one, "__file__", None) or "" for name, one in sys.modules.items()}
    print(*{name.partition(".")[0] for name, file in files.items() if "site-packages" in file}, file=sys.stderr)
    devices = [name for name in files if name.startswith("stabctl.devices.")]
    print(*(name.rpartition(".")[2] for name in devices if "ROLE" in vars(sys.modules[name])), "-", file=sys.stderr)
"""


def loaded(*words):
    """Libraries and devices that a command loads."""
    done = subprocess.run([sys.executable, "-c", LOADED, *words], capture_output=True, text=True)
    assert done.returncode == 0
    libraries, devices = done.stderr.splitlines()[-2:]
    return {name for name in libraries.split() if not name.startswith("_")} - {"stabctl"}, set(devices.split()) - {"-"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "libraries", "devices"),
    [
        (["--help"], {"click"}, set()),
        (["simulate", "--help"], {"click"}, set()),
        (["models", "genrou"], {"annotated_types", "click", "numpy", "rich", "typing_extensions"}, {"genrou"}),
        (["check", "two_area"], CASE | {"click"}, MODELS - {"esd", "hvdc"}),
        (["simulate", *FAULT, "--json"], RUNS | {"click"}, MODELS - {"esd"} | SENSORS),
        (["simulate", *FAULT, "--storage", "50MW"], RUNS | {"click", "rich"}, MODELS | SENSORS),
        (["modes", "two_area"], RUNS | {"click", "rich"}, MODELS - {"esd"} | {"bus_frequency", "line_power", "rocof"}),
        (
            ["clearing-time", *FAULT[:3], "--classical"],
            RUNS | {"click", "rich"},
            MODELS - {"esd"} | {"gencls"} | SENSORS,
        ),
    ],
)
def test_a_command_loads_what_it_needs(words, libraries, devices):
    loaded(*words)  # what it compiles is on disk now
    found = loaded(*words)
    assert found[0] <= libraries
    assert found[1] == devices


@pytest.mark.slow
def test_without_numba_and_machine_code_it_says_what_is_missing(tmp_path):
    code = "import sys; sys.modules['numba'] = None; from stabctl.__main__ import main; main()"
    where = os.environ | {"XDG_CACHE_HOME": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", code, "modes", "two_area"], capture_output=True, text=True, env=where)
    assert done.returncode == 2
    assert "stabctl: The equations must be compiled for this computer, which needs numba" in done.stderr
    assert done.stderr.endswith("pip install numba.\n")
