"""Doors of vehicles as actors: an open door is a body at the vehicle's side, a shut one is absent."""

from __future__ import annotations

import math
from collections.abc import Mapping

from foresee_dsl.compile.bundle import DoorOf, PlacedActor
from foresee_dsl.compile.placement.doors import DOOR_OPEN_DEG, hinge_m
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.simulate.actors.moved_actors import StaticActor
from foresee_dsl.simulate.actors.states import SimulatedActor
from foresee_dsl.simulate.world import World


class OpenDoor(StaticActor):
    """An actor's door, which moves with that actor."""

    __slots__ = ("_network", "_of", "is_open", "owner")

    def __init__(self, actor: PlacedActor, of: DoorOf, world: World, network: RoadNetwork, edge: str) -> None:
        """Create the door, which is absent from the world at first. Call `belongs_to` once, and then `follow` in each
        step, which puts the door at its owner's side.
        """
        super().__init__(actor, world, network, edge)
        self._network, self._of = network, of
        self.owner: SimulatedActor = self
        self.is_open = of.is_open
        self.present = False
        self.positions = ()

    def belongs_to(self, actors: Mapping[str, SimulatedActor]) -> None:
        """Find the actor to which this door belongs, and set `owner` to that actor."""
        self.owner = actors[self._of.actor]

    def swing(self, *, opens: bool) -> None:
        """Open or shut the door."""
        self.is_open = opens
        self.follow()

    def follow(self) -> None:
        """Move the door to its owner's side. It is absent while it is shut or while its owner is absent."""
        self.present = self.is_open and self.owner.present
        if not self.present:
            self.positions = ()
            return
        owner, left = self.owner, 1.0 if self._of.side == "left" else -1.0
        out = math.pi - left * math.radians(DOOR_OPEN_DEG)
        ahead, beside = hinge_m(owner.length), left * owner.width / 2
        c, s = math.cos(owner.heading), math.sin(owner.heading)
        heading = math.remainder(owner.heading + out, math.tau)
        x = owner.x + ahead * c - beside * s + self.length / 2 * math.cos(heading)
        y = owner.y + ahead * s + beside * c + self.length / 2 * math.sin(heading)
        if (x, y, heading) != (self.x, self.y, self.heading) or not self.positions:
            self.move(x, y, heading, 0.0)
            self.look(self._network)
