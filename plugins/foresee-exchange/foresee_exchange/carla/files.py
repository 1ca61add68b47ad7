"""Readers of CARLA's leaderboard files: routes (XML), scenario triggers (JSON), blueprints as vTypes (XML).

CARLA's world is left-handed: y points south, yaw turns clockwise, in degrees. All results here are right-handed:
y = -y_carla, heading = -yaw.
"""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_dsl.compile.foreign.opendrive_geometry import Pose
from foresee_dsl.compile.nets.safe_xml import parse_xml, unreadable
from foresee_dsl.compile.roads.polyline import XY, wrap
from foresee_dsl.exchange.outcome import ExchangeError
from foresee_dsl.files import read_outside
from foresee_exchange.naming import sentence

_LISTS = ("waypoints", "positions")
"""Elements that contain a route's places in newer files."""
_FAMILY = re.compile(r"[Ss]cenario_?(\d{1,3})(?!\d)")
_LEVEL_DEG = 0.5
"""Pitch and roll up to this value, in degrees, count as level (ours: rounding in CARLA's recorder)."""
_LEVEL_M = 0.5
"""If no place of a file is higher than this, m, its heights are ignored, because CARLA's older route files have 0
everywhere (ours)."""
_DENSE_M = 15.0
"""A place without a yaw gets the direction to the next place if that is at most this far away, m (ours: then there is
no corner in between)."""
_NAMES = {
    "3": ("DynamicObjectCrossing", "ParkingCrossingPedestrian", "PedestrianCrossing"),
    "4": ("VehicleTurningRoute", "VehicleTurningRoutePedestrian"),
    "7": ("OppositeVehicleRunningRedLight", "OppositeVehicleTakingPriority"),
    "8": ("SignalizedJunctionLeftTurn", "NonSignalizedJunctionLeftTurn"),
    "9": ("SignalizedJunctionRightTurn", "NonSignalizedJunctionRightTurn"),
}
"""Names of the families in leaderboard 2.0: classes of scenario_runner, which we have assigned to families."""
_FAMILY_OF = {name: family for family, names in _NAMES.items() for name in names}


@dataclass(frozen=True)
class Trigger:
    """The place at which a scenario of a family starts. `order`: its index in its file."""

    family: str
    town: str
    pose: Pose
    file: Path
    order: int


@dataclass(frozen=True)
class CarlaRoute:
    """A route.

    Attributes:
        id: its name in the file. town: such as `Town10HD`, or empty. family: such as `3`; empty if unknown.
        start, end: its first and last place. between: the places in between.
        file: the route file. order: the route's index in it.
        triggers: triggers inside the route, in newer files.
    """

    id: str
    town: str
    family: str
    start: Pose
    end: Pose
    file: Path
    order: int
    between: tuple[Pose, ...] = ()
    triggers: tuple[Trigger, ...] = ()

    @property
    def key(self) -> str:
        """Return the name of the route in messages."""
        return f"route {self.id} of {self.file.name}"


def pose_of(x: float, y: float, yaw_deg: float, z: float | None = None) -> Pose:
    """Return a place of CARLA in our coordinates; a yaw of NaN means an unknown direction."""
    return Pose(x, -y, math.nan if math.isnan(yaw_deg) else wrap(math.radians(-yaw_deg)), z)


def read_routes(path: Path, left_out: Counter[str]) -> tuple[CarlaRoute, ...]:
    """Read a route file of the older or the newer leaderboard.

    Args:
        path: `<routes><route id town><waypoint x y z pitch roll yaw/>...`, or `<waypoints><position x y z/>...` and
            `<scenarios><scenario type><trigger_point x y z yaw/>...`.
        left_out: receives the counts of everything that is left out.

    Raises:
        CompileError: the file is unreadable, too large, not XML, or declares entities.
        ExchangeError: the file has no complete route, or two routes of one id.
    """
    root = parse_xml(path, "routes", "a CARLA route file")
    routes = []
    short: list[str] = []
    high = any(abs(_number_in(point, "z")) > _LEVEL_M for route in root.iterfind("route") for point in _points(route))
    for order, element in enumerate(root.iterfind("route")):
        name = element.get("id", str(order))
        places = [_waypoint(path, name, point, high=high) for point in _points(element)]
        _count_left_out(element, left_out)
        if len(places) < 2:
            short.append(f"{path}: route {name} has {len(places)} waypoints; it needs a start and an end")
            continue
        routes.append(_route(element, name, _directed(places), path, order, left_out))
    if not routes:
        raise ExchangeError(short[0] if short else f"{path} contains no routes")
    if short:
        left_out["routes with less than two waypoints"] += len(short)
    twice = [name for (_, name), count in Counter((r.town, r.id) for r in routes).items() if count > 1]
    if twice:
        raise ExchangeError(f"{path} has two routes with the id {twice[0]}; give one of them another")
    return tuple(routes)


def _route(
    element: Element, name: str, places: Sequence[Pose], path: Path, order: int, left_out: Counter[str]
) -> CarlaRoute:
    town = town_in(element.get("town", element.get("map", "")))
    triggers = []
    for number, scenario in enumerate(element.iterfind("scenarios/scenario")):
        kind = scenario.get("type", "")
        point = scenario.find("trigger_point")
        if not family_of(kind) or point is None:
            left_out[f"scenarios of routes: {kind or 'without a type'}"] += 1
            continue
        triggers.append(Trigger(family_of(kind), town, _waypoint(path, name, point, high=True), path, number))
    family = _family(path) or next((trigger.family for trigger in triggers), "")
    others = sum(trigger.family != family for trigger in triggers)
    if others:
        left_out["scenarios of routes besides the first family's (a case stages one)"] += others
    return CarlaRoute(name, town, family, places[0], places[-1], path, order, tuple(places[1:-1]), tuple(triggers))


def family_of(kind: str) -> str:
    """Return the family of a scenario's type: of `Scenario7`, or of a name in a newer leaderboard; empty if unknown."""
    return _number(kind) or _FAMILY_OF.get(kind, "")


def _points(route: Element) -> Iterator[Element]:
    """Yield the elements that contain a route's places, in order."""
    for child in route:
        if child.tag == "waypoint":
            inner = child.find("position")
            yield child if inner is None or "x" in child.attrib else inner
        elif child.tag == "position":
            yield child
        elif child.tag in _LISTS:
            yield from _points(child)


def _directed(places: Sequence[Pose]) -> list[Pose]:
    """Return the places; a place without a direction gets the direction to the next one, if that is near."""
    poses = list(places)
    for k, (here, there) in enumerate(pairwise(places)):
        dx, dy = there.x - here.x, there.y - here.y
        if 0 < math.hypot(dx, dy) <= _DENSE_M:
            towards = math.atan2(dy, dx)
            for at in (k, k + 1) if k == len(places) - 2 else (k,):
                if math.isnan(places[at].heading_rad):
                    poses[at] = replace(places[at], heading_rad=towards)
    return poses


def read_triggers(path: Path, left_out: Counter[str]) -> tuple[Trigger, ...]:
    """Read a trigger file; arguments and errors as in `read_routes`."""
    data = _json(path)
    triggers: list[Trigger] = []
    try:
        for towns in data["available_scenarios"]:
            for town, scenarios in towns.items():
                for scenario in scenarios:
                    kind = str(scenario.get("scenario_type", "") or "")
                    family = family_of(kind) if kind else _family(path)
                    events = scenario["available_event_configurations"]
                    if not family:
                        left_out[f"triggers of the unknown kind {sentence(kind) or 'without a name'}"] += len(events)
                    for event in events:
                        triggers.append(
                            Trigger(family, town_in(town), _transform(event["transform"]), path, len(triggers))
                        )
                        if event.get("other_actors"):
                            left_out["actors that a trigger names (`other_actors`)"] += 1
    except (KeyError, TypeError, ValueError, AttributeError) as err:
        raise ExchangeError(
            f"{path} is not a CARLA trigger file (available_scenarios > TOWN > available_event_configurations > "
            f"transform): {type(err).__name__} {err}"
        ) from err
    return tuple(triggers)


def read_vtypes(path: Path) -> tuple[dict[str, str], ...]:
    """Return the attributes of the vehicle types in a SUMO file, in its order; errors as in `read_routes`."""
    types = tuple(dict(element.attrib) for element in parse_xml(path, "routes", "a SUMO file of types").iter("vType"))
    if not types:
        raise ExchangeError(f"{path} contains no vType")
    return types


def offset_of(net: Element) -> XY:
    """Return the offset by which a SUMO net's coordinates were moved, m; `ValueError` if it is not a pair of
    numbers."""
    location = net.find("location")
    x, y = (float(part) for part in (location.get("netOffset", "0,0") if location is not None else "0,0").split(","))
    return x, y


def town_of(path: Path) -> str:
    """Return the town in a map's file name (`Town10HD`), or an empty string."""
    return town_in(path.name)


def town_in(text: str) -> str:
    """Return the town in a text: `Town10HD` for `Carla/Maps/Town10HD_Opt`; without a town name, the text itself.

    A file name without a town name gives an empty string.
    """
    match = re.search(r"Town\d+[A-Z]*", text)
    return match.group() if match else "" if "." in text else text


def _waypoint(path: Path, route: str, element: Element, *, high: bool) -> Pose:
    """Return a place. In newer files the yaw may be missing; the lane then gives the direction.

    `high`: whether heights are meaningful.
    """
    try:
        x, y = (float(element.attrib[key]) for key in ("x", "y"))
        yaw = float(element.get("yaw", "nan"))
        z = float(element.get("z", "nan")) if high else math.nan
    except KeyError as err:
        raise ExchangeError(f"{path}: a waypoint of route {route} has no {err}") from err
    except ValueError as err:
        raise ExchangeError(f"{path}: a waypoint of route {route} is not a number: {err}") from err
    if not (math.isfinite(x) and math.isfinite(y)) or math.isinf(yaw):
        raise ExchangeError(f"{path}: a waypoint of route {route} is not finite")
    return pose_of(x, y, yaw, z if math.isfinite(z) else None)


def _count_left_out(route: Element, left_out: Counter[str]) -> None:
    for point in _points(route):
        left_out["heights of waypoints (the world is flat)"] += abs(_number_in(point, "z")) > _LEVEL_M
        turned = any(abs(_number_in(point, key) + 180) % 360 - 180 > _LEVEL_DEG for key in ("pitch", "roll"))
        left_out["pitch and roll of waypoints (the world is flat)"] += turned
    for child in route:
        if child.tag not in ("waypoint", "position", "scenarios", *_LISTS):
            left_out[f"<{child.tag}> of routes"] += 1
    for gone in [what for what, count in left_out.items() if count == 0]:
        del left_out[gone]


def _number_in(element: Element, key: str) -> float:
    try:
        return float(element.get(key, "0"))
    except ValueError:
        return 0.0


def _transform(values: dict[str, Any]) -> Pose:
    x, y = (float(values[key]) for key in ("x", "y"))
    yaw = float(values["yaw"]) if "yaw" in values else math.nan
    if not (math.isfinite(x) and math.isfinite(y)) or math.isinf(yaw):
        raise ValueError("a transform is not finite")
    return pose_of(x, y, yaw)


def _json(path: Path) -> dict[str, Any]:
    try:
        data = json.loads(read_outside(path))
    except json.JSONDecodeError as err:
        raise ExchangeError(f"{path} is not a CARLA trigger file: it is not JSON from line {err.lineno} on") from err
    except OSError as err:
        raise unreadable(path, err, ExchangeError) from err
    except (ValueError, RecursionError) as err:
        raise ExchangeError(f"{path} is not a CARLA trigger file: {err}") from err
    if not isinstance(data, dict):
        raise ExchangeError(f"{path} is not a CARLA trigger file: its content is not an object")
    return data


def _family(path: Path) -> str:
    return _number(path.stem) or _number(path.parent.name)


def _number(text: str) -> str:
    match = _FAMILY.search(text)
    return str(int(match.group(1))) if match else ""
