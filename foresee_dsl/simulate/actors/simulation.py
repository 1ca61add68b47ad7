"""The running simulation: places the actors in SUMO's world, moves them step by step, and carries out orders
to them.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from foresee_dsl.compile.bundle import PlacedActor, SumoBundle
from foresee_dsl.compile.placement.statements import WHEELS, lane_kind
from foresee_dsl.compile.roads.polyline import XY, distinct, whole_millimetres
from foresee_dsl.compile.roads.route_line import RouteLine
from foresee_dsl.drivers.protocol import Control
from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.measuring import Part
from foresee_dsl.simulate.actors.guided_vehicles import GuidedVehicle
from foresee_dsl.simulate.actors.insertion import Insertion, ShownActors
from foresee_dsl.simulate.actors.moved_actors import (
    EgoVehicle,
    OpenDoor,
    PathActor,
    StaticActor,
    SteeredVehicle,
    with_timing,
)
from foresee_dsl.simulate.actors.path_groups import PathGroup
from foresee_dsl.simulate.actors.progress import Progress
from foresee_dsl.simulate.actors.roads import RoadLimits, SlipperyGround
from foresee_dsl.simulate.actors.states import SimulatedActor, StateTable
from foresee_dsl.simulate.actors.sumo_vehicles import SumoTraffic, SumoVehicle
from foresee_dsl.simulate.actors.track_followers import TrackActor, TrackGroup
from foresee_dsl.simulate.trace import STEP_S
from foresee_dsl.simulate.world import World

LOOKS_AHEAD_M = 60.0
"""Distance ahead within which a vehicle under recovery obeys a red signal, m. Ours: braking from 80 km/h takes 55 m."""


class Simulation:
    """The actors of a scene in SUMO's world; `actors[0]` is the ego, the others are in the scene's order.

    Frame 0 is the world after some steps in which SUMO places the vehicles and they are held there (see `insertion`).
    """

    def __init__(self, bundle: SumoBundle, world: World) -> None:
        """Place all actors as in the scene."""
        self.world, self.network, self.scene = world, bundle.network, bundle.scene
        scene = bundle.scene
        edge = scene.ego.route[0]
        self.ego = EgoVehicle(scene.ego, scene.friction)
        self.actors: list[SimulatedActor] = [self.ego, *(self._make(actor, edge) for actor in scene.actors[1:])]
        vehicles = tuple(actor for actor in self.actors if isinstance(actor, SumoVehicle))
        on_paths = {a.id for a in vehicles if isinstance(a, GuidedVehicle) and a.guide is not None}
        self.sumo_vehicles = {actor.id: actor for actor in vehicles if actor.id not in on_paths}
        self.by_id = {actor.id: actor for actor in self.actors}
        self.doors = [actor for actor in self.actors if isinstance(actor, OpenDoor)]
        for door in self.doors:
            door.belongs_to(self.by_id)
        self.cruise_mps = {a.id: with_timing(a.placed).cruise_mps or a.placed.model.max_speed_mps for a in self.actors}
        self.ignored_rules: dict[str, set[str]] = {actor.id: set() for actor in self.actors}
        self.progress = Progress(self.network, self.actors)
        self._held: set[str] = set()
        self.state_table = StateTable(self.actors)
        rows = {actor.id: number for number, actor in enumerate(self.actors)}
        on_tracks = [actor for actor in self.actors if isinstance(actor, TrackActor)]
        on_foot = [actor for actor in self.actors if isinstance(actor, PathActor) and actor not in on_tracks]
        self._paths: tuple[PathGroup, TrackGroup] = (
            PathGroup(on_foot, [rows[actor.id] for actor in on_foot], self.state_table, self.network),
            TrackGroup(on_tracks, [rows[actor.id] for actor in on_tracks], self.state_table, self.network),
        )
        self._shown_actors = ShownActors(self.ego, self.actors, self._paths, self.progress, world)
        self._traffic = SumoTraffic(
            vehicles,
            self.state_table,
            rows,
            world,
            self.network,
            scene.friction,
            self.cruise_mps,
        )
        for name in on_paths:
            self._traffic.drop(name)
        self.limits = RoadLimits(self.network, world)
        self.ground = SlipperyGround(scene)
        self.frame = 0
        self.time_s = 0.0
        for door in self.doors:
            door.follow()
        insertion = Insertion(
            world, self._shown_actors, self._traffic, self.sumo_vehicles, self.cruise_mps, self.progress
        )
        insertion.run(bundle)
        self._shown_actors.find_ego_lane(self.frame)
        self._take_over()

    def step(self, control: Control) -> tuple[str, ...]:
        """Advance by one frame, with the driver's answer to the last frame; return the ids of the vehicles that left
        the network.
        """
        self.ground.take_effect(self.actors, self.sumo_vehicles, self.world)
        self._traffic.slow_for_bends()
        self.ego.drive(control)
        for group in self._shown_actors.paths:
            group.move()
        for guided in self._shown_actors.guided:
            self._guide(guided)
        if self._shown_actors.steered:
            self._recover()
        for vehicle in self.sumo_vehicles.values() if self.network.bays else ():
            if vehicle.lane in self.network.bays and vehicle.id in self.world:
                self.world.look_ahead(vehicle.id)
                if vehicle.id in self._held:
                    self._keep_in_bay(vehicle)
        self.frame += 1
        self.time_s = round(self.frame * STEP_S, 6)
        with Part.WORLD:
            self._shown_actors.show(self.frame)
            states = self.world.advance(self._shown_actors.motions())
        self._shown_actors.joined.clear()
        left = self._traffic.follow(states)
        self._shown_actors.find_ego_lane(self.frame)
        self._take_over()
        if self.limits.changed:
            self.keep_limits()
        for door in self.doors:
            door.follow()
        return left

    def order_speed(self, actor: SimulatedActor, speed_mps: float) -> None:
        """Limit an actor's speed to this value and to its model's maximum from the next step on; 0 halts it."""
        speed_mps = min(speed_mps, actor.placed.model.max_speed_mps)
        if isinstance(actor, PathActor):
            actor.follower.pace_mps = speed_mps
        elif isinstance(actor, GuidedVehicle) and actor.guide is not None:
            actor.guide.follower.pace_mps = speed_mps
        elif isinstance(actor, SteeredVehicle) and actor.recovery is not None:
            actor.recovery.cruise_mps = speed_mps
        elif actor.id in self.world:
            halt = speed_mps < STANDS_MPS
            if halt:
                self.world.set_speed(actor.id, 0.0)
                self._held.add(actor.id)
                return
            if self.limits.changed:
                speed_mps = self.limits.capped(actor, speed_mps)
            self.world.set_cruise(actor.id, speed_mps)
            self._traffic.set_cruise(actor.id, speed_mps)
            if actor.id in self._held:
                self._held.remove(actor.id)
                self.world.set_speed(actor.id, None)

    def brake(self, actor: SimulatedActor, speed_mps: float | None) -> None:
        """Limit an actor's speed in the next step, however hard it must brake for that; None ends the limit."""
        if actor.id in self.world:
            self.world.brake(actor.id, speed_mps)
            self._held.discard(actor.id)
            if speed_mps == 0.0:
                self._keep_in_bay(actor)
        if speed_mps is None or actor.id not in self.world:
            self.order_speed(actor, self.cruise_mps[actor.id] if speed_mps is None else speed_mps)

    def braking(self, actor: SimulatedActor, rate_mps2: float) -> float:
        """Return this rate of braking, m/s^2, or what the ground under a vehicle on a lane allows, if that is less."""
        vehicle = self.sumo_vehicles.get(actor.id) if actor.id in self.world else None
        return rate_mps2 if vehicle is None else self.ground.braking(vehicle, rate_mps2)

    def brake_harder(self, actor: SimulatedActor, most_mps2: float) -> None:
        """Let an actor on a path brake with at least this rate (m/s^2) instead of its comfortable braking; 0 restores
        it.
        """
        follower = actor.follower if isinstance(actor, PathActor) else None
        if isinstance(actor, GuidedVehicle) and actor.guide is not None:
            follower = actor.guide.follower
        if follower is not None:
            follower.brake_harder(most_mps2)

    def path_done(self, actor: SimulatedActor) -> bool:
        """Return whether an actor has reached the end of the path that it was ordered to follow."""
        if isinstance(actor, PathActor):
            return actor.follower.arrived
        return isinstance(actor, GuidedVehicle) and (actor.guide is None or actor.arrived)

    def follow_path(
        self, actor: SimulatedActor, points: Iterable[XY], way: tuple[tuple[str, ...], RouteLine] | None
    ) -> tuple[XY, ...]:
        """Let an actor leave its lane or path and follow another path from its current position; return that path.

        `way`: the edges along which the actor drives on from the path's end, and the line of these edges; None: the
            actor stays at the path's end.
        """
        path = distinct(whole_millimetres(((actor.x, actor.y), *points)))
        if isinstance(actor, PathActor):
            actor.follow(path)
            self.progress.set_line(actor, actor.follower.line)
        elif isinstance(actor, GuidedVehicle):
            if actor.guide is None:
                self.world.remove(actor.id)
                self._traffic.drop(actor.id)
                del self.sumo_vehicles[actor.id]
            actor.follow(path, None if way is None else way[1], speed_mps=actor.speed)
            actor.route = () if way is None else way[0]
            if actor.guide is not None:
                self.progress.set_line(actor, actor.guide.follower.line)
            self.order_speed(actor, self.cruise_mps[actor.id])
        return tuple(path)

    def leave_track(self, actor: SimulatedActor) -> None:
        """Let a vehicle leave its recorded track as soon as it is there and near the lanes that it joins."""
        if isinstance(actor, GuidedVehicle) and actor.on_track:
            actor.leaves_track = True

    @staticmethod
    def on_track(actor: SimulatedActor) -> bool:
        """Return whether an actor follows its recorded track, also before the track's beginning and after its end."""
        return isinstance(actor, TrackActor) or (isinstance(actor, GuidedVehicle) and actor.on_track)

    def back_up(self, vehicle: GuidedVehicle, length_m: float) -> None:
        """Let a vehicle that stands on its lane reverse along it by `length_m`, and then drive on."""
        if vehicle.guide is None and vehicle.id in self.world:
            self.world.remove(vehicle.id)
            self._traffic.drop(vehicle.id)
            del self.sumo_vehicles[vehicle.id]
            self._held.discard(vehicle.id)
            vehicle.back_up(length_m)

    def _guide(self, vehicle: GuidedVehicle) -> None:
        """Move a vehicle along its path; at the path's end hand it over to SUMO."""
        if vehicle.guide is None or not (vehicle.present or vehicle.on_track):
            return
        if vehicle.leaves_now:
            vehicle.join_from_track(lane_kind(vehicle.placed.model))
        if not vehicle.joins_now:
            vehicle.step_on_path()
            return
        placed = vehicle.hand_over()
        if placed is None or placed.line is None:
            return
        self.world.add_vehicle(replace(placed, cruise_mps=self.cruise_mps[vehicle.id]))
        if vehicle.leaves_track and placed.accelerates_mps2 < placed.model.acceleration_mps2:
            self.world.set_acceleration(vehicle.id, placed.accelerates_mps2)
        self.sumo_vehicles[vehicle.id] = vehicle
        self._traffic.adopt(vehicle.id, placed.lane, self.cruise_mps[vehicle.id])
        self.progress.set_line(vehicle, placed.line)
        for what in self.ignored_rules[vehicle.id]:
            self.world.ignore(vehicle.id, what)
        vehicle.speed = placed.speed_mps
        self._shown_actors.joined.append(vehicle)

    def leave(self, actor: SimulatedActor) -> None:
        """Remove an actor from the world for the rest of the run."""
        actor.present = False
        if isinstance(actor, SumoVehicle):
            self.world.remove(actor.id)
            self._traffic.drop(actor.id)
            if isinstance(actor, GuidedVehicle):
                actor.leave()
        elif isinstance(actor, PathActor):
            self._paths[isinstance(actor, TrackActor)].drop(actor)
        elif isinstance(actor, StaticActor):
            self._shown_actors.hide(actor)

    def close_up(self, actor: SimulatedActor, *, on: bool) -> None:
        """Let a vehicle that SUMO drives come as near to others as its orders require, or restore its usual gap."""
        if actor.id in self.world:
            self.world.close_up(actor.id, on=on)

    def keep_to_lane(self, actor: SimulatedActor, lane: str) -> None:
        """Let a vehicle that SUMO drives change to a lane of its current edge, or stay on it."""
        edge, _, index = lane.rpartition("_")
        if actor.lane.rpartition("_")[0] == edge and actor.id in self.world:
            self.world.keep_to_lane(actor.id, int(index))

    def _keep_in_bay(self, actor: SimulatedActor) -> None:
        """Let a vehicle that was told to stand in a bay stay there.

        Its route continues beside the bay, and SUMO 1.28 makes even a standing vehicle change to the lane that
        continues its route.
        """
        if actor.lane in self.network.bays:
            self.keep_to_lane(actor, actor.lane)

    def keep_limits(self) -> None:
        """Apply changed speed limits to the vehicles that SUMO drives; to be called once a step."""
        for vehicle in self.sumo_vehicles.values():
            if vehicle.present and vehicle.id in self.world and vehicle.id not in self._held:
                speed_mps = self.limits.driven(vehicle, self.cruise_mps[vehicle.id])
                if speed_mps is not None:
                    self.world.set_cruise(vehicle.id, speed_mps)
                    self._traffic.set_cruise(vehicle.id, speed_mps)

    def ignore(self, actor: SimulatedActor, what: str, *, on: bool = True) -> None:
        """Let an actor ignore `signals` or `priority`, or obey them again."""
        (self.ignored_rules[actor.id].add if on else self.ignored_rules[actor.id].discard)(what)
        if what == "signals" and isinstance(actor, PathActor):
            actor.stops = () if on else actor.placed.walk_stops
        if actor.id in self.world:
            self.world.ignore(actor.id, what, on=on)

    def others(self, actor: SimulatedActor) -> Iterable[SimulatedActor]:
        """Return all present actors except this one."""
        return (other for other in self.actors if other is not actor and other.present)

    # --- inside ----------------------------------------------------------------------------------------------------

    def _make(self, actor: PlacedActor, edge: str) -> SimulatedActor:
        wheels = actor.model.kind in WHEELS and actor.steering is None
        if actor.joins or (actor.guided and wheels and actor.control in ("sumo", "path")):
            return GuidedVehicle(actor, self.world, self.network, edge, self.scene.friction)
        if actor.control == "path":
            how = self.world, edge, self.scene.friction
            return PathActor(actor, *how) if actor.playback is None else TrackActor(actor, actor.playback, *how)
        if actor.door is not None:
            return OpenDoor(actor, actor.door, self.world, self.network, edge)
        if actor.control == "static":
            return StaticActor(actor, self.world, self.network, edge)
        if actor.steering is not None:
            return SteeredVehicle(actor, self.network, self.scene.friction)
        return SumoVehicle(actor, self.network)

    def _recover(self) -> None:
        taken = [a for a in self._shown_actors.steered if a.taken is not None and a.present]
        if not taken:
            return
        movers = {a.id: a.mover for a in self.actors if a.present}
        for actor in taken:
            others = [mover for name, mover in movers.items() if name != actor.id]
            # An actor that was told to run a red light or to refuse to yield still brakes for a body already in its
            # way.
            actor.recover(self.time_s, others, self._red_ahead(actor), yields=not self.ignored_rules[actor.id])
            if not actor.present:
                self.world.remove(actor.id)

    def _red_ahead(self, actor: SimulatedActor) -> float | None:
        if "signals" in self.ignored_rules[actor.id]:
            return None
        for passage, room in self.progress.ahead(actor, self.frame, LOOKS_AHEAD_M):
            tls, link = passage.movement.tls, passage.movement.link
            if room >= 0 and tls is not None and link >= 0 and self.world.signals.colour(tls, link) == "red":
                return passage.entry_s
        return None

    def _take_over(self) -> None:
        for actor in self._shown_actors.steered:
            if actor.present and actor.due(self.time_s):
                actor.take_over(self.network, self.cruise_mps[actor.id])
                self.world.take_over(actor.placed)
                self._traffic.drop(actor.id)
