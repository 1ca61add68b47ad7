"""Speed limits that were changed during a run, and what vehicles drive under them."""

from __future__ import annotations

from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.simulate.actors.states import Actor
from foresee_dsl.simulate.world import World

ROUNDING_MPS = 0.01
"""A vehicle that is this much slower than the limit drives as fast as it allows. Ours: clips round to 0.0001 m/s, maps
to 0.01 m/s."""


class Limits:
    """The lanes whose limit was changed.

    What a vehicle drives there depends on its own speed and on both limits only, so that a clip needs no more: one that
    drives as fast as the old limit allows, or faster, drives the new one, others where that is less.
    """

    def __init__(self, network: RoadNetwork, world: World) -> None:
        self._network, self._world = network, world
        self._now: dict[str, float] = {}
        self._driven: dict[str, float] = {}

    @property
    def changed(self) -> bool:
        """Whether any was."""
        return bool(self._now)

    def change(self, edge: str, lane: int | None, speed_mps: float) -> None:
        """Change the limit of all lanes of an edge, or of one (counted from 1, the rightmost for cars)."""
        for piece in self._network.pieces(edge):
            lanes = self._network.edges[piece].drivable
            for found in lanes if lane is None else lanes[lane - 1 : lane]:
                self._now[found.id] = speed_mps
                self._world.set_limit(found.id, speed_mps)

    def capped(self, actor: Actor, speed_mps: float) -> float:
        """Return what an actor drives that was told a speed: no more than a limit that was lowered."""
        self._driven.pop(actor.id, None)
        now = self._now.get(actor.lane)
        return speed_mps if now is None or now >= self._network.lanes[actor.lane].speed_mps else min(speed_mps, now)

    def driven(self, actor: Actor, cruise_mps: float) -> float | None:
        """Return what an actor that nobody orders drives on its lane; None where it does so already."""
        if actor.lane.startswith(":"):
            return None
        now, speed_mps = self._now.get(actor.lane), cruise_mps
        if now is not None:
            fast = cruise_mps >= self._network.lanes[actor.lane].speed_mps - ROUNDING_MPS
            speed_mps = min(now if fast else min(cruise_mps, now), actor.placed.model.max_speed_mps)
        if self._driven.get(actor.id, cruise_mps) == speed_mps:
            return None
        self._driven[actor.id] = speed_mps
        return speed_mps
