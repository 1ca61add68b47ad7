"""Objects on the roads of a network (roundabouts, ramps, zebra crossings, bumps), and rules for turns and lanes."""

from __future__ import annotations

from typing import Annotated

from foresee_dsl.language.model import values as v
from foresee_dsl.language.model.item import Bounds, Item, Names

_Lane = Annotated[v.Count, Bounds(1, 8)]
_LaneWidth = Annotated[v.Length, Bounds(1.0, 10.0)]  # ours: the same bounds as for a road


class BannedTurn(Item):
    """`forbid left over middle from [west, east]`: a turn that no vehicle may take there."""

    pattern = "forbid {turn} over {junction} from {roads}"
    words = """
        forbid (statement): a turn that no vehicle may take at a junction | forbid left over middle from [west, east]
    """

    turn: v.Turn
    junction: Annotated[v.Name, Names("junction")]
    roads: tuple[Annotated[v.Name, Names("road")], ...]


class LaneTurns(Item):
    """`lane 1 of west goes [right, straight]`: the turns to which a lane leads at the end of its edge; lane 1 is the
    rightmost."""

    pattern = "lane {lane} of {edge} goes {turns}"
    words = """
        goes (link): before the turns to which a lane leads; the other lanes of its edge keep theirs
            | lane 2 of west goes [left]
    """

    lane: _Lane
    edge: Annotated[v.Name, Names("road")]
    turns: tuple[v.Turn, ...]


class Roundabout(Item):
    """`roundabout circle at (0 m, 0 m) { radius 18 m; lanes 2 }`: a ring that the roads ending at it lead into.

    The radius is that of the middle of its carriageway. Vehicles on the ring go first. The junction of each arm has the
    names of the roundabout and the road: `circle_west`.
    """

    pattern = "roundabout {name} at {at} { radius; lanes; lane_width; speed; sidewalk; crossings [{crossings}] }"
    words = """
        roundabout (statement): a ring to which roads lead; vehicles on it have priority
            | roundabout circle at (0 m, 0 m) { ... }
        radius (setting): the radius of the middle of a roundabout's carriageway, or of a slippery patch | radius 18 m
    """
    one_line_without = ()

    name: Annotated[v.Name, Names("junction", defines=True)]
    at: v.Point
    radius: Annotated[v.Length, Bounds(8.0, 200.0)]  # ours: on a smaller ring, two arms do not fit side by side
    lanes: Annotated[v.Count, Bounds(1, 4)] | None = None
    lane_width: _LaneWidth | None = None
    speed: Annotated[v.Speed, Bounds(0.1)] | None = None
    sidewalk: Annotated[v.Length, Bounds(0.0, 50.0)] | None = None
    crossings: tuple[v.Name, ...] | None = None
    """The roads that have a crossing at the ring; an empty tuple means all roads, None means no roads."""


class OnRamp(Item):
    """`on_ramp up from side to a1 at 400 m { length 250 m }`: a lane from a junction into an edge. From there on, the
    edge has an extra lane on the right for `length`, the acceleration lane."""

    pattern = "on_ramp {name} from {junction} to {edge} at {at} [{ length; speed; lane_width; via }]"
    words = "on_ramp (statement): a lane that joins an edge on its right | on_ramp up from side to a1 at 400 m"
    one_line_without = ("via",)

    name: Annotated[v.Name, Names("road", defines=True)]
    junction: Annotated[v.Name, Names("junction")]
    edge: Annotated[v.Name, Names("road")]
    at: Annotated[v.Length, Bounds(0.0)]
    length: Annotated[v.Length, Bounds(20.0, 2000.0)] | None = None
    speed: Annotated[v.Speed, Bounds(0.1)] | None = None
    lane_width: _LaneWidth | None = None
    via: tuple[v.Point, ...] = ()


class OffRamp(Item):
    """`off_ramp down from a1 at 900 m to side { length 200 m }`: a lane that leaves an edge. The edge has an extra lane
    on the right for `length` before it, the deceleration lane."""

    pattern = "off_ramp {name} from {edge} at {at} to {junction} [{ length; speed; lane_width; via }]"
    words = "off_ramp (statement): a lane that leaves an edge on its right | off_ramp down from a1 at 900 m to b"
    one_line_without = ("via",)

    name: Annotated[v.Name, Names("road", defines=True)]
    edge: Annotated[v.Name, Names("road")]
    at: Annotated[v.Length, Bounds(0.0)]
    junction: Annotated[v.Name, Names("junction")]
    length: Annotated[v.Length, Bounds(20.0, 2000.0)] | None = None
    speed: Annotated[v.Speed, Bounds(0.1)] | None = None
    lane_width: _LaneWidth | None = None
    via: tuple[v.Point, ...] = ()


class Zebra(Item):
    """`zebra school on west at 40 m { width 4 m; island 2 m }`: a crossing without a signal, where pedestrians have
    priority.

    It is a junction of this name. With an island, pedestrians cross one direction at a time.
    """

    pattern = "zebra {name} on {road} at {at} [{ width; island }]"
    words = """
        zebra (statement): a crossing anywhere on a road at which pedestrians have priority
            | zebra school on west at 40 m
        island (setting): a refuge of this width between the two directions of a zebra crossing | island 2 m
    """
    one_line_without = ()

    name: Annotated[v.Name, Names("junction", defines=True)]
    road: Annotated[v.Name, Names("road")]
    at: Annotated[v.Length, Bounds(0.0)]
    width: Annotated[v.Length, Bounds(2.0, 20.0)] | None = None
    island: Annotated[v.Length, Bounds(1.0, 20.0)] | None = None  # ours: people need this width to stand


class Bump(Item):
    """`bump hump on west at 60 m { speed 20 km/h; length 4 m }`: a speed bump with that speed limit.

    The limit applies to a short piece of the road, which begins at a junction of this name; vehicles do not move
    vertically.
    """

    pattern = "bump {name} on {road} at {at} [{ speed; length }]"
    words = "bump (statement): a speed bump: a short piece of a road with a low limit | bump hump on west at 60 m"
    one_line_without = ()

    name: Annotated[v.Name, Names("junction", defines=True)]
    road: Annotated[v.Name, Names("road")]
    at: Annotated[v.Length, Bounds(0.0)]
    speed: Annotated[v.Speed, Bounds(0.5)] | None = None
    length: Annotated[v.Length, Bounds(1.0, 50.0)] | None = None


class LaneEnd(Item):
    """`lane 3 of a1 ends at 500 m`: a lane drop. From there on the edge has one lane less; lane 1 is the rightmost."""

    pattern = "lane {lane} of {edge} ends at {at}"
    words = """
        ends (link): before the place where a lane ends, so that its vehicles change lane | lane 3 of a1 ends at 500 m
    """

    lane: _Lane
    edge: Annotated[v.Name, Names("road")]
    at: Annotated[v.Length, Bounds(0.0)]
