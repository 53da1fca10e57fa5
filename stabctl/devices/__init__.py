"""Device models, one file each, discovered automatically: a new model is a new file in one of the folders.

`device.Device` says what such a file may contain; everything else in the package asks that record.
"""

import copyreg
import importlib
import importlib.util
import re
import sys
from collections.abc import Container, Iterator, Mapping
from functools import cache, cached_property
from hashlib import sha256
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import Any

from stabctl._util.errors import StudyError, shown
from stabctl._util.schema import fields

from . import storage
from .device import ROLES, Device, misspelt, of

OF_CONVERTER = ("electrical control", "plant control", "drive train")
UNIT_ROLES = ("machine", "converter", "exciter", "governor", "stabilizer", *OF_CONVERTER)
BUILT_IN = ("zip_load", *storage.DEVICES, "hvdc")  # their rows come from the tables loads, storage and links

_registered: dict[str, Device] = {}


class Devices(Mapping[str, Device]):
    """Devices by the names of their files, ordered by role; a file is imported when its device is asked for."""

    def __init__(self, roles: Mapping[str, str]) -> None:
        self.roles = MappingProxyType(dict(roles))  # of each device, known without importing it

    def __getitem__(self, name: str) -> Device:
        if name not in self.roles:
            raise KeyError(name)
        return _registered[name] if name in _registered else of(_module(name))

    def __contains__(self, name: object) -> bool:
        return name in self.roles

    def __iter__(self) -> Iterator[str]:
        return iter(self.roles)

    def __len__(self) -> int:
        return len(self.roles)

    @cached_property
    def records(self) -> Mapping[str, tuple[str, str]]:
        """Kind of PSS/E record -> name of the device, and its constants in order."""
        return MappingProxyType({kind: (name, order) for name, d in self.items() for kind, order in d.dyr.items()})

    def of_role(self, *roles: str) -> list[str]:
        """Names of the devices with one of these roles."""
        return [name for name, role in self.roles.items() if role in roles]

    def among(self, names: Container[str]) -> Iterator[tuple[str, Device]]:
        """Those among these names, in order."""
        return ((name, self[name]) for name in self.roles if name in names)


@cache
def _files() -> Mapping[str, tuple[str, str]]:
    """Role and folder of every device of the package."""
    found = dict.fromkeys(storage.DEVICES, ("storage", "storage"))
    for path in sorted(Path(__path__[0]).glob("*/*.py")):
        role = re.search('^ROLE = "(.+)"$', path.read_text(encoding="utf-8"), re.MULTILINE)
        if role and path.parent.name != "storage":
            found[path.stem] = role[1], path.parent.name
    order = list(ROLES)
    return dict(sorted(found.items(), key=lambda item: order.index(item[1][0])))


def _module(name: str) -> ModuleType:
    """The module of a device of the package."""
    _, folder = _files()[name]
    return storage.composed(name) if folder == "storage" else importlib.import_module(f"{__name__}.{folder}.{name}")


@cache
def every() -> Devices:
    """Every device by the name of its file: those of the package, then those registered."""
    packaged = {name: role for name, (role, _) in _files().items()}
    return Devices(packaged | {name: device.role for name, device in _registered.items()})


@cache
def models() -> Devices:
    """The devices with a table of their own in a case, by name."""
    apart = {*BUILT_IN, *every().of_role("sensor", "controller")}
    apart |= {name for name, device in _registered.items() if not fields(device.Par)}
    return Devices({name: role for name, role in every().roles.items() if name not in apart})


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

    Examples
    --------
    >>> st.register("pi_exciter.py")
    'pi_exciter'
    >>> st.load("two_area").with_device("pi_exciter", 1, TR=0.01, KP=20, KI=5).devices["pi_exciter"][1].KP
    20.0
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
    if name in _files():
        raise StudyError(f"{path}: {name!r} is the name of a packaged device; rename the file.")
    spec: Any = importlib.util.spec_from_file_location(f"stabctl_device_{name}", path)
    module = importlib.util.module_from_spec(spec)
    before = sys.modules.get(spec.name)
    sys.modules[spec.name] = module
    try:
        spec.loader.exec_module(module)
        device = checked(path, module)
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


def checked(path: str | Path, module: ModuleType) -> Device:
    """The device of a module of the user's. Raises `StudyError` if it is none."""
    from . import trial  # imported late: it needs this package

    missing = [part for part in ("NAME", "ROLE", "Par") if part not in vars(module)]
    if missing:
        raise StudyError(f"The device file {path} lacks {', '.join(missing)}; see docs/extending.md.")
    if module.ROLE == "link":
        raise StudyError(f"{path}: a link model of your own is not supported; all rows of links.csv are HVDC links.")
    wrong = trial.unreadable(module) or misspelt(module) or trial.mistake(of(module))
    if wrong:
        raise StudyError(f"{path}: {wrong}{'' if wrong.endswith('?') else '.'}")
    device = of(module)
    _ = device.content  # as it is now: what it computes later and keeps is none of it
    return device


def _record(file: str, *values: Any) -> Any:
    """Parameters received from another process, where the device of this file is registered."""
    if file not in (device.file for device in _registered.values()):
        register(file)
    return _registered[Path(file).stem].Par(*values)


def register_as(files: Mapping[str, str]) -> None:
    """Register what another process has registered. Raises `StudyError` for a file that has been edited since then."""
    for file, code in files.items():
        if registered().get(file) != code:
            register(file)
            if registered()[file] != code:
                raise StudyError(f"{file} has been edited since the study began; run the same command again.")


def registered() -> dict[str, str]:
    """Files of the devices registered so far, with a hash of the content of each."""
    return {d.file: sha256(d.content.text.encode()).hexdigest() for d in _registered.values()}
