"""Conditions: what triggers wait for and what expectations are about."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from foresee_dsl.language.model.values import (
    ONE_OF,
    AlongEdge,
    AlongRoute,
    Id,
    Item,
    Length,
    Name,
    PastJunction,
    Point,
    Ref,
    Time,
    Value,
)

SIGNAL_COLOURS = ("green", "amber", "red")
"""What a signal shows to one movement."""


class Measure(Item):
    """A number that can be read off the running world.

    `time` (s since the start), `ego.speed` (m/s), `ego.acceleration` (m/s^2, along its heading), `ego.eta(j4)` (s until
    the actor, at its speed and not under 1 m/s, enters the junction along its route; infinite when it has passed),
    `distance(a, b)` (m between footprints, or from `a` along its route to where it enters junction `b`), `ttc(a, b)`
    (s, constant velocities, footprints; infinite when they do not meet), `headway(a, b)` (s that `a` needs at its
    speed, not under 1 m/s, for the distance between the two footprints).
    """

    kind: Literal["measure"] = "measure"
    what: Literal["time", "speed", "acceleration", "eta", "distance", "ttc", "headway"]
    actor: Name | None = None
    other: Id | Ref | None = None
    """The second actor or the junction."""


class Comparison(Item):
    """`ego.eta(j4) < 4 s`; in a `require`, the left side is a parameter: `gap < 2 s`."""

    kind: Literal["comparison"] = "comparison"
    left: Measure | Ref
    op: Literal["<", "<=", ">", ">="]
    right: Value


class Equals(Item):
    """`approach is south`, in a `require`: a parameter that holds a word."""

    kind: Literal["equals"] = "equals"
    left: Ref
    right: Id


class Predicate(Item):
    """`collision(ego)` (it touches anything), `arrived(ego)` (it has reached its goal)."""

    kind: Literal["predicate"] = "predicate"
    what: Literal["collision", "arrived"]
    actor: Name


class InJunction(Item):
    """`ego in junction j4`: some part of its footprint is inside the junction's outline; without a name, of any."""

    kind: Literal["in_junction"] = "in_junction"
    actor: Name
    junction: Id | Ref | None = None


class Named(Item):
    """An actor or a junction, by its name."""

    kind: Literal["named"] = "named"
    name: Id | Ref


class Within(Item):
    """`ego within 5 m of walker`, of a junction, or of a place: its footprint is no further from the other's footprint,
    the junction's outline or the point."""

    kind: Literal["within"] = "within"
    actor: Name
    distance: Length
    of: Annotated[Named | Point | AlongEdge | AlongRoute | PastJunction, ONE_OF]


class Shows(Item):
    """`ego.signal(j4) is red`: what the signal shows to the actor's way over the junction: green, amber or red.
    `signal(j4) is ns_go`: the stage that the signal is in."""

    kind: Literal["shows"] = "shows"
    actor: Name | None = None
    junction: Id | Ref
    state: Id | Ref


class Sustained(Item):
    """`CONDITION for 2 s`: it has held at every frame of that time, without a break. Binds stronger than `not`.

    `CONDITION for 2 s since -1.30 s`: before the run it held since that time and not just before that; then the `for`
    holds at 0.70 s if nothing breaks it, and after a break takes its full time. `since 0 s`: it did not hold just
    before the beginning. A condition that is looked at later (of a `then when`) held from that time until then. Clips
    write it.
    """

    kind: Literal["for"] = "for"
    condition: Condition
    duration: Time
    since: Time | None = None
    """0 s or earlier; without it nobody knows what was before."""


class Not(Item):
    """`not CONDITION`."""

    kind: Literal["not"] = "not"
    condition: Condition


class Both(Item):
    """`A and B and C`."""

    kind: Literal["and"] = "and"
    conditions: tuple[Condition, ...] = Field(min_length=2)


class Either(Item):
    """`A or B or C`; binds weaker than `and`, brackets as usual."""

    kind: Literal["or"] = "or"
    conditions: tuple[Condition, ...] = Field(min_length=2)


Condition = Annotated[
    Comparison | Equals | Predicate | InJunction | Within | Shows | Sustained | Not | Both | Either,
    ONE_OF,
]

Sustained.model_rebuild()
Not.model_rebuild()
Both.model_rebuild()
Either.model_rebuild()
