"""The mutation operators: model swap and steering (paper, section 3.4); when and beside which line (ours)."""

from __future__ import annotations

import sys
from functools import lru_cache

from foresee_dsl.derive.operators.ours import DelayShift, HeadStart, LineShift, TimingShift
from foresee_dsl.derive.operators.paper import ModelSwap, Steer
from foresee_dsl.derive.operators.situation import Operator, Situation
from foresee_dsl.errors import ForeseeError
from foresee_dsl.plugins import PluginGroup

__all__ = ["OPERATORS", "Operator", "Situation", "operators"]

OPERATORS = PluginGroup("foresee_dsl.operators", "operator", ForeseeError)
"""A package adds its own with `[project.entry-points."foresee_dsl.operators"]` and `mine = "package.module:MINE"`,
an object with a `name` and `changes`."""

_OURS: tuple[Operator, ...] = (ModelSwap(), Steer(), TimingShift(), DelayShift(), HeadStart(), LineShift())


def operators() -> dict[str, Operator]:
    """Return all operators by name: ours, and those of installed packages (ours win)."""
    return {**_added(tuple(sys.path)), **{o.name: o for o in _OURS}}


@lru_cache(maxsize=8)
def _added(path: tuple[str, ...]) -> dict[str, Operator]:  # noqa: ARG001  (it keys the cache)
    """Return the operators of installed packages; looking through them takes 5 ms, and a worker mutates many clips."""
    return {name: OPERATORS.load(name) for name in OPERATORS.names()}
