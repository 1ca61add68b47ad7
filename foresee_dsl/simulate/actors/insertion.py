"""Brings the actors into SUMO's world: inserts those of the scene, so that from frame 0 SUMO grants right of way as if
they had driven to their places, and shows SUMO those that it does not move."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from foresee_dsl.compile.bundle import PlacedActor, SumoBundle
from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.simulate.actors.guided_vehicles import GuidedVehicle
from foresee_dsl.simulate.actors.moved_actors import EgoVehicle, OpenDoor, StaticActor, SteeredVehicle, with_timing
from foresee_dsl.simulate.actors.path_groups import PathGroup
from foresee_dsl.simulate.actors.progress import Progress
from foresee_dsl.simulate.actors.states import SimulatedActor
from foresee_dsl.simulate.actors.sumo_vehicles import SumoTraffic, SumoVehicle
from foresee_dsl.simulate.trace import STEP_S
from foresee_dsl.simulate.world import BodyMotion, World

GAINS_SHARE = 0.9
"""A vehicle inside a junction that drives slower than it may, and accelerates with less than this share of its maximum,
is treated as yielding or following. Ours: a vehicle of SUMO with nothing in its way accelerates with exactly its
maximum."""
MAY_DRIVE_MPS = 0.3
"""A vehicle counts as driving as fast as it may if it is at most this much slower, m/s. Ours: two steps of
acceleration."""
HELD_MPS = 0.6
"""Least speed of a moving vehicle that is held in place while others are inserted. Per step SUMO 1.28 takes 0.45 m/s
(its emergency braking) off a held vehicle's speed, and one that reaches 0 counts as having stopped at a stop sign.
Ours: enough that no held vehicle reaches 0."""
REGISTRATION_STEPS = 1
"""Steps for which all vehicles are held after the last insertion. Ours: SUMO 1.28 registers a vehicle that approaches a
junction one step later."""
INSIDE_CREEPS_MPS = 0.5
"""Assumed approach speed of a vehicle that waits inside a junction, m/s. Ours: it is used only to order such vehicles
by how far inside they are."""


class Insertion:
    """The steps in which SUMO places the vehicles and they are held there, before frame 0."""

    def __init__(
        self,
        world: World,
        shown_actors: ShownActors,
        traffic: SumoTraffic,
        vehicles: Mapping[str, SumoVehicle],
        cruise_mps: Mapping[str, float],
        progress: Progress,
    ) -> None:
        """Use these parts of the simulation.

        `vehicles`: the vehicles that SUMO drives, by id. `cruise_mps`: cruising speed of each actor by id, m/s.
        """
        self._world, self._shown_actors, self._traffic, self._vehicles = world, shown_actors, traffic, vehicles
        self._cruise_mps, self._progress = cruise_mps, progress

    def run(self, bundle: SumoBundle) -> None:
        """Insert all actors into SUMO, hold them until all are registered, and let them roll to frame 0.

        In SUMO the vehicle that reached a junction first goes first. Vehicles inside a junction are therefore inserted
        one per step, in the order in which they probably entered (`_insertion_order`). In the last step SUMO decides
        about gaps and lane changes.
        """
        world = self._world
        waves, stand_ins_from = self._insertion_order()
        world.signals.start(bundle, (len(waves) + 1) * STEP_S)
        for vehicle in self._vehicles.values():
            vehicle.speed = with_timing(vehicle.placed).speed_mps
        before = {vehicle.id: with_timing(vehicle.in_sumo()) for vehicle in self._vehicles.values()}
        here: list[SimulatedActor] = []
        for count, wave in enumerate(waves):
            self._hold(here, before)
            for actor in wave:
                self._add(actor, before)
            here += wave
            if count >= stand_ins_from:
                self._shown_actors.show_others()
            self._pass_step(at_least_mps=HELD_MPS if count + 1 < len(waves) else 0.0)
        rolling = [vehicle for vehicle in self._vehicles.values() if vehicle.rolls]
        self._hold([vehicle for vehicle in self._vehicles.values() if not vehicle.rolls], before)
        for vehicle in rolling:
            world.roll(vehicle.id, vehicle.speed, free=vehicle.acceleration > 0)
        for vehicle in self._vehicles.values() if bundle.network.bays else ():
            # In a bay, a vehicle that does not speed up has come to stop there, so SUMO must not change its lane.
            if vehicle.lane in bundle.network.bays and vehicle.acceleration <= 0:
                world.keep_to_lane(vehicle.id, int(vehicle.lane.rpartition("_")[2]))
        self._traffic.slow_for_bends()
        self._shown_actors.show(0)
        self._pass_step()
        for vehicle in rolling:
            world.let_go(vehicle.id)

    def _insertion_order(self) -> tuple[list[list[SimulatedActor]], int]:
        """Return which actors are inserted in which step, and the step from which stand-ins are shown.

        A vehicle inside a junction that stands, or drives slower than it may, is treated as yielding to a vehicle that
        entered earlier. For the other vehicles, the time since they entered is the distance that they have driven
        inside, divided by their speed.
        """
        vehicles: list[SimulatedActor] = [self._shown_actors.ego, *self._vehicles.values()]
        bends = self._traffic.may_drive_mps()
        at_speed = {
            vehicle.id: vehicle.speed >= min(self._cruise_mps[vehicle.id], bends[vehicle.id]) - MAY_DRIVE_MPS
            for vehicle in self._vehicles.values()
        }
        since = {actor.id: self._since_entry(actor, at_speed.get(actor.id, False)) for actor in vehicles}
        inside = sorted((a for a in vehicles if since[a.id] > 0), key=lambda a: -since[a.id])
        going = [a for a in inside if a is self._shown_actors.ego or _drives_freely(a, at_speed[a.id])]
        yielding = [a for a in inside if a not in going]
        rest = [a for a in vehicles if a not in inside]
        none: list[SimulatedActor] = []
        waves = [*([a] for a in going), none, *([a] for a in yielding), rest, *([none] * REGISTRATION_STEPS)]
        return waves, len(going)

    def _since_entry(self, actor: SimulatedActor, at_speed: bool) -> float:
        """Return the estimated time since a vehicle's front entered the junction that it is on, s; 0 outside junctions.

        `at_speed`: whether it drives as fast as it may.
        """
        inside_m = self._progress.inside(actor, 0)
        if inside_m <= 0.0:
            return 0.0
        # A vehicle that leaves a bend accelerates in the same way, but it has not waited; it drives as fast as the bend
        # allows.
        waited = actor is not self._shown_actors.ego and _accelerates_freely(actor) and not at_speed
        return since_entry_s(inside_m, actor.speed, actor.acceleration if waited else 0.0)

    def _add(self, actor: SimulatedActor, before: Mapping[str, PlacedActor]) -> None:
        if actor is self._shown_actors.ego:
            self._world.bodies.add(
                self._shown_actors.ego.id, self._shown_actors.ego.placed.model.name, self._shown_actors.ego.placed.route
            )
            self._shown_actors.show_ego(0, -STEP_S)
            return
        placed = before[actor.id]
        self._world.add_vehicle(placed)
        if placed.accelerates_mps2 < placed.model.acceleration_mps2:
            self._world.set_acceleration(actor.id, placed.accelerates_mps2)

    def _hold(self, actors: Iterable[SimulatedActor], before: Mapping[str, PlacedActor]) -> None:
        for actor in actors:
            if actor is self._shown_actors.ego:
                self._shown_actors.show_ego(0, -STEP_S)
            else:
                self._world.hold(before[actor.id])

    def _pass_step(self, *, at_least_mps: float = 0.0) -> None:
        """Let SUMO take a step, then restore the speeds of its vehicles; a vehicle that moves gets at least
        `at_least_mps`.
        """
        self._world.step()
        for motion in self._shown_actors.motions():
            self._world.settle(*motion)
        self._shown_actors.joined.clear()
        for vehicle in self._vehicles.values():
            if vehicle.id not in self._world:
                continue  # not inserted yet
            speed = vehicle.speed if vehicle.speed < STANDS_MPS else max(vehicle.speed, at_least_mps)
            self._world.settle(vehicle.id, speed, vehicle.acceleration)


def _accelerates_freely(actor: SimulatedActor) -> bool:
    """Return whether a vehicle accelerates as if nothing were in its way."""
    return actor.acceleration >= GAINS_SHARE * actor.placed.accelerates_mps2


def _drives_freely(actor: SimulatedActor, at_speed: bool) -> bool:
    """Return whether a vehicle inside a junction seems to have nothing to wait for."""
    return actor.speed >= STANDS_MPS and (_accelerates_freely(actor) or at_speed)


_OFF_LANE_M = 1.8
"""Lateral distance to a lane's centreline up to which the ego is on that lane, m. Ours: about half a lane."""


class ShownActors:
    """The actors that SUMO does not move and whose positions it gets in every step.

    Attributes:
        paths: the groups that have actors.
        joined: vehicles that SUMO drives from this step on, at the end of their path.
    """

    def __init__(
        self, ego: EgoVehicle, actors: Iterable[SimulatedActor], paths: Sequence[PathGroup], progress: Progress,
        world: World,
    ) -> None:  # fmt: skip
        """Select the actors to show from all actors; `paths`: the groups of the actors that follow paths or tracks."""
        self.ego, self._progress, self._world = ego, progress, world
        self.paths = tuple(group for group in paths if len(group))
        actors = list(actors)
        self.guided = [actor for actor in actors if isinstance(actor, GuidedVehicle)]
        self.steered = [actor for actor in actors if isinstance(actor, SteeredVehicle)]
        bodies = (actor for actor in actors if isinstance(actor, StaticActor))
        self._in_the_way = [body for body in bodies if body.positions or isinstance(body, OpenDoor)]
        self.joined: list[SumoVehicle] = []

    def show(self, frame: int) -> None:
        """Tell SUMO where the actors that it does not move will be at the end of the next step."""
        self.show_ego(frame)
        self.show_others()

    def show_ego(self, frame: int, ahead_s: float = 0.0) -> None:
        """Tell SUMO the ego's position, or its position `ahead_s` later at its current speed."""
        ego = self.ego
        x, y, heading, speed, *_ = ego.row()
        half, way, cos, sin = ego.length / 2, speed * ahead_s, math.cos(heading), math.sin(heading)
        front_x, front_y = x + half * cos + way * cos, y + half * sin + way * sin
        self._world.bodies.place(ego.id, front_x, front_y, heading, self._lane_ahead(frame))

    def _lane_ahead(self, frame: int) -> str:
        """Return the lane that the ego's front is on; "" if it is not on a lane of its route."""
        line = self.ego.placed.line
        if line is None:
            return ""
        s, lateral = self._progress.of(self.ego, frame)
        return line.lane_at(s + self.ego.length / 2) if abs(lateral) <= _OFF_LANE_M else ""

    def show_others(self) -> None:
        """Tell SUMO where all shown actors except the ego are."""
        for group in self.paths:
            group.show()
        for guided in self.guided:
            guided.show()
        for static in self._in_the_way:
            static.stand_in.show(static.positions)
        for steered in self.steered:
            if steered.taken is not None and steered.present:
                x, y = steered.front
                self._world.bodies.place(steered.id, x, y, steered.heading)

    def motions(self) -> list[BodyMotion]:
        """Return the speeds that the shown actors must have in SUMO after the next step: SUMO derives other speeds from
        how far they moved.
        """
        bodies: list[SimulatedActor] = [self.ego, *self.joined]
        if self.steered:
            bodies += [actor for actor in self.steered if actor.taken is not None and actor.present]
        motions = []
        for body in bodies:
            _, _, _, speed, acceleration, *_ = body.row()
            motions.append((body.id, speed, acceleration))
        for group in self.paths:
            motions += group.motions()
        for static in self._in_the_way:
            motions += static.stand_in.motions()
        for guided in self.guided:
            if guided.guide is not None:
                motions += guided.guide.stand_in.motions()
        return motions

    def hide(self, actor: StaticActor) -> None:
        """Remove a standing actor from SUMO."""
        actor.stand_in.hide()
        self._in_the_way = [other for other in self._in_the_way if other is not actor]

    def find_ego_lane(self, frame: int) -> None:
        """Set the ego's `lane` from its position."""
        line = self.ego.placed.line
        if line is not None:
            s, lateral = self._progress.of(self.ego, frame)
            self.ego.lane = line.lane_at(s) if abs(lateral) <= _OFF_LANE_M else ""


def since_entry_s(inside_m: float, speed_mps: float, acceleration_mps2: float) -> float:
    """Return the time since a vehicle entered a junction (s), estimated from its current state.

    Args:
        inside_m: distance of its front inside the junction, m.
        speed_mps: its speed, m/s; without an acceleration it entered at this speed.
        acceleration_mps2: if positive, the vehicle is assumed to have accelerated at this rate, from a stand if it is
            far enough inside, and to have moved at `INSIDE_CREEPS_MPS` before that.
    """
    if acceleration_mps2 <= 0.0:
        return inside_m / max(speed_mps, STANDS_MPS)
    began = speed_mps * speed_mps - 2 * acceleration_mps2 * inside_m
    if began >= 0.0:
        return (speed_mps - math.sqrt(began)) / acceleration_mps2
    crept_m = inside_m - speed_mps * speed_mps / (2 * acceleration_mps2)
    return speed_mps / acceleration_mps2 + crept_m / INSIDE_CREEPS_MPS
