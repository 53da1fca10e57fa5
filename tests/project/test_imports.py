"""What is not used is not imported."""

import subprocess
import sys
from pathlib import Path


def loaded(code, *modules):
    """Those of the modules that are loaded after the code."""
    code += f"\nimport sys; print([m for m in {modules} if m in sys.modules])"
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip()


def test_importing_the_core_imports_nothing_slow():
    code = "import stabctl.dynamics.operating_point, stabctl.io, stabctl.simulation.simulation"
    assert loaded(code, "pandas", "xarray", "matplotlib", "cvxpy", "control", "rich") == "[]"


def test_the_interactive_page_is_loaded_by_its_command_only():
    modules = "starlette", "uvicorn", "anyio", "stabctl.view.live", "stabctl.view.diagram"
    assert loaded("import stabctl as st, stabctl.cli; st.load('two_area')", *modules) == "[]"


def test_reading_a_case_loads_no_compiler():
    assert loaded("import stabctl", "numba", "numpy", "scipy") == "[]"
    assert loaded("import stabctl as st; st.load('two_area'); st.cases()", "numba", "llvmlite") == "[]"


def test_reading_a_case_takes_no_compiler_and_no_model_classes():
    script = (
        "import sys, stabctl; case = stabctl.load('two_area'); case.set('pss.1.K', 3);"
        "print([m for m in ('pandas', 'pydantic', 'matplotlib', 'xarray', 'numba') if m in sys.modules])"
    )
    out = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
    assert "pydantic" not in out
    assert set(eval(out)) <= {"numba"}


def test_light_commands_import_no_heavy_library():
    """A whole run of `simulate` must not pay for libraries it does not use."""
    import subprocess

    words = ["simulate", "two_area", "--until", "0.05", "--json"]
    code = f"import sys; sys.argv = ['stabctl', *{words}]; from stabctl.cli import main\n"
    code += "try: main()\nfinally: print(sorted(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=Path(__file__).parents[2])
    loaded = set(done.stdout.splitlines()[-1].strip("[]").replace("'", "").split(", "))
    assert not loaded & {"control", "cvxpy", "pandas", "xarray", "matplotlib", "filterpy", "sympy"}
