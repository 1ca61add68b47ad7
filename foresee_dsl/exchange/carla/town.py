"""A town's map, and CARLA's routes on it: those that are there and can be driven, and why the others are not."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

from foresee_dsl.compile.bundle import ModelSpec, Signal
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import XY
from foresee_dsl.compile.roads.routing import RouteError
from foresee_dsl.exchange.carla.files import CarlaRoute, Trigger, town_of
from foresee_dsl.exchange.carla.placed_route import (
    BESIDE_GOAL_M,
    MISSED_M,
    PlacedRoute,
    family_on_way,
    place_route,
    strays,
    turns_back,
)
from foresee_dsl.exchange.maps.bridges import Heights, bridges
from foresee_dsl.exchange.maps.ways import NEAR_M
from foresee_dsl.exchange.outcome import ExchangeError

MOST_LOST = 0.5
"""With more than this share of routes that are not on the map, it is another town's (ours)."""
_LEAST_WAY_M = 1.0


@dataclass
class Town:
    """A map, and the report of what was imported on it so far."""

    network: RoadNetwork
    signals: Mapping[str, Signal]
    heights: Heights
    ego: ModelSpec
    left_out: Counter[str] = field(default_factory=Counter)
    taken: Counter[str] = field(default_factory=Counter)
    notes: list[str] = field(default_factory=list)

    @cached_property
    def bridges(self) -> tuple[XY, ...]:
        """Where roads go over others."""
        return tuple((one.x, one.y) for one in bridges(self.network, self.heights))

    @cached_property
    def has_sidewalks(self) -> bool:
        """Whether there is a place for people anywhere."""
        return any(lane.kinds == {"pedestrian"} and not lane.internal for lane in self.network.lanes.values())


def routes_in_town(map_file: Path, routes: Sequence[CarlaRoute], left_out: Counter[str]) -> list[CarlaRoute]:
    """Return the routes in the town of a map; those in others are counted.

    Raises:
        ExchangeError: all are in others.
    """
    town = town_of(map_file)
    found = [route for route in routes if not town or route.town in ("", town)]
    if not found:
        route = routes[0]
        raise ExchangeError(
            f"{route.file}: route {route.id} is in {route.town}, but the map {map_file.name} is {town}: "
            f"use the map of {route.town}, or leave this file out"
        )
    left_out.update(f"routes in {route.town}" for route in routes if town and route.town not in ("", town))
    return found


def place_routes(town: Town, routes: Sequence[CarlaRoute], triggers: Sequence[Trigger]) -> list[PlacedRoute]:
    """Put the routes on the map; those that are not on it, or cannot be driven there, are counted and reported.

    Raises:
        ExchangeError: most are not on it.
    """
    found: list[PlacedRoute] = []
    lost: list[str] = []
    broken: list[str] = []
    of_family = Counter(route.family for route in routes)
    for route in routes:
        near = [t for t in triggers if t.family and t.town in ("", route.town or t.town)]
        try:
            placed = _placed(town, route, near, of_family)
        except RouteError as err:
            lost.append(f"{route.key}: {err}")
            continue
        if placed.start_off_m > NEAR_M:
            lost.append(f"{route.key}: the ego would start {placed.start_off_m:.1f} m from its place")
        elif placed.finish_m <= _LEAST_WAY_M:
            lost.append(f"{route.key}: its end is where it starts")
        elif turns_back(placed):
            broken.append(f"{route.key}: its way goes over lanes of the map that run backwards")
        elif (off := strays(town.network, placed))[0] > 0:
            broken.append(f"{route.key}: its way leaves the road at ({off[1]:.0f} m, {off[2]:.0f} m) by {off[0]:.1f} m")
        else:
            found.append(placed)
    if len(lost) > MOST_LOST * len(routes):
        raise ExchangeError(f"{len(lost)} of {len(routes)} routes are not on this map; is it another town's? {lost[0]}")
    town.left_out["routes that are not on the map"] += len(lost)
    town.left_out["routes that nobody can drive on this map"] += len(broken)
    town.notes += lost + broken
    _report_places(town, found, triggers)
    return found


def _placed(town: Town, route: CarlaRoute, triggers: Sequence[Trigger], of_family: Counter[str]) -> PlacedRoute:
    if not route.family:
        placed = place_route(town.network, route, [], town.ego, in_order=False, heights=town.heights)
        route = replace(route, family=family_on_way(placed, triggers))
    near = route.triggers or [trigger for trigger in triggers if trigger.family == route.family]
    in_order = not route.triggers and len(near) == of_family[route.family]
    return place_route(town.network, route, near, town.ego, in_order=in_order, heights=town.heights)


def _place(trigger: Trigger) -> tuple[str, int, int]:
    """A trigger's family and place, to the metre: CARLA's files repeat some."""
    return trigger.family, round(trigger.pose.x), round(trigger.pose.y)


def _report_places(town: Town, placed: Sequence[PlacedRoute], triggers: Sequence[Trigger]) -> None:
    used = {_place(one.trigger) for one in placed if one.trigger is not None}
    known = {one.route.town for one in placed if one.route.town}
    elsewhere = [t for t in triggers if t.town and known and t.town not in known]
    town.left_out.update(f"triggers in {trigger.town}" for trigger in elsewhere)
    unused = sum(_place(t) not in used for t in triggers if t not in elsewhere)
    town.left_out["triggers that no case uses (each stages one)"] += unused
    moved = [one.start_off_m for one in placed if one.start_off_m > MISSED_M]
    if moved:
        town.notes.append(
            f"routes that start beside CARLA's place (at most {max(moved):.1f} m): {len(moved)}; their map was another"
        )
    without = sum(one.trigger is None for one in placed)
    if without and triggers:
        town.notes.append(
            f"routes without a trigger within 5 m, where what happens is placed from the start: {without}"
        )
    town.left_out["goals beside the lane that the ego comes on (the goal is a length along its route)"] += sum(
        math.dist(one.line.at(one.goal_s)[:2], (one.route.end.x, one.route.end.y)) > BESIDE_GOAL_M for one in placed
    )
