"""Actions of triggers that change the road for everybody, and those that bring an actor to a place."""

from __future__ import annotations

from typing import Annotated, Literal

from foresee_dsl.language.model import values as v
from foresee_dsl.language.model.item import ONE_OF, Bounds, Item, Names, Phrase


class TurnsTo(Item):
    """`king_oak turns to ew_go`: the signal shows that stage from its beginning, then its programme goes on.

    With `amber` or `red`: from where that stage's amber, or the red for all behind it, begins.
    """

    pattern = "{junction} turns to {stage} [{light}]"
    words = "turns (action): a signal shows a stage, then its programme goes on | king_oak turns to ew_go amber"

    junction: v.JunctionId
    stage: v.StageId
    light: Literal["amber", "red"] | None = None


class Limit(Item):
    """`limit on mill_west is 30 km/h`: another speed limit on a road, or with `lane 2` on one of its lanes.

    Vehicles that SUMO drives keep to it there: who drives as fast as the old limit allows, or faster, drives the new
    one; who is slower stays so where that is less. They brake before they come there. Lanes count from 1, the rightmost
    for cars.
    """

    pattern = "limit on {road} [lane {lane}] is {speed}"
    words = "limit (action): another speed limit on a road or a lane | limit on mill_west is 30 km/h"

    road: v.RoadId
    lane: Annotated[v.Count, Bounds(1, 8)] | None = None
    speed: Annotated[v.Speed, Bounds(0.1)]


class AtStop(Phrase):
    """A bus stop of the network, by its name."""

    pattern = "{stop}"

    stop: Annotated[v.Id, Names("stop")]


class StopsAt(Item):
    """`bus stops at market for 8 s`: brakes so that its front stands at the end of that stop (or at a place), stands
    there for the time or for good, then drives on.

    At a stop it changes to the stop's lane. It brakes with 3 m/s^2 at most; one that can no longer stop there comes to
    stand behind it, one that is more than 5 m past it drives on.
    """

    pattern = "{actor} stops at {where} [for {duration}]"

    actor: v.ActorName
    where: Annotated[AtStop | v.Point | v.AlongEdge | v.AlongRoute | v.PastJunction, ONE_OF]
    duration: v.Time | None = None
