"""The running simulation: puts the actors into SUMO's world, moves them by one step, and takes speed orders."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace

from foresee_dsl.compile.bundle import PlacedActor, SumoBundle
from foresee_dsl.compile.placement.starts import WHEELS
from foresee_dsl.compile.roads.polyline import XY, distinct, whole_millimetres
from foresee_dsl.compile.roads.route_line import RouteLine
from foresee_dsl.drivers.protocol import Control
from foresee_dsl.simulate.actors.doors import OpenDoor
from foresee_dsl.simulate.actors.guided_vehicles import GuidedVehicle
from foresee_dsl.simulate.actors.limits import Limits
from foresee_dsl.simulate.actors.moved_actors import (
    STANDS_MPS,
    Ego,
    PathActor,
    StaticActor,
    SteeredVehicle,
    with_timing,
)
from foresee_dsl.simulate.actors.path_groups import PathGroup
from foresee_dsl.simulate.actors.slippery import SlipperyGround
from foresee_dsl.simulate.actors.states import Actor, StateTable
from foresee_dsl.simulate.actors.sumo_vehicles import SumoTraffic, SumoVehicle
from foresee_dsl.simulate.results.metrics import since_entry_s
from foresee_dsl.simulate.trace import STEP_S
from foresee_dsl.simulate.triggers.progress import Progress
from foresee_dsl.simulate.world import World

OFF_LANE_M = 1.8
"""The ego is on its lane while its centre is this near to the lane's. Ours: about half a lane."""
LOOKS_AHEAD_M = 60.0
"""A vehicle under recovery looks this far ahead for a red signal. Ours: braking from 80 km/h takes 55 m."""
GAINS_SHARE = 0.9
"""A vehicle inside a junction that accelerates with less than this share of its maximum, below the speed that it may
drive, is treated as yielding or following. Ours: with nothing in the way SUMO accelerates with exactly its maximum."""
MAY_DRIVE_MPS = 0.3
"""A vehicle that is at most this much slower than it may drive counts as driving at that speed. Ours: two steps of
acceleration."""
HELD_MPS = 0.6
"""Least speed of a moving vehicle that is held in place while others are inserted. Per step SUMO 1.28 takes 0.45 m/s
(its emergency braking) off a held vehicle's speed, and one that reaches 0 counts as having stopped at a stop sign.
Ours: enough that none does."""
KNOWN_AFTER = 1
"""Steps for which all vehicles are held after the last insertion. Ours: SUMO 1.28 registers a vehicle that approaches a
junction one step later."""


class Simulation:
    """The actors of a scene in SUMO's world; `actors[0]` is the ego, the others are in the scene's order.

    Frame 0 is the world after some steps in which SUMO places the vehicles and they are held there.
    """

    def __init__(self, bundle: SumoBundle, world: World) -> None:
        """Place all actors as the scene has them."""
        self.world, self.network, self.scene = world, bundle.network, bundle.scene
        scene = bundle.scene
        edge = scene.ego.route[0]
        self.ego = Ego(scene.ego, scene.friction)
        self.actors: list[Actor] = [self.ego, *(self._make(actor, edge) for actor in scene.actors[1:])]
        vehicles = tuple(actor for actor in self.actors if isinstance(actor, SumoVehicle))
        self.guided = [actor for actor in vehicles if isinstance(actor, GuidedVehicle)]
        on_paths = {actor.id for actor in self.guided if actor.guide is not None}
        self.sumo_vehicles = {actor.id: actor for actor in vehicles if actor.id not in on_paths}
        self._joined: list[SumoVehicle] = []
        bodies = (actor for actor in self.actors if isinstance(actor, StaticActor))
        self._in_the_way = [body for body in bodies if body.positions or isinstance(body, OpenDoor)]
        self.steered = [actor for actor in self.actors if isinstance(actor, SteeredVehicle)]
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
        on_foot = [actor for actor in self.actors if isinstance(actor, PathActor)]
        self._paths = PathGroup(on_foot, [rows[actor.id] for actor in on_foot], self.state_table, self.network)
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
        self.limits = Limits(self.network, world)
        self.ground = SlipperyGround(scene)
        self.frame = 0
        self.time_s = 0.0
        for door in self.doors:
            door.follow()
        self._insert_all(bundle)

    def step(self, control: Control) -> tuple[str, ...]:
        """Advance by one frame with the driver's answer to the last one; return the ids of the vehicles that have
        left."""
        self.ground.take_effect(self.actors, self.sumo_vehicles, self.world)
        self._traffic.slow_for_bends()
        self.ego.drive(control)
        self._paths.move()
        for guided in self.guided:
            self._guide(guided)
        self._recover()
        self.frame += 1
        self.time_s = round(self.frame * STEP_S, 6)
        self._show()
        self.world.step()
        self.world.correct_lane_order()
        self._settle()
        left = self._traffic.follow()
        self._ego_lane()
        self._take_over()
        if self.limits.changed:
            self.keep_limits()
        for door in self.doors:
            door.follow()
        return left

    def order_speed(self, actor: Actor, speed_mps: float) -> None:
        """Let an actor drive or walk at most this (and what its model can), from the next step on; 0 halts it."""
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

    def brake(self, actor: Actor, speed_mps: float | None) -> None:
        """Let an actor drive or walk at most this in the next step, however hard it brakes for that; None: it drives on
        as before."""
        if actor.id in self.world:
            self.world.brake(actor.id, speed_mps)
            self._held.discard(actor.id)
        if speed_mps is None or actor.id not in self.world:
            self.order_speed(actor, self.cruise_mps[actor.id] if speed_mps is None else speed_mps)

    def path_done(self, actor: Actor) -> bool:
        """Whether an actor has come to the end of the path that it was told to follow."""
        if isinstance(actor, PathActor):
            return actor.follower.arrived
        return isinstance(actor, GuidedVehicle) and (actor.guide is None or actor.arrived)

    def follow_path(
        self, actor: Actor, points: Iterable[XY], way: tuple[tuple[str, ...], RouteLine] | None
    ) -> tuple[XY, ...]:
        """Let an actor leave its lane, or its path, and follow another path from where it is; at its end it drives on
        along a way (edges, line), or stays there. Return the path."""
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

    def back_up(self, vehicle: GuidedVehicle, length_m: float) -> None:
        """Let a vehicle that stands on its lane go backwards along it, and then drive on."""
        if vehicle.guide is None and vehicle.id in self.world:
            self.world.remove(vehicle.id)
            self._traffic.drop(vehicle.id)
            del self.sumo_vehicles[vehicle.id]
            self._held.discard(vehicle.id)
            vehicle.back_up(length_m)

    def _guide(self, vehicle: GuidedVehicle) -> None:
        """Move a vehicle along its path, or give it to SUMO at the path's end."""
        if vehicle.guide is None or not vehicle.present:
            return
        if not vehicle.joins_now:
            vehicle.step_on_path()
            return
        placed = vehicle.hand_over()
        if placed is None or placed.line is None:
            return
        self.world.add_vehicle(replace(placed, cruise_mps=self.cruise_mps[vehicle.id]))
        self.sumo_vehicles[vehicle.id] = vehicle
        self._traffic.adopt(vehicle.id, placed.lane, self.cruise_mps[vehicle.id])
        self.progress.set_line(vehicle, placed.line)
        for what in self.ignored_rules[vehicle.id]:
            self.world.ignore(vehicle.id, what)
        vehicle.speed = placed.speed_mps
        self._joined.append(vehicle)

    def leave(self, actor: Actor) -> None:
        """Take an actor out of the world for good."""
        actor.present = False
        if isinstance(actor, SumoVehicle):
            self.world.remove(actor.id)
            self._traffic.drop(actor.id)
            if isinstance(actor, GuidedVehicle) and actor.guide is not None:
                actor.guide.stand_in.hide()
        elif isinstance(actor, PathActor):
            self._paths.drop(actor)
        elif isinstance(actor, StaticActor):
            actor.stand_in.hide()
            self._in_the_way = [other for other in self._in_the_way if other is not actor]

    def close_up(self, actor: Actor, *, on: bool) -> None:
        """Let a vehicle that SUMO drives come as near to others as it is told, or keep its usual distance again."""
        if actor.id in self.world:
            self.world.close_up(actor.id, on=on)

    def keep_to_lane(self, actor: Actor, lane: str) -> None:
        """Let a vehicle that SUMO drives change to a lane, or stay on it, where it is on its edge."""
        edge, _, index = lane.rpartition("_")
        if actor.lane.rpartition("_")[0] == edge and actor.id in self.world:
            self.world.keep_to_lane(actor.id, int(index))

    def keep_limits(self) -> None:
        """Let the vehicles that SUMO drives keep to the limits that were changed."""
        for vehicle in self.sumo_vehicles.values():
            if vehicle.present and vehicle.id in self.world and vehicle.id not in self._held:
                speed_mps = self.limits.driven(vehicle, self.cruise_mps[vehicle.id])
                if speed_mps is not None:
                    self.world.set_cruise(vehicle.id, speed_mps)
                    self._traffic.set_cruise(vehicle.id, speed_mps)

    def ignore(self, actor: Actor, what: str, *, on: bool = True) -> None:
        """Let an actor ignore `signals` or `priority`, or obey again."""
        (self.ignored_rules[actor.id].add if on else self.ignored_rules[actor.id].discard)(what)
        if what == "signals" and isinstance(actor, PathActor):
            actor.stops = () if on else actor.placed.walk_stops
        if actor.id in self.world:
            self.world.ignore(actor.id, what, on=on)

    def others(self, actor: Actor) -> Iterable[Actor]:
        """Return all actors that are present, but one."""
        return (other for other in self.actors if other is not actor and other.present)

    # --- inside ----------------------------------------------------------------------------------------------------

    def _make(self, actor: PlacedActor, edge: str) -> Actor:
        wheels = actor.model.kind in WHEELS and actor.steering is None
        if actor.joins or (actor.guided and wheels and actor.control in ("sumo", "path")):
            return GuidedVehicle(actor, self.world, self.network, edge, self.scene.friction)
        if actor.control == "path":
            return PathActor(actor, self.world, edge, self.scene.friction)
        if actor.door is not None:
            return OpenDoor(actor, actor.door, self.world, self.network, edge)
        if actor.control == "static":
            return StaticActor(actor, self.world, self.network, edge)
        if actor.steering is not None:
            return SteeredVehicle(actor, self.network, self.scene.friction)
        return SumoVehicle(actor, self.network)

    def _insert_all(self, bundle: SumoBundle) -> None:
        """Insert all actors into SUMO, hold them until it knows what it would have known, and let them roll to frame 0.

        In SUMO the vehicle that came to a junction first goes first: those inside are inserted one per step, in the
        order in which they seem to have come (`_insertion_order`). In the last step SUMO decides on gaps and lanes.
        """
        world = self.world
        waves, stand_ins_from = self._insertion_order()
        world.signals.start(bundle, (len(waves) + 1) * STEP_S)
        for vehicle in self.sumo_vehicles.values():
            vehicle.speed = with_timing(vehicle.placed).speed_mps
        before = {vehicle.id: with_timing(vehicle.in_sumo()) for vehicle in self.sumo_vehicles.values()}
        here: list[Actor] = []
        for count, wave in enumerate(waves):
            self._hold(here, before)
            for actor in wave:
                self._add(actor, before)
            here += wave
            if count >= stand_ins_from:
                self._show_others()
            self._pass_step(at_least_mps=HELD_MPS if count + 1 < len(waves) else 0.0)
        rolling = [vehicle for vehicle in self.sumo_vehicles.values() if vehicle.rolls]
        self._hold([vehicle for vehicle in self.sumo_vehicles.values() if not vehicle.rolls], before)
        for vehicle in rolling:
            world.roll(vehicle.id, vehicle.speed, free=vehicle.acceleration > 0)
        self._traffic.slow_for_bends()
        self._show()
        self._pass_step()
        for vehicle in rolling:
            world.let_go(vehicle.id)
        self._ego_lane()
        self._take_over()

    def _insertion_order(self) -> tuple[list[list[Actor]], int]:
        """Return which actors are inserted in which step, and from which step on stand-ins are shown.

        Inside a junction, a vehicle that stands or drives slower than it may is taken to yield to one that was there
        before; the others came as long ago as their way inside takes at their speed.
        """
        vehicles: list[Actor] = [self.ego, *self.sumo_vehicles.values()]
        bends = self._traffic.may_drive_mps()
        at_speed = {
            vehicle.id: vehicle.speed >= min(self.cruise_mps[vehicle.id], bends[vehicle.id]) - MAY_DRIVE_MPS
            for vehicle in self.sumo_vehicles.values()
        }
        since = {actor.id: self._since_entry(actor, at_speed.get(actor.id, False)) for actor in vehicles}
        inside = sorted((a for a in vehicles if since[a.id] > 0), key=lambda a: -since[a.id])
        going = [a for a in inside if a is self.ego or _drives_freely(a, at_speed[a.id])]
        yielding = [a for a in inside if a not in going]
        rest = [a for a in vehicles if a not in inside]
        none: list[Actor] = []
        waves = [*([a] for a in going), none, *([a] for a in yielding), rest, *([none] * KNOWN_AFTER)]
        return waves, len(going)

    def _since_entry(self, actor: Actor, at_speed: bool) -> float:
        """Return how long ago a vehicle's front seems to have come to the junction that it is on, s; 0 on none.

        `at_speed`: it drives as fast as it may.
        """
        inside_m = self.progress.inside(actor, self.frame)
        if inside_m <= 0.0:
            return 0.0
        # A vehicle that has come out of a bend gains speed as well, but has not waited.
        waited = actor is not self.ego and _accelerates_freely(actor) and not at_speed
        return since_entry_s(inside_m, actor.speed, actor.acceleration if waited else 0.0)

    def _add(self, actor: Actor, before: Mapping[str, PlacedActor]) -> None:
        if actor is self.ego:
            self.world.add_body(self.ego.id, self.ego.placed.model.name, self.ego.placed.route)
            self._show_ego(-STEP_S)
            return
        placed = before[actor.id]
        self.world.add_vehicle(placed)
        if placed.timing < 1.0:
            self.world.set_acceleration(actor.id, placed.model.acceleration_mps2 * placed.timing**2)

    def _hold(self, actors: Iterable[Actor], before: Mapping[str, PlacedActor]) -> None:
        for actor in actors:
            if actor is self.ego:
                self._show_ego(-STEP_S)
            else:
                self.world.hold(before[actor.id])

    def _pass_step(self, *, at_least_mps: float = 0.0) -> None:
        """Let SUMO take a step, and put back the speeds of its vehicles, those that move at least at `at_least_mps`."""
        self.world.step()
        self._settle()
        for vehicle in self.sumo_vehicles.values():
            if vehicle.id not in self.world:
                continue  # not yet
            speed = vehicle.speed if vehicle.speed < STANDS_MPS else max(vehicle.speed, at_least_mps)
            self.world.settle(vehicle.id, speed, vehicle.acceleration)

    def _show(self) -> None:
        """Tell SUMO where the actors that it does not move will be at the end of the next step."""
        self._show_ego()
        self._show_others()

    def _show_ego(self, ahead_s: float = 0.0) -> None:
        (x, y), way, heading = self.ego.front, self.ego.speed * ahead_s, self.ego.heading
        self.world.place(
            self.ego.id, x + way * math.cos(heading), y + way * math.sin(heading), heading, self._lane_ahead()
        )

    def _lane_ahead(self) -> str:
        """The lane that the ego's front is on, "" off its route's lanes."""
        line = self.ego.placed.line
        if line is None:
            return ""
        s, lateral = self.progress.of(self.ego, self.frame)
        return line.lane_at(s + self.ego.length / 2) if abs(lateral) <= OFF_LANE_M else ""

    def _show_others(self) -> None:
        self._paths.show()
        for guided in self.guided:
            guided.show()
        for static in self._in_the_way:
            static.stand_in.show(static.positions)
        for steered in self.steered:
            if steered.taken is not None and steered.present:
                x, y = steered.front
                self.world.place(steered.id, x, y, steered.heading)

    def _settle(self) -> None:
        ego = self.ego
        self.world.settle(ego.id, ego.speed, ego.acceleration)
        self._paths.settle()
        for static in self._in_the_way:
            static.stand_in.settle()
        for guided in self.guided:
            if guided.guide is not None:
                guided.guide.stand_in.settle()
        for joined in self._joined:
            self.world.settle(joined.id, joined.speed, joined.acceleration)
        self._joined.clear()
        for steered in self.steered:
            if steered.taken is not None and steered.present:
                self.world.settle(steered.id, steered.speed, steered.acceleration)

    def _recover(self) -> None:
        taken = [a for a in self.steered if a.taken is not None and a.present]
        if not taken:
            return
        movers = {a.id: a.mover for a in self.actors if a.present}
        for actor in taken:
            others = [mover for name, mover in movers.items() if name != actor.id]
            # An actor that runs a red light or refuses to yield still brakes for what is in its way already.
            actor.recover(self.time_s, others, self._red_ahead(actor), yields=not self.ignored_rules[actor.id])
            if not actor.present:
                self.world.remove(actor.id)

    def _red_ahead(self, actor: Actor) -> float | None:
        if "signals" in self.ignored_rules[actor.id]:
            return None
        for passage, room in self.progress.ahead(actor, self.frame, LOOKS_AHEAD_M):
            tls, link = passage.movement.tls, passage.movement.link
            if room >= 0 and tls is not None and link >= 0 and self.world.signals.colour(tls, link) == "red":
                return passage.entry_s
        return None

    def _take_over(self) -> None:
        for actor in self.steered:
            if actor.present and actor.due(self.time_s):
                actor.take_over(self.network, self.cruise_mps[actor.id])
                self.world.take_over(actor.placed)
                self._traffic.drop(actor.id)

    def _ego_lane(self) -> None:
        line = self.ego.placed.line
        if line is not None:
            s, lateral = self.progress.of(self.ego, self.frame)
            self.ego.lane = line.lane_at(s) if abs(lateral) <= OFF_LANE_M else ""


def _accelerates_freely(actor: Actor) -> bool:
    """Whether a vehicle accelerates as if nothing were in its way."""
    return actor.acceleration >= GAINS_SHARE * actor.placed.model.acceleration_mps2 * min(actor.placed.timing, 1.0) ** 2


def _drives_freely(actor: Actor, at_speed: bool) -> bool:
    """Say whether a vehicle inside a junction seems to have nothing to wait for."""
    return actor.speed >= STANDS_MPS and (_accelerates_freely(actor) or at_speed)
