"""Makes kernels of plain functions: numba compiles each once and keeps the machine code in its own cache.

A kernel is a plain function of numbers, arrays and records that loops over a few actors, frames or proposals: many
small operations, for which calls of numpy would cost ten times what the arithmetic does. numba compiles each for one
signature. A process reads a kernel from the cache when it first calls it.

Arithmetic is IEEE's, in the order that is written (no `fastmath`, no threads), so that a machine of the same kind gives
the same bits. Indices are not checked: an index that comes from a measurement is clamped to its array (the integer of a
NaN may be anything).

Another package may have kernels too: it names the package that they are in by an entry point of the group `GROUP`, and
they are compiled with ours, before its driver's time is counted.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import pkgutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache, cached_property, update_wrapper
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, Literal, TypeVar, cast

import numba
import numpy as np
from llvmlite import binding
from numba.extending import typeof_impl

F = TypeVar("F", bound=Callable[..., Any])
_FOLDER = Path(__file__).parent
GROUP = "foresee_dsl.kernels"
"""Entry points: packages with kernels, which may call those here."""


@dataclass(frozen=True)
class Kind:
    """The type of a kernel's argument: a number, or an array of numbers or records.

    Attributes:
        dtype: numpy's. dimensions: 0 of a number. layout: in one piece ("C"), or a part of another array, perhaps.
    """

    dtype: np.dtype[Any]
    dimensions: int = 0
    layout: Literal["C", "A"] = "C"

    def for_numba(self) -> Any:  # noqa: ANN401  numba's types have none
        """Return numba's type."""
        item = numba.from_dtype(self.dtype)
        return numba.types.Array(item, self.dimensions, self.layout) if self.dimensions else item


FLOAT, INT, FLAG = (Kind(np.dtype(kind)) for kind in (np.float64, np.int64, np.bool_))
FLOATS, INTS, KEYS = (Kind(np.dtype(kind), 1) for kind in (np.float64, np.int64, np.uint64))
"""[N], in one piece."""
TABLE, KEY_TABLE = (Kind(np.dtype(kind), 2) for kind in (np.float64, np.uint64))
"""[M, N], in one piece."""
ANY_TABLE = Kind(np.dtype(np.float64), 2, "A")
"""[M, N], a part of another one, perhaps."""
BYTE_TABLE, FLAG_TABLE = (Kind(np.dtype(kind), 2) for kind in (np.uint8, np.bool_))
CUBE = Kind(np.dtype(np.float64), 3)
HYPERCUBE = Kind(np.dtype(np.float64), 4)


class Kernel:
    """A function that is compiled for one signature.

    Attributes:
        py_func: the plain function.
    """

    def __init__(self, function: Callable[..., Any], kinds: tuple[Kind, ...]) -> None:
        self.py_func = function
        self._kinds = kinds
        update_wrapper(self, function)

    @cached_property
    def dispatcher(self) -> Any:  # noqa: ANN401  numba's types have none
        """What numba makes of it; it refuses arguments of other types with a `TypeError`."""
        signature = tuple(kind.for_numba() for kind in self._kinds)
        # numba (0.68.1) compiles anew when the function's own file changes, but not when a file does from which it uses
        # functions or constants. It stores a function under its name, so the name contains a hash of its folder.
        qualified = self.py_func.__qualname__
        self.py_func.__qualname__ = f"{qualified}_{_state_around(self.py_func)}"
        try:
            return numba.njit(signature, cache=True, error_model="numpy")(self.py_func)
        except RuntimeError:  # it can be stored neither beside the module nor in a user's folder
            return numba.njit(signature, error_model="numpy")(self.py_func)
        finally:
            self.py_func.__qualname__ = qualified

    def __call__(self, *arguments: object) -> Any:  # noqa: ANN401  whatever the function returns
        """Run its machine code; a `TypeError` where an argument is of another type than it was compiled for."""
        return self.dispatcher(*arguments)


@typeof_impl.register(Kernel)
def _(kernel: Kernel, context: object) -> Any:  # noqa: ANN401  numba's types have none
    """Let one kernel call another."""
    return typeof_impl(kernel.dispatcher, context)


def inner(function: F) -> F:
    """Mark a function that only kernels call: it is compiled as a part of each of them."""
    return cast(F, numba.njit(error_model="numpy")(function))


def compiled(*signature: Kind) -> Callable[[F], F]:
    """Compile a function for arguments of these types: those above, or of `records.array_of`."""

    def compile_it(function: F) -> F:
        return cast(F, Kernel(function, signature)) if _compiles() else function

    return compile_it


@cache
def ensure() -> None:
    """Compile all kernels, ours and those of other packages, where that was not done yet: a minute, once.

    A run calls this before its driver's time is counted.
    """
    if not _compiles():
        return
    for package in (str(__package__), *_added()):
        # The cache of a package is that of any function in it.
        function = _machine if package == __package__ else next((k.py_func for k in _kernels_of(package)), None)
        if function is not None:
            _ensure(package, function)


def _ensure(package: str, function: Callable[..., Any]) -> None:
    """Compile a package's kernels; `function` is one of the package's, compiled or not."""
    try:
        folder = Path(str(numba.njit(cache=True)(function).stats.cache_path))
    except RuntimeError:  # nothing can be stored
        return
    stamp = folder / f"kernels-{_machine()}-{_state_around(function)}"
    if stamp.exists():
        return
    with _alone(folder):
        if stamp.exists():  # another process was faster
            return
        if sys.stderr.isatty():
            sys.stderr.write("compiling the inner loops for this machine, once (about a minute) ...\n")
        load(package)
        stamp.touch()


def load(*packages: str) -> None:
    """Make the kernels of these packages ready, from numba's cache where it has them; of all, where none is named."""
    for package in packages or (str(__package__), *_added()):
        for kernel in _kernels_of(package):
            _ = kernel.dispatcher


def _kernels_of(package: str) -> Iterator[Kernel]:
    """Yield the kernels of a package's modules; none of one that cannot be imported, of which its driver tells."""
    with suppress(ImportError):
        for info in pkgutil.walk_packages(import_module(package).__path__, f"{package}."):
            for value in vars(import_module(info.name)).values():
                if isinstance(value, Kernel) and value.py_func.__module__ == info.name:
                    yield value


@cache
def _added() -> tuple[str, ...]:
    """Return the packages of others that have kernels."""
    return tuple(sorted({entry.value for entry in entry_points(group=GROUP)}))


def _state_around(function: Callable[..., Any]) -> str:
    """Return a hash of what a kernel may use: this folder, and its own package's where that is another."""
    own = [package for package in _added() if (function.__module__ or "").startswith(f"{package}.")]
    states = [state_of(_FOLDER), *(state_of(Path(path)) for name in own for path in import_module(name).__path__)]
    return states[0] if len(states) == 1 else hashlib.sha256("".join(states).encode()).hexdigest()[:12]


def _compiles() -> bool:
    """Return whether kernels are compiled; numba's variable lets them be plain Python, for tests and debuggers."""
    return os.environ.get("NUMBA_DISABLE_JIT", "0") in ("", "0")


@cache
def state_of(folder: Path) -> str:
    """Return a short hash of the contents of all Python files in a folder and those within it."""
    digest = hashlib.sha256()
    for file in sorted(folder.rglob("*.py")):
        digest.update(file.read_bytes())
    return digest.hexdigest()[:12]


def _machine() -> str:
    """Return a short hash of what numba compiles for: its version, Python's, and the processor."""
    parts = (numba.__version__, sys.version, binding.get_host_cpu_name(), binding.get_host_cpu_features().flatten())
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:12]


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Let one process at a time do what is in this block."""
    lock = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
    finally:
        os.close(lock)
