"""What can be wrong with a scene once its network is known."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np
import shapely

from foresee_dsl.compile.bundle import PlacedActor, Signal
from foresee_dsl.compile.geometry import RoadNetwork
from foresee_dsl.compile.starts import OFF_ROUTE_M, lane_kind
from foresee_dsl.language.document import Problem, TestCase
from foresee_dsl.language.model import (
    Actor,
    Both,
    Comparison,
    Condition,
    CruiseSpeed,
    Ego,
    Either,
    Expect,
    Ignores,
    IgnoresRule,
    Item,
    Meets,
    MeetsState,
    Not,
    SignalState,
    When,
)
from foresee_dsl.language.suggest import did_you_mean

ROUTE = "FS250"
UNKNOWN = "FS251"
PLACE = "FS252"
OFF_ROAD = "FS253"
OVERLAP = "FS254"
GOAL = "FS255"
TOO_FAST = "FS256"
NO_WAY = "FS257"
NO_MEETING = "FS258"

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
    points = np.vstack(([(placed.x, placed.y)], placed.path))
    near = network.near_lanes(points, NEAR_ROAD_M)
    if not near.all():
        x, y = points[int(np.argmin(near))]
        message = f"{placed.id} is off the road: ({x:.1f} m, {y:.1f} m) is over {NEAR_ROAD_M:.0f} m from every lane"
        yield Problem(placed.id, said, OFF_ROAD, message, _nearest_road(float(x), float(y), network))


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
            found = f"{placed.id} is to go {speed * 3.6:.0f} km/h"
            yield Problem(
                placed.id, at, TOO_FAST, f"{found}, but {placed.model.name} can go only {top / slack * 3.6:.0f} km/h"
            )
            return


def of_overlaps(placed: Sequence[PlacedActor], *, clip: bool) -> Iterator[Problem]:
    """Say which actors stand on top of each other.

    In a clip only the ego's neighbours count: people on their paths do not evade each other, and a moment of a run
    where two of them touch is rebuilt as it was.
    """
    boxes = [footprint(actor) for actor in placed]
    for k, box in enumerate(boxes):
        for j in range(min(k, 1) if clip else k):
            if box.intersects(boxes[j]) and box.intersection(boxes[j]).area > _TOUCH_M2:
                yield Problem(
                    placed[k].id,
                    "start_at",
                    OVERLAP,
                    f"{placed[k].id} starts on top of {placed[j].id}",
                    f"both are at ({placed[k].x:.1f} m, {placed[k].y:.1f} m), give one of them another start",
                )


def of_names(case: TestCase, network: RoadNetwork, signals: Mapping[str, Signal]) -> Iterator[Problem]:
    """Say which junctions, stages and actors are named that do not exist."""
    scenario = case.scenario
    for actor in scenario.actors:
        for item in actor.body:
            if isinstance(item, IgnoresRule | MeetsState) and item.junction is not None:
                yield from _junction(actor.name, item.kind, item.junction, network)
    for state in scenario.all(SignalState):
        yield from _signal(state, signals)
    actors = {actor.name for actor in scenario.actors}
    for when in scenario.all(When):
        yield from _condition(when, when.condition, actors, network)
        for action in when.actions:
            if isinstance(action, Meets | Ignores) and action.junction is not None:
                yield from _junction("", when.kind, action.junction, network)
    for expect in scenario.all(Expect):
        yield from _condition(expect, expect.condition, actors, network)


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
        for action in when.actions:
            if isinstance(action, Meets):
                yield from _meeting("", when.kind, action.actor, action, by_name)


def footprint(actor: PlacedActor) -> shapely.Polygon:
    """Return an actor's oriented box."""
    back = actor.model.length_m / 2 if actor.control in ("ego", "sumo") else 0.0
    c, s = math.cos(actor.heading_rad), math.sin(actor.heading_rad)
    x, y = actor.x - back * c, actor.y - back * s
    half_length, half_width = actor.model.length_m / 2, actor.model.width_m / 2
    corners = ((1, 1), (-1, 1), (-1, -1), (1, -1))
    return shapely.Polygon(
        [
            (x + a * half_length * c - b * half_width * s, y + a * half_length * s + b * half_width * c)
            for a, b in corners
        ]
    )


def _junction(actor: str, at: str, junction: str, network: RoadNetwork) -> Iterator[Problem]:
    if junction not in network.junctions:
        message = f"there is no junction called {junction}"
        yield Problem(actor, at, UNKNOWN, message, did_you_mean(junction, network.junctions))


def _signal(state: SignalState, signals: Mapping[str, Signal]) -> Iterator[Problem]:
    signal = signals.get(state.junction)
    if signal is None:
        message = f"there is no signal at {state.junction}"
        yield Problem("", state.kind, UNKNOWN, message, did_you_mean(state.junction, signals))
    elif state.stage not in signal.stages:
        message = f"the signal at {state.junction} has no stage called {state.stage}"
        yield Problem("", state.kind, UNKNOWN, message, f"its stages are {', '.join(signal.stages)}")


def _condition(owner: When | Expect, condition: Condition, actors: set[str], network: RoadNetwork) -> Iterator[Problem]:
    if isinstance(condition, Both | Either):
        for part in condition.conditions:
            yield from _condition(owner, part, actors, network)
    elif isinstance(condition, Not):
        yield from _condition(owner, condition.condition, actors, network)
    elif isinstance(condition, Comparison):
        other = condition.left.other
        if other is not None and other not in actors and not (condition.left.what == "distance" and other in actors):
            yield from _junction("", owner.kind, other, network)


def _meeting(owner: str, at: str, name: str, item: Item, by_name: Mapping[str, PlacedActor]) -> Iterator[Problem]:
    if not isinstance(item, Meets | MeetsState):
        return
    for one in (name, item.other):
        actor = by_name.get(one)
        if actor is None or actor.line is None:
            continue  # unknown, already wrong, or off the lanes: said elsewhere, or left to the simulator
        if actor.line.passage(item.junction) is None:
            over = ", ".join(p.junction for p in actor.line.passages) or "no junction"
            message = f"{name} cannot meet {item.other} at {item.junction}: {one} does not go over it"
            yield Problem(owner, at, NO_MEETING, message, f"{one} goes over {over}")


def _nearest_road(x: float, y: float, network: RoadNetwork) -> str:
    near = network.nearest_lane(x, y, within_m=1000.0)
    if near is None:
        return ""
    nx, ny, _ = near.lane.line.at(near.pos_m)
    return f"{near.lane.edge} is at ({nx:.1f} m, {ny:.1f} m)"


def _metres(distance: float) -> str:
    return f"{distance:.1f} m" if math.isfinite(distance) else "nowhere"
