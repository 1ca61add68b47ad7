"""Changes of roads during a run: slippery patches of ground, and speed limits."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import hypot

from foresee_dsl.compile.bundle import Scene
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.constants import GRAVITY_MPS2
from foresee_dsl.simulate.actors.dynamics import Bicycle, BicycleState
from foresee_dsl.simulate.actors.guided_vehicles import GuidedVehicle
from foresee_dsl.simulate.actors.moved_actors import EgoVehicle, PathActor, SteeredVehicle
from foresee_dsl.simulate.actors.states import SimulatedActor
from foresee_dsl.simulate.actors.sumo_vehicles import SumoVehicle
from foresee_dsl.simulate.world import World

TYRE_M = 0.1
"""Distance of a wheel's centre from the vehicle's side, m. Ours: half a car tyre's width."""
ROUNDING_MPS = 0.01
"""A vehicle that is at most this much slower than the limit counts as driving at the limit, m/s. Ours: clips round
speeds to 0.0001 m/s, maps to 0.01 m/s."""


class SlipperyGround:
    """The slippery patches of a scene. They change the grip of all actors once a step, before any actor moves.

    No actor perceives a patch. The ego and vehicles under a steering offset have the mean friction under their four
    wheels. Vehicles that SUMO or a path moves have one rate of speeding up and one of braking, which are limited by the
    friction under the middle of the footprint; they do not leave their line in a bend. Pedestrians are not affected.
    """

    def __init__(self, scene: Scene) -> None:
        """Use the patches of a scene, and the friction of the road around them."""
        self._patches, self._road = scene.slippery, scene.friction
        self._slowed: set[str] = set()

    def friction_at(self, x: float, y: float) -> float:
        """Return the tyre-road friction coefficient at a point (x and y in m)."""
        here = (p.friction for p in self._patches if hypot(x - p.x, y - p.y) <= p.radius_m)
        return min(here, default=self._road) if self._patches else self._road

    def under(self, points: FloatArray | Iterable[tuple[float, float]]) -> float:
        """Return the mean friction coefficient at some points (m); on a patch it is never higher than the
        road's own.
        """
        frictions = [min(self.friction_at(float(x), float(y)), self._road) for x, y in points]
        return sum(frictions) / len(frictions)

    def take_effect(self, actors: Iterable[SimulatedActor], vehicles: Mapping[str, SumoVehicle], world: World) -> None:
        """Set the grip of all actors for the next step; `vehicles`: those that SUMO drives, by id."""
        if not self._patches:
            return
        for actor in actors:
            if not actor.present:
                continue
            match actor:
                case EgoVehicle():
                    self.hold(actor.motion, actor.bicycle())
                case SteeredVehicle() if actor.recovery is not None:
                    self.hold(actor.recovery.bicycle, actor.bicycle())
                case PathActor():
                    self._path(actor)
                case GuidedVehicle() if actor.guide is not None:
                    self._path(actor.guide)
        self._traffic(vehicles, world)

    def hold(self, motion: Bicycle, state: BicycleState) -> None:
        """Set a vehicle's friction to that under its wheels; does nothing in a scene without patches."""
        if self._patches:
            motion.hold(self.under(motion.wheels(state, TYRE_M)))

    def _path(self, actor: PathActor) -> None:
        if actor.placed.model.kind != "pedestrian":
            actor.follower.hold(self._most(actor))

    def _most(self, actor: PathActor | SumoVehicle) -> float:
        """Return the largest acceleration (m/s^2) that the friction under the middle of an actor allows."""
        return self.under([(actor.x, actor.y)]) * GRAVITY_MPS2

    def braking(self, vehicle: SumoVehicle, rate_mps2: float) -> float:
        """Return this rate of braking, or on a patch at most what the friction under the middle of a vehicle allows."""
        return min(rate_mps2, self._most(vehicle)) if self._slips(vehicle) else rate_mps2

    def _slips(self, vehicle: SumoVehicle) -> bool:
        return self.friction_at(vehicle.x, vehicle.y) < self._road

    def _traffic(self, vehicles: Mapping[str, SumoVehicle], world: World) -> None:
        """Limit the rates of a vehicle in SUMO when it enters a patch, and restore them when it has left it."""
        for name, vehicle in vehicles.items():
            if not vehicle.present or name not in world:
                continue
            slips = self._slips(vehicle)
            if slips or name in self._slowed:
                world.hold_tyres(name, self._most(vehicle) if slips else None)
                (self._slowed.add if slips else self._slowed.discard)(name)


class RoadLimits:
    """The lanes whose speed limit a trigger has changed, and the speeds of vehicles on them.

    A vehicle whose cruising speed is at least the old limit drives at the new limit; a slower vehicle does so only
    where the new limit is lower than its cruising speed. A vehicle's speed on such a lane thus depends only on its
    cruising speed and on both limits, and a clip needs nothing else.
    """

    def __init__(self, network: RoadNetwork, world: World) -> None:
        self._network, self._world = network, world
        self._now: dict[str, float] = {}
        self._driven: dict[str, float] = {}

    @property
    def changed(self) -> bool:
        """Whether the limit of any lane was changed."""
        return bool(self._now)

    def change(self, edge: str, lane: int | None, speed_mps: float) -> None:
        """Change the speed limit of one lane of an edge (counted from 1, the rightmost lane for cars), or of all its
        lanes (None).
        """
        for piece in self._network.pieces(edge):
            lanes = self._network.edges[piece].drivable
            for lane_info in lanes if lane is None else lanes[lane - 1 : lane]:
                self._now[lane_info.id] = speed_mps
                self._world.set_limit(lane_info.id, speed_mps)

    def capped(self, actor: SimulatedActor, speed_mps: float) -> float:
        """Return an ordered speed (m/s), reduced to the limit of the actor's lane if that limit was lowered."""
        self._driven.pop(actor.id, None)
        now = self._now.get(actor.lane)
        return speed_mps if now is None or now >= self._network.lanes[actor.lane].speed_mps else min(speed_mps, now)

    def driven(self, actor: SimulatedActor, cruise_mps: float) -> float | None:
        """Return the speed (m/s) that a changed limit gives an actor without a speed order; None if SUMO already drives
        it at that speed.
        """
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
