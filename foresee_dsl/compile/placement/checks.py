"""Checks the placed actors of a scenario: whether they are off the road, in a building, too fast, or overlap."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from foresee_dsl.compile.bundle import PlacedActor, SlipperyPatch
from foresee_dsl.compile.placement.starts import OFF_ROUTE_M
from foresee_dsl.compile.placement.statements import lane_kind, path_of
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import XY, Points, line_of
from foresee_dsl.compile.roads.routing import metres
from foresee_dsl.compile.roads.topology import LaneKind
from foresee_dsl.errors import Message, measured, subject
from foresee_dsl.helps import HelpText, write
from foresee_dsl.language import model as m
from foresee_dsl.language.document import Problem
from foresee_dsl.language.printer import written

NEAR_ROAD_M = 30.0
"""Maximum distance of pedestrians, obstacles and actors on paths from a lane, m (ours: a larger distance is probably a
mistake of the author).
"""
GOAL_OFF_M = 5.0
"""A goal that is farther than this from the ego's centreline is on another road, m (ours: more than a lane's width)."""
_MOST_NAMED = 20
"""Maximum number of reported problems of a kind (ours: they fill a screen; without a limit, 500 actors in one place
would make 124,750 problems).
"""
_MOST_COUNTED = 10_000
"""Maximum number of further overlapping pairs that are counted (ours: counting them takes 0.2 s)."""
_TOUCH_M2 = 1e-4
"""Largest overlap of two footprints that is attributed to rounding, m^2 (ours: 1 cm^2)."""


def of_place(actor: m.Ego | m.Actor, placed: PlacedActor, network: RoadNetwork) -> Iterator[Problem]:
    """Yield a problem if an actor is too far from the road, or in a building."""
    path = path_of(actor)
    at = "state" if actor.state is not None else (path.kind if path is not None else "start_at")
    if placed.control in ("ego", "sumo"):
        kind = lane_kind(placed.model)
        away = network.distance_to_lanes(placed.x, placed.y, kind)
        if away > OFF_ROUTE_M:
            how_far = metres(away) if math.isfinite(away) else "nowhere"
            message = f"{placed.id} is off the road: the nearest lane for a {kind} is " + how_far + " away"
            yield Problem(placed.id, at, "FS253", message, _nearest_road(placed.x, placed.y, network))
        return
    far = network.far_from_lanes(((placed.x, placed.y), *placed.path), NEAR_ROAD_M)
    if far is not None:
        message = f"{placed.id} is off the road: " + _spot(far) + f" is over {NEAR_ROAD_M:.0f} m from every lane"
        yield Problem(placed.id, at, "FS253", message, _nearest_road(*far, network))
    wall = network.wall_on_the_way(placed.path or ((placed.x, placed.y),))
    if wall is not None:
        message = f"{placed.id} is in a building: its outline has a corner at " + _spot(wall)
        help_ = "lead it around the building, or make the building smaller"
        yield Problem(placed.id, at, "FS259", message, help_)


def _spot(place: XY) -> Message:
    return "(" + metres(place[0]) + ", " + metres(place[1]) + ")"


def of_speed(actor: m.Ego | m.Actor, placed: PlacedActor, slack: float) -> Iterator[Problem]:
    """Yield a problem if an actor's speed exceeds its model's maximum by more than the factor `slack`, which allows for
    rounding."""
    if placed.control == "static":
        return
    speeds = [("speed", placed.cruise_mps)] if any(isinstance(i, m.CruiseSpeed) for i in actor.body) else []
    speeds.append(("state" if actor.state is not None else "start_speed", placed.speed_mps))
    too_fast = next(((at, speed) for at, speed in speeds if speed > placed.model.max_speed_mps * slack), None)
    if too_fast is not None:
        at, speed = too_fast
        most = placed.model.max_speed_mps * slack / slack * 3.6
        drives, reaches = (measured(f"{kmh:.0f}") + " km/h" for kmh in (speed * 3.6, most))
        message = f"{placed.id} has a speed of " + drives + f", but {placed.model.name} can reach only " + reaches
        help_ = "use at most " + write(f"{math.floor(most)} km/h") + ", or a faster model"
        yield Problem(placed.id, at, "FS256", message, help_)


def of_overlaps(
    placed: Sequence[PlacedActor], actors: Mapping[str, m.Ego | m.Actor], *, clip: bool
) -> Iterator[Problem]:
    """Yield a problem for each pair of actors that overlap.

    In a clip only overlaps with the ego count: pedestrians on paths do not evade each other, and a clip reproduces the
    moment of a run in which two of them overlap.
    """
    pairs = 0
    boxes = [footprint(actor) for actor in placed]
    reach = [math.hypot(actor.model.length_m, actor.model.width_m) for actor in placed]
    for k, box in enumerate(boxes):
        for j in range(min(k, 1) if clip else k):
            if placed[k].comes_later or placed[j].comes_later or (_is_recorded(placed[k]) and _is_recorded(placed[j])):
                continue
            apart = math.hypot(placed[k].x - placed[j].x, placed[k].y - placed[j].y)
            if apart < reach[k] + reach[j] and common_area(box, boxes[j]) > _TOUCH_M2:
                message = subject(placed[k].id) + f" starts on top of {placed[j].id}"
                help_: HelpText = (
                    f"both are at ({placed[k].x:.1f} m, {placed[k].y:.1f} m), give one of them another start"
                )
                help_ += _farther(actors.get(placed[k].id), placed[k], placed[j])
                yield Problem(placed[k].id, "start_at", "FS254", message, help_)
                pairs += 1
                if pairs == _MOST_NAMED + _MOST_COUNTED:
                    return


def _is_recorded(actor: PlacedActor) -> bool:
    """Return whether an actor follows a recorded track; in recordings, boxes of neighbours may overlap."""
    return actor.control == "path" and actor.playback is not None


def of_slippery(patches: Iterable[SlipperyPatch], network: RoadNetwork) -> Iterator[Problem]:
    """Yield a problem for each slippery patch that does not touch a lane, so that no vehicle drives over it."""
    for patch in patches:
        away = min(network.distance_to_lanes(patch.x, patch.y, kind) for kind in ("car", "bicycle"))
        if away > patch.radius_m:
            message = f"{patch.name} lies beside the road: the nearest lane is " + metres(away) + " from its middle"
            help_ = "put it on a lane, such as " + write("20 m along ego.route") + ", or make it larger"
            yield Problem("", "slippery", "FS331", message, help_, patch.name)


def of_paths(
    placed: Iterable[PlacedActor], actors: Mapping[str, m.Ego | m.Actor], network: RoadNetwork
) -> Iterator[Problem]:
    """Yield a problem for each path that touches no lane and no sidewalk, so its actor meets no other actor."""
    for actor in placed:
        path = path_of(actors[actor.id])
        if path is None or not actor.path:
            continue
        kinds: tuple[LaneKind, ...] = ("car", "bus", "bicycle", "pedestrian")
        away = min(network.distance_to_lanes(x, y, kind) for x, y in line_of(actor.path).xy for kind in kinds)
        if away > actor.model.width_m / 2:
            message = f"the path of {actor.id} comes to no road: the nearest lane is " + metres(away) + " from it"
            example = "path [20 m along ego.route offset -5 m, 20 m along ego.route]"
            help_ = "lead it onto a road, such as " + write(example)
            yield Problem(actor.id, path.kind, "FS332", message, help_)


def few(problems: Iterable[Problem]) -> tuple[Problem, ...]:
    """Return the first problems of each kind; a single problem with a count replaces the others of a kind."""
    named: list[Problem] = []
    rest: dict[str, list[Problem]] = {}
    counts = Counter[str]()
    for problem in problems:
        counts[problem.code] += 1
        if counts[problem.code] <= _MOST_NAMED:
            named.append(problem)
        else:
            rest.setdefault(problem.code, []).append(problem)
    for code, left in rest.items():
        if len(left) == 1:
            named += left
            continue
        least = "at least " if code == "FS254" and len(left) >= _MOST_COUNTED else ""
        message = least + measured(f"{len(left):,}") + " more errors of this kind: the last is that " + left[-1].message
        named.append(replace(left[-1], message=message, help="correct the errors above, and check again"))
    return tuple(named)


def each_once(problems: Sequence[Problem]) -> tuple[Problem, ...]:
    """Return the problems without those that only repeat the error of a route: every place along a wrong route has the
    same error.

    If there are many problems of one kind, most of them are left out.
    """
    routes = {(problem.message, problem.help) for problem in problems if problem.code == "FS250"}
    unlike = (p for p in problems if p.code == "FS250" or (p.message, p.help) not in routes)
    return few(dict.fromkeys(unlike))


def _farther(actor: m.Ego | m.Actor | None, first: PlacedActor, other: PlacedActor) -> HelpText:
    """Return a start farther along at which there is room; "" if the actor's start is not a position along an edge or
    route."""
    start = next((item for item in actor.body if isinstance(item, m.StartAt)), None) if actor is not None else None
    place = start.place if start is not None else None
    if not isinstance(place, m.AlongEdge | m.AlongRoute) or not isinstance(place.at, m.Quantity):
        return ""
    room = math.ceil(first.model.length_m + other.model.length_m)
    at = m.Quantity.of(place.at.si + room, "length", 2)
    return ": " + write(f"start at {written(place.model_copy(update={'at': at}))}")


def footprint(actor: PlacedActor) -> Points:
    """Return the corners of an actor's oriented box, counter-clockwise."""
    back = actor.model.length_m / 2 if actor.control in ("ego", "sumo") else 0.0
    c, s = math.cos(actor.heading_rad), math.sin(actor.heading_rad)
    x, y = actor.x - back * c, actor.y - back * s
    half_length, half_width = actor.model.length_m / 2, actor.model.width_m / 2
    corners = ((1, 1), (-1, 1), (-1, -1), (1, -1))
    return tuple(
        (x + a * half_length * c - b * half_width * s, y + a * half_length * s + b * half_width * c) for a, b in corners
    )


def common_area(first: Points, second: Points) -> float:
    """Return the common area of two convex outlines, both counter-clockwise, m^2 (Sutherland-Hodgman)."""
    left: list[XY] = list(first)
    for k, (x0, y0) in enumerate(second):
        x1, y1 = second[(k + 1) % len(second)]
        sides = [(x1 - x0) * (y - y0) - (y1 - y0) * (x - x0) for x, y in left]
        clipped: list[XY] = []
        for i, ((x, y), side) in enumerate(zip(left, sides, strict=True)):
            (px, py), before = left[i - 1], sides[i - 1]
            if (side < 0) != (before < 0):
                share = before / (before - side)
                clipped.append((px + share * (x - px), py + share * (y - py)))
            if side >= 0:
                clipped.append((x, y))
        left = clipped
    return sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in zip(left, left[1:] + left[:1], strict=True)) / 2


def _nearest_road(x: float, y: float, network: RoadNetwork) -> HelpText:
    near = network.nearest_lane(x, y, within_m=1000.0)
    if near is None:
        return ""
    nx, ny, _ = near.lane.line.at(near.pos_m)
    return f"the nearest lane is on {near.lane.edge}, at " + write(f"({nx:.1f} m, {ny:.1f} m)")
