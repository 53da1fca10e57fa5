"""Arguments of compiled functions as 64-bit words, and their kinds: what a call needs, without numba.

A function has one argument, the address of its words:

    array             address of the object, from whose head compiled code reads data, shape and strides
    record or tuple   address of the words of its fields
    number            its value; a complex number has two words

Then come the words of what it returns. The words of a `record` are made once and kept with it.
"""

import ctypes
from collections.abc import Iterable, Iterator
from struct import Struct
from typing import Any, NamedTuple, TypeVar

import numpy as np

T = TypeVar("T")
HEAD = object.__basicsize__  # bytes before the address of the data of an array; then its axes, shape and strides
SCALARS = {bool: (bool, np.bool_), int: (int, np.integer), float: (float,), complex: (complex,)}


class Kind(NamedTuple):
    """The kind of an argument."""

    type: Any  # np.ndarray, the class of a number, or that of a tuple
    parts: tuple[Any, ...]  # of an array its dtype, axes, whether in C order and writeable; of a tuple, kinds

    @property
    def layout(self) -> str:
        """Its words, for `struct`."""
        return {bool: "q", int: "q", float: "d", complex: "dd"}.get(self.type, "q")

    def __str__(self) -> str:
        name = f"{self.type.__module__}.{self.type.__qualname__}{getattr(self.type, '_fields', '')}"
        return f"{name}({', '.join(map(str, self.parts))})"


_kinds: dict[Any, Kind] = {one: Kind(one, ()) for one in SCALARS}


def record(cls: type[T]) -> type[T]:
    """Let the records of a NamedTuple keep their words; these leave them behind when they are copied or pickled."""
    about = {"__module__": cls.__module__, "__qualname__": cls.__qualname__, "__doc__": cls.__doc__}
    return type(cls.__name__, (cls,), {**about, "__getstate__": lambda self: None})


def taken(values: Iterable[Any]) -> tuple[list[Any], tuple[Kind, ...], list[Any]]:
    """Words of arguments, their kinds, and what must live until the call is over."""
    words: list[Any] = []
    kinds: list[Kind] = []
    held: list[Any] = []
    for value in values:
        found = type(value)
        if found is np.ndarray:
            words.append(id(value))
            usual = _usual.get(value.dtype) if value.flags.carray else None
            kinds.append(usual[value.ndim] if usual else _array(value))
        elif isinstance(value, tuple):
            kind, address, buffer = packed(value)
            words.append(address)
            kinds.append(kind)
            held.append(buffer)
        else:
            simple = found if found in SCALARS else next((k for k, v in SCALARS.items() if isinstance(value, v)), None)
            if simple is None:
                raise TypeError(f"compiled code takes no {found.__name__}")
            words += (value.real, value.imag) if simple is complex else (value,)
            kinds.append(_kinds[simple])
    return words, tuple(kinds), held


def _array(value: np.ndarray) -> Kind:
    key = value.dtype, value.ndim, value.flags.c_contiguous, value.flags.writeable
    return _kinds.get(key) or _kinds.setdefault(key, Kind(np.ndarray, key))


_usual = {
    np.dtype(one): [
        _kinds.setdefault(key, Kind(np.ndarray, key)) for key in ((np.dtype(one), n, True, True) for n in range(9))
    ]
    for one in (bool, np.int32, np.int64, np.uint32, np.uint64, float, complex)
}


def packed(value: Any) -> tuple[Kind, int, Any]:
    """Kind of a tuple, address of its words, and what owns them; a `record` keeps them."""
    own = getattr(value, "__dict__", None)
    if own:
        return own["words"]  # type: ignore[no-any-return]
    words, kinds, held = taken(value)
    key = type(value), kinds
    kind = _kinds.get(key) or _kinds.setdefault(key, Kind(*key))
    layout = Struct("".join(part.layout for part in kinds))
    buffer = ctypes.create_string_buffer(layout.pack(*words), layout.size or 8)
    found = kind, ctypes.addressof(buffer), (buffer, held)
    if own is not None:
        own["words"] = found
    return found


class Function:
    """A compiled function in memory, for arguments of some kinds."""

    def __init__(self, code: "Loaded", kinds: Iterable[Kind]) -> None:
        self._call, self._owner = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p)(code.address), code.owner
        self._address = code.address
        layout = "".join(kind.layout for kind in kinds)
        self._returned = Struct("".join(f"{c}7x" if c == "?" else c for c in code.returns if c not in "()"))
        self._at, self._words = Struct(layout).size, Struct(f"{layout}{self._returned.size}x")
        self._buffer, self._shape = ctypes.c_char * self._words.size, _shape(iter(code.returns))

    def __call__(self, words: list[Any]) -> Any:
        """Call it."""
        buffer = self._buffer.from_buffer_copy(self._words.pack(*words))
        if self._call(buffer):
            raise ZeroDivisionError("a complex number is divided by zero in compiled code")  # it raises nothing else
        found = _nested(self._shape, iter(self._returned.unpack_from(buffer, self._at)))
        return found[0] if found else None

    def bound(self, words: list[Any], held: Any) -> "Bound":
        """The function with these words, to be called from compiled code."""
        buffer = self._buffer.from_buffer_copy(self._words.pack(*words))
        return Bound(self._address, ctypes.addressof(buffer), (self._owner, buffer, held))


class Bound(NamedTuple):
    """A call to be made from compiled code, by `perform.call`."""

    address: int  # of the function
    words: int  # address of its words
    held: Any  # what must live until the last call


class Loaded(NamedTuple):
    """A function in memory."""

    address: int
    returns: str  # a character of `struct` for each word of what it returns; the words of a tuple are in brackets
    owner: Any  # of the memory


def _shape(returns: Iterator[str]) -> list[Any]:
    """A list for every tuple that is returned, with None for every number."""
    return [_shape(returns) if c == "(" else None for c in iter(lambda: next(returns, ")"), ")")]


def _nested(shape: list[Any], values: Iterator[Any]) -> tuple[Any, ...]:
    return tuple([next(values) if part is None else _nested(part, values) for part in shape])
