"""Routes and triggers of CARLA's kind."""

from __future__ import annotations

import json
import math
from pathlib import Path

from foresee_dsl.compile.roads.network import RoadNetwork


def carla_place(network: RoadNetwork, edge: str, at_m: float, lane: int = 0) -> dict[str, float]:
    """A place on an edge as CARLA would say it."""
    x, y, heading = network.edges[edge].for_kind("car")[lane].line.at(at_m)
    return {"x": x, "y": -y, "z": 0.0, "pitch": 0.0, "roll": 0.0, "yaw": -math.degrees(heading) + 360.0}


def write_routes(path: Path, *ends: tuple[dict[str, float], dict[str, float]], town: str = "Town77") -> Path:
    """A route file with two places a route; ids 10, 20, ..."""

    def point(place: dict[str, float]) -> str:
        return "<waypoint " + " ".join(f'{key}="{value:.6f}"' for key, value in place.items()) + "/>"

    routes = [f'<route id="{10 * k}" town="{town}">{point(a)}{point(b)}</route>' for k, (a, b) in enumerate(ends, 1)]
    path.write_text(f"<routes>{''.join(routes)}</routes>", encoding="utf-8")
    return path


def write_triggers(path: Path, family: str, *places: dict[str, float], town: str = "Town77") -> Path:
    """A trigger file of one family."""
    events = [{"transform": {key: value for key, value in place.items() if key != "roll"}} for place in places]
    scenario = {"available_event_configurations": events, "scenario_type": f"Scenario{family}"}
    path.write_text(json.dumps({"available_scenarios": [{town: [scenario]}]}), encoding="utf-8")
    return path
