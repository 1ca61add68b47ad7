"""Towns that no bundled case uses (generated ones and CARLA's), and drives through them with random traffic.

Town10HD and Town02 are held out: no driver is trained on them, and `training.evaluate` drives there.
"""

from __future__ import annotations

import itertools
import math
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from foresee_dsl.compile.foreign.networks import foreign_net
from foresee_dsl.compile.nets.net_reader import read_network
from foresee_dsl.compile.nets.netconvert import sumo_home, without_header
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.routing import RouteError
from foresee_dsl.exchange.outcome import write_text
from foresee_dsl.language import model as m

CARLA_TRAINED: Mapping[str, str] = {"Town01": "xodr/Town01.xodr", "Town03": "net/Town03.net.xml"}
CARLA_HELD_OUT: Mapping[str, str] = {"Town02": "xodr/Town02.xodr", "Town10HD": "xodr/Town10HD.xodr"}

_COMMON = ("--crossings.guess", "--walkingareas", "--no-turnarounds", "--default.sidewalk-width", "2.5")
_WALKS = ("--sidewalks.guess", "--sidewalks.guess.max-speed", "20")
_SIGNALS = ("--default-junction-type", "traffic_light")
_RIGHT_FIRST = ("--default-junction-type", "right_before_left")
_PRIORITY = ("--default-junction-type", "priority", "--random-priority")
GENERATED: Mapping[str, tuple[str, ...]] = {
    "grid_signals": ("--grid", "--grid.x-number", "4", "--grid.y-number", "4", "--grid.length", "120",
                     "--grid.attach-length", "70", "-S", "13.89", *_SIGNALS, *_WALKS),
    "grid_two_lanes": ("--grid", "--grid.x-number", "4", "--grid.y-number", "3", "--grid.x-length", "150",
                       "--grid.y-length", "110", "--grid.attach-length", "80", "-L", "2", "-S", "13.89",
                       "--turn-lanes", "1", "--turn-lanes.length", "35", *_SIGNALS, *_WALKS),
    "grid_right_first": ("--grid", "--grid.x-number", "5", "--grid.y-number", "4", "--grid.length", "85",
                         "--grid.attach-length", "60", "-S", "8.33", *_RIGHT_FIRST, *_WALKS),
    "bent_grid": ("--grid", "--grid.x-number", "5", "--grid.y-number", "4", "--grid.length", "100",
                  "--grid.attach-length", "60", "--perturb-x", "norm(0,16)", "--perturb-y", "norm(0,16)",
                  "-L", "2", "--random-lanenumber", "-S", "11.11", "--tls.guess", *_PRIORITY, *_WALKS),
    "spider_signals": ("--spider", "--spider.arm-number", "6", "--spider.circle-number", "3",
                       "--spider.space-radius", "90", "--spider.attach-length", "60", "--spider.omit-center",
                       "-S", "11.11", *_SIGNALS, *_WALKS),
    "spider_priority": ("--spider", "--spider.arm-number", "5", "--spider.circle-number", "3",
                        "--spider.space-radius", "80", "--spider.attach-length", "60", "--spider.omit-center",
                        "-S", "13.89", *_PRIORITY, *_WALKS),
    "random_mixed": ("--rand", "--rand.iterations", "55", "--rand.min-distance", "70", "--rand.max-distance", "160",
                     "--rand.min-angle", "60", "-L", "2", "--random-lanenumber", "-S", "13.89", "--tls.guess",
                     *_PRIORITY, *_WALKS),
    "random_right_first": ("--rand", "--rand.iterations", "60", "--rand.min-distance", "60", "--rand.max-distance",
                           "140", "--rand.min-angle", "60", "-S", "8.33", *_RIGHT_FIRST, *_WALKS),
    "random_signals": ("--rand", "--rand.iterations", "50", "--rand.min-distance", "80", "--rand.max-distance", "150",
                       "--rand.min-angle", "65", "-S", "13.89", *_SIGNALS, *_WALKS),
    "random_no_walks": ("--rand", "--rand.iterations", "45", "--rand.min-distance", "70", "--rand.max-distance",
                        "170", "--rand.min-angle", "60", "-L", "2", "-S", "16.67", *_PRIORITY),
}  # fmt: skip
"""Options of netgenerate: grids, spiders' webs and random towns, with signals, right before left, priority roads."""

SHORTEST_M, LONGEST_M = 220.0, 700.0
_CLEAR_M = 12.0
_LEAST_LIMIT_MPS = 20 / 3.6
_TRIES = 400
_EGOS = ("car.compact", "car.electric", "car.hatchback", "car.sedan", "car.suv", "car.wagon")
_VEHICLES = ("car.compact", "car.sedan", "car.suv", "car.hatchback", "van.delivery", "van.parcel", "truck.light",
             "bus.city", "motorcycle.scooter", "motorcycle.street", "bicycle.city")  # fmt: skip
_WALKERS = ("pedestrian.adult", "pedestrian.hurried", "pedestrian.elderly", "pedestrian.pram", "pedestrian.child")
_TRAFFIC = ((0, 0.2), (8, 0.2), (18, 0.3), (30, 0.3))
"""Numbers of vehicles, with their relative frequencies."""
_WALKING = ((0, 0.3), (6, 0.3), (16, 0.4))
_WET = 0.25
_SIGNAL_S = 35.0
_SLOW_SHARE = 0.4


@dataclass(frozen=True)
class _Streets:
    """The part of a network that random drives need: length and limit of each edge for cars, and the edges after it."""

    lengths: dict[str, float]
    limits: dict[str, float]
    onward: dict[str, tuple[tuple[str, str, bool], ...]]
    """Of each edge the next ones: edge, turn, and whether a signal controls it."""


def generate(name: str, folder: Path, seed: int) -> Path:
    """Return the net file of a generated town; it is generated if it does not exist."""
    file = folder / f"{name}.net.xml"
    if not file.exists():
        folder.mkdir(parents=True, exist_ok=True)
        part = folder / f"{name}.part.net.xml"
        program = sumo_home() / "bin" / "netgenerate"
        command = [str(program), *GENERATED[name], *_COMMON, "--seed", str(seed), "-o", str(part)]
        subprocess.run(command, check=True, capture_output=True, timeout=120)  # noqa: S603  SUMO's own program
        part.write_bytes(without_header(part.read_bytes()))  # the header holds the time and the folder
        part.rename(file)
    return file


@lru_cache(maxsize=2)
def _roads(net_file: Path) -> tuple[RoadNetwork, _Streets]:
    roads = read_network(foreign_net(net_file))
    lanes = {edge.id: edge.drivable[0] for edge in roads.edges.values() if edge.for_kind("car")}
    onward = {
        edge: tuple(
            sorted(
                {(movement.to_edge, movement.turn, movement.tls is not None)
                 for movement in roads.movements_from(edge) if movement.turn != "back" and movement.to_edge in lanes}
            )
        )
        for edge in lanes
    }  # fmt: skip
    lengths = {edge: lane.line.length_m for edge, lane in lanes.items()}
    return roads, _Streets(lengths, {edge: lane.speed_mps for edge, lane in lanes.items()}, onward)


def drive(net_file: Path, name: str, folder: Path, rng: np.random.Generator, *, alone: bool = False) -> Path:
    """Write a scenario of a random drive through a town, with traffic and people (or `alone`), and return its file."""
    roads, streets = _roads(net_file)
    edges, signals = _way(roads, streets, rng)
    limit = streets.limits[edges[0]]
    start_m = math.floor(rng.uniform(_CLEAR_M, max(streets.lengths[edges[0]] - 25.0, _CLEAR_M + 1)))
    goal_m = math.floor(min(streets.lengths[edges[-1]] - _CLEAR_M, rng.uniform(25.0, 90.0)))
    free_s = sum(streets.lengths[edge] / max(streets.limits[edge], 1.0) for edge in edges)
    end_s = 10.0 * math.ceil((free_s / _SLOW_SHARE + _SIGNAL_S * signals + 20.0) / 10.0)
    speed = round(float(rng.uniform(0.0, 0.9)) * limit, 1) if rng.random() < 0.7 else 0.0
    body: list[m.ScenarioItem] = [
        m.Doc(text="A drive through a town."),
        m.UseNetwork(path=net_file.resolve().as_posix()),
        m.Ego(
            model=str(rng.choice(_EGOS)),
            body=(
                m.EdgeRoute(edges=edges),
                m.StartAt(place=m.AlongEdge(edge=edges[0], at=m.Quantity.of(start_m, "length", 0))),
                m.StartSpeed(speed=m.Quantity.of(speed, "speed", 1)),
                m.GoalAt(place=m.AlongEdge(edge=edges[-1], at=m.Quantity.of(goal_m, "length", 0))),
            ),
        ),
    ]
    if not alone:
        body += _others(roads, rng)
        if rng.random() < _WET:
            rain, wet = (m.Quantity.of(float(rng.uniform(0.1, 0.8)), "ratio", 1) for _ in range(2))
            body.append(m.Weather(rain=rain, wetness=wet))
    body.append(m.Expect(mode="eventually", condition=m.Predicate(what="arrived", actor="ego")))
    body.append(m.End(after=m.Quantity.of(end_s, "time", 0)))
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / f"{name}.foresee"
    write_text(file, m.Scenario(name=name, body=tuple(body)))
    return file


def _way(roads: RoadNetwork, streets: _Streets, rng: np.random.Generator) -> tuple[tuple[str, ...], int]:
    """Return a random route, with turns preferred, and the number of signals on it."""
    starts = sorted(e for e, length in streets.lengths.items() if length >= 40.0 and streets.onward[e])
    for _ in range(_TRIES):
        edges, signals = [starts[int(rng.integers(len(starts)))]], 0
        length, wanted = 0.5 * streets.lengths[edges[0]], rng.uniform(SHORTEST_M, LONGEST_M)
        while length < wanted:
            ways = [street for street in streets.onward[edges[-1]] if street[0] not in edges]
            if not ways:
                break
            weights = np.array([1.0 if turn == "straight" else 1.6 for _, turn, _ in ways])
            edge, _, signal = ways[int(rng.choice(len(ways), p=weights / weights.sum()))]
            edges.append(edge)
            signals += signal
            length += streets.lengths[edge]
        slowest = min(streets.limits[edge] for edge in edges)
        if length < SHORTEST_M or slowest < _LEAST_LIMIT_MPS or streets.lengths[edges[-1]] < 40.0:
            continue
        try:
            roads.line(tuple(edges))
        except RouteError:
            continue
        return tuple(edges), signals
    raise ValueError("this network has no way that is long enough")


def _others(roads: RoadNetwork, rng: np.random.Generator) -> list[m.ScenarioItem]:
    items: list[m.ScenarioItem] = []
    vehicles = [name for name in _VEHICLES if not name.startswith("bicycle") or _any(roads, "bicycle")]
    for name, counts, models, within_m in (
        ("others", _TRAFFIC, vehicles, 140),
        ("walkers", _WALKING, list(_WALKERS), 50),
    ):
        count = int(rng.choice([n for n, _ in counts], p=[share for _, share in counts]))
        if count == 0 or (name == "walkers" and not _walked(roads)):
            continue
        items.append(
            m.Traffic(
                name=name,
                count=m.Quantity.of(count, "count", 0),
                models=tuple(models),
                within=m.Quantity.of(within_m, "length", 0),
                seed=m.Quantity.of(int(rng.integers(1, 10_000_000)), "count", 0),
            )
        )
    return items


def _any(roads: RoadNetwork, kind: str) -> bool:
    return any(kind in lane.kinds for lane in roads.lanes.values())


def _walked(roads: RoadNetwork) -> bool:
    return any(lane.kinds == {"pedestrian"} and not lane.internal for lane in roads.lanes.values())


def town_names(carla: Path | None) -> tuple[str, ...]:
    """Return the towns for training; CARLA's only if its maps exist."""
    own = tuple(CARLA_TRAINED) if carla is not None else ()
    return tuple(itertools.chain(GENERATED, own))


def net_of(town: str, folder: Path, carla: Path | None, seed: int) -> Path:
    """Return the network file of a town by its name."""
    if town in GENERATED:
        return generate(town, folder, seed)
    files = {**CARLA_TRAINED, **CARLA_HELD_OUT}
    if carla is None or town not in files:
        raise ValueError(f"there is no town {town!r}")
    return carla / "maps" / files[town]
