"""Compiles kernels to machine code (numba) and keeps them on disk.

A kernel is a plain function of numbers, arrays and records that loops over a few actors, frames or proposals: many
small operations, for which calls of numpy would cost ten times what the arithmetic does. Each is compiled for one
signature when its module is imported, and kept beside the module (`__pycache__`), so the first import in an environment
takes half a minute. In the campaign's workers that happens in the fork server, before any of them starts.

Arithmetic is IEEE's, in the order that is written (no `fastmath`, no threads), so that a machine of the same kind gives
the same bits. Indices are not checked: an index that comes from a measurement is clamped to its array (the integer of a
NaN may be anything).
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

from numba import njit, types

F = TypeVar("F", bound=Callable[..., Any])

FLOAT, INT, FLAG = types.float64, types.int64, types.boolean
FLOATS, INTS = types.float64[::1], types.int64[::1]
"""[N], in one piece."""
TABLE = types.float64[:, ::1]
"""[M, N], in one piece."""
ANY_TABLE = types.float64[:, :]
"""[M, N], a part of another one, perhaps."""
BYTE_TABLE = types.uint8[:, ::1]
FLAG_TABLE = types.boolean[:, ::1]
CUBE = types.float64[:, :, ::1]
HYPERCUBE = types.float64[:, :, :, ::1]

_notice_given = False


def inner(function: F) -> F:
    """Mark a function that only kernels call: it is compiled and kept as a part of each of them."""
    return cast(F, njit(error_model="numpy")(function))


def compiled(*signature: Any) -> Callable[[F], F]:  # noqa: ANN401  numba's types have none
    """Compile a function for arguments of these types: those above, or of `records.array_of`."""

    def compile_it(function: F) -> F:
        # numba (0.68.1) compiles anew when the function's own file changes, but not when a file does from which it uses
        # functions or constants. It stores a function under its name, so the name contains a hash of this folder.
        function.__qualname__ += "_" + state_of(Path(__file__).parent)
        try:
            made = njit(signature, cache=True, error_model="numpy")(function)
            _announce_once(made)
            return cast(F, made)
        except RuntimeError:  # it can be stored neither beside the module nor in a user's folder
            return cast(F, njit(signature, error_model="numpy")(function))

    return compile_it


def _announce_once(made: object) -> None:
    """Tell the user at a terminal why it takes so long, once the first function had to be compiled."""
    global _notice_given  # noqa: PLW0603  once in a process
    stats = getattr(made, "stats", None)  # none where NUMBA_DISABLE_JIT is set
    if not _notice_given and stats is not None and stats.cache_misses and sys.stderr.isatty():
        _notice_given = True
        sys.stderr.write("compiling the inner loops for this machine, once (about half a minute) ...\n")


@cache
def state_of(folder: Path) -> str:
    """Return a short hash of the contents of all Python files in a folder and those within it."""
    found = hashlib.sha256()
    for file in sorted(folder.rglob("*.py")):
        found.update(file.read_bytes())
    return found.hexdigest()[:12]
