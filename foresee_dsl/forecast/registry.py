"""Rankers by name: the entry points of group `foresee_dsl.rankers`, ours and anyone's."""

from __future__ import annotations

import difflib
from importlib.metadata import EntryPoint, entry_points

from foresee_dsl.errors import ForeseeError
from foresee_dsl.forecast.protocol import Ranker

GROUP = "foresee_dsl.rankers"
"""A package adds its own with `[project.entry-points."foresee_dsl.rankers"]` and `mine = "package.module:MyRanker"`."""


class UnknownRankerError(ForeseeError):
    """No ranker of that name is installed, or it cannot be loaded."""


def ranker_names() -> tuple[str, ...]:
    """Return the names of all installed rankers, sorted."""
    return tuple(sorted(_entries()))


def load_ranker(name: str) -> Ranker:
    """Make the ranker of a name, with its default settings.

    Raises:
        UnknownRankerError: there is none of that name (close names are in the message), or it does not load.
    """
    entries = _entries()
    if name not in entries:
        close = difflib.get_close_matches(name, entries, n=2)
        hint = (
            f"did you mean {' or '.join(repr(c) for c in close)}?" if close else f"known: {', '.join(ranker_names())}"
        )
        raise UnknownRankerError(f"unknown ranker {name!r} ({hint})")
    try:
        ranker = entries[name].load()()
    except Exception as err:  # a plug-in may fail in any way; the user is told which one
        raise UnknownRankerError(f"ranker {name!r} ({entries[name].value}) cannot be loaded: {err}") from err
    if not isinstance(ranker, Ranker):
        raise UnknownRankerError(f"ranker {name!r} ({entries[name].value}) has no method `rank` or no `name`")
    return ranker


def _entries() -> dict[str, EntryPoint]:
    return {entry.name: entry for entry in entry_points(group=GROUP)}
