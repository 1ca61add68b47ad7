"""Placements that were made before: all children of a clip have the clip's actors, but for the one or two they change.

An actor with an exact state, on a route or on a path of plain points, is placed by its own statement, its model and the
network alone; whatever else a test case has is the same to it.
"""

from __future__ import annotations

from dataclasses import dataclass

from foresee_dsl.compile.bundle import ModelSpec, PlacedActor
from foresee_dsl.compile.placement.spots import OnRoute
from foresee_dsl.compile.placement.statements import path_of
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.language import model as m

_MOST = 128
"""Placements that are kept, 110 kB each, most of it the line of a route. Ours: those of the four clips for which a
worker counts as warm, with 32 actors each."""


@dataclass(frozen=True, slots=True)
class _Placement:
    actor: m.Ego | m.Actor
    spec: ModelSpec
    told: tuple[bool, bool]
    placed: PlacedActor
    start: OnRoute | None


class PlacedBefore:
    """The placements on the network that was asked for last, by the actors' statements.

    A child has its clip's statements as the very same objects, so they are found by identity; each is held as long as
    its placement is, so that no other can get its place in memory.
    """

    def __init__(self) -> None:
        self._network: RoadNetwork | None = None
        self._known: dict[int, _Placement] = {}

    def get(
        self, actor: m.Ego | m.Actor, spec: ModelSpec, network: RoadNetwork, told: tuple[bool, bool]
    ) -> tuple[PlacedActor, OnRoute | None] | None:
        """Return an actor's placement and where it starts on its route, if it has one; None where it is not known.

        `told`: whether a trigger starts it, and whether one tells it to follow a path.
        """
        found = self._known.get(id(actor)) if network is self._network else None
        if found is None or found.actor is not actor or found.told != told or found.spec != spec:
            return None
        return found.placed, found.start

    def put(
        self, actor: m.Ego | m.Actor, network: RoadNetwork, told: tuple[bool, bool], placed: PlacedActor,
        start: OnRoute | None,
    ) -> None:  # fmt: skip
        """Keep the placement of an actor with which nothing is wrong, where it depends on nobody else."""
        path = path_of(actor)
        if actor.state is None or isinstance(path, m.PathAlong):
            return
        if path is not None and not all(isinstance(p, m.Point) for p in path.points):
            return
        if network is not self._network:
            self._network = network
            self._known.clear()
        while len(self._known) >= _MOST:
            del self._known[next(iter(self._known))]
        self._known[id(actor)] = _Placement(actor, placed.model, told, placed, start)


PLACED_BEFORE = PlacedBefore()
"""Those of this process."""
