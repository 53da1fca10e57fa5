"""The solution of dense linear equations in compiled code, by the LAPACK of scipy, called at its address."""

import ctypes
from functools import cache

import numpy as np

from stabctl._util.jit import disabled, noinline

from .perform import call

HEAD = 3  # of `places`: number of equations, right sides, and what LAPACK tells; the pivots follow


@cache
def address() -> int:
    """Address of dgesv."""
    from scipy.linalg import cython_lapack

    capsule, api = cython_lapack.__pyx_capi__["dgesv"], ctypes.pythonapi
    api.PyCapsule_GetName.restype, api.PyCapsule_GetName.argtypes = ctypes.c_char_p, [ctypes.py_object]
    api.PyCapsule_GetPointer.restype = ctypes.c_void_p
    api.PyCapsule_GetPointer.argtypes = [ctypes.py_object, ctypes.c_char_p]
    return int(api.PyCapsule_GetPointer(capsule, api.PyCapsule_GetName(capsule)))


if disabled():

    def solve(A: np.ndarray, b: np.ndarray, places: np.ndarray, address: int) -> bool:
        """Solve A' x = b, with x in the place of b; returns whether A has an inverse."""
        try:
            b[:] = np.linalg.solve(A.T, b)
        except np.linalg.LinAlgError:
            return False
        return True

else:

    @noinline
    def solve(A, b, places, address):  # type: ignore[misc]  # noqa: ANN001, ANN201
        """Solve A' x = b, with x in the place of b, and A overwritten; returns whether A has an inverse."""
        places[0], places[1], places[2] = len(b), 1, 0
        at = places.ctypes.data
        call(address, at, at + 4, A.ctypes.data, at, at + 12, b.ctypes.data, at, at + 8)
        return places[2] == 0
