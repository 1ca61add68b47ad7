"""Writes the files around a net: vehicle types, and a folder that SUMO's own programs open."""

from __future__ import annotations

import math
import shutil
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from shapely import LineString, Point

from foresee_dsl.compile.bundle import ActorKind, ModelSpec, PlacedActor, Signal, SumoBundle
from foresee_dsl.compile.nets.safe_xml import parse_net
from foresee_dsl.compile.nets.signals import write_programs
from foresee_dsl.compile.templates import number, render

GHOST = "ghost"
"""The type of stand-ins for bodies that SUMO does not drive."""
GHOST_SIZE_M = 0.5
"""Ours: about a pedestrian's shoulders; traffic reacts to it as to any vehicle."""

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
"""SUMO's desiredMaxSpeed of cars (10,000 km/h). Bicycles would have 20 km/h, which SUMO multiplies by the speed factor
and takes as a limit, so that a bicycle with a factor for its cruise speed would creep."""
SPEED_SLACK = 0.001
"""Ours: more than what rounding speeds to the millimetre a second does to their ratio."""
STEP_S = 0.05
"""20 steps a second, as in the paper (section 4.2)."""


@dataclass(frozen=True)
class _Departure:
    id: str
    type: str
    color: str
    edges: tuple[str, ...]
    lane: str
    pos: str
    speed: str
    factor: float


@dataclass(frozen=True)
class _Lane:
    """A lane: its centreline, SUMO's length and its speed limit."""

    shape: LineString
    length_m: float
    limit_mps: float


@dataclass(frozen=True)
class _Shape:
    id: str
    type: str
    points: tuple[tuple[float, float], ...]
    fill: bool


def write_types(models: Iterable[ModelSpec], out: Path) -> None:
    """Write SUMO's types: one for each model on wheels, by name, and the ghost.

    Krauss, SUMO's default, is the car-following model: its next step depends on positions and speeds alone, which a
    clip holds (others keep a memory, such as IDMM's level of service). Nothing is left to chance (sigma, speedDev), and
    the changes of lane that depend on hidden sums (keeping right, gaining speed) are off; those for the route remain.
    """
    by_name = {model.name: model for model in models if model.kind in _CLASSES}
    types = [
        {"model": model, "vclass": _CLASSES[model.kind], "min_gap": 1.0 if model.kind in _TWO_WHEELERS else 2.0}
        for _, model in sorted(by_name.items())
    ]
    render("types.add.xml", out, types=types, ghost=GHOST, ghost_size=GHOST_SIZE_M, no_limit=NO_LIMIT_MPS)


def write_sumo_folder(bundle: SumoBundle, out: Path) -> tuple[Path, ...]:
    """Write a test case as a folder for `sumo` and `sumo-gui`: open `scenario.sumocfg`.

    The ego drives like any other vehicle there, and what the scenario triggers does not happen. Bodies that SUMO does
    not drive are drawn as shapes.

    Returns:
        The files, the configuration first.
    """
    out.mkdir(parents=True, exist_ok=True)
    net, types = out / "net.net.xml", out / "types.add.xml"
    shutil.copyfile(bundle.net_file, net)
    shutil.copyfile(bundle.types_file, types)
    actors = bundle.scene.actors
    lanes = _lanes(net, {a.lane for a in actors if a.lane})
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
    )
    return config, net, types, routes, signals, drawn


def _departure(actor: PlacedActor, lanes: Mapping[str, _Lane]) -> _Departure:
    """How SUMO is told to insert a vehicle; one that stands inside a junction starts with its route instead."""
    edge, _, index = actor.lane.rpartition("_")
    edges = _edges(actor)
    on_first = actor.lane in lanes and edge == edges[0]
    pos, speed, factor = "0", "max", 1.0
    if on_first:
        lane = lanes[actor.lane]
        pos = number(lane.shape.project(Point(actor.x, actor.y)) / lane.shape.length * lane.length_m)
        speed_mps = min(actor.speed_mps, actor.model.max_speed_mps)
        speed = number(speed_mps)
        # SUMO refuses to insert what is faster than its factor times the limit.
        factor = max(actor.cruise_mps or lane.limit_mps, speed_mps) / lane.limit_mps + SPEED_SLACK
    return _Departure(
        id=actor.id,
        type=actor.model.name,
        color="red" if actor.control == "ego" else "yellow",
        edges=edges,
        lane=index if on_first else "best",
        pos=pos,
        speed=speed,
        factor=factor,
    )


def _edges(actor: PlacedActor) -> tuple[str, ...]:
    return tuple(edge for edge in actor.route if not edge.startswith(":"))


def _shapes(actor: PlacedActor) -> list[_Shape]:
    """A body's footprint (m, centred on its position), and its path when it has one."""
    c, s = math.cos(actor.heading_rad), math.sin(actor.heading_rad)
    half_length, half_width = actor.model.length_m / 2, actor.model.width_m / 2
    corners = ((1, 1), (-1, 1), (-1, -1), (1, -1), (1, 1))
    box = tuple(
        (actor.x + a * half_length * c - b * half_width * s, actor.y + a * half_length * s + b * half_width * c)
        for a, b in corners
    )
    found = [_Shape(actor.id, actor.model.name, box, True)]
    if len(actor.path) >= 2:
        found.append(_Shape(f"{actor.id}.path", "path", tuple((float(x), float(y)) for x, y in actor.path), False))
    return found


def _passed(signal: Signal, stage: str, elapsed_s: float) -> float:
    """How far into its cycle a signal is when the stage has been on for `elapsed_s`, s."""
    phase, left_s = signal.phase_at(stage, elapsed_s)
    return sum(p.duration_s for p in signal.phases[: phase + 1]) - left_s


def _lanes(net: Path, wanted: set[str]) -> dict[str, _Lane]:
    """Read some lanes of a net, by id."""
    found = {}
    for lane in parse_net(net).iter("lane"):
        name = lane.get("id", "")
        if name in wanted:
            points = [tuple(map(float, p.split(",")[:2])) for p in lane.get("shape", "").split()]
            length_m, limit_mps = float(lane.get("length", "0")), float(lane.get("speed", "0"))
            found[name] = _Lane(LineString(points), length_m, limit_mps)
    return found
