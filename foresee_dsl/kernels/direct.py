"""Calls of kernels without the check of their arguments' types."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

from foresee_dsl.kernels.compiling import load_now

F = TypeVar("F", bound=Callable[..., Any])


def direct(kernel: F) -> F:
    """Return a kernel's machine code for callers that make its arguments themselves, and always of the same types.

    numba (0.68.1) looks at the type of each argument in every call, which takes half of the time of a small kernel's
    call. An array of another type than the kernel's would be read as if it were of its type.
    """
    load_now(kernel)
    overloads = getattr(kernel, "overloads", None)  # none where NUMBA_DISABLE_JIT is set
    if not overloads or len(overloads) != 1:
        return kernel
    return cast(F, getattr(next(iter(overloads.values())), "entry_point", kernel))
