"""The records of the driver `pdm`: the ego, the others, the route, junctions and crossing streams, proposals.

Lengths are in m, angles in rad (counter-clockwise from east), speeds in m/s, accelerations in m/s^2. `s` is the length
along the route, `d` the offset from it (left positive). [A] counts actors, [F] crossing streams, [P] proposals, [O]
lateral offsets, [T] frames of a prediction or roll-out.
"""

from __future__ import annotations

from typing import NamedTuple

from foresee_dsl.kernels.records import array_of, dtype_of


class EgoRecord(NamedTuple):
    """The driven vehicle: its limits, its state, and its position on the route. All fields are floats.

    Attributes:
        length, width, wheelbase: dimensions of the vehicle. front, centre: distances from the rear axle forwards to the
            front bumper and to the middle of the footprint.
        sharpest: largest curvature, 1/m. steer_max: largest front-wheel angle, rad. grip: the part of the largest
            acceleration of the tyres that the driver uses, m/s^2. motor, brakes: the vehicle's largest acceleration
            and braking, m/s^2. strongest: largest braking within the grip, m/s^2.
        x, y, heading, speed, acceleration: current state of the footprint's middle.
        s, d, heading_error: position and heading error of the rear axle's middle on the route. forward: the speed,
            never negative.
        front_s, rear_s: lengths along the route at which the front and the rear bumper are.
    """

    length: float
    width: float
    wheelbase: float
    front: float
    centre: float
    sharpest: float
    steer_max: float
    grip: float
    motor: float
    brakes: float
    strongest: float
    x: float
    y: float
    heading: float
    speed: float
    acceleration: float
    s: float
    d: float
    heading_error: float
    forward: float
    front_s: float
    rear_s: float


class ActorRecord(NamedTuple):
    """The current state of another road user.

    Attributes:
        x, y, cos, sin: position and heading. speed: along the heading, never negative. half_length, half_width: m.
        speeds_up: acceleration by which its speed may grow.
        s, d, point: position on the route, and the nearest point of the route's grid.
        pedestrian, obstacle: its class. own_lane: whether it is in the ego's lane, in the same direction.
        passable: whether it is parked, with room to pass in lanes of the ego's direction.
    """

    x: float
    y: float
    cos: float
    sin: float
    speed: float
    half_length: float
    half_width: float
    speeds_up: float
    s: float
    d: float
    point: int
    pedestrian: bool
    obstacle: bool
    own_lane: bool
    passable: bool


class RoutePoint(NamedTuple):
    """A point of the route's even grid.

    Attributes:
        s: length along the route. x, y, cos, sin, heading: position and tangent (the heading unwrapped).
        curvature: 1/m. profile: speed limit, reduced for bends so that braking stays comfortable.
        left, right: free width on both sides within lanes of the ego's direction.
    """

    s: float
    x: float
    y: float
    cos: float
    sin: float
    heading: float
    curvature: float
    profile: float
    left: float
    right: float


class JunctionRecord(NamedTuple):
    """A junction on the route, with lengths along the route.

    It has the length of its stop line, of its exit, and of its end for the ego (the exit, or the end of its last
    conflict). `crossed`: whether other vehicles cross the ego's route.
    """

    stop_s: float
    exit_s: float
    end_s: float
    crossed: bool


class FoeRecord(NamedTuple):
    """A stream that crosses or joins the ego's route (`drivers.protocol.Foe`), with its path on an even grid.

    Attributes:
        added: length of the straight prolongation before its path. length: length of the path without the prolongation.
        entry: length along the path at which it enters the junction. meets, leaves: lengths at which the conflict
            begins and ends.
        own_s, own_until_s: the same conflict along the route.
        first, end: range of its points in the `PathPoint`s, `end` excluded. junction: index of its junction.
        has_priority: whether the ego must yield to it. walking: whether it is a pedestrian crossing.
    """

    added: float
    length: float
    entry: float
    meets: float
    leaves: float
    own_s: float
    own_until_s: float
    first: int
    end: int
    junction: int
    has_priority: bool
    walking: bool


class PathPoint(NamedTuple):
    """A point of a crossing stream's path, and its tangent."""

    x: float
    y: float
    cos: float
    sin: float


class MatchRecord(NamedTuple):
    """An actor relative to a crossing stream's path: length along it, speed along it, offset; `on`: it follows the
    path."""

    s: float
    speed: float
    d: float
    on: bool


class Predicted(NamedTuple):
    """A predicted footprint.

    Attributes:
        x, y, cos, sin: centre and heading. half_length: grows where the speed is uncertain. s, d: position on the
            route.
        reach_s, reach_d: half its extent along and across the route. speed_s: speed along the route.
    """

    x: float
    y: float
    cos: float
    sin: float
    half_length: float
    s: float
    d: float
    reach_s: float
    reach_d: float
    speed_s: float


class LeaderRecord(NamedTuple):
    """The actor that the ego must stay behind: s of its rear, and its speed along the route."""

    s: float
    speed: float


class Rolled(NamedTuple):
    """One frame of a proposal: s, d and speed of the rear axle, slope d'(s), the footprint's centre and heading."""

    s: float
    d: float
    speed: float
    slope: float
    x: float
    y: float
    cos: float
    sin: float


class ConflictRecord(NamedTuple):
    """Conflicts of a proposal with others in a frame: a collision at fault, too little clearance, a TTC below
    `TTC_S`."""

    hit: bool
    close: bool
    ttc: bool


class ProposalResult(NamedTuple):
    """What the roll-out of a proposal shows.

    Attributes:
        done: whether the proposal was rolled out; otherwise the other fields are 0.
        allowed: whether it neither collides nor leaves the lanes.
        touches: whether a TTC is below `TTC_S`. close: number of frames with too little clearance. Both are complete
            only if there is no collision.
        collides: frame of the first collision at fault, T without one. impact: speed in that frame, or in the last.
    """

    done: bool
    allowed: bool
    touches: bool
    close: int
    collides: int
    impact: float


EGO, ACTOR, ROUTE_POINT, JUNCTION, FOE = (
    dtype_of(kind) for kind in (EgoRecord, ActorRecord, RoutePoint, JunctionRecord, FoeRecord)
)
PATH_POINT, MATCH, PREDICTED, LEADER = (dtype_of(kind) for kind in (PathPoint, MatchRecord, Predicted, LeaderRecord))
ROLLED, CONFLICT, PROPOSAL_RESULT = dtype_of(Rolled), dtype_of(ConflictRecord), dtype_of(ProposalResult)

EGOS, ACTORS, ROUTE, JUNCTIONS, FOES = (
    array_of(kind) for kind in (EgoRecord, ActorRecord, RoutePoint, JunctionRecord, FoeRecord)
)
"""The kernels' array types of these records, with the lengths 1, A, N, J and F."""
PATHS, MATCHES, PREDICTION = array_of(PathPoint), array_of(MatchRecord, 2), array_of(Predicted, 2)
ROLLOUT = array_of(Rolled, 2)
