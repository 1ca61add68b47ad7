"""Shows records in notebooks: the class of a record is `Displayed`, and a layer above says how it is drawn.

A record cannot draw itself, because pictures are made by modules that import it. `foresee_dsl.api` names the function
for each class; without it a notebook shows the record's text.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

T = TypeVar("T")
_VIEWS: dict[type, Callable[[Any], str]] = {}


class Displayed:
    """A record that notebooks show as HTML."""

    __slots__ = ()

    def _repr_html_(self) -> str | None:
        """Return the record as HTML; None, so that its text is shown, if no module has said how."""
        view = next((_VIEWS[kind] for kind in type(self).__mro__ if kind in _VIEWS), None)
        return view(self) if view is not None else None


def show_as(kind: type[T], view: Callable[[T], str]) -> None:
    """Show the records of a class with this function, which returns HTML."""
    _VIEWS[kind] = view
