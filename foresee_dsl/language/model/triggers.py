"""Triggers: conditions with the actions that follow, and the common actions of actors (`actions` has the others)."""

from typing import Annotated, Literal

from pydantic import Field

from foresee_dsl.language.model import actions as a
from foresee_dsl.language.model import values as v
from foresee_dsl.language.model.conditions import Condition
from foresee_dsl.language.model.item import ONE_OF, Bounds, Item, Names


class Meets(Item):
    """`runner meets ego at j4 after gap`: from now on the actor controls its speed so that it reaches the point where
    the two routes cross in the junction this much after (or before) the other.

    Its model's limits apply, and its speed is never above 1.3 times its cruise speed. The prediction assumes that the
    other drives at 3 m/s or more, so that two actors do not wait for each other.
    """

    pattern = "{actor} meets {other} at {junction} {order} {gap}"

    actor: v.ActorName
    other: v.ActorName
    junction: v.JunctionId
    gap: v.Time
    order: Literal["after", "before"] = "after"


class Ignores(Item, kind="does_ignore"):
    """`runner ignores signals at j4`, `runner ignores priority at j4`: from now on the actor does not obey signals, or
    does not yield; without a junction, everywhere."""

    pattern = "{actor} ignores {what} [at {junction}]"

    actor: v.ActorName
    what: Literal["signals", "priority"]
    junction: v.JunctionId | None = None


class Starts(Item):
    """`walker starts`: the actor moves off. An actor that such a trigger names stands until then, or until another
    trigger orders a speed."""

    pattern = "{actor} starts"
    words = "starts (action): an actor that waited moves off | walker starts"

    actor: v.ActorName


class ChangesSpeed(Item):
    """`lead changes speed to 3 m/s over 2 s`: the actor's speed changes linearly over the time; without a time, as fast
    as its model allows."""

    pattern = "{actor} changes speed to {to} [over {over}]"
    words = "changes (action): an actor changes its speed or its lane | lead changes speed to 3 m/s over 2 s"

    actor: v.ActorName
    to: Annotated[v.Speed, Bounds(0.0)]
    over: v.Duration | None = None


class ChangesLane(Item):
    """`cutter changes lane left`: the actor moves to the lane on its left or right."""

    pattern = "{actor} changes lane {side}"
    words = "lane (action): the lane to the left or right of an actor's lane | cutter changes lane left"

    actor: v.ActorName
    side: Literal["left", "right"] | v.Ref


class Stops(Item):
    """`lead stops`, `lead stops for 4 s`: the actor brakes comfortably and stands, for good or for the time."""

    pattern = "{actor} stops [for {duration}]"
    words = "stops (action): an actor brakes and stands, for good or for a time | lead stops for 4 s"

    actor: v.ActorName
    duration: v.Duration | None = None


class Wait(Item):
    """`wait 2 s`: delays the next `then` by this time."""

    pattern = "wait {duration}"
    words = "wait (action): the next step begins this much later | wait 2 s"

    duration: v.Duration


class Then(Item):
    """`then { ... }`: actions that begin once every action before them in the same block is complete; `then when
    CONDITION { ... }`: actions that begin once, from that moment on, the condition holds.

    An action is complete: `starts` when the actor moves off; `changes speed` when its speed or the time is reached;
    `changes lane` when the actor is in the lane or cannot change to it; `stops for` when it drives again (`stops` alone
    never); `brakes for` after the time (`brakes` alone never); `meets` when it is through the junction; `ignores`,
    `turns to`, `limit`, `door`, `leaves` and `leaves track` at once; `changes line` when it has reached the line;
    `follows`, `matches` and `keeps` after their time, or without a time as soon as they have reached the gap or speed
    that they keep;
    `synchronises` when it is at its place; `follows` with a path at the path's end; `reverses` when it has covered the
    distance. Actions of an actor that has left the world count as complete.
    """

    pattern = "then [when {condition}] { ...actions }"
    words = "then (action): actions that begin once every action before them is complete | then { walker starts }"

    condition: Condition | None = None
    actions: tuple["Action", ...] = Field(min_length=1)


Moves = (
    Meets
    | Ignores
    | Starts
    | ChangesSpeed
    | ChangesLane
    | a.ChangesLine
    | a.KeepsBeside
    | a.KeepsGap
    | a.FollowsPath
    | a.Reverses
    | a.MatchesSpeed
    | a.Synchronises
    | a.Leaves
    | Stops
    | a.BrakesFor
    | a.StopsAt
)
"""Actions that say how an actor moves."""
WithoutActor = a.TurnsTo | a.Limit | Wait | Then
"""Actions without an actor."""
Action = Annotated[Moves | a.LeavesTrack | a.Door | WithoutActor, ONE_OF]

Then.model_rebuild()


class When(Item):
    """`when ego.eta(j4) < 4 s { ... }`: the actions all begin the first time that the condition holds.

    `when every CONDITION` fires each time that the condition becomes true (it may be at the first frame); `when next`
    does the same but not before the condition has been false once (in clips, for a trigger that has just fired). A name
    before the condition, as in `when late: ...`, is what `extends` and messages call the trigger.
    """

    pattern = "when [{repeat}] [{name}:] {condition} { ...actions }"
    words = """
        when (statement): a trigger: actions that happen when its condition holds
            | when ego.eta(j4) < 4 s { runner stops }
        once (condition): the trigger fires only the first time that its condition holds; this is the default
            | when once time > 1 s
        every (condition): the trigger fires each time that its condition becomes true | when every ttc(ego, lead) < 2 s
        next (condition): like `every`, but the trigger does not fire before the condition has been false once
            | when next ttc(ego, lead) < 2 s
    """

    repeat: Literal["once", "every", "next"] | None = None
    name: Annotated[v.Name, Names("label", defines=True)] | None = None
    condition: Condition
    actions: tuple["Action", ...] = Field(min_length=1)
