"""Traffic participants: the ego, actors of every kind, background traffic; and their actions."""

from typing import Annotated, Literal

from pydantic import Field

from foresee_dsl.language.model import values as v
from foresee_dsl.language.model.actions import (
    HARDEST_MPS2,
    WIDEST_LINE_M,
    BrakesFor,
    ChangesLine,
    Door,
    FollowsPath,
    Joins,
    KeepsBeside,
    KeepsGap,
    Leaves,
    Limit,
    MatchesSpeed,
    Reverses,
    StopsAt,
    Synchronises,
    TurnsTo,
)
from foresee_dsl.language.model.conditions import Condition
from foresee_dsl.language.model.item import ONE_OF, Bounds, Item, Names, Phrase


class Leg(Phrase, kind=""):
    """`straight over j4`: one junction of a route."""

    pattern = "{turn} over {junction}"
    words = """
        straight (constant): a turn: straight on | straight over j4
        left (constant): a turn, or a side | left over j4
        right (constant): a turn, or a side | right over j4
    """

    turn: v.Turn | v.Ref
    junction: v.JunctionId


class Route(Item):
    """`route from south straight over j4 left over j5`: the road (or edge) where it starts, then a turn at each
    junction.

    The road is entered in the direction of the first junction.
    """

    pattern = "route from {start} [{legs: }]"
    words = "route (statement): where an actor drives: a road and turns, or edges | route from south straight over j4"

    start: v.RoadId
    legs: tuple[Leg, ...]


class EdgeRoute(Item):
    """`route [west, north_back]`: edge ids one after the other; `route [a, ..., b]` fills the gap with the shortest
    way. An edge may be a parameter of type `arm`."""

    pattern = "route {edges}"

    edges: tuple[v.RoadId, ...] = Field(min_length=1)
    shortest: bool = False
    """True when written with `...`: consecutive edges need not touch."""

    def own_pattern(self) -> str:
        """Return the pattern with or without `...`; a single edge is followed by them."""
        if not self.shortest:
            return self.pattern
        return r"route \[{edges:, ..., }, ...]" if len(self.edges) == 1 else r"route \[{edges:, ..., }]"


class Path(Item):
    """`path [PLACE, PLACE]`: a polyline that the actor follows off SUMO's lanes (a pedestrian's crossing, a
    cyclist's cut)."""

    pattern = "path {points}"
    words = "path (statement): a line off the lanes that an actor follows | path [(90 m, 10 m), (90 m, 30 m)]"

    points: tuple[v.Place, ...] = Field(min_length=2)


class PathAlong(Item):
    """`path along ego.route from 2 m to 96 m offset 1.9 m`: a smooth line beside a part of an actor's route.

    The lengths are measured from that actor's start, as those of places are. In the other order, `from 96 m to 2 m`,
    the line leads against the route; the offset is to the left of the route in both cases. Corners of the route's line
    become arcs, so that an actor that follows the line slows down in its bends and not at its corners.
    """

    pattern = "path along {actor}.route from {begin} to {end} [offset {offset}]"

    actor: v.ActorName
    begin: v.Length
    end: v.Length
    offset: v.Length | None = None


AnyPath = Path | PathAlong
"""A path of an actor off the lanes."""


class StartAt(Item):
    """`start at PLACE`: place of the actor's front (of a pedestrian's or obstacle's middle) at the beginning; or `start
    at market`: at the end of that bus stop and in its lane."""

    pattern = "start at {place}"
    words = """
        start (statement): where an actor's front is at the beginning, or how fast it is | start at 20 m along ego.route
    """

    place: v.StopOrPlace


class StartSpeed(Item):
    """`start speed 40 km/h`."""

    pattern = "start speed {speed}"

    speed: Annotated[v.Speed, Bounds(0.0)]


class CruiseSpeed(Item, kind="speed"):
    """`speed 50 km/h`: its speed when nothing hinders it (default: the limit, or a walking pace)."""

    pattern = "speed {speed}"
    words = "speed (statement): how fast: an actor where nothing hinders it, or a road's limit | speed 50 km/h"

    speed: Annotated[v.Speed, Bounds(0.0)]


class GoalAt(Item, kind="goal"):
    """`goal PLACE`: the end of the ego's route (default: the end of the last edge)."""

    pattern = "goal {place}"
    words = "goal (statement): where the ego's route ends | goal 40 m past j4 on ego.route"

    place: v.Place


class IgnoresRule(Item, kind="ignores"):
    """`ignores signals at j4`, `ignores priority at j4`; everywhere when no junction is named."""

    pattern = "ignores {what} [at {junction}]"
    words = "ignores (statement): signals or priority, everywhere or at one junction | ignores signals at j4"

    what: Literal["signals", "priority"]
    junction: v.JunctionId | None = None


class MeetsState(Item):
    """`meets ego at j4 after 1.5 s`: the action `Meets`, in force from the beginning."""

    pattern = "meets {other} at {junction} {order} {gap}"
    words = """
        meets (statement): its speed is set so that it is at the junction's crossing point that much after the other,
            or before | meets ego at j4 after 1.5 s
    """

    other: v.ActorName
    junction: v.JunctionId
    gap: v.Time
    order: Literal["after", "before"] = "after"


class Walked(Item):
    """`moving 4.20 m along its path`: distance that a path-follower has already covered (written into clips)."""

    pattern = "moving {along}"
    words = "moving (statement): how far along its path an actor is already | moving 2.60 m"

    along: Annotated[v.Length, Bounds(0.0)]


class Steers(Item):
    """`steers 0.12 from 4.00 s for 1.00 s`: a steering offset, -1 (right) to 1 (left) of the largest steering angle;
    afterwards the actor recovers its lane. From the beginning, and to the end, when no times are given."""

    pattern = "steers {value} [from {start}] [for {duration}]"
    words = "steers (statement): a steering offset, -1 (right) to 1 (left) | steers 0.12 from 1.00 s for 1.00 s"

    value: Annotated[v.Ratio, Bounds(-1.0, 1.0)]
    start: v.Time | None = None
    duration: v.Time | None = None


class Timing(Item):
    """`timing 0.80`: factor on its speed along its own path; it still stops where it must.

    It scales the speed at the beginning, the cruise speed and the target speeds of triggers. With a factor other than 1
    an actor no longer adapts to the other actor that it `meets`, because that would cancel the factor: its speed for
    the meeting at the first moment, times the factor, becomes its cruise speed for good.
    """

    pattern = "timing {factor}"
    words = "timing (statement): its speed along its own way, as a ratio | timing 0.90"

    factor: Annotated[v.Ratio, Bounds(0.01, 10.0)]  # ours: the operator's own range is 0.6 to 1.4


class Delay(Item):
    """`delay 0.50 s`: it moves off this much later (an actor that waits for a trigger: this long after the trigger)."""

    pattern = "delay {time}"
    words = "delay (statement): an actor moves off that much later | delay 0.5 s"

    time: Annotated[v.Time, Bounds(0.0)]


class Line(Item):
    """`line 0.60 m`: it keeps this distance to the left of its own path, or of the middle of its lane (negative:
    right).

    On a path it moves there from its start in a straight line, over the first 5 m of the path (or the rest of a shorter
    path). On a lane it moves over as in a lane change. Its speed along its route does not change. On a lane, `line 0.60
    m from 2.00 s for 3.00 s` limits the time; afterwards the actor returns to the middle.
    """

    pattern = "line {left} [from {start}] [for {duration}]"
    words = "line (statement): how far an actor keeps to the left of its path or its lane's middle | line 0.60 m"

    left: Annotated[v.Length, Bounds(-WIDEST_LINE_M, WIDEST_LINE_M)]
    start: v.Time | None = None
    duration: v.Time | None = None


class Brakes(Item):
    """`brakes 4.00 m/s^2 from 2.00 s for 1.50 s`: it brakes with this deceleration during this time, then drives or
    walks on as before; an actor that stops earlier stands until the time is over.

    Without times it brakes from the beginning to the end. It brakes harder if traffic requires that. During the time it
    ignores what triggers order about its speed.
    """

    pattern = "brakes {braking} [from {start}] [for {duration}]"
    words = "brakes (statement): an actor brakes for a time | brakes 4.00 m/s^2 from 2.00 s for 1.50 s"

    braking: Annotated[v.Acceleration, Bounds(0.0, HARDEST_MPS2)]
    start: v.Time | None = None
    duration: v.Time | None = None


class PassesInLane(Item):
    """`passes in lane`: a bicycle or motorcycle keeps to the right of its lane and passes vehicles within that lane if
    the lane is wide enough: at a red light it goes past the queue.

    Without it, SUMO keeps the actor in the middle of its lane, behind the vehicle ahead. With it, SUMO decides the
    lateral position of all vehicles of the scenario that it controls.
    """

    pattern = "passes in lane"
    words = """
        passes (statement): an actor goes past vehicles within its lane; of an expected result: without a failure
            | passes in lane
    """


class Style(Item):
    """`style takes_gap`: a vehicle or bicycle on a route obeys all rules, but drives in this way.

    `takes_gap`: it enters smaller gaps at junctions and in lane changes. `brakes_late`: it plans its stops with harder
    braking. `creeps`: it accelerates slowly. SUMO drives it, and reacts to the ego as always.
    """

    pattern = "style {manner}"
    words = """
        style (statement): how an actor drives that obeys all rules | style takes_gap
        takes_gap (constant): a style: it enters smaller gaps | style takes_gap
        brakes_late (constant): a style: it plans its stops with harder braking | style brakes_late
        creeps (constant): a style: it accelerates slowly | style creeps
    """

    manner: Literal["takes_gap", "brakes_late", "creeps"]


class State(Phrase, kind=""):
    """`at (61.90 m, 101.55 m) heading 0.3 deg speed 17.22 m/s`: an exact state at the beginning.

    The position is the middle of the front bumper of an actor with wheels, and the middle of the footprint of any
    other; the heading is counter-clockwise from east.
    """

    pattern = "at {at} heading {heading} speed {speed} [acceleration {acceleration}] [steer {steer}]"
    words = """
        heading (setting): an actor's direction, counter-clockwise from east | at (1 m, 2 m) heading 90 deg speed 8 m/s
        steer (setting): the angle of the front wheels in a state; of a mutant: a steering offset | steer 2.0 deg
    """

    at: v.Point
    heading: v.Angle
    speed: Annotated[v.Speed, Bounds(-10.0)]
    """Negative while it reverses (in clips)."""
    acceleration: v.Acceleration | None = None
    steer: v.Angle | None = None


class Recorded(Item):
    """`recorded 0.10 s at (1.20 m, 0 m) heading 0 deg speed 12 m/s`: state of the ego at this time after the beginning.

    The ego follows its recorded states to the last of them, whatever its driver answers; then the driver takes over. In
    this time a driver with a memory sees the scene before its answers count (written into clips).
    """

    pattern = "recorded {time} {state}"
    words = """
        recorded (statement): where the ego was that much after a clip's beginning: it follows these states first,
            then its driver | recorded 0.10 s at (1.20 m, 0 m) heading 0 deg speed 12 m/s
    """

    time: Annotated[v.Time, Bounds(0.05, 10.0)]  # one step of the simulation, to a whole clip
    state: State


ActorItem = Annotated[
    Route
    | EdgeRoute
    | Path
    | PathAlong
    | Joins
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
    | Brakes
    | PassesInLane
    | Style
    | Recorded,
    ONE_OF,
]


class Ego(Item):
    """`ego: car.sedan { ... }`: the vehicle that the driver under test drives."""

    pattern = "ego: {model} [{state}] [{ ...body }]"
    words = "ego (statement): the vehicle of the driver under test | ego: car.sedan { ... }"

    model: v.ModelName | v.Ref
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

    pattern = "{kind} {name}: {model} [{state}] [{ ...body }]"
    words = """
        vehicle (statement): an actor: car, van, truck, bus or motorcycle | vehicle runner: car.compact { ... }
        bicycle (statement): an actor that rides a bicycle | bicycle cyclist: bicycle.city { ... }
        pedestrian (statement): an actor on foot | pedestrian walker: pedestrian.adult { ... }
        obstacle (statement): a thing that does not move | obstacle box: obstacle.crate { ... }
    """

    kind: Literal["vehicle", "bicycle", "pedestrian", "obstacle"]
    name: Annotated[v.Name, Names("actor", defines=True)]
    model: v.ModelName | v.Ref
    state: State | None = None
    body: tuple[ActorItem, ...] = ()


class Traffic(Item):
    """`traffic others { count 16; models [car.compact, van.delivery]; within 120 m of ego.route; seed 7 }`.

    Background actors `others_01`, `others_02`, ...: vehicles and bicycles on random routes, pedestrian models on the
    sidewalks and crossings.
    """

    pattern = "traffic {name} { count; models; within {within} of ego.route; seed }"
    words = """
        traffic (statement): background actors, drawn from a seed
            | traffic others { count 16; models [car.compact]; within 120 m of ego.route; seed 7 }
        count (statement): how many background actors | count 16
        within (statement): at most that far, or by that time: of traffic, of a condition, of an expectation
            | within 120 m of ego.route
        seed (statement): where the draw begins; the same seed draws the same | seed 7
    """

    name: Annotated[v.Name, Names("actor", defines=True)]
    count: Annotated[v.Count, Bounds(0, 500)]  # ours: more is a traffic study, not a test case
    models: tuple[v.ModelName, ...] = Field(min_length=1)
    within: v.Length
    seed: v.Count


class Meets(Item):
    """`runner meets ego at j4 after gap`: from now on its speed is controlled so that it reaches the point where the
    two routes cross in the junction this much after (or before) the other; within its model's limits, and never above
    1.3 times its cruise speed.

    The other's speed is taken as at least 3 m/s, so that two actors do not wait for each other.
    """

    pattern = "{actor} meets {other} at {junction} {order} {gap}"

    actor: v.ActorName
    other: v.ActorName
    junction: v.JunctionId
    gap: v.Time
    order: Literal["after", "before"] = "after"


class Ignores(Item, kind="does_ignore"):
    """`runner ignores signals at j4`, `runner ignores priority at j4`."""

    pattern = "{actor} ignores {what} [at {junction}]"

    actor: v.ActorName
    what: Literal["signals", "priority"]
    junction: v.JunctionId | None = None


class Starts(Item):
    """`walker starts`: the actor moves off. An actor with such a trigger stands until then, or until it is ordered a
    speed."""

    pattern = "{actor} starts"
    words = "starts (action): an actor that waited moves off | walker starts"

    actor: v.ActorName


class ChangesSpeed(Item):
    """`lead changes speed to 3 m/s over 2 s`: the speed changes linearly over the time; without a time, at its model's
    limits."""

    pattern = "{actor} changes speed to {to} [over {over}]"
    words = "changes (action): its speed or its lane | lead changes speed to 3 m/s over 2 s"

    actor: v.ActorName
    to: v.Speed
    over: v.Time | None = None


class ChangesLane(Item):
    """`cutter changes lane left`."""

    pattern = "{actor} changes lane {side}"
    words = "lane (action): to the left or right neighbour | cutter changes lane left"

    actor: v.ActorName
    side: Literal["left", "right"] | v.Ref


class Stops(Item):
    """`lead stops`, `lead stops for 4 s`: with comfortable braking."""

    pattern = "{actor} stops [for {duration}]"
    words = "stops (action): brakes and stands, for good or for a time | lead stops for 4 s"

    actor: v.ActorName
    duration: v.Time | None = None


class Wait(Item):
    """`wait 2 s`: delays the next `then` by this time."""

    pattern = "wait {duration}"
    words = "wait (action): nothing happens for that time | wait 2 s"

    duration: v.Time


class Then(Item):
    """`then { ... }`: what happens once every action before it in the same block is complete; `then when CONDITION
    { ... }`: and, from then on, once the condition holds.

    Complete is: `starts` when the actor moves off, `changes speed` when its speed or the time is reached, `changes
    lane` when it is in the lane (or cannot be), `stops for` when it drives again (`stops` alone never), `brakes for`
    after the time (`brakes` alone never), `meets` when it
    is through the junction, `ignores`, `turns to`, `limit`, `door` and `leaves` at once, `changes line` when it is
    there, `follows`, `matches` and `keeps` with a time when that is over, without one as soon as they have what they
    keep, `synchronises` when it is at its place, `follows` with a path at the path's end, `reverses` when
    it has. An actor that has left the
    world holds nothing up.
    """

    pattern = "then [when {condition}] { ...actions }"
    words = "then (action): what comes once every action before it is complete | then { walker starts }"

    condition: Condition | None = None
    actions: tuple["Action", ...] = Field(min_length=1)


Moves = (
    Meets
    | Ignores
    | Starts
    | ChangesSpeed
    | ChangesLane
    | ChangesLine
    | KeepsBeside
    | KeepsGap
    | FollowsPath
    | Reverses
    | MatchesSpeed
    | Synchronises
    | Leaves
    | Stops
    | BrakesFor
    | StopsAt
)
"""Actions that say how an actor moves."""
WithoutActor = TurnsTo | Limit | Wait | Then
"""Actions without an actor."""
Action = Annotated[Moves | Door | WithoutActor, ONE_OF]

Then.model_rebuild()


class When(Item):
    """`when ego.eta(j4) < 4 s { ... }`: the actions happen, all at once, the first time that the condition holds.

    `when every CONDITION` fires each time that the condition becomes true (it may be at the first frame); `when next`
    does the same but not before the condition has been false once (in clips, for a trigger that has just fired). A name
    before the condition, `when late: ...`, is what `extends` and messages call it by.
    """

    pattern = "when [{repeat}] [{name}:] {condition} { ...actions }"
    words = """
        when (statement): a trigger: actions for when a condition holds | when ego.eta(j4) < 4 s { runner stops }
        once (condition): the trigger fires the first time only (the default) | when once time > 1 s
        every (condition): the trigger fires each time that its condition becomes true | when every ttc(ego, lead) < 2 s
        next (condition): as `every`, but not before the condition has been false once | when next ttc(ego, lead) < 2 s
    """

    repeat: Literal["once", "every", "next"] | None = None
    name: Annotated[v.Name, Names("label", defines=True)] | None = None
    condition: Condition
    actions: tuple["Action", ...] = Field(min_length=1)
