"""Writes SUMO's files for a net: the vehicle types, and a folder that SUMO's own programs can open."""

from __future__ import annotations

import shutil
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from types import MappingProxyType

from shapely import Point

from foresee_dsl.compile.bundle import ActorKind, ModelSpec, PlacedActor, Signal, SumoBundle, passing_type
from foresee_dsl.compile.nets.signals import write_programs
from foresee_dsl.compile.placement.checks import footprint
from foresee_dsl.compile.roads.topology import Lane
from foresee_dsl.compile.templates import number, render, rendered
from foresee_dsl.kernels.constants import STEP_S

GHOST = "ghost"
"""Vehicle type of the stand-ins for actors that SUMO does not drive."""
GHOST_SIZE_M = 0.5
"""Length and width of a stand-in, m. Ours: about the width of a pedestrian's shoulders. Traffic reacts to a stand-in as
to any vehicle.
"""

_CLASSES: Mapping[ActorKind, str] = MappingProxyType(
    {
        "car": "passenger",
        "van": "delivery",
        "truck": "truck",
        "bus": "bus",
        "motorcycle": "motorcycle",
        "bicycle": "bicycle",
    }
)
_TWO_WHEELERS = ("motorcycle", "bicycle")
NO_LIMIT_MPS = 2777.78
"""SUMO's `desiredMaxSpeed` for all types, m/s: its default for cars (10,000 km/h). SUMO 1.28 limits speeds to the
product of this and the speed factor; with a bicycle's default of 20 km/h and the factor for its cruise speed, it would
be much too slow."""
SPEED_SLACK = 0.001
"""Amount added to speed factors (ours: more than rounding speeds to 1 mm/s changes their ratio)."""
LATERAL_RESOLUTION_M = 0.2
"""Width of SUMO's sublanes in a scenario with an actor that passes within its lane, m. Ours: a bicycle of 0.65 m passes
a car of 1.8 m in a lane of 3.5 m with each of the widths 0.1, 0.2, 0.4 and 0.8 m. In a lane of 3.2 m it passes only
with 0.1 m, and is then 5 cm away from the car.
"""
SIDEWAYS_MPS2 = 20.0
"""Lateral acceleration and braking of SUMO's vehicles in a scenario with an actor that passes within its lane, m/s^2.
Ours: they reach SUMO's lateral speed of 1 m/s within one step, so that the next step depends only on positions and
speeds, which a clip holds. With SUMO's 1 m/s^2 a clip cut while a bicycle moves aside was off by 0.9 to 1.5 m within 8
s; with this by less than 0.1 mm.
"""
_SUBLANES: Mapping[str, float] = MappingProxyType(
    {
        "maxSpeedLat": 1.0,  # SUMO's default, and the lateral speed of our lane changes (`kernels.sumo_traffic`)
        "lcAccelLat": SIDEWAYS_MPS2,
        "lcMaxSpeedLatStanding": 0.0,  # a standing vehicle does not slide
        "lcMaxSpeedLatFactor": 0.25,  # share of the speed, as in our lane changes
    }
)


def types_of(models: Iterable[ModelSpec], passing: Collection[str] = ()) -> str:
    """Return SUMO's file of vehicle types: one for each model on wheels, in the order of names, and the stand-in's.

    The car-following model is Krauss, SUMO's default, because its next step depends only on positions and speeds,
    which a clip holds (other models have a memory, such as IDMM's level of service). Randomness is off (sigma,
    speedDev), and so are lane changes that depend on sums inside SUMO (keeping right, gaining speed); lane changes for
    the route remain. `passing`: the models of actors that pass within their lanes; each has a second type, which keeps
    to the right, and all types have the parameters of SUMO's sublane model. The first types have no lateral gap: SUMO
    would move a standing car aside for a bicycle that passes it (measured: by 0.2 m).
    """
    by_name = {model.name: model for model in models if model.kind in _CLASSES}
    sideways = _SUBLANES if passing else {}
    types: list[dict[str, object]] = []
    for name, model in sorted(by_name.items()):
        min_gap = 1.0 if model.kind in _TWO_WHEELERS else 2.0
        type_ = {"model": model, "vclass": _CLASSES[model.kind], "min_gap": min_gap, "sideways": sideways}
        types.append({"id": name, **type_, "sideways": {**sideways, "minGapLat": 0} if passing else {}})
        if name in passing:
            types.append({"id": passing_type(name), **type_, "sideways": {**sideways, "latAlignment": "right"}})
    return rendered("types.add.xml", types=types, ghost=GHOST, ghost_size=GHOST_SIZE_M, no_limit=NO_LIMIT_MPS)


def write_sumo_folder(bundle: SumoBundle, out: Path) -> tuple[Path, ...]:
    """Write a test case as a folder for `sumo` and `sumo-gui`; return its files, `scenario.sumocfg` first.

    In SUMO, the ego drives like any other vehicle, and triggers have no effect. Actors that SUMO does not drive are
    drawn as shapes.
    """
    out.mkdir(parents=True, exist_ok=True)
    net, types = out / "net.net.xml", out / "types.add.xml"
    shutil.copyfile(bundle.net_file, net)
    shutil.copyfile(bundle.types_file, types)
    actors = bundle.scene.actors
    lanes = bundle.network.lanes
    departures = [_departure(a, lanes) for a in actors if a.control in ("ego", "sumo") and _edges(a)]
    routes = render("routes.rou.xml", out / "routes.rou.xml", vehicles=departures)
    shapes = [shape for a in actors if a.control in ("path", "static") for shape in _shapes(a)]
    drawn = render("shapes.add.xml", out / "shapes.add.xml", shapes=shapes)
    starts = {bundle.signals[j].tls: (bundle.signals[j], stage, elapsed) for j, stage, elapsed in bundle.scene.signals}
    signals = out / "signals.add.xml"
    offsets = {tls: -_passed(*start) for tls, start in starts.items()}
    write_programs([signal for signal, _, _ in starts.values()], signals, program_id="from_file", offsets=offsets)
    config = render(
        "scenario.sumocfg",
        out / "scenario.sumocfg",
        net=net.name,
        routes=routes.name,
        additional=[types.name, signals.name, drawn.name],
        end_s=bundle.scene.end_s,
        step_s=STEP_S,
        lateral_m=LATERAL_RESOLUTION_M if bundle.scene.has_sublanes else None,
    )
    return config, net, types, routes, signals, drawn


def _departure(actor: PlacedActor, lanes: Mapping[str, Lane]) -> dict[str, object]:
    """Return how SUMO inserts a vehicle; if it is inside a junction, then at the beginning of its route instead."""
    edge, _, index = actor.lane.rpartition("_")
    edges = _edges(actor)
    where: dict[str, object] = {"lane": "best", "pos": "0", "speed": "max", "factor": 1.0}
    if actor.lane in lanes and edge == edges[0]:
        lane = lanes[actor.lane]
        pos = lane.centreline.project(Point(actor.x, actor.y)) / lane.centreline.length * lane.length_m
        speed = min(actor.speed_mps, actor.model.max_speed_mps)
        # SUMO 1.28 does not insert a vehicle that is faster than its factor times the limit
        factor = max(actor.cruise_mps or lane.speed_mps, speed) / lane.speed_mps + SPEED_SLACK
        where = {"lane": index, "pos": number(pos), "speed": number(speed), "factor": factor}
    color = "red" if actor.control == "ego" else "yellow"
    return {"id": actor.id, "type": actor.sumo_type, "color": color, "edges": edges, **where}


def _edges(actor: PlacedActor) -> tuple[str, ...]:
    return tuple(edge for edge in actor.route if not edge.startswith(":"))


def _shapes(actor: PlacedActor) -> list[dict[str, object]]:
    """Return the shapes of an actor's footprint and of its path, if it has one."""
    shapes: list[dict[str, object]] = [
        {"id": actor.id, "type": actor.model.name, "points": (*(box := footprint(actor)), box[0]), "fill": True}
    ]
    if len(actor.path) >= 2:
        shapes.append({"id": f"{actor.id}.path", "type": "path", "points": actor.path, "fill": False})
    return shapes


def _passed(signal: Signal, stage: str, elapsed_s: float) -> float:
    """Return the time since the beginning of a signal's cycle, s, if a stage has lasted for `elapsed_s`."""
    phase, left_s = signal.phase_at(stage, elapsed_s)
    return sum(p.duration_s for p in signal.phases[: phase + 1]) - left_s
