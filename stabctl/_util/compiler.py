"""Object code of functions, made by numba. Only what compiles imports this module.

A function that Python calls has one argument, the address of its words (`words`): what takes its arguments from there,
and puts there what it returns, is generated here from their kinds. Any function returns a status, 0 if all is well.
"""

import linecache
import os
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from itertools import count
from typing import Any

import llvmlite.binding as llvm
import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.core import ccallback
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import cpu_target
from numba.np.arrayobj import populate_array
from numba.np.numpy_support import from_dtype

from .errors import StudyError
from .jit import own
from .object_code import Code, processor
from .process import paused
from .words import HEAD, SCALARS, Kind

WORD, STATUS = ir.IntType(64), ir.IntType(32)
NUMBERS = {types.boolean: "?", types.int64: "q", types.uint64: "Q", types.float64: "d"}


def function(python: Callable[..., Any], kinds: Sequence[Kind], symbol: str) -> Code:
    """A function that Python calls, for arguments of these kinds."""
    returns: list[str] = []

    def call(context: Any, builder: Any, about: Any, inner: Any, given: Sequence[Any]) -> Any:
        words = _words(builder, given[0])
        taken = [_read(context, builder, kind, words) for kind in about.argtypes]
        status, value = context.call_conv.call_function(builder, inner, about.restype, about.argtypes, taken)
        returns[:] = _write(context, builder, about.restype, value, words) if about.restype is not types.none else ""
        return status

    machine = _machine(python, [_type(kind) for kind in kinds], None, [WORD.as_pointer()], call, symbol)
    return Code(symbol, "".join(returns), numba.__version__, *machine)


def callback(python: Callable[..., None], scalar: type, symbol: str) -> Code:
    """A family of devices, which compiled code calls; see `stabctl.dynamics._codegen`."""
    number = types.complex128 if scalar is complex else types.float64
    pointers = [types.CPointer(kind) for kind in (types.int64, types.float64, number, number, types.int64)]

    def call(context: Any, builder: Any, about: Any, inner: Any, given: Sequence[Any]) -> Any:
        cast = [
            builder.inttoptr(one, context.get_value_type(kind)) for one, kind in zip(given[2:], pointers, strict=True)
        ]
        return context.call_conv.call_function(builder, inner, about.restype, about.argtypes, [*given[:2], *cast])[0]

    machine = _machine(python, [types.int64, types.int64, *pointers], types.void, [WORD] * 7, call, symbol)
    return Code(symbol, "", numba.__version__, *machine)


also: list[Callable[[Any, str], None]] = []  # called with every optimized module and its symbol


def _machine(
    python: Callable[..., Any], kinds: Any, returned: Any, given: Any, call: Any, symbol: str
) -> tuple[list[str], bytes]:
    """Object code of a function of numba, and of the one function visible in it, which `call` writes."""
    options = {"error_model": "numpy", "_nrt": False}
    family: Any = ccallback.CFunc
    compiler = _Compiler(python, family._targetdescr, options, {}, numba.core.compiler.Compiler)
    with global_compiler_lock, paused(), _linked_only():
        try:
            found: Any = compiler.compile(tuple(kinds), returned)
        except numba.core.errors.NumbaError as error:
            raise _located(error) from None
        about, context, library = found.fndesc, found.target_context, found.library
        module = library.create_ir_module("visible")
        inner = ir.Function(
            module, context.call_conv.get_function_type(about.restype, about.argtypes), about.llvm_func_name
        )
        outer = ir.Function(module, ir.FunctionType(STATUS, given), symbol)
        builder = ir.IRBuilder(outer.append_basic_block())
        builder.ret(call(context, builder, about, inner, outer.args).code)
        library.add_ir_module(module)
        for one in dict.fromkeys(library._linking_libraries):
            library._final_module.link_in(one._get_module_for_linking(), preserve=True)
        for one in library._final_module.functions:
            if not one.is_declaration and one.name != symbol:
                one.linkage = "internal"
        library._optimize_final_module()
        library._final_module.verify()
        for use in also:
            use(library._final_module, symbol)
        called = [one.name for one in library._final_module.functions if one.is_declaration]
        return [name for name in called if name.startswith("numba_")], target().emit_object(library._final_module)


def _located(error: Exception) -> Exception:
    """What numba does not compile, with its place in a file of the user's; the error itself if there is none."""
    for file, line in re.findall(r"""(?:at |File ")([^"\n]+?\.py)(?: \(|", line )(\d+)""", str(error)):
        if own(path := os.path.abspath(file)):
            lines = [linecache.getline(path, k).strip() for k in range(int(line), 0, -1)]
            function = next((one[4:].partition("(")[0] for one in lines if one.startswith("def ")), "it")
            return StudyError(
                f"{path}: line {line}, {function} cannot be compiled: {lines[0]}; use arithmetic of single numbers, "
                "functions such as np.exp, and the blocks of stabctl.devices.blocks."
            )
    return error


@contextmanager
def _linked_only() -> Iterator[None]:
    """Make no machine code of the functions that a function calls: they are linked into it."""
    codegen: Any = cpu_target.target_context.codegen()
    codegen._library_class, codegen.set_env = _Linked, lambda *_: None
    try:
        yield
    finally:
        del codegen._library_class, codegen.set_env


class _Linked(JITCodeLibrary):
    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        self._ensure_finalized()
        return 0


class _Compiler(ccallback._CFuncCompiler):  # type: ignore[name-defined,misc]
    def _customize_flags(self, flags: Any) -> Any:
        found = super()._customize_flags(flags)
        found.no_cfunc_wrapper = True  # numba's own needs numba where it is called
        return found


@cache
def target(**options: Any) -> Any:
    """The processor that is compiled for, by default for code that LLVM loads."""
    triple, cpu, features = processor()
    how = options or {"reloc": "static", "codemodel": "jitdefault", "jit": True}
    return llvm.Target.from_triple(triple).create_target_machine(cpu=cpu, features=features, opt=3, **how)


def _type(kind: Kind) -> Any:
    """The type of numba."""
    if kind.type is np.ndarray:
        dtype, axes, plain, writeable = kind.parts
        return types.Array(from_dtype(dtype), axes, "C" if plain else "A", readonly=not writeable)
    if kind.type in SCALARS:
        return from_dtype(np.dtype(kind.type))
    parts = [_type(part) for part in kind.parts]
    return types.NamedTuple(parts, kind.type) if hasattr(kind.type, "_fields") else types.Tuple(parts)


def _words(builder: Any, table: Any, first: int = 0) -> Iterator[Any]:
    """Pointers to the words from the first on."""
    return (builder.gep(table, [WORD(i)]) for i in count(first))


def _pointer(builder: Any, word: Any, kind: Any = WORD) -> Any:
    return builder.inttoptr(builder.load(word), kind.as_pointer())


def _read(context: Any, builder: Any, kind: Any, words: Iterator[Any]) -> Any:
    """A value from its words."""
    if isinstance(kind, types.BaseTuple):
        inner = _words(builder, _pointer(builder, next(words)))
        of_fields: Any = kind
        return context.make_tuple(builder, kind, [_read(context, builder, part, inner) for part in of_fields])
    if isinstance(kind, types.Array):
        return _array(context, builder, kind, _pointer(builder, next(words)))
    if kind is types.complex128:
        parts = [builder.bitcast(next(words), ir.DoubleType().as_pointer()) for _ in range(2)]
        return context.make_complex(builder, kind, *map(builder.load, parts))._getvalue()
    kept = builder.bitcast(next(words), context.get_data_type(kind).as_pointer())
    return context.data_model_manager[kind].from_data(builder, builder.load(kept))


def _write(context: Any, builder: Any, kind: Any, value: Any, words: Iterator[Any]) -> str:
    """Store what is returned; returns its words, see `words.Loaded`."""
    if isinstance(kind, types.BaseTuple):
        of_fields: Any = kind
        parts = [(part, builder.extract_value(value, i)) for i, part in enumerate(of_fields)]
        return f"({''.join(_write(context, builder, *part, words) for part in parts)})"
    kind = types.unliteral(kind)
    kept = context.get_value_as_data(builder, kind, value)
    builder.store(kept, builder.bitcast(next(words), kept.type.as_pointer()))
    return NUMBERS[kind]


def _array(context: Any, builder: Any, kind: Any, item: Any) -> Any:
    """An array from the head of its object, which is the same in every version of numpy."""
    made, of_items = context.make_array(kind)(context, builder), context.get_data_type(kind.dtype)
    data, _, shape, strides = (next(_words(builder, item, HEAD // 8 + i)) for i in range(4))
    sizes = [
        [builder.load(next(_words(builder, _pointer(builder, at), i))) for i in range(kind.ndim)]
        for at in (shape, strides)
    ]
    populate_array(made, _pointer(builder, data, of_items), *sizes, WORD(context.get_abi_sizeof(of_items)), None)  # type: ignore[call-arg]
    return made._getvalue()
