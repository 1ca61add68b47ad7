"""Checks actors where they were placed: off the road, in a building, too fast, inside each other."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from foresee_dsl.compile.bundle import PlacedActor
from foresee_dsl.compile.codes import IN_WALL, OFF_ROAD, OVERLAP, TOO_FAST
from foresee_dsl.compile.placement.starts import OFF_ROUTE_M, lane_kind
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import XY, Points
from foresee_dsl.language.model import Actor, CruiseSpeed, Ego
from foresee_dsl.language.project.document import Problem

NEAR_ROAD_M = 30.0
"""Farthest distance, m, of pedestrians, obstacles and path-followers from a lane (ours: farther away is an error)."""
GOAL_OFF_M = 5.0
"""A goal farther from the ego's centreline than this, m, is on another road (ours: more than a lane's width)."""
_TOUCH_M2 = 1e-4
"""Footprints may touch: an overlap smaller than a square centimetre is rounding (ours)."""


def of_place(actor: Ego | Actor, placed: PlacedActor, network: RoadNetwork) -> Iterator[Problem]:
    """Yield a problem if an actor is too far from the road, or in a building."""
    at = "state" if actor.state is not None else ("path" if placed.control == "path" else "start_at")
    if placed.control in ("ego", "sumo"):
        kind = lane_kind(placed.model)
        away = network.distance_to_lanes(placed.x, placed.y, kind)
        if away > OFF_ROUTE_M:
            away_text = f"{away:.1f} m" if math.isfinite(away) else "nowhere"
            message = f"{placed.id} is off the road: the nearest lane for a {kind} is {away_text} away"
            yield Problem(placed.id, at, OFF_ROAD, message, _nearest_road(placed.x, placed.y, network))
        return
    far = network.far_from_lanes(((placed.x, placed.y), *placed.path), NEAR_ROAD_M)
    if far is not None:
        x, y = far
        message = f"{placed.id} is off the road: ({x:.1f} m, {y:.1f} m) is over {NEAR_ROAD_M:.0f} m from every lane"
        yield Problem(placed.id, at, OFF_ROAD, message, _nearest_road(x, y, network))
    wall = network.wall_on_the_way(placed.path or ((placed.x, placed.y),))
    if wall is not None:
        x, y = wall
        message = f"{placed.id} is in a building: its outline has a corner at ({x:.1f} m, {y:.1f} m)"
        yield Problem(placed.id, at, IN_WALL, message, "lead it around the building, or let the building end before")


def of_speed(actor: Ego | Actor, placed: PlacedActor, slack: float) -> Iterator[Problem]:
    """Yield a problem if an actor is to be faster than its model can be; `slack`: factor for rounded speeds."""
    if placed.control == "static":
        return
    speeds = [("speed", placed.cruise_mps)] if any(isinstance(i, CruiseSpeed) for i in actor.body) else []
    speeds.append(("state" if actor.state is not None else "start_speed", placed.speed_mps))
    too_fast = next(((at, speed) for at, speed in speeds if speed > placed.model.max_speed_mps * slack), None)
    if too_fast is not None:
        at, speed = too_fast
        most = placed.model.max_speed_mps * slack / slack * 3.6
        message = f"{placed.id} is to go {speed * 3.6:.0f} km/h, but {placed.model.name} can go only {most:.0f} km/h"
        yield Problem(placed.id, at, TOO_FAST, message, f"use at most `{math.floor(most)} km/h`, or a faster model")


def of_overlaps(placed: Sequence[PlacedActor], *, clip: bool) -> Iterator[Problem]:
    """Yield a problem for each two actors that overlap.

    In a clip only overlaps with the ego count: pedestrians on paths do not evade each other, and a moment of a run
    where two of them touch is reproduced as it was.
    """
    boxes = [footprint(actor) for actor in placed]
    reach = [math.hypot(actor.model.length_m, actor.model.width_m) for actor in placed]
    for k, box in enumerate(boxes):
        for j in range(min(k, 1) if clip else k):
            apart = math.hypot(placed[k].x - placed[j].x, placed[k].y - placed[j].y)
            if apart < reach[k] + reach[j] and common_area(box, boxes[j]) > _TOUCH_M2:
                yield Problem(
                    placed[k].id,
                    "start_at",
                    OVERLAP,
                    f"{placed[k].id} starts on top of {placed[j].id}",
                    f"both are at ({placed[k].x:.1f} m, {placed[k].y:.1f} m), give one of them another start",
                )


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


def common_area(one: Points, other: Points) -> float:
    """Return the area (m^2) that two convex outlines, both counter-clockwise, have in common (Sutherland-Hodgman)."""
    left: list[XY] = list(one)
    for k, (x0, y0) in enumerate(other):
        x1, y1 = other[(k + 1) % len(other)]
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


def _nearest_road(x: float, y: float, network: RoadNetwork) -> str:
    near = network.nearest_lane(x, y, within_m=1000.0)
    if near is None:
        return ""
    nx, ny, _ = near.lane.line.at(near.pos_m)
    return f"the nearest lane is at ({nx:.1f} m, {ny:.1f} m), on {near.lane.edge}"
