"""Export of clips as routes of CARLA's leaderboard: the ego's start and its goal (paper, section 3.3)."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

# Only to build elements; `safe_xml` parses files.
from xml.etree.ElementTree import Element, ElementTree, SubElement, indent

from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.bundle import Scene, SumoBundle
from foresee_dsl.compile.nets.safe_xml import parse_net
from foresee_dsl.compile.placement.scene import DRY_FRICTION
from foresee_dsl.exchange.outcome import ExchangeError, Imported, import_together
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.project.loading import Project
from foresee_exchange.carla.files import offset_of

ROUTE_FORMATS = ("0.9.10", "0.9.15")
"""Route files by the version of CARLA whose leaderboard reads them: `<waypoint>` elements with poses in leaderboard 1
(0.9.10), `<waypoints>`, `<scenarios>` and `<weathers>` in leaderboard 2 and today's scenario_runner (0.9.15)."""
_LOW_SUN_DEG, _HIGH_SUN_DEG = 9.0, 70.0
"""The altitude of a low sun, which dazzles (ours: as in exported OpenSCENARIO), and scenario_runner's default."""
_DIGITS = 6
"""Decimals of metres and degrees (as in CARLA's own route files)."""


def run(
    addresses: Sequence[str],
    *,
    out: Path,
    town: str = "",
    route_format: str = ROUTE_FORMATS[0],
    allow_outside: bool = True,
) -> Imported:
    """Write a route file with one route per test case, in the given order; their ids count from 0.

    Args:
        addresses: clips, mutants or test cases, whose networks are CARLA's maps.
        out: the file, `.xml`.
        town: CARLA's name of the map; by default the network's file name up to its first dot.
        route_format: one of `ROUTE_FORMATS`.
        allow_outside: see `project.load_test_case`.

    Raises:
        ExchangeError: `out` cannot be written, the format is unknown, or the town is unknown.
        InputError, CompileError: a test case has errors.
    """
    if out.suffix != ".xml":
        raise ExchangeError(f"{out} cannot be the name of a route file: it must end in .xml")
    if route_format not in ROUTE_FORMATS:
        raise ExchangeError(f"there is no format {route_format}: write {' or '.join(ROUTE_FORMATS)}")
    project = Project(allow_outside=allow_outside)
    left_out: Counter[str] = Counter()
    routes = Element("routes")
    for number, address in enumerate(addresses):
        case = project.test_case(address)
        bundle = compile_test_case(case)
        route = SubElement(routes, "route", {"id": str(number), "town": town or _town(case)})
        if route_format == ROUTE_FORMATS[0]:
            for x, y, heading_rad in _waypoints(bundle):
                SubElement(route, "waypoint", _waypoint(x, y, heading_rad))
            left_out["weather"] += bool(_weather(bundle.scene))
        else:
            _add_parts(route, bundle)
        left_out["actors besides the ego"] += len(bundle.scene.actors) - 1
        left_out["speeds at the beginning"] += bundle.scene.ego.speed_mps > 0
        left_out["triggers"] += len(bundle.scene.whens)
        left_out["slippery patches"] += len(bundle.scene.slippery)
        left_out["signals' states"] += len(bundle.scene.signals)
    indent(routes)

    def write(folder: Path) -> Imported:
        ElementTree(routes).write(folder / out.name, encoding="UTF-8", xml_declaration=True)
        return Imported(cases=len(addresses), left_out=+left_out)

    return import_together(out.parent, write)


def _add_parts(route: Element, bundle: SumoBundle) -> None:
    """Add the elements that scenario_runner's parser requires: weather, the ends of the route, an empty scenario
    list."""
    if weather := _weather(bundle.scene):
        weathers = SubElement(route, "weathers")
        values = {name: f"{value:g}" for name, value in weather.items()}
        SubElement(weathers, "weather", {"route_percentage": "0", **values})
    waypoints = SubElement(route, "waypoints")
    for x, y, heading_rad in _waypoints(bundle):
        pose = _waypoint(x, y, heading_rad)
        SubElement(waypoints, "position", {axis: pose[axis] for axis in "xyz"})
    SubElement(route, "scenarios")


def _weather(scene: Scene) -> dict[str, float]:
    """Return CARLA's weather values (percent, degrees) for a scene; empty if it is dry and clear."""
    wet = 1 - scene.friction / DRY_FRICTION
    if not (scene.rain or scene.fog or scene.sun or wet > 0):
        return {}
    return {
        "cloudiness": 0.0 if scene.sun else 50.0,
        "precipitation": round(100 * scene.rain, 1),
        "wetness": 100.0 if wet > 0 else 0.0,
        "fog_density": round(100 * scene.fog, 1),
        "sun_altitude_angle": _LOW_SUN_DEG if scene.sun else _HIGH_SUN_DEG,
    }


def _town(case: TestCase) -> str:
    if not isinstance(case.network, Path):
        raise ExchangeError(
            f"the network of {case.id} is not a file of a CARLA map: give the name of the map with --town"
        )
    return case.network.name.partition(".")[0]


def _waypoints(bundle: SumoBundle) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Return the centre of the ego at the start, and its goal: x, y in m of the map, heading in rad."""
    scene = bundle.scene
    ego, line = scene.ego, scene.ego.line
    if line is None:
        raise ExchangeError(f"the ego of {bundle.name} has no route")
    back = ego.model.length_m / 2  # our statement places a vehicle by its front, CARLA's by its centre
    ox, oy = offset_of(parse_net(bundle.net_file))
    start = ego.x - back * math.cos(ego.heading_rad) - ox, ego.y - back * math.sin(ego.heading_rad) - oy
    goal_x, goal_y, goal_heading = line.at(scene.goal_s)
    return (*start, ego.heading_rad), (goal_x - ox, goal_y - oy, goal_heading)


def _waypoint(x: float, y: float, heading_rad: float) -> dict[str, str]:
    """Return the attributes of a route point for CARLA, whose world is left-handed: y points south, and yaw turns
    clockwise, in degrees.
    """
    yaw = math.degrees(math.remainder(-heading_rad, math.tau))
    values = {"x": x, "y": -y, "z": 0.0, "pitch": 0.0, "roll": 0.0, "yaw": yaw}
    return {name: f"{round(value, _DIGITS) + 0.0:.{_DIGITS}f}" for name, value in values.items()}
