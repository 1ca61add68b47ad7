"""The protocol of a search: it proposes points of a unit cube, receives what their runs showed, and proposes again."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

Point = tuple[float, ...]
"""A place in the search space: a number from 0 to 1 for each dimension."""
OBJECTIVES = ("gap", "time to collision", "post-encroachment time")
"""The margins of a run. Each is a share of the value below which a pass is a near miss (`run_margins`)."""
FAR = 10.0
"""Largest margin, also that of a run without a value and of a point without a mutant. Ours: ten times the bound of a
near miss; above it, a difference says nothing about the ego."""


@dataclass(frozen=True)
class Evaluation:
    """What the run of a point's mutant showed.

    Attributes:
        margins: one for each of `OBJECTIVES`, 0 (contact, or another failure) to `FAR`; the first one is what a search
            with one objective lowers.
        fails: whether the run failed.
    """

    point: Point
    margins: tuple[float, ...]
    fails: bool = False

    @property
    def margin(self) -> float:
        """Return the margin that a search with one objective lowers."""
        return self.margins[0]


Proposals = Generator[list[Point], list[Evaluation], None]
"""What a search does: it yields points whose runs do not depend on each other, and is sent their evaluations in the
same order. It may go on without end: the simulated time ends it."""


class Search(Protocol):
    """A search. A new one is a class with a name and this method, and its entry in `searches.SEARCHES`."""

    @property
    def name(self) -> str:
        """Return the name by which the command line and the tables call it."""
        ...

    def proposals(self, dimensions: int, rng: np.random.Generator) -> Proposals:
        """Begin to search the unit cube; all random choices come from `rng`."""
        ...
