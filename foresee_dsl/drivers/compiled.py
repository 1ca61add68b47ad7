"""Inner loops of the drivers, compiled to machine code (numba).

A kernel is a plain function of numbers and arrays over a few others, over frames and over proposals: many small
operations, where calls of numpy cost ten times what they reckon. Each is compiled for one signature when its module is
imported, and kept beside the module (`__pycache__`): the first import in an environment takes the time of a compiler.
In the campaign's workers that is in the fork server, before any of them starts.

Arithmetic is IEEE's, in the order that is written (no `fastmath`, no threads), so that a machine of the same kind gives
the same bits. Two things to keep in mind: a kernel is compiled anew when its own file changes, but not when another one
does, so it calls kernels of its own file only and is given the settings that it needs; and indices are not checked, so
they are held within their array where they come from a measurement (the integer of a NaN may be anything).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit, typeof, types

F = TypeVar("F", bound=Callable[..., Any])
_type_of: Callable[[object], Any] = typeof

FLOAT, INT, FLAG = types.float64, types.int64, types.boolean
FLOATS, INTS, FLAGS = types.float64[::1], types.int64[::1], types.boolean[::1]
"""[N], in one piece."""
TABLE, INT_TABLE, FLAG_TABLE = types.float64[:, ::1], types.int64[:, ::1], types.boolean[:, ::1]
"""[M, N], in one piece."""
CUBE = types.float64[:, :, ::1]
HYPERCUBE = types.float64[:, :, :, ::1]


def inner(function: F) -> F:
    """Mark a function that only kernels of its own file call: it is compiled and kept as a part of each of them."""
    return cast(F, njit(error_model="numpy")(function))


def compiled(*signature: Any) -> Callable[[F], F]:  # noqa: ANN401  numba's types have none
    """Compile a function for these types of arguments.

    Args:
        signature: of each argument, one of the types above, or a named tuple of numbers as an example.
    """
    kinds = tuple(_type_of(kind) if isinstance(kind, tuple) else kind for kind in signature)

    def compile_it(function: F) -> F:
        try:
            return cast(F, njit(kinds, cache=True, error_model="numpy")(function))
        except RuntimeError:  # nowhere to keep it: neither beside the module nor in a user's folder
            return cast(F, njit(kinds, error_model="numpy")(function))

    return compile_it
