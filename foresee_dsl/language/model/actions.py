"""Actions of triggers that change the road or a signal for all actors, or that move an actor in a special way."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from foresee_dsl.language.model import values as v
from foresee_dsl.language.model.item import Bounds, Item


class TurnsTo(Item):
    """`king_oak turns to ew_go`: the signal switches to the beginning of that stage; then its programme continues from
    there.

    With `amber` or `red` it switches to the amber, or to the all-red, that ends the stage.
    """

    pattern = "{junction} turns to {stage} [{light}]"
    never_bare = ("door", "limit", "then", "wait")
    words = """
        turns (action): a signal switches to a stage, and then its programme continues | king_oak turns to ew_go amber
    """

    junction: v.JunctionId
    stage: v.StageId
    light: Literal["amber", "red"] | None = None


class Limit(Item):
    """`limit on mill_west is 30 km/h`: the road gets another speed limit, or with `lane 2` only one of its lanes does.

    Vehicles that SUMO drives obey the new limit and brake before they reach the place: a vehicle that drives at the old
    limit or faster then drives at the new one, and a slower vehicle keeps its speed if that is below the new limit.
    Lanes count from 1, the rightmost for cars.
    """

    pattern = "limit on {road} [lane {lane}] is {speed}"
    words = "limit (action): a road or a lane gets another speed limit | limit on mill_west is 30 km/h"

    road: v.RoadId
    lane: Annotated[v.Count, Bounds(1, 8)] | None = None
    speed: Annotated[v.Speed, Bounds(0.1)]


class StopsAt(Item):
    """`bus stops at market for 8 s`: the actor brakes so that its front stands at the end of that stop (or at a place),
    stands there for the time, then drives on; without a time it stays there.

    For a stop it changes to the stop's lane. It brakes with at most 3 m/s^2. An actor that can no longer stop there
    stops behind the stop; an actor that is more than 5 m past it drives on.
    """

    pattern = "{actor} stops at {where} [for {duration}]"

    actor: v.ActorName
    where: v.StopOrPlace
    duration: v.Duration | None = None


HARDEST_MPS2 = 12.0
"""Largest braking that can be written, m/s^2. Ours: no tyre on a road can brake harder."""


class BrakesFor(Item):
    """`lead brakes 6 m/s^2 for 2 s`: the actor brakes with this deceleration for the time, and stands if it stops
    earlier; then it drives on as before. Without a time it brakes until it stands, and stays there.

    It brakes harder if traffic requires that. The model's limits apply: `emergency_braking`, and under a steering
    offset `braking`.
    """

    pattern = "{actor} brakes {braking} [for {duration}]"

    actor: v.ActorName
    braking: Annotated[v.Acceleration, Bounds(0.01, HARDEST_MPS2)]
    duration: v.Duration | None = None


WIDEST_LINE_M = 5.0
"""Largest lateral offset of a `line`, m. Ours: an actor that is more than a lane's width beside its lane is on another
lane."""


class ChangesLine(Item):
    """`cutter changes line to 0.8 m over 2 s`: from now on the actor keeps this distance to the left of its lane's
    middle (negative: right), as the statement `line` does from the beginning.

    It moves over linearly in the given time, or at 1 m/s without a time; its lateral speed is never more than a quarter
    of its speed.
    """

    pattern = "{actor} changes line to {to} [over {over}]"

    actor: v.ActorName
    to: Annotated[v.Length, Bounds(-WIDEST_LINE_M, WIDEST_LINE_M)]
    over: v.Duration | None = None


class KeepsBeside(Item):
    """`cutter keeps 1.2 m left of ego for 4 s`: the actor keeps this lateral gap between the two footprints, measured
    across its lane.

    It stays within 5 m of its lane's middle. Afterwards it keeps the lateral position that it has then.
    """

    pattern = "{actor} keeps {room} {side} of {other} [for {duration}]"
    words = """
        keeps (action): an actor keeps this lateral gap to the side of another actor
            | cutter keeps 1.2 m left of ego for 4 s
    """

    actor: v.ActorName
    # Ours: up to six lanes; a negative gap lets them overlap across the lane.
    room: Annotated[v.Length, Bounds(-20.0, 20.0)]
    side: Literal["left", "right"] | v.Ref
    other: v.ActorName
    duration: v.Duration | None = None


class FollowsPath(Item):
    """`cutter follows [(10 m, 4 m), (30 m, 4 m)] then joins [mill_mid]`: the actor leaves its lane (or its path) and
    follows a polyline from its position, without reacting to others; at its end it drives on in traffic along these
    edges, or stays there if none are named.

    Between edges that do not touch it takes the shortest route. Only vehicles and bicycles join.
    """

    pattern = "{actor} follows {points} [then joins {edges}]"
    words = """
        joins (action): an actor drives on in the traffic of these edges when its path ends
            | cutter follows [(10 m, 4 m), (30 m, 4 m)] then joins [mill_mid]
    """

    actor: v.ActorName
    points: Annotated[tuple[v.Place, ...], Field(min_length=1)]
    edges: tuple[v.RoadId, ...] = ()
    """Edges on which it drives on; empty if it stays at the path's end."""


class Joins(Item):
    """`then joins [mill_mid, oak_north]`: a vehicle or bicycle with a path drives on in traffic along these edges when
    it reaches the path's end. Between edges that do not touch it takes the shortest route."""

    pattern = "then joins {edges}"

    edges: Annotated[tuple[v.RoadId, ...], Field(min_length=1)]


class KeepsGap(Item):
    """`lead follows ego gap 1.5 s`, `lead follows ego gap 20 m for 8 s`, `lead leads ego gap 20 m`: the actor controls
    its speed so that it keeps this gap, from bumper to bumper along its own route. A gap in seconds becomes a length by
    the speed of the actor behind.

    The model's limits apply. It keeps the gap as written, even if that is too small to be safe.
    """

    pattern = "{actor} {way} {other} gap {gap} [for {duration}]"
    words = """
        follows (action): an actor keeps a gap behind another actor | lead follows ego gap 1.5 s
        leads (action): an actor keeps a gap ahead of another actor | lead leads ego gap 20 m
        gap (link): before the gap to another actor: a time or a length | lead follows ego gap 1.5 s
    """

    actor: v.ActorName
    way: Literal["follows", "leads"]
    other: v.ActorName
    gap: Annotated[v.Value, Bounds(0.0)]
    duration: v.Duration | None = None

    @property
    def gap_is_time(self) -> bool:
        """True if the gap is a time. For a parameter, the dimension of its value decides."""
        return isinstance(self.gap, v.Quantity) and self.gap.dimension == "time"


class MatchesSpeed(Item):
    """`lead matches ego plus 2 m/s`, `lead matches ego times 0.8 for 4 s`: the actor's speed is the other's present
    speed times a factor plus a difference (`plus -2 m/s`: slower); the model's limits apply."""

    pattern = "{actor} matches {other} [times {factor}] [plus {more}] [for {duration}]"
    words = """
        matches (action): an actor takes the speed of another actor at each moment
            | lead matches ego times 0.9 plus 2 m/s
        times (link): before a factor by which the other actor's speed is multiplied | lead matches ego times 0.9
        plus (link): before a speed that is added to the other actor's speed; a negative one makes the actor slower
            | lead matches ego plus 2 m/s
    """

    actor: v.ActorName
    other: v.ActorName
    factor: Annotated[v.Ratio, Bounds(0.0, 10.0)] | None = None
    more: v.Speed | None = None
    duration: v.Duration | None = None


class Reverses(Item):
    """`van reverses 6 m at 5 km/h`: the actor brakes until it stands, drives this distance backwards along its lane,
    then drives on as before."""

    pattern = "{actor} reverses {length} at {speed}"
    words = "reverses (action): an actor drives backwards along its lane | van reverses 6 m at 5 km/h"

    actor: v.ActorName
    length: Annotated[v.Length, Bounds(0.1, 100.0)]  # ours: drivers do not reverse farther
    speed: Annotated[v.Speed, Bounds(0.1, 10.0)]  # ours: the top speed in reverse gear is about 35 km/h


class Leaves(Item):
    """`lead leaves`: from now on the actor is absent."""

    pattern = "{actor} leaves"
    words = "leaves (action): an actor is absent from now on | lead leaves"

    actor: v.ActorName


class LeavesTrack(Item):
    """`lorry leaves track`: a vehicle leaves its recorded track at its present place and speed; from now on SUMO drives
    it along the edges of its `then joins`.

    A vehicle that is not there yet leaves its track when it appears. One that is on none of the lanes of these edges,
    as inside a junction, stays on its track until it is.
    """

    pattern = "{actor} leaves track"

    actor: v.ActorName


class Synchronises(Item):
    """`cutter synchronises at 5 m before j4 on cutter.route with ego at 10 m before j4 on ego.route speed 8 m/s`: the
    actor controls its speed so that its front reaches its place when the other's front reaches the other place; the
    model's limits apply.

    The prediction assumes that the other drives at 3 m/s or more. With a `speed`, the actor has that speed at its place
    and keeps it afterwards; without one it drives on as before.
    """

    pattern = "{actor} synchronises at {place} with {other} at {there} [speed {speed}]"
    words = """
        synchronises (action): an actor reaches a place when another actor reaches its own place
            | cutter synchronises at (10 m, 2 m) with ego at (12 m, 5 m)
    """

    actor: v.ActorName
    place: v.Place
    other: v.ActorName
    there: v.Place
    speed: Annotated[v.Speed, Bounds(0.0)] | None = None


class Door(Item):
    """`door of van opens left`, `door of van closes left`: opens or closes the front door of a car, van or truck,
    parked or not. An open door is an obstacle beside the vehicle that others can collide with. The default side is
    left."""

    pattern = "door of {actor} {what} [{side}]"
    words = """
        door (action): the front door of a car, van or truck, on its left or right side | door of van opens left
        opens (action): the door opens and extends sideways | door of van opens left
        closes (action): the open door closes | door of van closes left
    """

    actor: v.ActorName
    what: Literal["opens", "closes"]
    side: Literal["left", "right"] | v.Ref | None = None


def door_name(actor: str, side: str) -> str:
    """Return the name of an actor's door in a run: `van_door`, on the right `van_right_door`."""
    return f"{actor}_door" if side == "left" else f"{actor}_{side}_door"
