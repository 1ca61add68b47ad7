"""What can be wrong with a scene once its network is known."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence

from foresee_dsl.compile.bundle import PlacedActor, Signal
from foresee_dsl.compile.codes import IN_WALL, NO_MEETING, OFF_ROAD, OVERLAP, TOO_FAST, UNKNOWN
from foresee_dsl.compile.placement.starts import OFF_ROUTE_M, lane_kind
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import XY, Points
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.model import (
    Actor,
    CruiseSpeed,
    Ego,
    IgnoresRule,
    Item,
    Meets,
    MeetsState,
    SignalState,
    When,
)
from foresee_dsl.language.project.document import Problem, TestCase
from foresee_dsl.language.traversal import all_actions, word_of

NEAR_ROAD_M = 30.0
"""Pedestrians, obstacles and path-followers must be this near to some lane: farther away they can only be a mistake."""
GOAL_OFF_M = 5.0
"""A goal farther from the ego's centreline than this is on another road (ours: more than a lane's width)."""
_TOUCH_M2 = 1e-4
"""Footprints may touch; an overlap smaller than a square centimetre is rounding."""


def of_place(actor: Ego | Actor, placed: PlacedActor, network: RoadNetwork) -> Iterator[Problem]:
    """Say whether an actor is too far from the road."""
    said = "state" if actor.state is not None else ("path" if placed.control == "path" else "start_at")
    if placed.control in ("ego", "sumo"):
        kind = lane_kind(placed.model)
        away, limit, what = network.distance_to_lanes(placed.x, placed.y, kind), OFF_ROUTE_M, f"lane for a {kind}"
        if away > limit:
            message = f"{placed.id} is off the road: the nearest {what} is {_metres(away)} away"
            yield Problem(placed.id, said, OFF_ROAD, message, _nearest_road(placed.x, placed.y, network))
        return
    far = network.far_from_lanes(((placed.x, placed.y), *placed.path), NEAR_ROAD_M)
    if far is not None:
        x, y = far
        message = f"{placed.id} is off the road: ({x:.1f} m, {y:.1f} m) is over {NEAR_ROAD_M:.0f} m from every lane"
        yield Problem(placed.id, said, OFF_ROAD, message, _nearest_road(x, y, network))
    wall = network.wall_on_the_way(placed.path or ((placed.x, placed.y),))
    if wall is not None:
        x, y = wall
        message = f"{placed.id} is in a building: its outline has a corner at ({x:.1f} m, {y:.1f} m)"
        yield Problem(placed.id, said, IN_WALL, message, "lead it around the building, or let the building end before")


def of_speed(actor: Ego | Actor, placed: PlacedActor, slack: float) -> Iterator[Problem]:
    """Say whether an actor is to be faster than its model can be."""
    top = placed.model.max_speed_mps * slack
    cruise_said = any(isinstance(i, CruiseSpeed) for i in actor.body)
    if placed.control == "static":
        return
    speeds = [("speed", placed.cruise_mps)] if cruise_said else []
    speeds.append(("state" if actor.state is not None else "start_speed", placed.speed_mps))
    for at, speed in speeds:
        if speed > top:
            reaches = top / slack * 3.6
            message = (
                f"{placed.id} is to go {speed * 3.6:.0f} km/h, but {placed.model.name} can go only {reaches:.0f} km/h"
            )
            help_ = f"use at most `{math.floor(reaches)} km/h`, or a faster model"
            yield Problem(placed.id, at, TOO_FAST, message, help_)
            return


def of_overlaps(placed: Sequence[PlacedActor], *, clip: bool) -> Iterator[Problem]:
    """Say which actors stand on top of each other.

    In a clip only the ego's neighbours count: people on their paths do not evade each other, and a moment of a run
    where two of them touch is rebuilt as it was.
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


def of_names(case: TestCase, network: RoadNetwork, signals: Mapping[str, Signal]) -> Iterator[Problem]:
    """Say which junctions and stages actors and signals name that do not exist (for conditions, see `said`)."""
    scenario = case.scenario
    for actor in scenario.actors:
        for item in actor.body:
            if isinstance(item, IgnoresRule | MeetsState) and item.junction is not None:
                yield from _junction(actor.name, item.kind, word_of(item.junction), network)
    for state in scenario.all(SignalState):
        yield from _signal(state, signals)


def of_meetings(case: TestCase, placed: Iterable[PlacedActor]) -> Iterator[Problem]:
    """Say which actors are to meet at a junction that is not on both routes.

    In a clip the one who is met may have passed the junction already, and what is left of its route does not show it.
    """
    if case.snapshot:
        return
    by_name = {actor.id: actor for actor in placed}
    for actor in case.scenario.actors:
        for item in actor.body:
            if isinstance(item, MeetsState):
                yield from _meeting(actor.name, item.kind, actor.name, item, by_name)
    for when in case.scenario.all(When):
        for action in all_actions(when.actions):
            if isinstance(action, Meets):
                yield from _meeting("", when.kind, action.actor, action, by_name)


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
        kept: list[XY] = []
        for i, ((x, y), side) in enumerate(zip(left, sides, strict=True)):
            (px, py), before = left[i - 1], sides[i - 1]
            if (side < 0) != (before < 0):
                share = before / (before - side)
                kept.append((px + share * (x - px), py + share * (y - py)))
            if side >= 0:
                kept.append((x, y))
        left = kept
    return sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in zip(left, left[1:] + left[:1], strict=True)) / 2


def _junction(actor: str, at: str, junction: str, network: RoadNetwork) -> Iterator[Problem]:
    if junction not in network.junctions:
        message = f"there is no junction called {junction}"
        yield Problem(actor, at, UNKNOWN, message, did_you_mean(junction, network.junctions), junction)


def _signal(state: SignalState, signals: Mapping[str, Signal]) -> Iterator[Problem]:
    junction, stage = word_of(state.junction), word_of(state.stage)
    signal = signals.get(junction)
    if signal is None:
        message = f"there is no signal at {junction}"
        yield Problem("", state.kind, UNKNOWN, message, did_you_mean(junction, signals), junction)
    elif stage not in signal.stages:
        message = f"the signal at {junction} has no stage called {stage}"
        yield Problem("", state.kind, UNKNOWN, message, f"its stages are {', '.join(signal.stages)}", stage)


def _meeting(owner: str, at: str, name: str, item: Item, by_name: Mapping[str, PlacedActor]) -> Iterator[Problem]:
    if not isinstance(item, Meets | MeetsState):
        return
    for one in (name, item.other):
        actor = by_name.get(one)
        if actor is None or actor.line is None:
            continue  # unknown, already wrong, or off the lanes: said elsewhere, or left to the simulator
        junction = word_of(item.junction)
        if actor.line.passage(junction) is None:
            over = ", ".join(p.junction for p in actor.line.passages) or "no junction"
            message = f"{name} cannot meet {item.other} at {junction}: {one} does not go over it"
            yield Problem(owner, at, NO_MEETING, message, f"{one} goes over {over}", junction)


def _nearest_road(x: float, y: float, network: RoadNetwork) -> str:
    near = network.nearest_lane(x, y, within_m=1000.0)
    if near is None:
        return ""
    nx, ny, _ = near.lane.line.at(near.pos_m)
    return f"the nearest lane is at ({nx:.1f} m, {ny:.1f} m), on {near.lane.edge}"


def _metres(distance: float) -> str:
    return f"{distance:.1f} m" if math.isfinite(distance) else "nowhere"
