"""What a driver keeps from one run to the next in one process: weights, a session, a program that stays.

Nothing that is kept may change what a driver does. So a run that took something from an earlier one is driven again
with nothing kept, at first and from time to time, and must give the same trace (`campaign.driving`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

T = TypeVar("T")
CHECKED_EVERY = 20
"""Of the runs that take something from an earlier one, the first and every such one are driven twice. Ours: a twentieth
of the time; a driver that remembers nearly always shows it in its second run."""


class _Kept:
    """Values of this process by key, and what runs took of them."""

    def __init__(self) -> None:
        self.values: dict[Hashable, Any] = {}
        self.taken: set[Hashable] = set()
        """Keys of what the run under way took that an earlier run had left."""
        self.new: set[Hashable] = set()
        """Keys of what the run under way made itself."""
        self.times: Counter[Hashable] = Counter()
        """How many runs took the value of a key."""


_HERE = _Kept()


def keep(key: Hashable, make: Callable[[], T]) -> T:
    """Return what `make` returns, made once in this process: for weights and the like, which no run changes.

    Args:
        key: of the value, such as `("my_driver", "weights.pt")`; it names all that the value depends on.
    """
    if key not in _HERE.values:
        _HERE.values[key] = make()
        _HERE.new.add(key)
    elif key not in _HERE.new:
        _HERE.taken.add(key)
    value: T = _HERE.values[key]
    return value


def take(key: Hashable) -> Any:  # noqa: ANN401 - what was left
    """Return what an earlier run left under a key, which is no longer kept then; None where there is nothing."""
    value = _HERE.values.pop(key, None)
    if value is not None:
        _HERE.taken.add(key)
    return value


def leave(key: Hashable, value: object) -> None:
    """Leave something for a later run, which takes it."""
    _HERE.values[key] = value


def values() -> tuple[Any, ...]:
    """Return all that is kept in this process now."""
    return tuple(_HERE.values.values())


@contextmanager
def one_run() -> Iterator[Callable[[], bool]]:
    """Note what a run takes; yield a function that says, after the run, whether it is to be driven again to check."""
    _HERE.taken, _HERE.new = set(), set()

    def to_be_checked() -> bool:
        _HERE.times.update(_HERE.taken)
        return any(_HERE.times[key] % CHECKED_EVERY == 1 for key in _HERE.taken)

    yield to_be_checked


@contextmanager
def nothing_kept() -> Iterator[None]:
    """Within, nothing is kept from before, and nothing that is left within stays."""
    before, _HERE.values = _HERE.values, {}
    try:
        yield
    finally:
        _drop(_HERE.values)
        _HERE.values = before


def forget() -> None:
    """Keep nothing any more of what was kept until now."""
    _drop(_HERE.values)
    _HERE.values = {}
    _HERE.times.clear()


def _drop(kept: dict[Hashable, Any]) -> None:
    for value in kept.values():
        if callable(kill := getattr(value, "kill", None)):
            kill()
