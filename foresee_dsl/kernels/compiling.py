"""Inner loops of the drivers, compiled to machine code (numba).

A kernel is a plain function of numbers and arrays over a few others, over frames and over proposals: many small
operations, where calls of numpy cost ten times what they reckon. Each is compiled for one signature when its module is
imported, and kept beside the module (`__pycache__`): the first import in an environment takes the time of a compiler.
In the campaign's workers that is in the fork server, before any of them starts.

Arithmetic is IEEE's, in the order that is written (no `fastmath`, no threads), so that a machine of the same kind gives
the same bits. Two things to keep in mind: a kernel is compiled anew when its own file changes, or one that is named in
in `made_of`, but not when another one does, so it takes functions and numbers from these files only; and indices are
not checked, so they are held within their array where they come from a measurement (the integer of a NaN may be
anything).
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

from numba import njit, typeof, types

_PACKAGE = Path(__file__).parent.parent
_KERNELS = "kernels/*.py drivers/**/*.py simulate/**/*.py forecast/*.py"
F = TypeVar("F", bound=Callable[..., Any])
_type_of: Callable[[object], Any] = typeof

FLOAT, INT, FLAG = types.float64, types.int64, types.boolean
FLOATS, INTS, FLAGS = types.float64[::1], types.int64[::1], types.boolean[::1]
"""[N], in one piece."""
TABLE, INT_TABLE, FLAG_TABLE = types.float64[:, ::1], types.int64[:, ::1], types.boolean[:, ::1]
"""[M, N], in one piece."""
ANY_TABLE = types.float64[:, :]
"""[M, N], a part of another one, perhaps."""
BYTE_TABLE = types.uint8[:, ::1]
CUBE = types.float64[:, :, ::1]
HYPERCUBE = types.float64[:, :, :, ::1]


_said = False


def inner(function: F) -> F:
    """Mark a function that only kernels call: it is compiled and kept as a part of each of them."""
    return cast(F, njit(error_model="numpy")(function))


def compiled(*signature: Any, made_of: str = "") -> Callable[[F], F]:  # noqa: ANN401  numba's types have none
    """Compile a function for these types of arguments.

    Args:
        signature: of each argument, one of the types above, or a named tuple of numbers as an example.
        made_of: the other files, beside its own, that it takes functions and numbers from: names or patterns such
            as `pdm_*.py`, with spaces between them.
    """
    kinds = tuple(_type_of(kind) if isinstance(kind, tuple) else kind for kind in signature)

    def compile_it(function: F) -> F:
        if made_of:  # it is kept under its name, so a name for each state of the files
            function.__qualname__ += "_" + _state_of(
                Path(__file__).parent.parent, "kernels/*.py drivers/**/*.py simulate/**/*.py forecast/*.py"
            )
        try:
            made = njit(kinds, cache=True, error_model="numpy")(function)
            _say_once(made)
            return cast(F, made)
        except RuntimeError:  # nowhere to keep it: neither beside the module nor in a user's folder
            return cast(F, njit(kinds, error_model="numpy")(function))

    return compile_it


def _say_once(made: object) -> None:
    """Tell who waits at a terminal what for, when the first function had to be compiled."""
    global _said  # noqa: PLW0603  once in a process
    stats = getattr(made, "stats", None)  # none where NUMBA_DISABLE_JIT is set
    if not _said and stats is not None and stats.cache_misses and sys.stderr.isatty():
        _said = True
        sys.stderr.write("compiling the inner loops for this machine, once (about half a minute) ...\n")


@cache
def _state_of(folder: Path, patterns: str) -> str:
    """Return a short hash of the contents of all files that hold kernels or their constants."""
    found = hashlib.sha256()
    for pattern in patterns.split():
        for file in sorted(folder.glob(pattern)):
            content = file.read_bytes()
            if b"kernels.compiling import" in content or file.name in ("settings.py", "compiling.py"):
                found.update(content)
    return found.hexdigest()[:12]
