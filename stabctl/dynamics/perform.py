"""The calls of a program, made from compiled code, and the evaluation of the exact derivatives with them.

A family is called through its address, so that the machine code of the caller does not depend on it.
"""

from typing import Any

from stabctl._util.jit import disabled, entry, inline, lowered, plain

from . import _codegen


def call(address: int, *words: int) -> int:
    """int (*address)(words ...): whole numbers, and pointers given as such (array.ctypes.data); only compiled.

    What a family returns is 0, or its status where a complex number is divided by zero: the rest is not evaluated then.
    """
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
            return types.int32(*args)

    @lower_builtin(call, types.VarArg(types.Any))
    def lower(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        word = ir.IntType(64)
        kind = ir.FunctionType(ir.IntType(32), [word] * (len(args) - 1))
        words = [context.cast(builder, a, t, types.int64) for a, t in zip(args, signature.args, strict=True)]
        return builder.call(builder.inttoptr(words[0], kind.as_pointer()), words[1:])


if disabled():

    def perform(calls: Any, w: Any, k: Any, s: Any, f: Any, on: Any) -> None:
        """Call families one after the other, as plain Python."""
        for address, op, n, i, j in calls:
            _codegen.plain[address](op, n, w[i:], k[j:], s, f, on)

    def fails(c: int, calls: Any, p: Any, s: Any, f: Any, at: int, on: Any) -> bool:
        """Make call c of a program, as plain Python; returns whether it divides by zero."""
        address, op, n, i, j = calls[c]
        try:
            _codegen.plain[address](op, n, p.w[i:], p.k[j:], s, f[at:], on)
        except ZeroDivisionError:
            return True
        return False

    def perform_due(calls: Any, bits: Any, due: int, w: Any, k: Any, s: Any, f: Any, on: Any) -> None:
        """Call the families whose bit is in `due`, as plain Python."""
        perform(calls[(bits & due) != 0], w, k, s, f, on)

    def call_bound(at: Any) -> None:
        """Call an entry point with the arguments bound to it, as plain Python."""
        plain[at[0] - 1]()

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
    def call_bound(at):  # type: ignore[misc]
        """Call an entry point with the arguments bound to it: `at` has the address of both, or 0."""
        call(at[0], at[1])

    @inline
    def fails(c, calls, p, s, f, at, on):  # type: ignore[misc]
        """Make call c of a program (complex); returns whether it divides by zero."""
        return call(
            calls[c, 0], calls[c, 1], calls[c, 2], p.w.ctypes.data + 8 * calls[c, 3],
            p.k.ctypes.data + 8 * calls[c, 4], s.ctypes.data, f.ctypes.data + 16 * at, on.ctypes.data,
        ) != 0  # fmt: skip

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
    """Update the outputs in s (complex) and write the derivative blocks of all devices to f.

    Returns the row of the call of `p.sweep`, and that of `p.step`, in which a complex number is divided by zero; those
    after it are not made. -1 if there is none.
    """
    for c in range(len(p.sweep)):
        if fails(c, p.sweep, p, s, f, 0, on):
            return c, -1
    for c in range(len(p.step)):
        if fails(c, p.step, p, s, f, starts[c], on):
            return -1, c
    return -1, -1
