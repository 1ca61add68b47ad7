"""Turns plain functions into kernels: numba compiles each once and stores the machine code in its own cache.

A kernel is a plain function of numbers, arrays and records that loops over a few actors, frames or proposals: many
small operations, for which calls of numpy would cost ten times as much as the arithmetic. numba compiles each kernel
for one signature. A process reads a kernel from the cache at the kernel's first call.

Arithmetic follows IEEE 754 in the written order (no `fastmath`, no threads), so that machines of the same kind compute
the same bits. Indices are not checked: an index computed from a measurement must be clamped to its array (a NaN may
become any integer).

Another package may have kernels too: an entry point of the group `GROUP` names the package that contains them, and they
are compiled together with ours, before the time of its driver is measured.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import pkgutil
import subprocess
import sys
import tempfile
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

_MOST_PROCESSES = 4
"""Largest number of processes that compile. Ours: the longest kernel takes a third of all the time."""
F = TypeVar("F", bound=Callable[..., Any])
_FOLDER = Path(__file__).parent
GROUP = "foresee_dsl.kernels"
"""Group of entry points that name packages with kernels; these may call the kernels here."""


@dataclass(frozen=True)
class ArgumentKind:
    """The type of a kernel's argument: a number, or an array of numbers or records.

    Attributes:
        dtype: type of the elements. dimensions: 0 for a number. layout: "C" for a contiguous array, "A" for any.
    """

    dtype: np.dtype[Any]
    dimensions: int = 0
    layout: Literal["C", "A"] = "C"

    def for_numba(self) -> Any:  # noqa: ANN401  numba's types have none
        """Return the corresponding type of numba."""
        item = numba.from_dtype(self.dtype)
        return numba.types.Array(item, self.dimensions, self.layout) if self.dimensions else item


FLOAT, INT, FLAG = (ArgumentKind(np.dtype(kind)) for kind in (np.float64, np.int64, np.bool_))
FLOATS, INTS, KEYS = (ArgumentKind(np.dtype(kind), 1) for kind in (np.float64, np.int64, np.uint64))
"""Arrays of numbers or hash keys, [N], contiguous in memory."""
TABLE, KEY_TABLE = (ArgumentKind(np.dtype(kind), 2) for kind in (np.float64, np.uint64))
"""Tables of numbers or hash keys, [M, N], contiguous in memory."""
ANY_TABLE = ArgumentKind(np.dtype(np.float64), 2, "A")
"""A table of numbers, [M, N], which may be a part of another array."""
BYTE_TABLE, FLAG_TABLE = (ArgumentKind(np.dtype(kind), 2) for kind in (np.uint8, np.bool_))
CUBE = ArgumentKind(np.dtype(np.float64), 3)
HYPERCUBE = ArgumentKind(np.dtype(np.float64), 4)


class Kernel:
    """A function that is compiled for one signature.

    Attributes:
        py_func: the plain function. kinds: the types of its arguments.
    """

    def __init__(self, function: Callable[..., Any], kinds: tuple[ArgumentKind, ...]) -> None:
        self.py_func = function
        self.kinds = kinds
        update_wrapper(self, function)

    @cached_property
    def dispatcher(self) -> Any:  # noqa: ANN401  numba's types have none
        """numba's compiled function; it raises `TypeError` for arguments of other types."""
        signature = tuple(kind.for_numba() for kind in self.kinds)
        # numba (0.68.1) recompiles a function when its own file changes, but not when a file changes whose functions or
        # constants it uses. As numba stores a function under its name, the name gets a hash of the folder.
        qualified = self.py_func.__qualname__
        self.py_func.__qualname__ = f"{qualified}_{_state_around(self.py_func)}"
        try:
            return numba.njit(signature, cache=True, error_model="numpy")(self.py_func)
        except RuntimeError:  # neither the module's folder nor the user's cache folder is writable
            return numba.njit(signature, error_model="numpy")(self.py_func)
        finally:
            self.py_func.__qualname__ = qualified

    def __call__(self, *arguments: object) -> Any:  # noqa: ANN401  the type of the function's result
        """Run the machine code; raises `TypeError` if an argument does not have the signature's type."""
        return self.dispatcher(*arguments)


def direct(kernel: F) -> F:
    """Return a kernel's compiled function, for calls in every step: without the 0.5 us that `Kernel` adds to a call."""
    return cast(F, kernel.dispatcher) if isinstance(kernel, Kernel) else kernel


@typeof_impl.register(Kernel)
def _(kernel: Kernel, context: object) -> Any:  # noqa: ANN401  numba's types have none
    """Let one kernel call another."""
    return typeof_impl(kernel.dispatcher, context)


def inner(function: F) -> F:
    """Mark a function that only kernels call: it is compiled as a part of each kernel that calls it."""
    return cast(F, numba.njit(error_model="numpy")(function))


def compiled(*signature: ArgumentKind) -> Callable[[F], F]:
    """Compile a function for arguments of these types: a `ArgumentKind` of this module or of `records.array_of`."""

    def compile_it(function: F) -> F:
        return cast(F, Kernel(function, signature)) if _compiles() else function

    return compile_it


@cache
def ensure() -> None:
    """Compile all kernels, ours and those of other packages, if the cache does not have them; this takes a minute of
    processor time, once.

    A run calls this before it measures the time of its driver.
    """
    if not _compiles():
        return
    for package in (str(__package__), *_added()):
        # All functions of a package have the same cache folder, so any one of them will do.
        function = _machine if package == __package__ else next((k.py_func for k in _kernels_of(package)), None)
        if function is not None:
            _ensure(package, function)


def _ensure(package: str, function: Callable[..., Any]) -> None:
    """Compile a package's kernels; `function` is one of the package's, compiled or not."""
    try:
        folder = Path(str(numba.njit(cache=True)(function).stats.cache_path))
    except RuntimeError:  # the cache is not writable
        return
    stamp = folder / f"kernels-{_machine()}-{_state_around(function)}"
    if stamp.exists():
        return
    with _alone(folder):
        if stamp.exists():  # another process was faster
            return
        _compile_all(package)
        stamp.touch()


def _compile_all(package: str) -> None:
    """Compile a package's kernels on all processors."""
    with tempfile.TemporaryDirectory() as claims, _helpers(package, claims):
        load_part(package, claims, progress=sys.stderr.isatty())
    load(package)  # reads what the helpers compiled, and compiles what they failed to compile


@contextmanager
def _helpers(package: str, claims: str) -> Iterator[None]:
    """Let the other processors compile too, each in a process of its own, until all kernels are compiled.

    They are programs, not forks or spawned copies of this process, which may be a notebook or a thread of a server.
    """
    code = f"from {__name__} import load_part; load_part({package!r}, {claims!r})"
    count = min(os.cpu_count() or 1, _MOST_PROCESSES) - 1
    helpers = [
        subprocess.Popen(  # noqa: S603 - this interpreter, with our own code
            [sys.executable, "-c", code], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        for _ in range(count)
    ]
    try:
        yield
        for helper in helpers:
            helper.wait()
    finally:
        for helper in helpers:
            helper.kill()
            helper.wait()


def load_part(package: str, claims: str, *, progress: bool = False) -> None:
    """Compile the kernels of a package that no other process has claimed, by a file in the folder `claims`."""
    # One kernel, pdm's decision, takes a third of the time, so it must not be compiled last: the kernel with most
    # arguments comes first. It calls others of its folder, which are compiled with it, so these come last.
    kernels = sorted(_kernels_of(package), key=lambda kernel: -len(kernel.kinds))
    beside = kernels[0].py_func.__module__.rpartition(".")[0]
    kernels[1:] = sorted(kernels[1:], key=lambda kernel: kernel.py_func.__module__.startswith(f"{beside}."))
    for kernel in kernels:
        name = f"{kernel.py_func.__module__}.{kernel.py_func.__qualname__}"
        with suppress(FileExistsError):
            (Path(claims) / name).touch(exist_ok=False)
            if progress:
                done = sum(1 for _ in Path(claims).iterdir())
                sys.stderr.write(f"\rcompiling the inner loops for this machine, once: {done} of {len(kernels)} ")
                sys.stderr.flush()
            _ = kernel.dispatcher
    if progress:
        sys.stderr.write("\n")


def load(*packages: str) -> None:
    """Prepare the kernels of these packages (default: all), from numba's cache where it has them."""
    for package in packages or (str(__package__), *_added()):
        for kernel in _kernels_of(package):
            _ = kernel.dispatcher


def _kernels_of(package: str) -> Iterator[Kernel]:
    """Yield the kernels of a package's modules; none if it cannot be imported, which its driver then reports."""
    with suppress(ImportError):
        for info in pkgutil.walk_packages(import_module(package).__path__, f"{package}."):
            for value in vars(import_module(info.name)).values():
                if isinstance(value, Kernel) and value.py_func.__module__ == info.name:
                    yield value


@cache
def _added() -> tuple[str, ...]:
    """Return the other packages that have kernels."""
    return tuple(sorted({entry.value for entry in entry_points(group=GROUP)}))


def _state_around(function: Callable[..., Any]) -> str:
    """Return a hash of the code that a kernel may use: the files of this folder and of the kernel's own package."""
    own = [package for package in _added() if (function.__module__ or "").startswith(f"{package}.")]
    states = [state_of(_FOLDER), *(state_of(Path(path)) for name in own for path in import_module(name).__path__)]
    return states[0] if len(states) == 1 else hashlib.sha256("".join(states).encode()).hexdigest()[:12]


def _compiles() -> bool:
    """Return whether kernels are compiled; numba's environment variable turns that off, for tests and debuggers."""
    return os.environ.get("NUMBA_DISABLE_JIT", "0") in ("", "0")


@cache
def state_of(folder: Path) -> str:
    """Return a short hash of the contents of all Python files in a folder and its subfolders."""
    digest = hashlib.sha256()
    for file in sorted(folder.rglob("*.py")):
        digest.update(file.read_bytes())
    return digest.hexdigest()[:12]


def _machine() -> str:
    """Return a short hash of the target of the compilation: versions of numba and Python, and the processor."""
    parts = (numba.__version__, sys.version, binding.get_host_cpu_name(), binding.get_host_cpu_features().flatten())
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:12]


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Let one process at a time execute this block."""
    lock = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
    finally:
        os.close(lock)
