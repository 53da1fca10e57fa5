"""Device models, one file each, discovered automatically: a new model is a new file in one of the folders.

`device.Device` says what such a file may contain; everything else in the package asks that record.
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

from stabctl._util.errors import StudyError, shown

from .device import ROLES, Device, misspelt, of

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

_registered: dict[str, Device] = {}


@cache
def _found() -> Mapping[str, Device]:
    names = []
    for package in pkgutil.iter_modules(__path__):
        if package.ispkg:
            inside = Path(__path__[0]) / package.name
            names += [f"{__name__}.{package.name}.{file.name}" for file in pkgutil.iter_modules([str(inside)])]
    modules = [importlib.import_module(name) for name in sorted(names)]
    devices = {m.__name__.rpartition(".")[2]: of(m) for m in modules if "ROLE" in vars(m)}
    order = {role: k for k, role in enumerate(ROLES)}
    return MappingProxyType(dict(sorted(devices.items(), key=lambda item: order[item[1].role])))


@cache
def every() -> Mapping[str, Device]:
    """Every device by the name of its file: those of the package, then those registered."""
    return MappingProxyType({**_found(), **_registered})


@cache
def models() -> Mapping[str, Device]:
    """The devices with a table of their own in a case, by name."""
    apart = ("sensor", "controller")
    return MappingProxyType({k: m for k, m in every().items() if m.role not in apart and k not in BUILT_IN})


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
        device = _checked(path, module)
    except (Exception, SystemExit) as error:
        sys.modules.pop(spec.name)
        if before is not None:
            sys.modules[spec.name] = before
        if isinstance(error, StudyError):
            raise
        raise StudyError(f"The device file {path} cannot be run: {type(error).__name__}: {error}.") from None
    _registered[name] = device
    copyreg.pickle(module.Par, lambda par: (_record, (str(module.__file__), *par)))
    every.cache_clear()
    models.cache_clear()
    return name


def _checked(path: Path, module: ModuleType) -> Device:
    """The device of a module. Raises `StudyError` if it is none."""
    from . import trial  # imported late: it needs this package

    missing = [part for part in ("NAME", "ROLE", "Par") if part not in vars(module)]
    if missing:
        raise StudyError(f"The device file {path} lacks {', '.join(missing)}; see docs/extending.md.")
    if module.ROLE == "link":
        raise StudyError(f"{path}: a link model of your own is not supported; all rows of links.csv are HVDC links.")
    wrong = trial.unreadable(module) or misspelt(module) or trial.mistake(of(module))
    if wrong:
        raise StudyError(f"{path}: {wrong}.")
    return of(module)


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
    return tuple(d.file for d in _registered.values())
