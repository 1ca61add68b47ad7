"""Reading values of a concrete scenario, which has no parameters left, and going through what its triggers do."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from foresee_dsl.language.model import Action, Quantity, Ref, Then


def si_of(value: Quantity | Ref) -> float:
    """Return a quantity in SI.

    Raises:
        TypeError: it is a parameter: the scenario is not concrete.
    """
    if isinstance(value, Ref):
        raise TypeError(f"the parameter {value.name} has no value: the scenario is not concrete")
    return value.si


def word_of(value: str | Ref) -> str:
    """Return a name.

    Raises:
        TypeError: it is a parameter: the scenario is not concrete.
    """
    if isinstance(value, Ref):
        raise TypeError(f"the parameter {value.name} has no value: the scenario is not concrete")
    return value


def all_actions(actions: Iterable[Action]) -> Iterator[Action]:
    """Yield actions and those inside their `then` blocks, outer ones first."""
    for action in actions:
        yield action
        if isinstance(action, Then):
            yield from all_actions(action.actions)
