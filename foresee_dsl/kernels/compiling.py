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

from numba import njit, typeof, types

PACKAGE = Path(__file__).parent.parent
KERNEL_FILES = "kernels/**/*.py drivers/**/*.py"
_CONSTANTS = ("settings.py", "foes.py")
"""Files of constants that kernels outside of this package take."""
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

_notice_given = False


def inner(function: F) -> F:
    """Mark a function that only kernels call: it is compiled and kept as a part of each of them."""
    return cast(F, njit(error_model="numpy")(function))


def compiled(*signature: Any) -> Callable[[F], F]:  # noqa: ANN401  numba's types have none
    """Compile a function for these types of arguments.

    Args:
        signature: of each argument, one of the types above, or a named tuple of numbers as an example.
    """
    kinds = tuple(_type_of(kind) if isinstance(kind, tuple) else kind for kind in signature)

    def compile_it(function: F) -> F:
        # numba (0.68.1) compiles anew when the function's own file changes, but not when one does that it takes
        # functions or constants from. It keeps a function under its name, so the name holds the state of all of them.
        function.__qualname__ += "_" + state_of(PACKAGE, KERNEL_FILES)
        try:
            made = njit(kinds, cache=True, error_model="numpy")(function)
            _announce_once(made)
            return cast(F, made)
        except RuntimeError:  # nowhere to keep it: neither beside the module nor in a user's folder
            return cast(F, njit(kinds, error_model="numpy")(function))

    return compile_it


def _announce_once(made: object) -> None:
    """Tell the user at a terminal why it takes so long, when the first function had to be compiled."""
    global _notice_given  # noqa: PLW0603  once in a process
    stats = getattr(made, "stats", None)  # none where NUMBA_DISABLE_JIT is set
    if not _notice_given and stats is not None and stats.cache_misses and sys.stderr.isatty():
        _notice_given = True
        sys.stderr.write("compiling the inner loops for this machine, once (about half a minute) ...\n")


@cache
def state_of(folder: Path, patterns: str) -> str:
    """Return a short hash of the contents of all files in a folder that hold kernels or their constants.

    Args:
        folder: where the patterns begin. patterns: such as `kernels/*.py`, with spaces between them.
    """
    found = hashlib.sha256()
    for pattern in patterns.split():
        for file in sorted(folder.glob(pattern)):
            content, in_house = file.read_bytes(), file.relative_to(folder).parts[0] == "kernels"
            if in_house or b"kernels.compiling import" in content or file.name in _CONSTANTS:
                found.update(content)
    return found.hexdigest()[:12]
