"""Compile for a level of processors into a shared library: python tools/machine_code.py x86-64-v3 FOLDER [DEVICE ...]

Every device, or those named, for real and complex numbers, and every entry point, which small studies call.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any

LINK = ("cc", "-shared", "-s", "-Wl,-z,noexecstack,-z,defs,--as-needed")  # an undefined symbol is an error


def main(level: str, folder: Path, names: list[str]) -> None:
    """Write LEVEL.so and its list, LEVEL.json; says how long it takes and how large it is."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as made:
        os.environ |= {"STABCTL_BUILD": made, "NUMBA_CPU_NAME": level, "NUMBA_CPU_FEATURES": ""}
        began = time.process_time()
        functions = compiled(Path(made), names)
        objects, library = sorted(map(str, Path(made).glob("*.o"))), folder / f"{level}.so"
        subprocess.run([*LINK, "-o", str(library), *objects, "-lm", "-lc"], check=True)
    about = {"sha256": sha256(library.read_bytes()).hexdigest(), "functions": functions}
    (folder / f"{level}.json").write_text(json.dumps(about, indent=0))
    size, spent = library.stat().st_size / 1e6, time.process_time() - began
    print(f"{level}: {len(functions)} functions in {spent:.0f} s of processor time, a library of {size:.2f} MB")


def compiled(folder: Path, names: list[str]) -> dict[str, str]:
    """Object code that can be linked, a file for each function; returns their symbols and what they return."""
    from stabctl import devices
    from stabctl._util import compiler, jit, object_code
    from stabctl.devices.device import of
    from stabctl.dynamics import _codegen, adder, drawn
    from stabctl.simulation import center, frame, gate, line, lti

    def emit(module: Any, symbol: str) -> None:
        machine = compiler.target(reloc="pic", codemodel="small")
        (folder / f"{symbol}.o").write_bytes(machine.emit_object(module))

    compiler.also.append(emit)
    jit.start = lambda *_: False  # no second process
    modules = {"adder": adder, "drawn": drawn, "center": center, "frame": frame, "gate": gate, "line": line, "lti": lti}
    for name, device in {**devices.every(), **{name: of(module) for name, module in modules.items()}}.items():
        for scalar in (float, complex) if name in names or not names else ():
            _codegen.address(name, device, scalar)
    studies()
    found = [code for path in folder.glob("*.obj") if (code := object_code.read(path))]
    return {code.symbol: code.returns for code in found}


def studies() -> None:
    """Small studies that call every entry point."""
    import numpy as np

    import stabctl as st
    from stabctl.simulation import stages

    fault, one = st.Contingency("7-8@0.4", clear="6cyc"), np.ones((1, 1))
    case = st.load("two_area")
    point = case.initialize(storage="50MW")
    feedback = partial(st.Controller, ("speed:2",), ("vs:2",), -one, one, one, 0 * one, limits=(-0.05, 0.05))
    laws = (
        None, st.BangBang(), st.Feedback(1.0), st.StorageLaw(slope=0.5), st.BangBang().sampled(60, "50ms"),
        feedback(rate=60, delay=0.05), feedback(gate=st.Gate("voltage:7", low=0.8)),
    )  # fmt: skip
    runs = [point.simulate(fault, "1.2s", control=law) for law in laws]
    loads = (k._replace(p_power=1.0, q_power=1.0, p_current=0.0, q_current=0.0) for k in case.loads)
    heavy = replace(case, loads=tuple(loads))
    heavy.initialize().simulate(st.Contingency("8", clear="6cyc", at=0.1), "0.4s")  # needs Newton's method
    stages.stages(runs[0])
    point.modes()
    for estimator in ("kalman", "ideal"):
        st.estimate(case, fault, 1.2, estimator=estimator)


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), sys.argv[3:])
