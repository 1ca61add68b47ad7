"""Caches placements of actors: the children of a clip have the same actors as the clip, except for one or two actors
that each child changes.

The placement of an actor with an exact state, on a route or on a path of plain points, depends only on its own
statement, its model and the network.
"""

from __future__ import annotations

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


class PlacedBefore:
    """The placements by the actors' statements.

    A child shares the statement objects of its clip, so placements are found by the object's id. A statement and its
    network are kept as long as the placement, so that Python does not reuse their ids.
    """

    def __init__(self) -> None:
        self._placements: dict[
            tuple[int, int, ModelSpec, Apart], tuple[m.Ego | m.Actor, RoadNetwork, PlacedActor, OnRoute | None]
        ] = {}

    def get(
        self, actor: m.Ego | m.Actor, spec: ModelSpec, network: RoadNetwork, apart: Apart
    ) -> tuple[PlacedActor, OnRoute | None] | None:
        """Return an actor's placement and its start on its route, if it has one; None if it is not cached.

        `apart`: see `Apart`.
        """
        placement = self._placements.get((id(actor), id(network), spec, apart))
        return placement[2:] if placement is not None else None

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
        while len(self._placements) >= _MOST:
            del self._placements[next(iter(self._placements))]
        self._placements[id(actor), id(network), placed.model, apart] = actor, network, placed, start


PLACED_BEFORE = PlacedBefore()
"""The cached placements of this process."""
