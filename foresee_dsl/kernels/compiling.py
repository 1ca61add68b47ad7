"""Makes kernels of plain functions: each becomes machine code once, and runs from there.

A kernel is a plain function of numbers, arrays and records that loops over a few actors, frames or proposals: many
small operations, for which calls of numpy would cost ten times what the arithmetic does. numba compiles each for one
signature, all of this folder when the first of them is imported in an environment, which takes a minute. After that
numba is not imported: it takes a second of CPU to start (`machine_code`).

Arithmetic is IEEE's, in the order that is written (no `fastmath`, no threads), so that a machine of the same kind gives
the same bits. Indices are not checked: an index that comes from a measurement is clamped to its array (the integer of a
NaN may be anything).
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, update_wrapper
from pathlib import Path
from typing import Any, Literal, TypeVar, cast

import numpy as np

from foresee_dsl.kernels import machine_code

F = TypeVar("F", bound=Callable[..., Any])


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
        from numba import from_dtype, types

        item = from_dtype(self.dtype)
        return types.Array(item, self.dimensions, self.layout) if self.dimensions else item


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


_CONTIGUOUS, _ALIGNED, _WRITEABLE = 0x1, 0x100, 0x400
_FLAGS = {"C": _CONTIGUOUS | _ALIGNED | _WRITEABLE, "A": _ALIGNED | _WRITEABLE}
"""Flags that an array of a layout has, as bits (numpy's C interface): to read them by name warns where an array is
from `broadcast_arrays` (numpy 2.4)."""


class _Function:
    """A function that numba can compile into others.

    Attributes:
        py_func: the plain one.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self.py_func = function
        update_wrapper(self, function)

    @cached_property
    def dispatcher(self) -> Any:  # noqa: ANN401  numba's types have none
        """What numba makes of it."""
        from numba import njit

        return njit(error_model="numpy")(self.py_func)

    @property
    def _numba_type_(self) -> Any:  # noqa: ANN401  numba's types have none
        """What numba (0.68.1) asks an object for that it meets in a function."""
        return self.dispatcher._numba_type_

    def __call__(self, *arguments: object) -> Any:  # noqa: ANN401  whatever the function returns
        """Compile it for these arguments and run it; only tests and training do that."""
        return self.dispatcher(*arguments)


class Kernel(_Function):
    """A function that is compiled for one signature.

    Attributes:
        kinds: the types of its arguments.
    """

    def __init__(self, function: Callable[..., Any], kinds: tuple[Kind, ...]) -> None:
        super().__init__(function)
        self.kinds = kinds
        places = enumerate(kinds)
        self._arrays = [(k, one.dtype, one.dimensions, _FLAGS[one.layout]) for k, one in places if one.dimensions]

    @cached_property
    def entry(self) -> Callable[..., Any]:
        """Its machine code, which reads arrays of other types than its own as if they were of its own."""
        return machine_code.stored().get(name_of(self.py_func)) or self.dispatcher

    @cached_property
    def dispatcher(self) -> Any:  # noqa: ANN401  numba's types have none
        """What numba makes of it, where there is no stored machine code, and in other compiled functions."""
        from numba import njit

        signature = tuple(kind.for_numba() for kind in self.kinds)
        # numba (0.68.1) compiles anew when the function's own file changes, but not when a file does from which it uses
        # functions or constants. It stores a function under its name, so the name contains a hash of this folder.
        qualified = self.py_func.__qualname__
        self.py_func.__qualname__ = f"{qualified}_{machine_code.state_of(Path(__file__).parent)}"
        try:
            return njit(signature, cache=True, error_model="numpy")(self.py_func)
        except RuntimeError:  # it can be stored neither beside the module nor in a user's folder
            return njit(signature, error_model="numpy")(self.py_func)
        finally:
            self.py_func.__qualname__ = qualified

    def __call__(self, *arguments: object) -> Any:  # noqa: ANN401  whatever the function returns
        """Run its machine code; a `TypeError` where an array is of another type than it was compiled for."""
        if len(arguments) == len(self.kinds):  # its machine code tells of others
            for place, dtype, dimensions, flags in self._arrays:
                given: Any = arguments[place]
                fits = isinstance(given, np.ndarray) and given.ndim == dimensions and given.dtype == dtype
                if not fits or given.flags.num & flags != flags:
                    kind = self.kinds[place]
                    raise TypeError(f"argument {place} of {self.py_func.__name__} is not {kind}")
        return self.entry(*arguments)


def inner(function: F) -> F:
    """Mark a function that only kernels call: it is compiled as a part of each of them."""
    return cast(F, _Function(function)) if _compiles() else function


def compiled(*signature: Kind) -> Callable[[F], F]:
    """Compile a function for arguments of these types: those above, or of `records.array_of`."""

    def compile_it(function: F) -> F:
        if not _compiles():
            return function
        if str(function.__module__).startswith(f"{__package__}."):
            machine_code.ensure()
        return cast(F, Kernel(function, signature))

    return compile_it


def name_of(function: Callable[..., Any]) -> str:
    """Return under which name a function's machine code is stored."""
    return f"{function.__module__}.{function.__qualname__}"


def _compiles() -> bool:
    """Return whether kernels are compiled; numba's variable lets them be plain Python, for tests and debuggers."""
    return os.environ.get("NUMBA_DISABLE_JIT", "0") in ("", "0")
