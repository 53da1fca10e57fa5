"""The calls of a program, made from compiled code, and the evaluation of the exact derivatives with them.

A family is called through its address, so that the machine code of the caller does not depend on it.
"""

from typing import Any

from stabctl._util.jit import disabled, entry, inline, lowered

from . import _codegen


def call(address: int, *words: int) -> None:
    """void (*address)(words ...): whole numbers, and pointers given as such (array.ctypes.data); only compiled."""
    raise NotImplementedError


@lowered
def _define() -> None:
    from llvmlite import ir
    from numba import types
    from numba.core.typing.templates import AbstractTemplate, infer_global
    from numba.extending import lower_builtin

    @infer_global(call)
    class Call(AbstractTemplate):  # type: ignore[misc]
        def generic(self, args: Any, kws: Any) -> Any:
            return types.void(*args)

    @lower_builtin(call, types.VarArg(types.Any))
    def lower(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        word = ir.IntType(64)
        kind = ir.FunctionType(ir.VoidType(), [word] * (len(args) - 1))
        words = [context.cast(builder, a, t, types.int64) for a, t in zip(args, signature.args, strict=True)]
        builder.call(builder.inttoptr(words[0], kind.as_pointer()), words[1:])
        return context.get_dummy_value()


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
