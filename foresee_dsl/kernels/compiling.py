"""Compiles kernels to machine code (numba) and keeps them on disk.

A kernel is a plain function of numbers, arrays and records that loops over a few actors, frames or proposals: many
small operations, for which calls of numpy would cost ten times what the arithmetic does. Each is compiled for one
signature when its module is imported for the first time, and kept beside the module (`__pycache__`), so the first
import in an environment takes half a minute. From then on a kernel is loaded from there when it is first called: a
run calls half of them. A campaign's fork server loads all that are imported, before the workers start (`load_all`).

Arithmetic is IEEE's, in the order that is written (no `fastmath`, no threads), so that a machine of the same kind gives
the same bits. Indices are not checked: an index that comes from a measurement is clamped to its array (the integer of a
NaN may be anything).
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

from foresee_dsl.late_import import left_out

with left_out("scipy.linalg.cython_blas"):
    # numba (0.68.1) imports it, and with it scipy.linalg, a third of its own start-up, to see whether it is installed
    import numba.np.arraymath  # noqa: F401  before the first kernel does
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
            made = njit(cache=True, error_model="numpy")(function)
        except RuntimeError:  # it can be stored neither beside the module nor in a user's folder
            return cast(F, njit(signature, error_model="numpy")(function))
        if hasattr(made, "py_func"):  # it has none where NUMBA_DISABLE_JIT is set
            _load_late(made, signature)
            if not _is_stored(made):
                load_now(made)
                _announce_once(made)
        return cast(F, made)

    return compile_it


_waiting: dict[Any, Callable[[], Any]] = {}
"""What loads each kernel that was not called yet."""


def _load_late(made: Any, signature: Sequence[Any]) -> None:  # noqa: ANN401  numba's dispatcher
    """Let a kernel be loaded when it is first called, or first compiled into another one.

    In both cases the dispatcher (numba 0.68.1) is asked for one of these two methods while it has no machine code for
    the arguments. Ours stand before them until then, so that later calls cost nothing more.
    """

    def load() -> Any:  # noqa: ANN401  its entry point
        for method in ("_compile_for_args", "get_call_template"):
            vars(made).pop(method, None)
        _waiting.pop(made, None)
        entry = made.compile(signature)
        made.disable_compile()
        return entry

    def first_called(*arguments: object) -> Any:  # noqa: ANN401  its entry point, which numba then calls
        given = [made.typeof_pyval(argument) for argument in arguments]
        fits = (made.typingctx.can_convert(*pair) is not None for pair in zip(given, signature, strict=False))
        if len(given) != len(signature) or not all(fits):
            raise TypeError(f"{made.py_func.__name__} is compiled for {signature}, not for {tuple(given)}")
        return load()

    def first_compiled_into(arguments: object, options: object) -> Any:  # noqa: ANN401  what numba's method returns
        load()
        return made.get_call_template(arguments, options)

    made._compile_for_args, made.get_call_template = first_called, first_compiled_into
    _waiting[made] = load


def load_now(kernel: object) -> None:
    """Load a kernel, if it was not loaded yet."""
    if load := _waiting.get(kernel):
        load()


def load_all() -> None:
    """Load every kernel whose module is imported now: in the process from which workers are forked."""
    for load in tuple(_waiting.values()):
        load()


def _is_stored(made: Any) -> bool:  # noqa: ANN401  numba's dispatcher
    """Return whether a kernel was compiled before, so that loading it takes no time worth a word."""
    function = made.py_func
    begins = f"{function.__module__.rpartition('.')[2]}.{function.__qualname__}-"
    return any(name.startswith(begins) for name in _files_in(made.stats.cache_path))


@cache
def _files_in(folder: str) -> tuple[str, ...]:
    """Return the names of a folder's files, read once."""
    return tuple(file.name for file in Path(folder).glob("*.nbc"))


def _announce_once(made: Any) -> None:  # noqa: ANN401  numba's dispatcher
    """Tell the user at a terminal why it takes so long, once the first function had to be compiled."""
    global _notice_given  # noqa: PLW0603  once in a process
    if not _notice_given and made.stats.cache_misses and sys.stderr.isatty():
        _notice_given = True
        sys.stderr.write("compiling the inner loops for this machine, once (about half a minute) ...\n")


@cache
def state_of(folder: Path) -> str:
    """Return a short hash of the contents of all Python files in a folder and those within it."""
    found = hashlib.sha256()
    for file in sorted(folder.rglob("*.py")):
        found.update(file.read_bytes())
    return found.hexdigest()[:12]
