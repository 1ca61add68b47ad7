"""Caches placements of actors: the children of a clip have the same actors as the clip, except for one or two actors
that each child changes.

The placement of an actor with an exact state, on a route or on a path of plain points, depends only on its own
statement, its model and the network.
"""

from __future__ import annotations

from dataclasses import dataclass

from foresee_dsl.compile.bundle import ModelSpec, PlacedActor
from foresee_dsl.compile.placement.spots import OnRoute
from foresee_dsl.compile.placement.statements import path_of
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.tracks import FileTrack
from foresee_dsl.language import model as m

_MOST = 128
"""Maximum number of cached placements, 110 kB each, most of it the line of a route. Ours: those of the four clips for
which a worker counts as warm, with 32 actors each."""


Apart = tuple[bool, bool, FileTrack | None]
"""What a placement depends on besides the statement: whether a trigger starts the actor, whether a trigger makes it
follow a path, and its recorded track."""


@dataclass(frozen=True, slots=True)
class _Placement:
    actor: m.Ego | m.Actor
    spec: ModelSpec
    apart: Apart
    placed: PlacedActor
    start: OnRoute | None


class PlacedBefore:
    """The placements on the most recent network, by the actors' statements.

    A child shares the statement objects of its clip, so placements are found by the object's id. A statement is kept as
    long as its placement, so that Python does not reuse its id.
    """

    def __init__(self) -> None:
        self._network: RoadNetwork | None = None
        self._placements: dict[int, _Placement] = {}

    def get(
        self, actor: m.Ego | m.Actor, spec: ModelSpec, network: RoadNetwork, apart: Apart
    ) -> tuple[PlacedActor, OnRoute | None] | None:
        """Return an actor's placement and its start on its route, if it has one; None if it is not cached.

        `apart`: see `Apart`.
        """
        placement = self._placements.get(id(actor)) if network is self._network else None
        if placement is None or placement.actor is not actor:
            return None
        if placement.apart != apart or placement.spec != spec:
            return None
        return placement.placed, placement.start

    def put(
        self, actor: m.Ego | m.Actor, network: RoadNetwork, apart: Apart, placed: PlacedActor,
        start: OnRoute | None,
    ) -> None:  # fmt: skip
        """Cache the placement of an actor without errors, if it does not depend on other actors."""
        path = path_of(actor)
        if actor.state is None or isinstance(path, m.PathAlong):
            return
        if path is not None and not all(isinstance(p, m.Point) for p in path.points):
            return
        if network is not self._network:
            self._network = network
            self._placements.clear()
        while len(self._placements) >= _MOST:
            del self._placements[next(iter(self._placements))]
        self._placements[id(actor)] = _Placement(actor, placed.model, apart, placed, start)


PLACED_BEFORE = PlacedBefore()
"""The cached placements of this process."""
