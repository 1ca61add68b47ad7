"""Writes the benchmark's scene as files for other tools: SUMO's network, state and routes, and an OpenDRIVE map."""

from __future__ import annotations

import shutil
from pathlib import Path

import libsumo
from foresee_exchange.maps.opendrive import opendrive_of
from jinja2 import Environment, FileSystemLoader, StrictUndefined

from benchmarks.bench_engine import CHILD_S, SOURCE, _state_of, child_of
from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.trace import STEP_S
from foresee_dsl.simulate.world import World

STEPS = round(CHILD_S / STEP_S)
NAME = "scene"
_TEMPLATES = Environment(
    loader=FileSystemLoader(Path(__file__).parent / "templates"), undefined=StrictUndefined, autoescape=True
)


def write_scene(folder: Path) -> SumoBundle:
    """Write the child's network, types, state, routes, a configuration, and `map.xodr`; return the child itself."""
    folder.mkdir(parents=True, exist_ok=True)
    child = child_of(folder)
    shutil.copy(child.net_file, folder / f"{NAME}.net.xml")
    shutil.copy(child.types_file, folder / "types.xml")
    _state_of(child, folder)
    files = {"net": f"{NAME}.net.xml", "routes": f"{NAME}.vehicles.rou.xml"}
    routes = _TEMPLATES.get_template("scene.rou.xml").render(vehicles=_vehicles())
    (folder / files["routes"]).write_text(routes, encoding="utf-8")
    config = _TEMPLATES.get_template("scene.sumo.cfg").render(**files)
    (folder / f"{NAME}.sumo.cfg").write_text(config, encoding="utf-8")
    World.close_shared()
    network = load_test_case(str(folder / SOURCE), allow_outside=True).network
    (folder / "map.xodr").write_bytes(opendrive_of(network, child.net_file))
    return child


def _vehicles() -> list[dict[str, object]]:
    """Return the places of all vehicles in SUMO's current state; a vehicle inside a junction starts behind it."""
    vehicles: list[dict[str, object]] = []
    vehicle = libsumo.vehicle
    for name in vehicle.getIDList():
        edges = vehicle.getRoute(name)[max(vehicle.getRouteIndex(name), 0) :]
        inside = vehicle.getRoadID(name).startswith(":")
        ahead = edges[1:] if inside and len(edges) > 1 else edges
        vehicles.append({
            "id": name,
            "at_m": "base" if inside else round(vehicle.getLanePosition(name), 2),
            "edges": " ".join(ahead),
        })  # fmt: skip
    return vehicles
