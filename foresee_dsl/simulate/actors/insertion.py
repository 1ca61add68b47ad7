"""Inserts the actors of a scene into SUMO, so that from frame 0 SUMO grants right of way as if they had driven to their
places.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from foresee_dsl.compile.bundle import PlacedActor, SumoBundle
from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.simulate.actors.moved_actors import with_timing
from foresee_dsl.simulate.actors.shown_actors import ShownActors
from foresee_dsl.simulate.actors.states import SimulatedActor
from foresee_dsl.simulate.actors.sumo_vehicles import SumoTraffic, SumoVehicle
from foresee_dsl.simulate.results.metrics import since_entry_s
from foresee_dsl.simulate.trace import STEP_S
from foresee_dsl.simulate.triggers.progress import Progress
from foresee_dsl.simulate.world import World

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
