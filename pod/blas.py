"""Products by BLAS that leave other threads of Python running, which those of scipy.linalg.blas do not."""

import ctypes
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cython_blas

Array = NDArray[np.float64]


def add_symmetric_product(rows: Array, total: Array) -> None:
    """Add BᵀB of rows B (b, n), contiguous, to the upper triangle of `total` (n, n), contiguous; the lower is not set.

    dsyrk reads both by columns: B is Bᵀ to it, and the triangle that it calls lower is the upper one of `total`.
    """
    b, n = rows.shape
    if b and n:
        _call("dsyrk", b"L", b"N", n, b, 1.0, rows, n, 1.0, total, n)


def multiply_by_triangle_(rows: Array, upper: Array) -> None:
    """Multiply rows B (b, n) by an upper triangle F (n, n) in place, B <- B F, both contiguous.

    dtrmm reads both by columns: Bᵀ <- Fᵀ Bᵀ with a lower triangle.
    """
    b, n = rows.shape
    if b and n:
        _call("dtrmm", b"L", b"L", b"N", b"N", n, b, 1.0, upper, n, rows, n)


def _call(name: str, *arguments: bytes | int | float | Array) -> None:
    """Call a function of BLAS, all of whose arguments are addresses."""
    kept = [_addressed(argument) for argument in arguments]
    _function(name, len(kept))(*kept)


def _addressed(argument: bytes | int | float | Array) -> Any:
    if isinstance(argument, bytes):
        return argument
    if isinstance(argument, np.ndarray):
        return argument.ctypes.data
    return ctypes.byref(ctypes.c_int(argument) if isinstance(argument, int) else ctypes.c_double(argument))


@cache
def _function(name: str, count: int) -> Callable[..., Any]:
    """Return a function of the BLAS that scipy has; a foreign function is called without the interpreter's lock."""
    functions: dict[str, Any] = dict(cython_blas.__pyx_capi__)
    capsule = functions[name]
    api = ctypes.pythonapi
    api.PyCapsule_GetName.restype, api.PyCapsule_GetName.argtypes = ctypes.c_char_p, [ctypes.py_object]
    api.PyCapsule_GetPointer.restype = ctypes.c_void_p
    api.PyCapsule_GetPointer.argtypes = [ctypes.py_object, ctypes.c_char_p]
    address = api.PyCapsule_GetPointer(capsule, api.PyCapsule_GetName(capsule))
    return ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * count)(address)
