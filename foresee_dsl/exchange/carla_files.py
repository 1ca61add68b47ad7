"""Reads CARLA's leaderboard files: routes (XML), scenario triggers (JSON), blueprints as vTypes (XML).

CARLA's world is left-handed: y points south, yaw turns clockwise, in degrees. Everything here is right-handed already:
y = -y_carla, heading = -yaw.
"""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from foresee_dsl.compile.netfile import check_size, parse_xml
from foresee_dsl.compile.polyline import wrap
from foresee_dsl.exchange.outcome import ExchangeError

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element  # the type only; files are parsed by defusedxml

_FAMILY = re.compile(r"[Ss]cenario_?(\d{1,3})(?!\d)")
_LEVEL_DEG = 0.5
"""Pitch and roll up to this are level (ours: roundings of CARLA's recorder)."""


@dataclass(frozen=True)
class Pose:
    """A place with a direction: m (x east, y north), rad counter-clockwise from east."""

    x: float
    y: float
    heading_rad: float


@dataclass(frozen=True)
class CarlaRoute:
    """A route of the ego.

    Attributes:
        id: unique within its file.
        family: the number in the file's name, such as `7`; empty where there is none.
        file: where it was read. order: its place in that file.
    """

    id: str
    town: str
    family: str
    start: Pose
    end: Pose
    file: Path
    order: int

    @property
    def key(self) -> str:
        """How messages call it."""
        return f"route {self.id} of {self.file.name}"


@dataclass(frozen=True)
class Trigger:
    """Where a scenario of a family fires. `order`: its place in its file."""

    family: str
    town: str
    pose: Pose
    file: Path
    order: int


def pose_of(x: float, y: float, yaw_deg: float) -> Pose:
    """Return a place of CARLA in our coordinates."""
    return Pose(x, -y, wrap(math.radians(-yaw_deg)))


def read_routes(path: Path, left_out: Counter[str]) -> tuple[CarlaRoute, ...]:
    """Read a route file.

    Args:
        path: `<routes><route id town><waypoint x y z pitch roll yaw/>...`.
        left_out: gets what is not taken over, with counts.

    Raises:
        CompileError: it is unreadable, too large, no XML, or declares entities.
        ExchangeError: it holds no route, or one that is incomplete.
    """
    root = parse_xml(path, "routes", "a CARLA route file")
    routes = []
    family = _family(path)
    for order, element in enumerate(root.iterfind("route")):
        name = element.get("id", str(order))
        places = [_waypoint(path, name, point) for point in element.iter("waypoint")]
        places += [_waypoint(path, name, point) for point in element.iterfind("waypoints/position")]
        if len(places) < 2:
            raise ExchangeError(f"{path}: route {name} has {len(places)} waypoints; it needs a start and an end")
        _count_left_out(element, len(places), left_out)
        town = element.get("town", "")
        routes.append(CarlaRoute(name, town, family, places[0], places[-1], path, order))
    if not routes:
        raise ExchangeError(f"{path} holds no routes")
    twice = [name for name, count in Counter(route.id for route in routes).items() if count > 1]
    if twice:
        raise ExchangeError(f"{path} has two routes with the id {twice[0]}; give one of them another")
    return tuple(routes)


def read_triggers(path: Path, left_out: Counter[str]) -> tuple[Trigger, ...]:
    """Read a trigger file; arguments and errors as of `read_routes`."""
    data = _json(path)
    found: list[Trigger] = []
    try:
        for towns in data["available_scenarios"]:
            for town, scenarios in towns.items():
                for scenario in scenarios:
                    family = _number(str(scenario.get("scenario_type", ""))) or _family(path)
                    for event in scenario["available_event_configurations"]:
                        found.append(Trigger(family, town, _transform(event["transform"]), path, len(found)))
                        if event.get("other_actors"):
                            left_out["actors that a trigger names (`other_actors`)"] += 1
    except (KeyError, TypeError, ValueError, AttributeError) as err:
        raise ExchangeError(
            f"{path} is not a CARLA trigger file (available_scenarios > TOWN > available_event_configurations > "
            f"transform): {type(err).__name__} {err}"
        ) from err
    return tuple(found)


def read_vtypes(path: Path) -> tuple[dict[str, str], ...]:
    """Return the attributes of the vehicle types in a SUMO file, in its order.

    Raises:
        CompileError: as of `read_routes`.
        ExchangeError: it holds none.
    """
    types = tuple(dict(element.attrib) for element in parse_xml(path, "routes", "a SUMO file of types").iter("vType"))
    if not types:
        raise ExchangeError(f"{path} holds no vType")
    return types


def town_of(path: Path) -> str:
    """Return the town that a map's file name says (`Town10HD`), or an empty string."""
    found = re.match(r"Town\d+[A-Z]*", path.name)
    return found.group() if found else ""


def _waypoint(path: Path, route: str, element: Element) -> Pose:
    try:
        x, y, yaw = (float(element.attrib[key]) for key in ("x", "y", "yaw"))
    except KeyError as err:
        if err.args[0] == "yaw":  # newer route files leave it out: the lane says it
            x, y, yaw = float(element.attrib["x"]), float(element.attrib["y"]), math.nan
        else:
            raise ExchangeError(f"{path}: a waypoint of route {route} has no {err}") from err
    except ValueError as err:
        raise ExchangeError(f"{path}: a waypoint of route {route} is no number: {err}") from err
    if not (math.isfinite(x) and math.isfinite(y)) or math.isinf(yaw):
        raise ExchangeError(f"{path}: a waypoint of route {route} is not finite")
    return Pose(x, -y, math.nan) if math.isnan(yaw) else pose_of(x, y, yaw)


def _count_left_out(route: Element, waypoints: int, left_out: Counter[str]) -> None:
    if waypoints > 2:
        left_out["waypoints between start and end (the shortest way is taken)"] += waypoints - 2
    for point in route.iter("waypoint"):
        left_out["heights of waypoints (the world is flat)"] += _number_in(point, "z") != 0
        turned = any(abs(_number_in(point, key) + 180) % 360 - 180 > _LEVEL_DEG for key in ("pitch", "roll"))
        left_out["pitch and roll of waypoints (the world is flat)"] += turned
    for child in route:
        if child.tag not in ("waypoint", "waypoints"):
            left_out[f"<{child.tag}> of routes"] += 1
    for gone in [what for what, count in left_out.items() if count == 0]:
        del left_out[gone]


def _number_in(element: Element, key: str) -> float:
    try:
        return float(element.get(key, "0"))
    except ValueError:
        return 0.0


def _transform(values: dict[str, Any]) -> Pose:
    x, y, yaw = (float(values[key]) for key in ("x", "y", "yaw"))
    if not all(math.isfinite(value) for value in (x, y, yaw)):
        raise ValueError("a transform is not finite")
    return pose_of(x, y, yaw)


def _json(path: Path) -> dict[str, Any]:
    check_size(path)
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as err:
        raise ExchangeError(f"{path} is not a CARLA trigger file: {err}") from err
    if not isinstance(data, dict):
        raise ExchangeError(f"{path} is not a CARLA trigger file: it holds no object")
    return data


def _family(path: Path) -> str:
    return _number(path.stem) or _number(path.parent.name)


def _number(text: str) -> str:
    found = _FAMILY.search(text)
    return str(int(found.group(1))) if found else ""


def towns(routes: Iterable[CarlaRoute]) -> Iterator[str]:
    """Return the towns that routes name, each once."""
    yield from dict.fromkeys(route.town for route in routes if route.town)
