"""Calls of kernels without the check of their arguments' types."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

F = TypeVar("F", bound=Callable[..., Any])


def direct(kernel: F) -> F:
    """Return a kernel's machine code for callers that make its arguments themselves, and always of the same types.

    The check takes half of the time of a small kernel's call. An array of another type than the kernel's would be read
    as if it were of its type.
    """
    return cast(F, getattr(kernel, "entry", kernel))  # plain Python has none
