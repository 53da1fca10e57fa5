"""Device models, one file each, discovered automatically: a new model is a new file in one of the folders.

A device is a module with NAME, ROLE, Par and, where needed, State, Input and Output (NamedTuples whose fields are
`Annotated` with unit and meaning). Its equations are scalar functions of x (State), u (Input), v (bus voltage, real
and imaginary part), y (its own Output) and p (Par), each marked `@inline`:

    internal(x, p)    -> Internal, quantities used by several equations, which read them as i
    output(...)       -> Output
    derivatives(...)  -> State, the state derivatives in 1/s
    source(...)       -> Norton current of a voltage source (system base), together with admittance(p)
    current(...)      -> current into the bus (system base) of any other device
    prepare(p)        -> Par, with the parameters computed from others
    guess(V, I, p)    -> State to start the initialization from
    inertia(p)        -> equivalent inertia constant (s, own base) of a converter's virtual rotor: its angle is the
                         state delta, its speed the state or output omega, as those of a machine
    automatic(p, u, y) -> Par, with the parameters that depend on the starting point (u, y: inputs and output there)
    step(...)         -> Output once per time step, for a sampled control law

LIMITS lists the states with non-windup limits, each a parameter or a number, STOPS those of them at whose limit the
power of the device jumps (the simulation ends a step there). Initialization ignores every limit: the parameters named
...max and ...min, and upper limits with other names, listed in UPPER; it also closes the deadbands whose edges are in
DEADBANDS. The file name is the name of the table. DYR names the fields of Par in the order of the constants of a PSS/E
record (`_name`: ignored, `+name`: an integer before the constants, `'name`: a text there); from_record(kind, values) ->
(Par, corrections) converts values where that is needed. ANGLES lists the states that are angles in the synchronous
frame, by default "delta"; PHASORS the pairs of states that are real and imaginary part of a phasor there. PLL names the
state that is the angle of a phase-locked loop there, judged by the criterion of stability as that of a rotor.
CURRENT_LIMIT names the parameter that limits the current of a storage device, pu on its MVA.
LOOPS maps the control loops of a converter to their states, after which modes are named; loops(p) does so where a
parameter decides what a loop holds.
"""

import copyreg
import importlib
import importlib.util
import pkgutil
import sys
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import Any

from stabctl.errors import StudyError, shown

ROLES: Mapping[str, str] = MappingProxyType(
    {
        "machine": "synchronous machine of a generating unit",
        "converter": "converter that takes the place of the machine of a generating unit",
        "exciter": "excitation system and voltage regulator",
        "governor": "turbine and speed governor",
        "stabilizer": "power system stabilizer",
        "electrical control": "electrical control of a converter",
        "plant control": "plant controller of a converter",
        "drive train": "drive train of a wind turbine with a converter",
        "load": "load at a bus",
        "storage": "energy storage device at a bus",
        "shunt": "controlled shunt at a bus",
        "link": "link between two buses",
        "sensor": "measurement",
        "controller": "control law of storage devices, or a designed controller",
    }
)
OF_CONVERTER = ("electrical control", "plant control", "drive train")
UNIT_ROLES = ("machine", "converter", "exciter", "governor", "stabilizer", *OF_CONVERTER)
BUILT_IN = (
    "zip_load",
    "esd",
    "esd_regc",
    "esd_regc_b",
    "esd_regc_c",
    "esd_regc_repc",
    "esd_regc_b_repc",
    "esd_regc_c_repc",
    "esd_regfm",
    "esd_regfm_b1",
    "hvdc",
)  # their rows come from the tables loads, storage and links

_registered: dict[str, ModuleType] = {}


@cache
def _found() -> Mapping[str, ModuleType]:
    names = []
    for package in pkgutil.iter_modules(__path__):
        if package.ispkg:
            inside = Path(__path__[0]) / package.name
            names += [f"{__name__}.{package.name}.{file.name}" for file in pkgutil.iter_modules([str(inside)])]
    modules = [importlib.import_module(name) for name in sorted(names)]
    devices = {m.__name__.rpartition(".")[2]: m for m in modules if hasattr(m, "ROLE")}
    order = {role: k for k, role in enumerate(ROLES)}
    return MappingProxyType(dict(sorted(devices.items(), key=lambda item: order[item[1].ROLE])))


@cache
def every() -> Mapping[str, ModuleType]:
    """Every device by the name of its file: those of the package, then those registered."""
    return MappingProxyType({**_found(), **_registered})


@cache
def models() -> Mapping[str, ModuleType]:
    """The devices with a table of their own in a case, by name."""
    apart = ("sensor", "controller")
    return MappingProxyType({k: m for k, m in every().items() if m.ROLE not in apart and k not in BUILT_IN})


def register(path: str | Path) -> str:
    """Register a user's device from a file outside the package.

    Loading a case never runs code, so a device must be registered before the case that uses it is loaded.

    Parameters
    ----------
    path
        A Python file like those in this folder; its name becomes the name of the table.

    Returns
    -------
    str
        The name of the device and its table.

    Raises
    ------
    StudyError
        If the file cannot be read, is not a device, or has the name of a packaged device.
    """
    if not isinstance(path, str | Path):
        raise StudyError(
            f"{shown(path)} is not a device file; give the path of a Python file, such as 'my_exciter.py'."
        )
    path = Path(path)
    name = path.stem
    if not path.is_file() or path.suffix != ".py":
        raise StudyError(f"There is no device file {str(path)!r}; give a Python file such as my_exciter.py.")
    if not name.isidentifier():
        raise StudyError(
            f"{path}: {name!r} is not a table name; name the file with letters, digits and "
            "underscores, such as my_exciter.py."
        )
    if name in _found():
        raise StudyError(f"{path}: {name!r} is the name of a packaged device; rename the file.")
    spec: Any = importlib.util.spec_from_file_location(f"stabctl_device_{name}", path)
    module = importlib.util.module_from_spec(spec)
    before = sys.modules.get(spec.name)
    sys.modules[spec.name] = module
    try:
        spec.loader.exec_module(module)
        _check(path, module)
    except (Exception, SystemExit) as error:
        sys.modules.pop(spec.name)
        if before is not None:
            sys.modules[spec.name] = before
        if isinstance(error, StudyError):
            raise
        raise StudyError(f"The device file {path} cannot be run: {type(error).__name__}: {error}.") from None
    _registered[name] = module
    copyreg.pickle(module.Par, lambda par: (_record, (str(module.__file__), *par)))
    every.cache_clear()
    models.cache_clear()
    return name


def _check(path: Path, module: ModuleType) -> None:
    """Raise `StudyError` if a module is not a device."""
    from . import trial  # imported late: it needs this package

    missing = [part for part in ("NAME", "ROLE", "Par") if not hasattr(module, part)]
    if missing:
        raise StudyError(f"The device file {path} lacks {', '.join(missing)}; see docs/extending.md.")
    if module.ROLE not in ROLES:
        raise StudyError(f"{path}: the role {module.ROLE!r} is not known; use one of {', '.join(ROLES)}.")
    if module.ROLE == "link":
        raise StudyError(f"{path}: a link model of your own is not supported; all rows of links.csv are HVDC links.")
    wrong = trial.mistake(module)
    if wrong:
        raise StudyError(f"{path}: {wrong}.")


def _record(file: str, *values: Any) -> Any:
    """Parameters received from another process, where the device of this file is registered."""
    register_missing([file])
    return _registered[Path(file).stem].Par(*values)


def register_missing(files: Iterable[str]) -> None:
    """Register the files that are not registered yet, in a worker process."""
    for file in files:
        if file not in registered():
            register(file)


def registered() -> tuple[str, ...]:
    """Files of the devices registered so far."""
    return tuple(str(m.__file__) for m in _registered.values())
