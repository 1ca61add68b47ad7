"""Slippery patches of ground: what tyres hold on them, for the ego and for every other vehicle.

Nobody is told of a patch. The ego and vehicles under a steering offset have the mean friction of what lies under their
four wheels. SUMO and paths move a vehicle by one rate of speeding up and one of braking, which are no more than the
friction under the middle of its footprint allows; in bends they keep their way. People walk over a patch as they did.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import hypot

from foresee_dsl.compile.bundle import Scene
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.simulate.actors.dynamics import GRAVITY_MPS2, Bicycle, BicycleState
from foresee_dsl.simulate.actors.guided_vehicles import GuidedVehicle
from foresee_dsl.simulate.actors.moved_actors import Ego, PathActor, SteeredVehicle
from foresee_dsl.simulate.actors.states import Actor
from foresee_dsl.simulate.actors.sumo_vehicles import SumoVehicle
from foresee_dsl.simulate.world import World

TYRE_M = 0.1
"""A wheel stands this far inside the vehicle's side. Ours: half a car tyre's width."""


class SlipperyGround:
    """The patches of a scene; asked once a step, before anybody moves."""

    def __init__(self, scene: Scene) -> None:
        """Know the patches, and the friction of the road around them."""
        self._patches, self._road = scene.slippery, scene.friction
        self._slowed: set[str] = set()

    def friction_at(self, x: float, y: float) -> float:
        """Return the tyre-road coefficient at a place, m."""
        here = (p.friction for p in self._patches if hypot(x - p.x, y - p.y) <= p.radius_m)
        return min(here, default=self._road) if self._patches else self._road

    def under(self, points: FloatArray | Iterable[tuple[float, float]]) -> float:
        """Return the mean friction under some points, m, none of them better than the road's."""
        found = [min(self.friction_at(float(x), float(y)), self._road) for x, y in points]
        return sum(found) / len(found)

    def take_effect(self, actors: Iterable[Actor], vehicles: Mapping[str, SumoVehicle], world: World) -> None:
        """Give everybody the grip that they have in the next step; `vehicles`: those that SUMO drives, by id."""
        if not self._patches:
            return
        for actor in actors:
            if not actor.present:
                continue
            match actor:
                case Ego():
                    self.hold(actor.motion, actor.bicycle())
                case SteeredVehicle() if actor.recovery is not None:
                    self.hold(actor.recovery.bicycle, actor.bicycle())
                case PathActor():
                    self._path(actor)
                case GuidedVehicle() if actor.guide is not None:
                    self._path(actor.guide)
        self._traffic(vehicles, world)

    def hold(self, motion: Bicycle, state: BicycleState) -> None:
        """Let a vehicle's tyres hold what the ground under its wheels allows; nothing changes without patches."""
        if self._patches:
            motion.hold(self.under(motion.wheels(state, TYRE_M)))

    def _path(self, actor: PathActor) -> None:
        if actor.placed.model.kind != "pedestrian":
            actor.follower.hold(self._most(actor))

    def _most(self, actor: PathActor | SumoVehicle) -> float:
        """Return the largest acceleration that the ground under the middle of an actor allows, m/s^2."""
        return self.under([(actor.x, actor.y)]) * GRAVITY_MPS2

    def _traffic(self, vehicles: Mapping[str, SumoVehicle], world: World) -> None:
        """Tell SUMO when a vehicle comes onto a patch, and when it has left it."""
        for name, vehicle in vehicles.items():
            if not vehicle.present or name not in world:
                continue
            slips = self.friction_at(vehicle.x, vehicle.y) < self._road
            if slips or name in self._slowed:
                world.hold_tyres(name, self._most(vehicle) if slips else None)
                (self._slowed.add if slips else self._slowed.discard)(name)
