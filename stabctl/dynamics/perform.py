"""The calls of a program, made from compiled code, and the evaluation of the exact derivatives with them.

A family is called through its address, so that the machine code of the caller does not depend on it.
"""

from typing import Any

from stabctl._util.jit import disabled, entry, inline

from . import _codegen

if disabled():

    def perform(calls: Any, w: Any, k: Any, s: Any, f: Any, on: Any) -> None:
        """Call families one after the other, as plain Python."""
        for address, op, n, i, j in calls:
            _codegen.plain[address](op, n, w[i:], k[j:], s, f, on)

    def perform_local(calls: Any, starts: Any, w: Any, k: Any, s: Any, f: Any, on: Any) -> None:
        """Call families one after the other, each with its own part of f, as plain Python."""
        for (address, op, n, i, j), start in zip(calls, starts, strict=False):
            _codegen.plain[address](op, n, w[i:], k[j:], s, f[start:], on)

    def perform_due(calls: Any, bits: Any, due: int, w: Any, k: Any, s: Any, f: Any, on: Any) -> None:
        """Call the families whose bit is in `due`, as plain Python."""
        perform(calls[(bits & due) != 0], w, k, s, f, on)

else:
    from llvmlite import ir
    from numba import types
    from numba.extending import intrinsic

    @intrinsic
    def call(typingctx: Any, address: Any, op: Any, n: Any, w: Any, k: Any, s: Any, f: Any, on: Any) -> Any:
        """void (*address)(op, n, w, k, s, f, on); pointers are given as integers (array.ctypes.data)."""

        def build(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            word, byte = ir.IntType(64), ir.IntType(8).as_pointer()
            kind = ir.FunctionType(ir.VoidType(), [word, word, byte, byte, byte, byte, byte])
            function = builder.inttoptr(args[0], kind.as_pointer())
            builder.call(function, [*args[1:3], *(builder.inttoptr(a, byte) for a in args[3:])])
            return context.get_dummy_value()

        return types.void(*[types.int64] * 8), build

    @inline
    def perform(calls, w, k, s, f, on):  # type: ignore[misc]
        """Call families one after the other."""
        for c in range(len(calls)):
            call(
                calls[c, 0], calls[c, 1], calls[c, 2], w.ctypes.data + 8 * calls[c, 3],
                k.ctypes.data + 8 * calls[c, 4], s.ctypes.data, f.ctypes.data, on.ctypes.data,
            )  # fmt: skip

    @inline
    def perform_local(calls, starts, w, k, s, f, on):  # type: ignore[misc]
        """Call families one after the other, each with its own part of f (complex)."""
        for c in range(len(calls)):
            call(
                calls[c, 0], calls[c, 1], calls[c, 2], w.ctypes.data + 8 * calls[c, 3],
                k.ctypes.data + 8 * calls[c, 4], s.ctypes.data, f.ctypes.data + 16 * starts[c], on.ctypes.data,
            )  # fmt: skip

    @inline
    def perform_due(calls, bits, due, w, k, s, f, on):  # type: ignore[misc]
        """Call the families whose bit is in `due`."""
        for c in range(len(calls)):
            if bits[c] & due:
                call(
                    calls[c, 0], calls[c, 1], calls[c, 2], w.ctypes.data + 8 * calls[c, 3],
                    k.ctypes.data + 8 * calls[c, 4], s.ctypes.data, f.ctypes.data, on.ctypes.data,
                )  # fmt: skip


@entry
def evaluate(p, starts, s, f, on):
    """Update the outputs in s (complex) and write the derivative blocks of all devices to f."""
    perform(p.sweep, p.w, p.k, s, f, on)
    perform_local(p.step, starts, p.w, p.k, s, f, on)
