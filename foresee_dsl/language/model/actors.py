"""Traffic participants: the ego, actors of every kind and background traffic, with their statements."""

from typing import Annotated, Literal

from pydantic import Field

from foresee_dsl.language.model import values as v
from foresee_dsl.language.model.actions import HARDEST_MPS2, WIDEST_LINE_M, Joins
from foresee_dsl.language.model.item import ONE_OF, Block, Bounds, Item, Names, Phrase


class Leg(Phrase, kind=""):
    """`straight over j4`: one junction of a route."""

    pattern = "{turn} over {junction}"
    words = """
        straight (constant): the turn straight on | straight over j4
        left (constant): the turn to the left, or the left side | left over j4
        right (constant): the turn to the right, or the right side | right over j4
    """

    turn: v.Turn | v.Ref
    junction: v.JunctionId


class Route(Item):
    """`route from south straight over j4 left over j5`: the road (or edge) where the actor starts, then a turn at each
    junction.

    The actor drives on the first road towards the first junction.
    """

    pattern = "route from {start} [{legs: }]"
    words = """
        route (statement): the way of an actor on the roads: a road and turns, or edges
            | route from south straight over j4
    """

    start: v.RoadId
    legs: tuple[Leg, ...]


class EdgeRoute(Item):
    """`route [west, north_back]`: edge ids one after the other; `route [a, ..., b]` fills the gap with the shortest
    way. An edge may be a parameter of type `arm`."""

    pattern = "route {edges}"

    edges: tuple[v.RoadId, ...] = Field(min_length=1)
    shortest: bool = False
    """True if `...` is among the edges: the shortest way fills the gaps, so consecutive edges need not touch."""

    def own_pattern(self) -> str:
        """Return the pattern, with `...` if the shortest way fills the gaps; for a single edge, `...` follows it."""
        if not self.shortest:
            return self.pattern
        return r"route \[{edges:, ..., }, ...]" if len(self.edges) == 1 else r"route \[{edges:, ..., }]"


class Path(Item):
    """`path [PLACE, PLACE]`: a polyline that the actor follows off SUMO's lanes, such as a pedestrian who crosses or a
    cyclist who cuts a corner."""

    pattern = "path {points}"
    words = "path (statement): a line off the lanes that an actor follows | path [(90 m, 10 m), (90 m, 30 m)]"

    points: tuple[v.Place, ...] = Field(min_length=2)


class PathAlong(Item):
    """`path along ego.route from 2 m to 96 m offset 1.9 m`: a smooth line beside a part of an actor's route.

    The lengths are measured from that actor's start, like the lengths in places. In the other order,
    `from 96 m to 2 m`, the line leads against the route; the offset is to the left of the route in both cases. Corners
    of the route's line become arcs, so that an actor that follows the line slows down in its bends and not at its
    corners.
    """

    pattern = "path along {actor}.route from {begin} to {end} [offset {offset}]"

    actor: v.ActorName
    begin: v.Length
    end: v.Length
    offset: v.Length | None = None


class Track(Item):
    """`track "117"`, `track "117" from 3.40 s`: the actor is where the recording has it, beginning at this time of the
    recording (0 s); `use tracks` names the file.

    An actor other than the ego is at each frame exactly at that place, with that heading and speed, whatever happens
    around it. It is absent before its first and after its last recorded place. The ego is driven by its driver: its
    track gives the start, the speed at the start and the goal, if the file does not state them, and `ego.deviation` is
    the distance to it.
    """

    pattern = "track {name} [from {start}]"
    words = """
        track (statement): the recorded track that an actor follows, by its name in the tracks file | track "117"
    """

    name: Annotated[v.Text, Field(min_length=1)]
    start: Annotated[v.Time, Bounds(0.0)] | None = None


AnyPath = Path | PathAlong
"""A path of an actor off the lanes."""


class StartAt(Item):
    """`start at PLACE`: the place of the actor's front at the beginning, or of a pedestrian's or obstacle's middle; or
    `start at market`: at the end of that bus stop and in its lane."""

    pattern = "start at {place}"
    words = """
        start (statement): the place of an actor's front, or its speed, at the beginning | start at 20 m along ego.route
    """

    place: v.StopOrPlace


class StartSpeed(Item):
    """`start speed 40 km/h`: the actor's speed at the beginning."""

    pattern = "start speed {speed}"

    speed: Annotated[v.Speed, Bounds(0.0)]


class CruiseSpeed(Item, kind="speed"):
    """`speed 50 km/h`: the actor's speed if nothing hinders it (default: the speed limit, or a walking pace)."""

    pattern = "speed {speed}"
    words = """
        speed (statement): the speed of an actor that nothing hinders, or the speed limit of a road | speed 50 km/h
    """

    speed: Annotated[v.Speed, Bounds(0.0)]


class GoalAt(Item, kind="goal"):
    """`goal PLACE`: the end of the ego's route (default: the end of the last edge)."""

    pattern = "goal {place}"
    words = """
        goal (statement): the place where the ego's route ends; in a campaign, the expectation that it searches
            | goal 40 m past j4 on ego.route
    """

    place: v.Place


class IgnoresRule(Item, kind="ignores"):
    """`ignores signals at j4`, `ignores priority at j4`: the actor does not obey signals, or does not yield; without a
    junction, everywhere."""

    pattern = "ignores {what} [at {junction}]"
    words = """
        ignores (statement): an actor ignores signals or priority, at one junction or everywhere | ignores signals at j4
    """

    what: Literal["signals", "priority"]
    junction: v.JunctionId | None = None


class MeetsState(Item):
    """`meets ego at j4 after 1.5 s`: the action `Meets`, in force from the beginning."""

    pattern = "meets {other} at {junction} {order} {gap}"
    words = """
        meets (statement): an actor sets its speed so that it reaches the point where the two routes cross this much
            after or before another actor | meets ego at j4 after 1.5 s
    """

    other: v.ActorName
    junction: v.JunctionId
    gap: v.Time
    order: Literal["after", "before"] = "after"


class Walked(Item):
    """`moving 4.20 m along its path`: the distance that an actor on a path has already covered at the beginning; clips
    contain it."""

    pattern = "moving {along}"
    words = "moving (statement): the length of its path that an actor has already covered | moving 2.60 m"

    along: Annotated[v.Length, Bounds(0.0)]


class Steers(Item):
    """`steers 0.12 from 4.00 s for 1.00 s`: a steering offset, -1 (right) to 1 (left) of the largest steering angle;
    afterwards the actor returns to its lane.

    Without times the offset lasts from the beginning to the end.
    """

    pattern = "steers {value} [from {start}] [for {duration}]"
    words = """
        steers (statement): an actor steers off its line by this share of the largest angle, from -1 (right) to 1 (left)
            | steers 0.12 from 1.00 s for 1.00 s
    """

    value: Annotated[v.Ratio, Bounds(-1.0, 1.0)]
    start: v.Duration | None = None
    duration: v.Duration | None = None


class Timing(Item):
    """`timing 0.80`: a factor on the actor's speed along its own path; it still stops where it must.

    It scales the speed at the beginning, the cruise speed and the target speeds of triggers. An actor with a factor
    other than 1 no longer adapts to the other actor that it `meets`, because that would cancel the factor. Instead, the
    speed that the meeting requires is computed once, at the first moment; this speed times the factor is its cruise
    speed until the end.
    """

    pattern = "timing {factor}"
    words = "timing (statement): a factor for an actor's speed along its own way | timing 0.90"

    factor: Annotated[v.Ratio, Bounds(0.01, 10.0)]  # ours: the operator's own range is 0.6 to 1.4


class Delay(Item):
    """`delay 0.50 s`: the actor moves off this much later; an actor that waits for a trigger moves off this long after
    the trigger."""

    pattern = "delay {time}"
    words = "delay (statement): an actor moves off this much later | delay 0.5 s"

    time: v.Duration


class Line(Item):
    """`line 0.60 m`: the actor keeps this distance to the left of its own path, or of the middle of its lane (negative:
    right).

    On a path it moves over in a straight line, along the first 5 m of the path from its start (or the rest of a shorter
    path). On a lane it moves over as in a lane change. Its speed along its route does not change. On a lane, `line 0.60
    m from 2.00 s for 3.00 s` limits the time; afterwards the actor returns to the middle. Only in a clip may the time
    be negative: an actor on a recorded track may have begun to move over before the clip.
    """

    pattern = "line {left} [from {start}] [for {duration}]"
    words = """
        line (statement): the distance that an actor keeps to the left of its path or of its lane's middle | line 0.60 m
    """

    left: Annotated[v.Length, Bounds(-WIDEST_LINE_M, WIDEST_LINE_M)]
    start: v.Duration | None = None
    duration: v.Duration | None = None


class Brakes(Item):
    """`brakes 4.00 m/s^2 from 2.00 s for 1.50 s`: the actor brakes with this deceleration during this time, then drives
    or walks on as before; an actor that stops earlier stands until the time is over.

    Without times it brakes from the beginning to the end. It brakes harder if traffic requires that. During the time it
    ignores the speeds that triggers order.
    """

    pattern = "brakes {braking} [from {start}] [for {duration}]"
    words = """
        brakes (statement): an actor brakes with this deceleration for a time | brakes 4.00 m/s^2 from 2.00 s for 1.50 s
    """

    braking: Annotated[v.Acceleration, Bounds(0.0, HARDEST_MPS2)]
    start: v.Duration | None = None
    duration: v.Duration | None = None


BESIDE_TRACK = (Track, Joins, StartSpeed, Timing, Delay, Line, Brakes)
"""The statements of an actor that follows a recorded track; clips state a `start speed` if it has braked."""


class PassesInLane(Item):
    """`passes in lane`: a bicycle or motorcycle keeps to the right of its lane and passes vehicles within that lane if
    the lane is wide enough: at a red light it goes past the queue.

    Without it, SUMO keeps the actor in the middle of its lane, behind the vehicle ahead. With it, SUMO decides the
    lateral position of all vehicles of the scenario that it controls.
    """

    pattern = "passes in lane"
    words = """
        passes (statement): an actor passes vehicles within its lane; in an expected result, the run passes
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
        heading (setting): the direction of an actor, counter-clockwise from east
            | at (1 m, 2 m) heading 90 deg speed 8 m/s
        steer (setting): the angle of an actor's front wheels; in a mutant, a steering offset | steer 2.0 deg
    """

    at: v.Point
    heading: v.Angle
    speed: Annotated[v.Speed, Bounds(-10.0)]
    """Its speed; in clips, negative while it reverses."""
    acceleration: v.Acceleration | None = None
    steer: v.Angle | None = None


class Recorded(Item):
    """`recorded 0.10 s at (1.20 m, 0 m) heading 0 deg speed 12 m/s`: a state of the ego at this time after the
    beginning; clips contain such states.

    The ego follows its recorded states to the last of them, whatever its driver answers; then the driver takes over. So
    a driver with a memory sees the scene for a while before its answers count.
    """

    pattern = "recorded {time} {state}"
    words = """
        recorded (statement): a state of the ego at this time after the beginning of a clip; the ego follows these
            states before its driver takes over | recorded 0.10 s at (1.20 m, 0 m) heading 0 deg speed 12 m/s
    """

    time: Annotated[v.Time, Bounds(0.05, 10.0)]  # from one step of the simulation to a whole clip
    state: State


ActorItem = Annotated[
    Route
    | EdgeRoute
    | Path
    | PathAlong
    | Track
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


class Ego(Block):
    """`ego: car.sedan { ... }`: the vehicle that the driver under test drives."""

    pattern = "ego: {model} [{state}] [{ ...body }]"
    words = "ego (statement): the vehicle that the driver under test drives | ego: car.sedan { ... }"

    model: v.ModelName | v.Ref
    state: State | None = None
    body: tuple[ActorItem, ...] = ()

    @property
    def name(self) -> str:
        """Always `ego`."""
        return "ego"


class Actor(Block):
    """`vehicle runner: car.compact { ... }`; also `bicycle`, `pedestrian`, `obstacle`.

    `vehicle` takes models of the classes car, van, truck, bus and motorcycle.
    """

    pattern = "{kind} {name}: {model} [{state}] [{ ...body }]"
    words = """
        vehicle (statement): an actor that is a car, van, truck, bus or motorcycle | vehicle runner: car.compact { ... }
        bicycle (statement): an actor that rides a bicycle | bicycle cyclist: bicycle.city { ... }
        pedestrian (statement): an actor that walks | pedestrian walker: pedestrian.adult { ... }
        obstacle (statement): an actor that never moves | obstacle box: obstacle.crate { ... }
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
        traffic (statement): background actors that are drawn from a seed
            | traffic others { count 16; models [car.compact]; within 120 m of ego.route; seed 7 }
        count (statement): the number of background actors | count 16
        within (statement): at most this far away, or at the latest by this time | within 120 m of ego.route
        seed (statement): the number that determines a draw; the same seed draws the same values | seed 7
    """

    name: Annotated[v.Name, Names("actor", defines=True)]
    count: Annotated[v.Count, Bounds(0, 500)]  # ours: more is a traffic study, not a test case
    models: tuple[v.ModelName, ...] = Field(min_length=1)
    within: Annotated[v.Length, Bounds(0.0)]
    seed: v.Count


def name_in_traffic(traffic: str, number: int) -> str:
    """Return the name of an actor of the background traffic; numbers begin at 1."""
    return f"{traffic}_{number:02d}"
