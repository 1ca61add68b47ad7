"""Keeps values of drivers in the process from one run to the next, such as weights, a session, or a program that stays.

A kept value must not change a driver's behaviour. Therefore some of the runs that use a value of an earlier run are
repeated without kept values, and must give the same trace (`campaign.driving`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

T = TypeVar("T")
CHECKED_EVERY = 20
"""Of the runs that use a value of an earlier run, the first one is driven twice, and then one in this number.
Ours: that costs a twentieth of the time, and a driver with hidden memory nearly always differs in its second run."""


class _Kept:
    """The kept values of this process by key, and their use by runs."""

    def __init__(self) -> None:
        self.values: dict[Hashable, Any] = {}
        self.taken: set[Hashable] = set()
        """Keys of the values of earlier runs that the current run uses."""
        self.new: set[Hashable] = set()
        """Keys of the values that the current run has created."""
        self.times: Counter[Hashable] = Counter()
        """Number of runs that used the value of a key."""


_HERE = _Kept()


def keep(key: Hashable, make: Callable[[], T]) -> T:
    """Return the result of `make`, which is called only once in this process: for values that no run changes, such as
    weights.

    Args:
        key: key of the value, such as `("my_driver", "weights.pt")`; it must contain everything that the value depends
            on.
        make: a function that creates the value.
    """
    if key not in _HERE.values:
        _HERE.values[key] = make()
        _HERE.new.add(key)
    elif key not in _HERE.new:
        _HERE.taken.add(key)
    value: T = _HERE.values[key]
    return value


def take(key: Hashable) -> Any:  # noqa: ANN401 - a value of any type
    """Return the value that an earlier run left under a key, and stop keeping it; None if there is none."""
    value = _HERE.values.pop(key, None)
    if value is not None:
        _HERE.taken.add(key)
    return value


def leave(key: Hashable, value: object) -> None:
    """Keep a value under a key for a later run, which gets it with `take`."""
    _HERE.values[key] = value


def values() -> tuple[Any, ...]:
    """Return all values that this process keeps now."""
    return tuple(_HERE.values.values())


@contextmanager
def one_run() -> Iterator[Callable[[], bool]]:
    """Record the values that a run uses; yield a function that says, after the run, whether the run must be
    repeated.
    """
    _HERE.taken, _HERE.new = set(), set()

    def to_be_checked() -> bool:
        _HERE.times.update(_HERE.taken)
        return any(_HERE.times[key] % CHECKED_EVERY == 1 for key in _HERE.taken)

    yield to_be_checked


@contextmanager
def nothing_kept() -> Iterator[None]:
    """Hide all kept values within this block, and drop values that are kept inside it."""
    before, _HERE.values = _HERE.values, {}
    try:
        yield
    finally:
        _drop(_HERE.values)
        _HERE.values = before


def forget() -> None:
    """Drop all kept values."""
    _drop(_HERE.values)
    _HERE.values = {}
    _HERE.times.clear()


def _drop(kept: dict[Hashable, Any]) -> None:
    for value in kept.values():
        if callable(kill := getattr(value, "kill", None)):
            kill()
