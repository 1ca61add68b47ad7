"""Puts CARLA's routes on a town's map: those that are there and can be driven, and why the others are not."""

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
from foresee_dsl.exchange.carla.files import CarlaRoute, Trigger, town_of, towns
from foresee_dsl.exchange.carla.journey import (
    BESIDE_GOAL_M,
    MISSED_M,
    Journey,
    family_on_way,
    journey_of,
    strays,
    turns_back,
)
from foresee_dsl.exchange.maps.heights import Heights, bridges
from foresee_dsl.exchange.maps.places_on_net import NEAR_M
from foresee_dsl.exchange.outcome import ExchangeError

MOST_LOST = 0.5
"""With more than this share of routes that are not on the map, it is another town's (ours)."""
_LEAST_WAY_M = 1.0


@dataclass
class Import:
    """What is known so far; one use."""

    network: RoadNetwork
    signals: Mapping[str, Signal]
    heights: Heights
    spec: ModelSpec
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


def of_town(map_file: Path, routes: Sequence[CarlaRoute], left_out: Counter[str]) -> list[CarlaRoute]:
    """Return the routes in the town of a map; those in others are counted.

    Raises:
        ExchangeError: all are in others.
    """
    town = town_of(map_file)
    found = [route for route in routes if not town or route.town in ("", town)]
    if found:
        for other in towns(routes):
            if town and other != town:
                left_out[f"routes in {other}"] += sum(route.town == other for route in routes)
        return found
    route = routes[0]
    raise ExchangeError(f"{route.file}: route {route.id} is in {route.town}, but the map {map_file.name} is {town}: "
                        f"use the map of {route.town}, or leave this file out")  # fmt: skip


def journeys_of(state: Import, routes: Sequence[CarlaRoute], triggers: Sequence[Trigger]) -> list[Journey]:
    """Put the routes on the map; those that are not on it, or cannot be driven there, are counted and said.

    Raises:
        ExchangeError: most are not on it.
    """
    found: list[Journey] = []
    lost: list[str] = []
    broken: list[str] = []
    of_family = Counter(route.family for route in routes)
    for route in routes:
        near = [t for t in triggers if t.family and t.town in ("", route.town or t.town)]
        try:
            journey = _journey(state, route, near, of_family)
        except RouteError as err:
            lost.append(f"{route.key}: {err}")
            continue
        wrong = _wrong(journey)
        undrivable = "" if wrong else _undrivable(state, journey)
        if wrong:
            lost.append(f"{route.key}: {wrong}")
        elif undrivable:
            broken.append(f"{route.key}: {undrivable}")
        else:
            found.append(journey)
    if len(lost) > MOST_LOST * len(routes):
        raise ExchangeError(f"{len(lost)} of {len(routes)} routes are not on this map; is it another town's? {lost[0]}")
    state.left_out["routes that are not on the map"] += len(lost)
    state.left_out["routes that nobody can drive on this map"] += len(broken)
    state.notes += lost + broken
    _tell_places(state, found, triggers)
    return found


def _journey(state: Import, route: CarlaRoute, triggers: Sequence[Trigger], of_family: Counter[str]) -> Journey:
    own = list(route.triggers)
    if not route.family:
        journey = journey_of(state.network, route, [], state.spec, in_order=False, heights=state.heights)
        route = replace(route, family=family_on_way(journey, triggers))
    near = own or [trigger for trigger in triggers if trigger.family == route.family]
    in_order = not own and len(near) == of_family[route.family]
    return journey_of(state.network, route, near, state.spec, in_order=in_order, heights=state.heights)


def _wrong(journey: Journey) -> str:
    """Why a route is not on the map, as far as its places say; empty where it is."""
    if journey.start_off_m > NEAR_M:
        return f"the ego would start {journey.start_off_m:.1f} m from its place"
    if journey.finish_m <= _LEAST_WAY_M:
        return "its end is where it starts"
    return ""


def _undrivable(state: Import, journey: Journey) -> str:
    """Why nobody arrives on a route's line; empty where one can."""
    if turns_back(journey):
        return "its way goes over lanes of the map that run backwards"
    depth_m, x, y = strays(state.network, journey)
    if depth_m > 0:
        return f"its way leaves the road at ({x:.0f} m, {y:.0f} m) by {depth_m:.1f} m"
    return ""


def _place(trigger: Trigger) -> tuple[str, int, int]:
    """A trigger's family and place, to the metre: CARLA's files repeat some."""
    return trigger.family, round(trigger.pose.x), round(trigger.pose.y)


def _tell_places(state: Import, journeys: Sequence[Journey], triggers: Sequence[Trigger]) -> None:
    used = {_place(j.trigger) for j in journeys if j.trigger is not None}
    of_known = {j.route.town for j in journeys if j.route.town}
    for town, count in Counter(t.town for t in triggers if t.town and of_known and t.town not in of_known).items():
        state.left_out[f"triggers in {town}"] += count
    here = [t for t in triggers if not t.town or not of_known or t.town in of_known]
    state.left_out["triggers that no case uses (each stages one)"] += sum(_place(t) not in used for t in here)
    moved = [journey.start_off_m for journey in journeys if journey.start_off_m > MISSED_M]
    if moved:
        state.notes.append(
            f"routes that start beside CARLA's place (at most {max(moved):.1f} m): {len(moved)}; their map was another"
        )
    without = sum(journey.trigger is None for journey in journeys)
    if without and triggers:
        state.notes.append(
            f"routes without a trigger within 5 m, where what happens is placed from the start: {without}"
        )
    state.left_out["goals beside the lane that the ego comes on (the goal is a length along its route)"] += sum(
        math.dist(j.line.at(j.goal_s)[:2], (j.route.end.x, j.route.end.y)) > BESIDE_GOAL_M for j in journeys
    )
