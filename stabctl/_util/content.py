"""What a user's Python objects consist of, as text that differs where they do different things.

A function consists of its bytecode and the values of the names that it uses, a class of its attributes, and so on. What
counts is in memory, since a file may have been edited after its import. What belongs to Python, to this package or to
an installed one is known by its name.
"""

import pickle
import sys
from collections.abc import Collection, Iterable, Mapping
from contextlib import suppress
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from types import (
    BuiltinFunctionType,
    CellType,
    CodeType,
    EllipsisType,
    FunctionType,
    GetSetDescriptorType,
    MemberDescriptorType,
    ModuleType,
    NoneType,
)
from typing import Any, NamedTuple

import numpy as np

from .jit import own

_CODE = (
    *("co_code", "co_exceptiontable", "co_consts", "co_names", "co_varnames", "co_freevars", "co_cellvars"),
    *("co_flags", "co_argcount", "co_posonlyargcount", "co_kwonlyargcount"),
)
_WRAPPED = "__wrapped__", "__func__", "__self__", "fget", "func", "args", "keywords"  # of methods, properties, ...


class Content(NamedTuple):
    """What something consists of."""

    text: str
    package: tuple[ModuleType, ...]  # modules of this package that it uses
    unknown: tuple[str, ...]  # types of the objects in it that cannot be read


def content(value: object, home: str | None) -> Content:
    """What a value consists of; what is installed in the folder of the file `home` counts as the user's, too."""
    reader = _Reader(Path(home).parent if home else None)
    return Content(reader.text(value), tuple(reader.package.values()), tuple(reader.unknown))


def attributes(value: Any) -> dict[str, Any]:
    """Name -> value, of what was given to an object, without what it has computed and kept."""
    every = [getattr(base, "__slots__", ()) for base in type(value).__mro__]
    names = [name for one in every for name in ([one] if isinstance(one, str) else one)]
    slots = [name for name in names if not name.startswith("__") and hasattr(value, name)]
    kept = {name for base in type(value).__mro__ for name, of in vars(base).items() if isinstance(of, cached_property)}
    given = {name: getattr(value, name) for name in slots} | getattr(value, "__dict__", {})
    return {name: one for name, one in given.items() if name not in kept}


class _Reader:
    """Reads objects; one that was read before is told by its number, so that circles end."""

    def __init__(self, home: Path | None) -> None:
        self.home = home
        self.seen: dict[int, tuple[int, object]] = {}  # the objects are held, as their addresses must not be used again
        self.package: dict[str, ModuleType] = {}
        self.unknown: list[str] = []

    def text(self, value: Any) -> str:
        """What a value consists of."""
        if isinstance(value, bool | int | float | complex | str | bytes | NoneType | EllipsisType):
            return repr(value)
        if isinstance(value, np.ndarray) and not value.dtype.hasobject:
            return f"{value.dtype}{value.shape}{sha256(value.tobytes()).hexdigest()}"
        if isinstance(value, CodeType):
            return self._texts(getattr(value, name) for name in _CODE)
        if isinstance(value, tuple):
            return self.text(type(value)) + self._texts(value)
        if isinstance(value, set | frozenset):
            alone = sorted(value, key=lambda one: _Reader(self.home).text(one))  # whatever was read before
            return type(value).__name__ + self._texts(alone)
        if id(value) in self.seen:
            return f"#{self.seen[id(value)][0]}"
        self.seen[id(value)] = len(self.seen), value
        return self._new(value)

    def _texts(self, values: Iterable[Any]) -> str:
        return f"({', '.join(map(self.text, values))})"

    def _new(self, value: Any) -> str:
        """What an object consists of that was not read before."""
        if isinstance(value, ModuleType):
            return self._name(value.__name__)
        if isinstance(value, FunctionType | type):
            module = value.__module__ or ""
            name = self._name(module, value.__qualname__)
            if not self._own(module):
                return name
            return name + (self._function(value) if isinstance(value, FunctionType) else self._class(value))
        if isinstance(value, list):
            return self._texts(value)
        if isinstance(value, Mapping):
            return self._texts(value.items())
        if isinstance(value, BuiltinFunctionType):
            return value.__qualname__ + self._texts([value.__self__])
        if self._own(type(value).__module__) or type(value).__module__.startswith("stabctl."):
            return self.text(type(value)) + self.text(attributes(value))
        if parts := [getattr(value, name) for name in _WRAPPED if hasattr(value, name)]:
            return type(value).__name__ + self._texts(parts)
        try:
            return sha256(pickle.dumps(value)).hexdigest()
        except Exception:  # it has a lock, a file, a generator, ...
            self.unknown.append(type(value).__name__)
            return type(value).__qualname__

    def _name(self, module: str, name: str = "") -> str:
        if module.startswith("stabctl.") and module in sys.modules:
            self.package[module] = sys.modules[module]
        return f"{module}:{name}"

    def _own(self, module: str) -> bool:
        """Whether a module is the user's; also what was typed in, or made of text."""
        if module == "__main__" or module not in sys.modules:
            return True
        file = getattr(sys.modules[module], "__file__", None) or ""
        return own(file) or (bool(file) and Path(file).parent == self.home)

    def _class(self, kind: type) -> str:
        """Bases and attributes, without those that Python adds."""
        added = GetSetDescriptorType | MemberDescriptorType
        given = {
            name: value
            for name, value in vars(kind).items()
            if not isinstance(value, added) and name != "_abc_impl"
            if not name.startswith("__") or isinstance(value, FunctionType)
        }
        return self._texts([kind.__bases__, given])

    def _function(self, function: FunctionType) -> str:
        """Bytecode, defaults, and the values of what it uses from around it."""
        names = list(dict.fromkeys(_names(function.__code__)))
        around = [_contents(cell) for cell in function.__closure__ or ()]
        used = {name: function.__globals__[name] for name in names if name in function.__globals__}
        imported = {name: sys.modules[name] for name in names if name in sys.modules and self._own(name)}
        used |= self._inside([*used.values(), *imported.values()], names)
        return self._texts(
            [function.__code__, function.__defaults__, function.__kwdefaults__, vars(function), around, used]
        )

    def _inside(self, values: Iterable[Any], names: Collection[str]) -> dict[str, Any]:
        """What has one of these names in the user's modules among the values, or in modules in them."""
        found: dict[str, Any] = {}
        todo = [value for value in values if isinstance(value, ModuleType)]
        for module in todo:
            if self._own(module.__name__):
                inside = {name: vars(module)[name] for name in names if name in vars(module)}
                todo += [value for value in inside.values() if isinstance(value, ModuleType) and value not in todo]
                found |= {f"{module.__name__}.{name}": value for name, value in inside.items()}
        return found


def _contents(cell: CellType) -> Any:
    """What a cell of a closure holds; None before it holds anything."""
    with suppress(ValueError):
        return cell.cell_contents
    return None


def _names(code: CodeType) -> Iterable[str]:
    """Names that are used in code, and in the functions within it."""
    yield from code.co_names
    for one in code.co_consts:
        if isinstance(one, CodeType):
            yield from _names(one)
