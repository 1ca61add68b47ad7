"""The actors that Python moves: the ego, followers of paths, obstacles, vehicles with a steering perturbation, and
doors.

Each of them moves itself by one step, and determines where the vehicles of SUMO see it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from foresee_dsl.compile.bundle import DoorOf, PlacedActor, RecordedState
from foresee_dsl.compile.placement.doors import DOOR_OPEN_DEG, hinge_m
from foresee_dsl.compile.placement.statements import PUSHED_MPS2
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import Points
from foresee_dsl.compile.roads.topology import cached, per_network
from foresee_dsl.drivers.protocol import Control, VehicleLimits
from foresee_dsl.kernels.arrays import FloatArray, Records
from foresee_dsl.kernels.bicycle import VehicleState
from foresee_dsl.kernels.boxes import Box, Mover, corner_points
from foresee_dsl.kernels.records import dtype_of
from foresee_dsl.simulate.actors.dynamics import Bicycle, BicycleState, centre_of_front, lateral_limit_mps2, limits_of
from foresee_dsl.simulate.actors.lane_recovery import LaneRecovery
from foresee_dsl.simulate.actors.path_followers import PathFollower
from foresee_dsl.simulate.actors.states import SimulatedActor, StateTable
from foresee_dsl.simulate.actors.sumo_vehicles import ROUNDING_M, SumoVehicle
from foresee_dsl.simulate.moved_bodies import GHOST_TYPE
from foresee_dsl.simulate.trace import STEP_S
from foresee_dsl.simulate.world import BodyMotion, World

KERB_M = 0.5
"""Distance before the edge of a crossing at which a pedestrian waits, m. Ours: toes behind the kerb."""
PASSES_M = 1.1
"""A body farther than this from a lane's centreline does not block the lane, m. Ours: half a car's width plus 0.2 m."""


class EgoVehicle(SimulatedActor):
    """The vehicle of the driver under test."""

    __slots__ = ("_recorded", "_state", "motion")

    def __init__(self, actor: PlacedActor, friction: float) -> None:
        """Place the ego as the scene says; `friction`: tyre-road coefficient."""
        super().__init__(actor)
        self._state: Records = self._row.view(dtype_of(VehicleState))
        self.motion = Bicycle(limits_of(actor.model, friction))
        self._recorded = iter(recorded_states(self.bicycle(), actor.recorded, self.motion))

    @property
    def limits(self) -> VehicleLimits:
        """The limits of the ego's vehicle."""
        return self.motion.limits

    def join(self, state_table: StateTable, number: int, row: FloatArray) -> None:
        """See `SimulatedActor.join`."""
        super().join(state_table, number, row)
        self._state = row.view(dtype_of(VehicleState))

    def follow_at_once(self, control: Control) -> None:
        """Give the ego a control's acceleration and wheel angle in the next step at once, without the lag of the
        drivetrain and of the steering (ideal control); the tyres still limit both.
        """
        limits, state = self.limits, self._state[0]
        fade = max(0.0, 1.0 - state["speed"] / limits.max_speed_mps)
        motor = control.throttle * limits.acceleration_mps2 * fade
        state["acceleration"] = motor - control.brake * limits.emergency_braking_mps2
        state["steer"] = control.steer * limits.steer_max_rad

    def drive(self, control: Control) -> None:
        """Move the ego by one step; its lane is read from the network, not from SUMO.

        While recorded states are left, the ego moves to the next of them and ignores the driver's answer. `control`
        must be within its ranges.
        """
        recorded = next(self._recorded, None)
        if recorded is not None:
            self.set_state(recorded)
        else:
            self.motion.move(self._state, control, STEP_S)
            heading = self.heading
            if not -math.pi <= heading <= math.pi:
                self._row[2] = math.remainder(heading, math.tau)


def recorded_states(start: BicycleState, recorded: Sequence[RecordedState], motion: Bicycle) -> Iterator[BicycleState]:
    """Yield the ego's states at the frames after the first, up to the last recorded one; `start` is that of the first.

    Between two recorded states the rear axle, the point that moves along the heading, follows the cubic curve that has
    these positions, speeds and headings at its ends. A state less than one step after the previous one is skipped.
    """
    before, began_s, frame = replace(start, yaw_rate=_yaw_rate(start.speed, start.steer, motion)), 0.0, 1
    for state in recorded:
        after, ends_s = _recorded_state(state, motion), state.time_s
        while frame * STEP_S <= ends_s + 1e-6:
            yield _state_between(before, after, ends_s - began_s, frame * STEP_S - began_s, motion)
            frame += 1
        before, began_s = after, ends_s


def _recorded_state(recorded: RecordedState, motion: Bicycle) -> BicycleState:
    heading = recorded.heading_rad
    x, y = centre_of_front(recorded.x, recorded.y, heading, motion.limits.length_m)
    turning = _yaw_rate(recorded.speed_mps, recorded.steer_rad, motion)
    return BicycleState(x, y, heading, recorded.speed_mps, recorded.acceleration_mps2, turning, recorded.steer_rad)


def _yaw_rate(speed: float, steer: float, motion: Bicycle) -> float:
    """Return the yaw rate (rad/s) at this speed and wheel angle, limited by the grip of the tyres."""
    most = motion.grip_mps2 / max(speed, STEP_S)
    return max(-most, min(most, speed * math.tan(steer) / motion.limits.wheelbase_m))


def _state_between(a: BicycleState, b: BicycleState, span_s: float, since_s: float, motion: Bicycle) -> BicycleState:
    """Return the state `since_s` after `a`; `b` follows `span_s` after `a`."""
    if since_s >= span_s - 1e-6:
        return b
    share = since_s / span_s
    turned = math.remainder(b.heading - a.heading, math.tau)
    heading = a.heading + _cubic(0.0, a.yaw_rate, turned, b.yaw_rate, span_s, share)
    (ax, ay), (bx, by) = motion.rear_axle(a), motion.rear_axle(b)
    x = _cubic(ax, a.speed * math.cos(a.heading), bx, b.speed * math.cos(b.heading), span_s, share)
    y = _cubic(ay, a.speed * math.sin(a.heading), by, b.speed * math.sin(b.heading), span_s, share)
    return BicycleState(
        x=x + motion.rear_axle_m * math.cos(heading),
        y=y + motion.rear_axle_m * math.sin(heading),
        heading=heading,
        speed=a.speed + share * (b.speed - a.speed),
        acceleration=(b.speed - a.speed) / span_s,
        yaw_rate=turned / span_s,
        steer=a.steer + share * (b.steer - a.steer),
    )


def _cubic(a: float, a_rate: float, b: float, b_rate: float, span_s: float, share: float) -> float:
    """Return the value, at `share` of the span, of the cubic with these end values and rates of change (Hermite)."""
    t, rest = share, 1.0 - share
    ends = a * rest * rest * (1 + 2 * t) + b * t * t * (3 - 2 * t)
    return ends + span_s * t * rest * (a_rate * rest - b_rate * t)


class LanePosition(NamedTuple):
    """The place of a stand-in: x, y (m) and heading (rad) of its front, its length (m), and its lane."""

    front: tuple[float, float, float]
    length_m: float
    lane: str


class StandIn:
    """Vehicles of SUMO that stand in for a body that SUMO does not drive, so that SUMO's cars brake for it.

    Each lane has its own stand-in. If one stand-in changed lane on a junction, SUMO 1.28 would remember when and how it
    had arrived, and right of way would depend on that; for a new stand-in SUMO stores only what a scene contains.
    """

    def __init__(self, world: World, name: str, edge: str) -> None:
        """Prepare the stand-ins of a body; at first none is on the road."""
        self._world, self._name, self._edge = world, name, edge
        self._in: dict[str, float] = {}  # speed of each stand-in that SUMO is to have, m/s, by its name
        self._positions: Sequence[LanePosition] = ()
        self._standing: dict[str, LanePosition] = {}  # place of each stand-in, by its name

    def show(self, positions: Sequence[LanePosition]) -> None:
        """Let one standing body be at each of these places in the next step, and remove the stand-ins at other
        places.
        """
        if positions is not self._positions:
            self._positions = positions
            self._standing = {f"~{self._name}~{position.lane}": position for position in positions}
            self._remove([name for name in self._in if name not in self._standing])
        for name, position in self._standing.items():
            self._place(name, position.lane, position.front, position.length_m, 0.0)

    def place(self, lane: str, front: tuple[float, float, float], length_m: float, speed_mps: float) -> None:
        """Show a moving body on one lane only in the next step; `speed_mps` is along the lane.

        `front`: x, y (m), heading (rad) of the stand-in. `length_m`: its length, which counts only when the stand-in is
        created.
        """
        name = f"~{self._name}~{lane}"
        if self._in and name not in self._in:
            self.hide()
        self._place(name, lane, front, length_m, speed_mps)

    def hide(self) -> None:
        """Remove all stand-ins of the body."""
        self._positions = ()
        self._standing.clear()
        self._remove(list(self._in))

    @property
    def is_seen(self) -> bool:
        """Whether the body has a stand-in in SUMO."""
        return bool(self._in)

    def motions(self) -> list[BodyMotion]:
        """Return the speeds that the stand-ins must have in SUMO after the next step."""
        return [(name, speed, 0.0) for name, speed in self._in.items()]

    def _place(
        self, name: str, lane: str, front: tuple[float, float, float], length_m: float, speed_mps: float
    ) -> None:
        if name not in self._in:
            self._world.bodies.add(name, GHOST_TYPE, (self._edge,), length_m)
        self._in[name] = speed_mps
        self._world.bodies.place(name, *front, lane)

    def _remove(self, names: Sequence[str]) -> None:
        for name in names:
            self._world.remove(name)
            del self._in[name]


class StaticActor(SimulatedActor):
    """An obstacle that does not move."""

    __slots__ = ("positions", "stand_in")

    def __init__(self, actor: PlacedActor, world: World, network: RoadNetwork, edge: str) -> None:
        """Place the obstacle as the scene says, and find the lanes that it blocks."""
        super().__init__(actor)
        self.stand_in = StandIn(world, actor.id, edge)
        self.positions = _blocked_by(self, network)

    def look(self, network: RoadNetwork) -> None:
        """Find the lanes that the actor blocks at its current position."""
        self.positions = _blocked_by(self, network)


class PathActor(SimulatedActor):
    """A pedestrian, cyclist or vehicle that follows a path; a `PathGroup` moves it and lets SUMO's vehicles see it.

    Attributes:
        path_changed: called when it follows another path; set by its group.
    """

    __slots__ = ("_world", "cruise", "follower", "friction", "path_changed", "stand_in", "stops")

    def __init__(self, actor: PlacedActor, world: World, edge: str, friction: float) -> None:
        """Place the actor at the length along its path that the scene states."""
        super().__init__(actor)
        paced = with_timing(actor)
        self._world, self.friction = world, friction
        self.cruise = paced.cruise_mps
        self.path_changed: Callable[[], None] | None = None
        self.follower = self._on(actor.path, self.cruise, paced.speed_mps, actor.along_m)
        self.stand_in = StandIn(world, actor.id, edge)
        self.stops = actor.walk_stops
        self.move(*self.follower.pose(), self.follower.speed_mps, self.acceleration)

    @property
    def along(self) -> float:
        """Length along the actor's path, m."""
        return self.follower.along_m

    @along.setter
    def along(self, along_m: float) -> None:
        self.follower.along_m = along_m
        if self._state_table is not None:
            self._state_table.along[self._number] = along_m

    def follow(self, path: Points) -> None:
        """Follow another path from its beginning, keeping the current speed."""
        self.follower = self._on(path, self.follower.pace_mps or self.cruise, self.speed)
        self.stops, self.along = (), 0.0
        if self.path_changed is not None:
            self.path_changed()

    def _on(self, path: Points, pace_mps: float, speed_mps: float, along_m: float = 0.0) -> PathFollower:
        """Return a follower of a path with the actor's rates."""
        model, walks = self.placed.model, self.placed.model.kind == "pedestrian"
        return PathFollower(
            path,
            pace_mps=pace_mps,
            acceleration_mps2=model.acceleration_mps2 or PUSHED_MPS2,
            braking_mps2=model.braking_mps2 or PUSHED_MPS2,
            length_m=0.0 if walks else model.length_m,
            along_m=along_m,
            speed_mps=speed_mps,
            lateral_mps2=None if walks else lateral_limit_mps2(model.name, self.friction),
        )

    def red_light(self) -> float | None:
        """Return the length along its path, m, at which the actor waits for a signal; None if it may go on."""
        along = self.along if self.stops else 0.0  # read once, because reading a number from a numpy record is slow
        for enters, _, tls, link in self.stops:
            stop = enters - KERB_M
            # Rounding in a clip's file may have moved a waiting actor slightly beyond its stop, where it must still
            # wait.
            if along <= stop + ROUNDING_M and self._world.signals.colour(tls, link) in ("red", "amber"):
                return max(stop, along)
        return None


class SteeredVehicle(SumoVehicle):
    """A vehicle that SUMO drives until its steering offset begins; from then on Python moves it as a bicycle."""

    __slots__ = ("friction", "recovery", "taken")

    def __init__(self, actor: PlacedActor, network: RoadNetwork, friction: float) -> None:
        """Place the vehicle as the scene says."""
        super().__init__(actor, network)
        self.friction = friction
        self.recovery: LaneRecovery | None = None
        self.taken: BicycleState | None = None

    def due(self, time_s: float) -> bool:
        """Return whether the steering offset begins now, so that Python must take the vehicle over."""
        steering = self.placed.steering
        return self.taken is None and steering is not None and time_s >= steering.from_s - STEP_S / 100

    def take_over(self, network: RoadNetwork, cruise_mps: float) -> None:
        """Let Python move the vehicle from its current state on."""
        actor = self.placed
        line = actor.line or network.line(actor.route, start_lane=actor.lane or None)
        limits = limits_of(actor.model, self.friction)
        # An actor that passes others within its lane goes back to its own line, not to the middle of the lane.
        line_m = line.project(self.x, self.y)[1] if actor.passes else actor.line_m
        self.recovery = LaneRecovery(limits, line, cruise_mps=cruise_mps, offset=actor.steering, line_m=line_m)
        self.taken = self.recovery.take_over(self.x, self.y, self.heading, self.speed, self.acceleration)
        self.lane = ""

    def recover(self, time_s: float, others: Sequence[Mover], stop_s: float | None, *, yields: bool) -> None:
        """Move the vehicle by one step; at the end of its route it becomes absent."""
        if self.recovery is None or self.taken is None:
            return
        self.taken = self.recovery.step(self.taken, time_s, others, STEP_S, stop_s=stop_s, yields=yields)
        self.set_state(self.taken)
        self.present = not self.recovery.done(self.taken)


def with_timing(actor: PlacedActor) -> PlacedActor:
    """Return an actor whose speeds are multiplied by its `timing`, up to its model's maximum speed."""
    k, top = actor.timing, actor.model.max_speed_mps
    if k == 1.0:
        return actor
    return replace(actor, cruise_mps=min(actor.cruise_mps * k, top), speed_mps=min(actor.speed_mps * k, top))


_MOST_BODIES = 2048
"""Maximum number of cached bodies per network. Ours: the bodies of some hundred test cases."""


@per_network
def _blocked_by_bodies(_: RoadNetwork) -> dict[Box, tuple[LanePosition, ...]]:
    """Return the stretches of lanes that bodies block, as far as they are known."""
    return {}


def _blocked_by(block: SimulatedActor, network: RoadNetwork) -> tuple[LanePosition, ...]:
    """Return the stretches of lanes that a body blocks."""
    box = block.box
    return cached(_blocked_by_bodies(network), box, _MOST_BODIES, lambda: _blocked(box, network))


def _blocked(block: Box, network: RoadNetwork) -> tuple[LanePosition, ...]:
    positions: dict[str, LanePosition] = {}
    for x, y in ((block.x, block.y), *corner_points(block)):
        near = network.nearest_lane(x, y, None, "car", PASSES_M)
        if near is None or near.lane.id in positions:
            continue
        pos, _ = near.lane.line.project(block.x, block.y)
        lane_x, lane_y, heading = near.lane.line.at(min(max(pos, 0.0), near.lane.line.length_m))
        turned = block.heading - heading
        extent = abs(math.cos(turned)) * block.length + abs(math.sin(turned)) * block.width
        front = lane_x + extent / 2 * math.cos(heading), lane_y + extent / 2 * math.sin(heading), heading
        positions[near.lane.id] = LanePosition(front, extent, near.lane.id)
    return tuple(positions.values())


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
