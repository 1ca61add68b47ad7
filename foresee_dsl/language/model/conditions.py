"""Conditions of triggers, expectations and requirements, and the measures that they compare."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated, Literal

from pydantic import Field

from foresee_dsl.language.model import values as v
from foresee_dsl.language.model.item import ONE_OF, Bounds, Names, Phrase
from foresee_dsl.language.units import Dimension

SIGNAL_COLOURS = ("green", "amber", "red")
"""Colours that a signal shows to one movement."""


MEASURED: Mapping[str, Dimension] = MappingProxyType(
    {
        "time": "time",
        "eta": "time",
        "ttc": "time",
        "ttc_along": "time",
        "headway": "time",
        "speed": "speed",
        "acceleration": "acceleration",
        "distance": "length",
        "offset": "length",
        "deviation": "length",
        "lateral": "length",
        "overlap": "length",
        "relative_speed": "speed",
    }
)
"""The dimension of each measure in a condition."""
BETWEEN_ACTORS = ("ttc", "ttc_along", "headway", "lateral", "overlap", "relative_speed")
"""Measures between two actors; the second name is never a junction."""


class Measure(Phrase):
    """A number that is measured during the run, by its words.

    `time`: s since the start. `ego.speed`: m/s. `ego.acceleration`: m/s^2, along its heading. `ego.eta(j4)`: s until
    the actor enters the junction along its route, at its speed but at least 1 m/s; infinite once it has passed.
    `distance(a, b)`: m between footprints, or from `a` along its route to where it enters junction `b`. `ttc(a, b)`: s
    until the footprints touch if both keep their velocities; infinite if they do not. `headway(a, b)`: s that `a` needs
    for the distance between the two footprints at its speed, but at least 1 m/s.

    `ego.offset`: m from the middle of the lane that contains its middle, left positive. `ego.deviation`: m between the
    ego's middle and the place at which its recorded `track` has it now. The others refer to the way of
    `a`: its route, its path, or straight on. `lateral(a, b)`: m to the side between the footprints, 0 if they overlap
    sideways. `overlap(a, b)`: m over which the footprints are side by side; a negative value is the gap. `ttc_along(a,
    b)`: s until the footprints are side by side if both keep their speeds along that way; 0 if they are, infinite if
    the gap does not close. `relative_speed(a, b)`: m/s by which `a` is faster than `b` along the heading of `a`.

    `ttc_along` is the longitudinal time to collision of ASAM OpenSCENARIO XML 1.3 (`TimeToCollisionCondition` with
    `freespace`, `relativeDistanceType="longitudinal"`): the distance along the road divided by the speed at which it
    becomes smaller, without accelerations. UN R157's cut-ins begin at such a time, in another lane.
    """

    words = """
        time (condition): the time since the start, in seconds | when time > 5 s { walker starts }
        distance (condition): the distance between two footprints, or along the route to a junction, in metres
            | distance(ego, lead) < 10 m
        ttc (condition): the time until two footprints touch if both keep heading and speed, in seconds
            | ttc(ego, lead) < 3 s
        ttc_along (condition): the time until two footprints are side by side along the way of the first if both keep
            their speeds, in seconds | ttc_along(ego, van) < 3 s
        headway (condition): the time that the first actor needs at its speed for the gap to the other, in seconds
            | headway(ego, lead) < 2 s
        eta (constant): the time until an actor enters a junction, in seconds | ego.eta(j4) < 4 s
        deviation (constant): the distance between the ego and the place at which its track has it now, in metres
            | ego.deviation > 2 m
        lateral (condition): the lateral distance between two footprints, across the way of the first, in metres
            | lateral(ego, cyclist) < 1 m
        overlap (condition): the length over which two footprints are side by side, in metres; a negative one is the gap
            along the way of the first | overlap(ego, lorry) > 0 m
        relative_speed (condition): how much faster the first actor is than the other, along the heading of the first,
            in m/s | relative_speed(ego, lead) > 3 m/s
    """

    what: Literal[
        "time", "speed", "acceleration", "offset", "deviation", "eta", "distance", "ttc", "ttc_along", "headway",
        "lateral", "overlap", "relative_speed",
    ]  # fmt: skip
    actor: v.ActorName | None = None
    other: Annotated[v.Id | v.Ref, Names("thing")] | None = None
    """The second actor, or the junction; None for a measure of one actor."""

    def own_pattern(self) -> str:
        """Return the pattern of this measure, such as `{actor}.speed` or `distance({actor}, {other})`."""
        match self.what:
            case "time":
                return self.what
            case "speed" | "acceleration" | "offset" | "deviation":
                return f"{{actor}}.{self.what}"
            case "eta":
                return "{actor}.eta({other})"
            case "distance" | "ttc" | "ttc_along" | "headway" | "lateral" | "overlap" | "relative_speed":
                return f"{self.what}({{actor}}, {{other}})"


class Comparison(Phrase):
    """`ego.eta(j4) < 4 s`: a comparison of a measure with a value; in a `require`, both sides are values: `gap + 0.5 s
    < 2 * other`."""

    pattern = "{left} {op} {right}"
    in_brackets_of = (("left", ("negative",)),)  # else `within 3 s -1 m < ...` reads as 3 s - 1 m

    left: Annotated[Measure | v.Quantity | v.Ref | v.Expression, v.OfDimension(None, (Measure,))]
    op: Literal["<", "<=", ">", ">="]
    right: v.Value


class Equals(Phrase):
    """`approach is south`, in a `require`: the parameter, which holds a word, has this value."""

    pattern = "{left} is {right}"
    words = "is (condition): the parameter has this value, or the signal shows this | ego.signal(j4) is red"

    left: Annotated[v.Ref, Names("parameter")]
    right: v.Word


class Predicate(Phrase):
    """`collision(ego)`: the actor touches anything; `arrived(ego)`: it has reached its goal."""

    pattern = "{what}({actor})"
    words = """
        collision (condition): the actor touches anything | expect never collision(ego)
        arrived (condition): the actor has reached its goal | expect eventually arrived(ego)
    """

    what: Literal["collision", "arrived"]
    actor: v.ActorName


class InJunction(Phrase):
    """`ego in junction j4`: a part of its footprint is inside the junction's outline; without a name: inside any
    junction."""

    pattern = "{actor} in junction [{junction}]"
    never_bare = ("and", "or", "for")

    actor: v.ActorName
    junction: v.JunctionId | None = None


class Ahead(Phrase):
    """`lead ahead of ego`: its whole footprint lies beyond the other's front, along the other's way (its route, its
    path, or straight on), at any lateral distance."""

    pattern = "{actor} ahead of {other}"

    actor: v.ActorName
    other: v.ActorName


class Behind(Phrase):
    """`lead behind ego`: its whole footprint lies behind the other's rear, along the other's way."""

    pattern = "{actor} behind {other}"

    actor: v.ActorName
    other: v.ActorName


class SameLane(Phrase):
    """`cutter in lane of ego`: the middle of its footprint lies in the other's lane, or in a lane that continues that
    lane along the other's route; or the same holds with the two actors exchanged."""

    pattern = "{actor} in lane of {other}"

    actor: v.ActorName
    other: v.ActorName


class InLane(Phrase):
    """`ego in lane 2`, `ego in lane 2 of west`: the middle of its footprint lies in that lane of the edge.

    Lanes are counted from the side that traffic keeps to, without lanes that only cyclists, pedestrians or parked cars
    use.
    """

    pattern = "{actor} in lane {number} [of {road}]"

    actor: v.ActorName
    number: Annotated[v.Count, Bounds(1, 20)]  # ours: no road of the maps has more lanes
    road: v.RoadId | None = None


class Sees(Phrase):
    """`ego sees walker`: the ego's sensors report it: it is in range, in their field of view, not hidden, and not
    missed at this moment. The report reaches the driver a moment later."""

    pattern = "{actor} sees {other}"
    words = "sees (condition): the ego's sensors report an actor | ego sees walker"

    actor: v.ActorName
    other: v.ActorName


class InSight(Phrase):
    """`walker in sight of bus`: no building and no actor hides it from the other's eyes, at any distance and on any
    side."""

    pattern = "{actor} in sight of {other}"
    words = "sight (condition): nothing hides the first actor from the second | walker in sight of bus"

    actor: v.ActorName
    other: v.ActorName


class RunsRed(Phrase):
    """`ego runs red`, `ego runs red at j4`: at this frame its front passes the line of a junction while the signal is
    red for its way. A light at which it could no longer stop does not count."""

    pattern = "{actor} runs red [at {junction}]"
    words = "runs (condition): the actor passes a red light at this moment | expect never ego runs red"
    never_bare = ("and", "or", "for")

    actor: v.ActorName
    junction: v.JunctionId | None = None


class YieldsAtCrossing(Phrase):
    """`ego yields to walker at crossing`, `ego yields to walker at crossing of school`: at a frame at which a
    pedestrian has passed the actor's way on a crossing, and the actor is at most 30 m before that crossing, the
    condition holds.

    At a frame at which the actor has passed the crossing before a pedestrian with priority, it does not hold. At all
    other frames it cannot be evaluated, so `expect always` with it holds if neither happens.
    """

    pattern = "{actor} yields to {other} at crossing [of {junction}]"
    words = """
        yields (condition): the actor lets another one pass that has priority
            | expect always ego yields to walker at crossing
        crossing (condition): any pedestrian crossing on the actor's way
            | expect always ego yields to walker at crossing
    """
    never_bare = ("and", "or", "for")

    actor: v.ActorName
    other: v.ActorName
    junction: v.JunctionId | None = None


class YieldsAt(Phrase):
    """`ego yields to runner at j4`: as at a crossing, but at a junction and to a vehicle with the right of way."""

    pattern = "{actor} yields to {other} at {junction}"

    actor: v.ActorName
    other: v.ActorName
    junction: v.JunctionId


class Named(Phrase):
    """An actor or a junction, by its name."""

    pattern = "{name}"
    never_bare = ("beside", "the")

    name: Annotated[v.Id | v.Ref, Names("thing")]


class Within(Phrase):
    """`ego within 5 m of walker`, of a junction, or of a place: distance from its footprint to the other's footprint,
    the junction's outline or the point."""

    pattern = "{actor} within {distance} of {of}"

    actor: v.ActorName
    distance: v.Length
    of: Annotated[
        Named | v.Point | v.AlongEdge | v.AlongRoute | v.PastJunction | v.AheadOf | v.BehindOf | v.Beside | v.PlaceOf,
        ONE_OF,
    ]


class Shows(Phrase):
    """`ego.signal(j4) is red`: the signal's colour (green, amber or red) for the actor's movement over the junction.
    `signal(j4) is ns_go`: the signal's stage."""

    pattern = "[{actor}.]signal({junction}) is {state}"
    words = """
        amber (constant): the signal shows amber | ego.signal(j4) is amber
        red (constant): the signal shows red | ego.signal(j4) is red
    """

    actor: v.ActorName | None = None
    junction: v.JunctionId
    state: v.StageId


class Sustained(Phrase, kind="for"):
    """`CONDITION for 2 s`: it has held at every frame of this time. Binds stronger than `not`.

    `CONDITION for 2 s since -1.30 s`: the condition has held since 1.30 s before the run, so that the `for` holds at
    0.70 s if nothing interrupts it; after an interruption it takes its full time. `since 0 s`: it did not hold just
    before the beginning. A condition that is evaluated only later (in a `then when`) counts as true from the time after
    `since` until its first evaluation. Clips contain `since`.
    """

    pattern = "{condition} for {duration} [since {since}]"
    in_brackets = ("for", "not", "and", "or")
    words = """
        since (link): before the time since which the condition of a `for` had held when the run began
            | when ego.speed > 5 m/s for 2 s since -1.30 s { runner stops }
    """

    condition: "Condition"
    duration: v.Duration
    since: Annotated[v.Time, Bounds(-1e9, 0.0)] | None = None
    """A time of 0 s or earlier; without it, nothing is assumed about the time before the run."""


class Not(Phrase):
    """`not CONDITION`: the condition does not hold."""

    pattern = "not {condition}"
    in_brackets = ("and", "or")
    words = "not (condition): the condition does not hold | not ego.speed < 3 m/s"

    condition: "Condition"


class Both(Phrase, kind="and"):
    """`A and B and C`: all parts hold."""

    pattern = "{conditions: and }"
    in_brackets = ("and", "or")
    words = "and (condition): both conditions hold; `and` binds stronger than `or` | time > 1 s and ego.speed < 3 m/s"

    conditions: tuple["Condition", ...] = Field(min_length=2)


class Either(Phrase, kind="or"):
    """`A or B or C`: at least one part holds; binds weaker than `and`; brackets are allowed."""

    pattern = "{conditions: or }"
    in_brackets = ("or",)
    words = "or (condition): at least one of the conditions holds | time > 9 s or ego.speed < 3 m/s"

    conditions: tuple["Condition", ...] = Field(min_length=2)


Condition = Annotated[
    Comparison
    | Equals
    | Predicate
    | InJunction
    | Ahead
    | Behind
    | SameLane
    | InLane
    | Sees
    | InSight
    | RunsRed
    | YieldsAtCrossing
    | YieldsAt
    | Within
    | Shows
    | Sustained
    | Not
    | Both
    | Either,
    ONE_OF,
]

Sustained.model_rebuild()
Not.model_rebuild()
Both.model_rebuild()
Either.model_rebuild()

TAKEN = frozenset(
    (
        *("then", "wait", "limit", "door", "once", "every", "next", "never", "always", "eventually", "within", "not"),
        *("time", "distance", *BETWEEN_ACTORS, "collision", "arrived", "signal"),
    )
)
"""Words that begin a condition or an action, or stand before one.

The parser could not tell an actor or a label with such a name from them. A test compares the list with the grammar.
"""
