"""Who takes part: the ego, actors of every kind, background traffic; and what they do."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from foresee_dsl.language.model.conditions import Condition
from foresee_dsl.language.model.values import (
    ONE_OF,
    Acceleration,
    Angle,
    Count,
    Id,
    Item,
    Length,
    ModelName,
    Name,
    Place,
    Point,
    Ratio,
    Ref,
    Speed,
    Time,
    Turn,
)


class Leg(Item):
    """`straight over j4`: one junction of a route."""

    turn: Turn | Ref
    junction: Id | Ref


class Route(Item):
    """`route from south straight over j4 left over j5`: the road (or edge) where it starts, then a turn at each
    junction.

    The road is entered in the direction of the first junction.
    """

    kind: Literal["route"] = "route"
    start: Id | Ref
    legs: tuple[Leg, ...]


class EdgeRoute(Item):
    """`route [west, north_back]`: edge ids one after the other; `route [a, ..., b]` fills the gap with the shortest
    way. An edge may be a parameter of type `arm`."""

    kind: Literal["edge_route"] = "edge_route"
    edges: tuple[Id | Ref, ...] = Field(min_length=1)
    shortest: bool = False
    """True when written with `...`: consecutive edges need not touch."""


class Path(Item):
    """`path [PLACE, PLACE]`: a polyline that the actor follows off SUMO's lanes (a pedestrian's crossing, a
    cyclist's cut)."""

    kind: Literal["path"] = "path"
    points: tuple[Place, ...] = Field(min_length=2)


class StartAt(Item):
    """`start at PLACE`: where the actor's front (a pedestrian's or obstacle's middle) is at the beginning."""

    kind: Literal["start_at"] = "start_at"
    place: Place


class StartSpeed(Item):
    """`start speed 40 km/h`."""

    kind: Literal["start_speed"] = "start_speed"
    speed: Speed


class CruiseSpeed(Item):
    """`speed 50 km/h`: what it drives or walks where nothing hinders it (default: the limit, or a walking pace)."""

    kind: Literal["speed"] = "speed"
    speed: Speed


class GoalAt(Item):
    """`goal PLACE`: where the route ends for the ego (default: the end of the last edge)."""

    kind: Literal["goal"] = "goal"
    place: Place


class IgnoresRule(Item):
    """`ignores signals at j4`, `ignores priority at j4`; everywhere when no junction is named."""

    kind: Literal["ignores"] = "ignores"
    what: Literal["signals", "priority"]
    junction: Id | Ref | None = None


class MeetsState(Item):
    """`meets ego at j4 after 1.5 s`: in force from the beginning; see the action `Meets`."""

    kind: Literal["meets_state"] = "meets_state"
    other: Name
    junction: Id | Ref
    gap: Time
    order: Literal["after", "before"] = "after"


class Walked(Item):
    """`moving 4.20 m along its path`: how far a path-follower has come (written into clips)."""

    kind: Literal["walked"] = "walked"
    along: Length


class Steers(Item):
    """`steers 0.12 from 4.00 s for 1.00 s`: a steering offset, -1 (right) to 1 (left) of the largest steering angle;
    afterwards the actor recovers its lane. From the beginning, and to the end, when no times are given."""

    kind: Literal["steers"] = "steers"
    value: Ratio
    start: Time | None = None
    duration: Time | None = None


class Timing(Item):
    """`timing 0.80`: its speed along its own path, as a ratio of what it would have driven; it still stops where it
    must.

    It scales the speed at the beginning, the cruise speed and what the actor is told to change its speed to. With a
    factor other than 1 an actor does not adapt to whom it `meets` any more, which would make up for the factor: what
    the meeting asks for at its first moment, times the factor, becomes its cruise speed for good.
    """

    kind: Literal["timing"] = "timing"
    factor: Ratio


class Delay(Item):
    """`delay 0.50 s`: it moves off that much later (an actor that waits for a trigger: after the trigger)."""

    kind: Literal["delay"] = "delay"
    time: Time


WIDEST_LINE_M = 5.0
"""The farthest that a `line` lies beside. Ours: more than a lane's width beside its way is another way."""


class Line(Item):
    """`line 0.60 m`: it keeps that far to the left of its own path, or of the middle of its lane (negative: right).

    On a path it goes there from where it is at the beginning, straight, over 5 m of the path (or what is left of it).
    On a lane it moves over as it would when it changes lane. Its speed along its way stays what it was.
    """

    kind: Literal["line"] = "line"
    left: Length


class State(Item):
    """`at (61.90 m, 101.55 m) heading 0.3 deg speed 17.22 m/s`: an exact state at the beginning.

    The position is the middle of the front bumper for anything with wheels, of the footprint for the rest; heading
    counter-clockwise from east.
    """

    at: Point
    heading: Angle
    speed: Speed
    acceleration: Acceleration | None = None
    steer: Angle | None = None


class Recorded(Item):
    """`recorded 0.10 s at (1.20 m, 0 m) heading 0 deg speed 12 m/s`: where the ego was that much after the beginning.

    The ego follows its recorded states to the last of them, whatever its driver answers; from there on the driver
    drives. So a driver that keeps in mind what it sees can see something before it counts (written into clips).
    """

    kind: Literal["recorded"] = "recorded"
    time: Time
    state: State


ActorItem = Annotated[
    Route
    | EdgeRoute
    | Path
    | StartAt
    | StartSpeed
    | CruiseSpeed
    | GoalAt
    | IgnoresRule
    | MeetsState
    | Walked
    | Steers
    | Timing
    | Delay
    | Line
    | Recorded,
    ONE_OF,
]


class Ego(Item):
    """`ego: car.sedan { ... }`: the vehicle that the driver under test drives."""

    kind: Literal["ego"] = "ego"
    model: ModelName | Ref
    state: State | None = None
    body: tuple[ActorItem, ...] = ()

    @property
    def name(self) -> str:
        """Always `ego`."""
        return "ego"


class Actor(Item):
    """`vehicle runner: car.compact { ... }`; also `bicycle`, `pedestrian`, `obstacle`.

    `vehicle` takes models of the classes car, van, truck, bus and motorcycle.
    """

    kind: Literal["vehicle", "bicycle", "pedestrian", "obstacle"]
    name: Name
    model: ModelName | Ref
    state: State | None = None
    body: tuple[ActorItem, ...] = ()


class Traffic(Item):
    """`traffic others { count 16; models [car.compact, van.delivery]; within 120 m of ego.route; seed 7 }`.

    Background actors `others_01`, `others_02`, ...: vehicles and bicycles on random routes, pedestrian models on the
    sidewalks and crossings.
    """

    kind: Literal["traffic"] = "traffic"
    name: Name
    count: Count
    models: tuple[ModelName, ...] = Field(min_length=1)
    within: Length
    seed: Count


class Meets(Item):
    """`runner meets ego at j4 after gap`: from now on its speed is set so that it reaches the point where the two
    routes
    cross in the junction `gap` after (or before) the other would; within its model's limits, never over 1.3 times
    its cruise speed.

    The other counts as driving 3 m/s at least: one does not wait for somebody who waits.
    """

    kind: Literal["meets"] = "meets"
    actor: Name
    other: Name
    junction: Id | Ref
    gap: Time
    order: Literal["after", "before"] = "after"


class Ignores(Item):
    """`runner ignores signals at j4`, `runner ignores priority at j4`."""

    kind: Literal["does_ignore"] = "does_ignore"
    actor: Name
    what: Literal["signals", "priority"]
    junction: Id | Ref | None = None


class Starts(Item):
    """`walker starts`: an actor that any trigger starts stands still until then, or until it is told another speed."""

    kind: Literal["starts"] = "starts"
    actor: Name


class ChangesSpeed(Item):
    """`lead changes speed to 3 m/s over 2 s`: linear over the time; at its model's limits when no time is given."""

    kind: Literal["changes_speed"] = "changes_speed"
    actor: Name
    to: Speed
    over: Time | None = None


class ChangesLane(Item):
    """`cutter changes lane left`."""

    kind: Literal["changes_lane"] = "changes_lane"
    actor: Name
    side: Literal["left", "right"] | Ref


class Stops(Item):
    """`lead stops`, `lead stops for 4 s`: with comfortable braking."""

    kind: Literal["stops"] = "stops"
    actor: Name
    duration: Time | None = None


class Wait(Item):
    """`wait 2 s`: nothing happens for that time; what comes `then` waits for it."""

    kind: Literal["wait"] = "wait"
    duration: Time


class Then(Item):
    """`then { ... }`: what happens once every action before it in the same block is complete; `then when CONDITION
    { ... }`: and, from then on, once the condition holds.

    Complete is: `starts` when the actor moves off, `changes speed` when its speed or the time is reached, `changes
    lane` when it is in the lane (or cannot be), `stops for` when it goes on (`stops` alone never), `meets` when it is
    through the junction, `ignores` at once. An actor that has left the world holds nothing up.
    """

    kind: Literal["then"] = "then"
    condition: Condition | None = None
    actions: tuple[Action, ...] = Field(min_length=1)


Action = Annotated[
    Meets | Ignores | Starts | ChangesSpeed | ChangesLane | Stops | Wait | Then,
    ONE_OF,
]

Then.model_rebuild()


class When(Item):
    """`when ego.eta(j4) < 4 s { ... }`: the actions happen, all at once, the first time that the condition holds.

    `when every CONDITION` fires each time that the condition becomes true (it may be at the first frame); `when next`
    does the same but not before the condition has been false once (clips say so of one that has just fired). A name
    before the condition, `when late: ...`, is what `extends` and messages call it by.
    """

    kind: Literal["when"] = "when"
    repeat: Literal["once", "every", "next"] | None = None
    name: Name | None = None
    condition: Condition
    actions: tuple[Action, ...] = Field(min_length=1)
