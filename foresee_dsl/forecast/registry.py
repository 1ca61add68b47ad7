"""Loads rankers by name from the entry points of group `foresee_dsl.rankers`, ours and those of other packages."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from foresee_dsl.errors import ForeseeError
from foresee_dsl.forecast.protocol import Mutations, NeedsSurroundings, Proposes, Ranker, Surroundings
from foresee_dsl.plugins import PluginGroup

if TYPE_CHECKING:
    from foresee_dsl.compile.bundle import SumoBundle


class UnknownRankerError(ForeseeError):
    """Raised if no ranker with that name is installed, or if it cannot be loaded."""


RANKERS = PluginGroup("foresee_dsl.rankers", "ranker", UnknownRankerError)


def load_ranker(name: str) -> Ranker:
    """Return the ranker of a name, with its default settings."""
    entry = RANKERS.find(name)
    with RANKERS.loading(entry):
        ranker = entry.load()()
    if not isinstance(ranker, Ranker):
        raise UnknownRankerError(f"ranker {name!r} ({entry.value}) has no method `rank` or no `name`")
    return ranker


def ranker_within(name: str, compiled: Callable[[], SumoBundle], mutations: Mutations | None = None) -> Ranker:
    """Return the ranker of a name for the runs of one test case.

    `compiled`: returns that test case, compiled; it is called only for a ranker that needs the surroundings.
    `mutations`: how clips will be mutated, for a ranker that proposes changes; None: its default.
    """
    ranker = load_ranker(name)
    if mutations is not None and isinstance(ranker, Proposes):
        ranker = ranker.before(mutations)
    return ranker.within(Surroundings.of(compiled())) if isinstance(ranker, NeedsSurroundings) else ranker
