"""Everybody in a run: puts the actors into the world, moves them one step, and takes speed orders."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from foresee_dsl.compile.bundle import PlacedActor, SumoBundle
from foresee_dsl.drivers.protocol import Control
from foresee_dsl.simulate.actors.moved_actors import (
    STANDS_MPS,
    Ego,
    PathActor,
    StandIn,
    StaticActor,
    SteeredVehicle,
    with_timing,
)
from foresee_dsl.simulate.actors.states import Actor, StateTable
from foresee_dsl.simulate.actors.sumo_vehicles import SumoTraffic, SumoVehicle
from foresee_dsl.simulate.results.junction_entry import since_entry_s
from foresee_dsl.simulate.trace import STEP_S
from foresee_dsl.simulate.triggers.progress import Progress
from foresee_dsl.simulate.world import World

OFF_LANE_M = 1.8
"""The ego is on its lane while its centre is this near to the lane's. Ours: about half a lane."""
LOOKS_AHEAD_M = 60.0
"""A vehicle under recovery looks this far ahead for a red signal. Ours: braking from 80 km/h takes 55 m."""
GAINS_SHARE = 0.9
"""Who gains speed on a junction with less than this share of what it can, although it may drive faster, lets somebody
go or follows. Ours: SUMO accelerates or drives exactly what it may where nothing is in the way."""
MAY_DRIVE_MPS = 0.3
"""Who is at most so much slower than it may be drives as fast as it may. Ours: two steps of acceleration."""
HELD_MPS = 0.6
"""SUMO takes 0.45 m/s (its emergency braking) off the speed of who is held, in a step, and whoever comes to stand has
stopped at a stop sign. Ours: so much that nobody does."""
KNOWN_AFTER = 1
"""Steps that everybody is held where they are placed. Ours: SUMO learns of who comes to a junction a step later."""


class Simulation:
    """The actors of a scene in a world; `actors[0]` is the ego, the rest in the scene's order.

    Frame 0 is the world after some steps in which SUMO places the vehicles and they are held there.
    """

    def __init__(self, bundle: SumoBundle, world: World) -> None:
        """Put everybody where the scene has them.

        Raises:
            SimulationError: SUMO refuses a route or a place.
        """
        self.world, self.network, self.scene = world, bundle.network, bundle.scene
        scene = bundle.scene
        edge = scene.ego.route[0]
        self.ego = Ego(scene.ego, scene.friction)
        self.bodies: dict[str, SumoVehicle] = {}
        self.walkers: list[PathActor] = []
        self.blocks: list[StaticActor] = []
        self.steered: list[SteeredVehicle] = []
        self.actors: list[Actor] = [self.ego]
        for actor in scene.actors[1:]:
            self.actors.append(self._make(actor, edge))
        self.by_id = {actor.id: actor for actor in self.actors}
        self.cruise_mps = {a.id: with_timing(a.placed).cruise_mps or a.placed.model.max_speed_mps for a in self.actors}
        self.ignored_rules: dict[str, set[str]] = {actor.id: set() for actor in self.actors}
        self.progress = Progress(self.network, self.actors)
        self._held: set[str] = set()
        self.state_table = StateTable(self.actors)
        rows = {actor.id: number for number, actor in enumerate(self.actors)}
        self._traffic = SumoTraffic(
            tuple(self.bodies.values()), self.state_table, rows, world, self.network, scene.friction, self.cruise_mps
        )
        self.frame = 0
        self.time_s = 0.0
        self._enter(bundle)

    def step(self, control: Control) -> tuple[str, ...]:
        """Go on by one frame.

        Args:
            control: what the driver answered to the last frame.

        Returns:
            Ids of those who have left the world.
        """
        self._traffic.slow_for_bends()
        self.ego.drive(control)
        for walker in self.walkers:
            walker.walk()
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
        return left

    def order_speed(self, actor: Actor, speed_mps: float) -> None:
        """Let an actor drive or walk at most this (and what its model can), from the next step on; 0 halts it."""
        speed_mps = min(speed_mps, actor.placed.model.max_speed_mps)
        if isinstance(actor, PathActor):
            actor.follower.pace_mps = speed_mps
        elif isinstance(actor, SteeredVehicle) and actor.recovery is not None:
            actor.recovery.cruise_mps = speed_mps
        elif actor.id in self.world:
            halt = speed_mps < STANDS_MPS
            if halt:
                self.world.set_speed(actor.id, 0.0)
                self._held.add(actor.id)
                return
            self.world.set_cruise(actor.id, speed_mps)
            self._traffic.set_cruise(actor.id, speed_mps)
            if actor.id in self._held:
                self._held.remove(actor.id)
                self.world.set_speed(actor.id, None)

    def ignore(self, actor: Actor, what: str, *, on: bool = True) -> None:
        """Let an actor ignore `signals` or `priority`, or obey again."""
        (self.ignored_rules[actor.id].add if on else self.ignored_rules[actor.id].discard)(what)
        if what == "signals" and isinstance(actor, PathActor):
            actor.stops = () if on else actor.placed.walk_stops
        if actor.id in self.world:
            self.world.ignore(actor.id, what, on=on)

    def others(self, actor: Actor) -> Iterable[Actor]:
        """Everybody present but one."""
        return (other for other in self.actors if other is not actor and other.present)

    # --- inside ----------------------------------------------------------------------------------------------------

    def _make(self, actor: PlacedActor, edge: str) -> Actor:
        if actor.control == "path":
            walker = PathActor(actor, self.world, self.network, edge, self.scene.friction)
            self.walkers.append(walker)
            return walker
        if actor.control == "static":
            block = StaticActor(actor, self.world, self.network, edge)
            self.blocks.append(block)
            return block
        if actor.steering is not None:
            steered = SteeredVehicle(actor, self.network, self.scene.friction)
            self.steered.append(steered)
            self.bodies[actor.id] = steered
            return steered
        self.bodies[actor.id] = SumoVehicle(actor, self.network)
        return self.bodies[actor.id]

    def _enter(self, bundle: SumoBundle) -> None:
        """Put everybody into SUMO, hold them until it knows what it would have known, and let them roll to frame 0.

        In SUMO, who came to a junction first goes first: those inside are put there one a step, in the order in which
        they seem to have come (`_waves`). In the last step it makes up its mind about gaps and lanes.
        """
        world = self.world
        waves, ghosts_from = self._waves()
        world.signals.start(bundle, (len(waves) + 1) * STEP_S)
        for body in self.bodies.values():
            body.speed = with_timing(body.placed).speed_mps
        before = {body.id: with_timing(body.in_sumo()) for body in self.bodies.values()}
        here: list[Actor] = []
        for count, wave in enumerate(waves):
            self._hold(here, before)
            for actor in wave:
                self._add(actor, before)
            here += wave
            if count >= ghosts_from:
                self._show_others()
            self._pass_step(at_least_mps=HELD_MPS if count + 1 < len(waves) else 0.0)
        rolling = [body for body in self.bodies.values() if body.rolls]
        self._hold([body for body in self.bodies.values() if not body.rolls], before)
        for body in rolling:
            world.roll(body.id, body.speed, free=body.acceleration > 0)
        self._traffic.slow_for_bends()
        self._show()
        self._pass_step()
        for body in rolling:
            world.let_go(body.id)
        self._ego_lane()
        self._take_over()

    def _waves(self) -> tuple[list[list[Actor]], int]:
        """Say who is put into SUMO in which step, and from which step on stand-ins are shown.

        On a junction, who stands or drives slower than it may lets somebody else go first, who was there before; the
        others came as long ago as their way inside takes at their speed.
        """
        vehicles: list[Actor] = [self.ego, *self.bodies.values()]
        bends = self._traffic.may_drive_mps()
        at_speed = {
            body.id: body.speed >= min(self.cruise_mps[body.id], bends[body.id]) - MAY_DRIVE_MPS
            for body in self.bodies.values()
        }
        since = {actor.id: self._since_entry(actor, at_speed.get(actor.id, False)) for actor in vehicles}
        inside = sorted((a for a in vehicles if since[a.id] > 0), key=lambda a: -since[a.id])
        going = [a for a in inside if a is self.ego or _goes(a, at_speed[a.id])]
        letting_go = [a for a in inside if a not in going]
        rest = [a for a in vehicles if a not in inside]
        none: list[Actor] = []
        waves = [*([a] for a in going), none, *([a] for a in letting_go), rest, *([none] * KNOWN_AFTER)]
        return waves, len(going)

    def _since_entry(self, actor: Actor, at_speed: bool) -> float:
        """Return how long ago an actor's front seems to have come to the junction that it is on, s; 0 on none.

        Args:
            actor: who. at_speed: it drives as fast as it may.
        """
        inside_m = self.progress.inside(actor, self.frame)
        if inside_m <= 0.0:
            return 0.0
        # Who has come out of a bend gains speed as well, but has not waited.
        waited = actor is not self.ego and _as_much_as_it_can(actor) and not at_speed
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
        """Let SUMO take a step of which it does not keep the speeds that it made up.

        Args:
            at_least_mps: what it goes on from for those that do not stand.
        """
        self.world.step()
        self._settle()
        for body in self.bodies.values():
            speed = body.speed if body.speed < STANDS_MPS else max(body.speed, at_least_mps)
            self.world.settle(body.id, speed, body.acceleration)

    def _show(self) -> None:
        """Say where those whom SUMO does not move will be at the end of the next step."""
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
        for walker in self.walkers:
            walker.show()
        for block in self.blocks:
            block.ghost.show(block.spots)
        for steered in self.steered:
            if steered.taken is not None and steered.present:
                x, y = steered.front
                self.world.place(steered.id, x, y, steered.heading)

    def _settle(self) -> None:
        self.world.settle(self.ego.id, self.ego.speed, self.ego.acceleration)
        for ghost in self._ghosts():
            ghost.settle()
        for steered in self.steered:
            if steered.taken is not None and steered.present:
                self.world.settle(steered.id, steered.speed, steered.acceleration)

    def _ghosts(self) -> Iterable[StandIn]:
        yield from (walker.ghost for walker in self.walkers)
        yield from (block.ghost for block in self.blocks)

    def _recover(self) -> None:
        taken = [a for a in self.steered if a.taken is not None and a.present]
        if not taken:
            return
        movers = {a.id: a.mover for a in self.actors if a.present}
        for actor in taken:
            others = [mover for name, mover in movers.items() if name != actor.id]
            # Who runs a red light or refuses to yield goes on doing so, but not into what is in its way already.
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


def _as_much_as_it_can(actor: Actor) -> bool:
    """Whether a vehicle gains speed as if nothing were in its way."""
    return actor.acceleration >= GAINS_SHARE * actor.placed.model.acceleration_mps2 * min(actor.placed.timing, 1.0) ** 2


def _goes(actor: Actor, at_speed: bool) -> bool:
    """Say whether a vehicle inside a junction seems to have nobody to wait for."""
    return actor.speed >= STANDS_MPS and (_as_much_as_it_can(actor) or at_speed)
