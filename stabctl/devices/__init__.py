"""Device models, one file each, discovered automatically: a new model is a new file in one of the folders.

A device is a module with NAME, ROLE, Par, and as far as it has them State, Input, Output (NamedTuples whose fields are
`Annotated` with unit and meaning) and the equations as scalar functions of x (State), u (Input), v (bus voltage, real
and imaginary part), y (its own Output) and p (Par), each marked `@inline`:

    internal(x, p)    -> Internal, what several equations share; they read it as i
    output(...)       -> Output
    derivatives(...)  -> State, the state rates in 1/s
    source(...)       -> Norton current of a voltage source (system base), beside admittance(p)
    current(...)      -> current into the bus (system base) of what is not such a source
    prepare(p)        -> Par, with the constants that follow from others
    guess(V, I, p)    -> State to start the initialization from
    step(...)         -> Output once per frame, of a sampled law

LIMITS names the states that stop at limits (non-windup). Initialization ignores every limit: the constants named
...max and ...min, and upper limits of other names listed in UPPER. The file name is the name of its table.
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
        "converter": "converter that stands in for the machine of a generating unit",
        "exciter": "excitation system and voltage regulator",
        "governor": "turbine and speed governor",
        "stabilizer": "power system stabilizer",
        "load": "load at a bus",
        "storage": "energy storage device at a bus",
        "shunt": "controlled shunt at a bus",
        "link": "link between two buses",
        "sensor": "measurement",
        "controller": "control law of storage devices, or a designed controller",
    }
)
UNIT_ROLES = ("machine", "converter", "exciter", "governor", "stabilizer")
BUILT_IN = ("zip_load", "esd", "hvdc")  # their rows come from the tables loads, storage and links

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
    """The devices that have a table of their own in a case, by its name."""
    apart = ("sensor", "controller")
    return MappingProxyType({k: m for k, m in every().items() if m.ROLE not in apart and k not in BUILT_IN})


def register(path: str | Path) -> str:
    """Register a user's device from a file outside the package.

    Opening a case never runs code: a device is registered by the user, before the case that uses it is read.

    Parameters
    ----------
    path
        A Python file like those in this folder; its name becomes the name of the table.

    Returns
    -------
    str
        The name.

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
            f"{path}: {name!r} cannot name a table; use letters, digits and underscores, as my_exciter.py."
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
        raise StudyError(f"The device file {path} fails when it is run: {type(error).__name__}: {error}.") from None
    _registered[name] = module
    copyreg.pickle(module.Par, lambda par: (_record, (str(module.__file__), *par)))
    every.cache_clear()
    models.cache_clear()
    return name


def _check(path: Path, module: ModuleType) -> None:
    """`StudyError` where a module is no device."""
    from . import trial  # reads the markers of this package, which is not complete while it is imported

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
    """Constants that come from another process, where the device of this file is registered."""
    register_missing([file])
    return _registered[Path(file).stem].Par(*values)


def register_missing(files: Iterable[str]) -> None:
    """Register those of these files that are not registered yet; in a process that another one has started."""
    for file in files:
        if file not in registered():
            register(file)


def registered() -> tuple[str, ...]:
    """Files of the devices registered so far."""
    return tuple(str(m.__file__) for m in _registered.values())
