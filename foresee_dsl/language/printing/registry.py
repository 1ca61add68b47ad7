"""Which function writes which class of the model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

from foresee_dsl.language import model as m
from foresee_dsl.language.syntax.nodes import Key

Parameters = frozenset[str]

MOST_INLINE = 4
"""A road or a case with at most so many settings is one line (ours; by number, not width, so that an edit of a value
never rewraps)."""


@dataclass(frozen=True, slots=True)
class Layout:
    """A statement to print: its head, and what is in its braces.

    `inside` is None for a statement without braces; otherwise the key of each inner statement in the model's path,
    and the item or (for a setting) its text. `inline`: in one line when nothing in it has a comment.
    """

    head: str
    inside: Sequence[tuple[Key, m.Item | str]] | None = None
    inline: bool = False


@dataclass(frozen=True, slots=True)
class _Registry:
    printers: dict[type[m.Item], Callable[[Any, Parameters], Layout]] = field(default_factory=dict)


_T = TypeVar("_T", bound=m.Item)
_registry = _Registry()


def layout(item: m.Item, parameters: Parameters) -> Layout:
    """Return how a statement is written.

    Args:
        item: any statement of the model.
        parameters: the names of the scenario's parameters (an id of the same name is quoted).
    """
    return _registry.printers[type(item)](item, parameters)


def block(kind: type[_T]) -> Callable[[Callable[[_T, Parameters], Layout]], Callable[[_T, Parameters], Layout]]:
    """Register the function that lays out a class."""

    def register(function: Callable[[_T, Parameters], Layout]) -> Callable[[_T, Parameters], Layout]:
        _registry.printers[kind] = function
        return function

    return register


def line(kind: type[_T]) -> Callable[[Callable[[_T, Parameters], str]], Callable[[_T, Parameters], str]]:
    """Register the function that writes a class whose statements have no braces."""

    def register(function: Callable[[_T, Parameters], str]) -> Callable[[_T, Parameters], str]:
        _registry.printers[kind] = lambda item, parameters: Layout(function(item, parameters))
        return function

    return register


def body(items: Sequence[m.Item], name: str = "body") -> list[tuple[Key, m.Item | str]]:
    """Return the statements in a block with their keys."""
    return [((name, k), item) for k, item in enumerate(items)]
