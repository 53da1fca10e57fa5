"""Calls of a family of devices through its address, so that the machine code of the caller is independent of it."""

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic


@intrinsic
def call(typingctx: Any, address: Any, op: Any, n: Any, w: Any, k: Any, s: Any, f: Any, on: Any) -> Any:
    """void (*address)(op, n, w, k, s, f, on); pointers are given as integers (array.ctypes.data)."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        word, byte = ir.IntType(64), ir.IntType(8).as_pointer()
        kind = ir.FunctionType(ir.VoidType(), [word, word, byte, byte, byte, byte, byte])
        function = builder.inttoptr(args[0], kind.as_pointer())
        builder.call(function, [*args[1:3], *(builder.inttoptr(a, byte) for a in args[3:])])
        return context.get_dummy_value()

    return types.void(*[types.int64] * 8), codegen
