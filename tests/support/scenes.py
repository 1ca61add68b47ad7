"""Scenes on a small town for the simulation tests, put together by hand."""

from __future__ import annotations

import math
import random
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from foresee_dsl.compile.bundle import ModelSpec, Phase, PlacedActor, Scene, Signal, SumoBundle
from foresee_dsl.compile.nets.net_reader import read_network
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.drivers.protocol import Control, Mission, Observation, VehicleLimits
from foresee_dsl.simulate.trace import Trace
from tests.support.worlds import ADULT, COMPACT, CRATE, VAN


class Cruise:
    """A driver that keeps a speed and its wheel straight."""

    name = "cruise"
    version = "1"

    def __init__(self, speed_mps: float = 0.0) -> None:
        self.speed_mps = speed_mps
        self.seen: list[Observation] = []

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        self.seen.clear()

    def step(self, observation: Observation) -> Control:
        self.seen.append(observation)
        error = self.speed_mps - observation.ego.speed_mps
        return Control(0.0, min(max(error, 0.0), 1.0), min(max(-error, 0.0), 1.0))


class LaneKeeper(Cruise):
    """A driver that follows the centreline at a speed and sees nobody; what it does hangs on what it sees only."""

    name = "lane_keeper"

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        super().reset(mission, vehicle, seed)
        self._line, self._vehicle = mission.centreline, vehicle

    def step(self, observation: Observation) -> Control:
        ego = observation.ego
        gaps = np.hypot(*(self._line - (ego.x, ego.y)).T)
        k = min(int(gaps.argmin()) + 6, len(self._line) - 1)
        x, y = self._line[k] - (ego.x, ego.y)
        angle = math.remainder(math.atan2(y, x) - ego.heading_rad, math.tau)
        steer = math.atan(2 * self._vehicle.wheelbase_m * math.sin(angle) / max(math.hypot(x, y), 1.0))
        pedals = super().step(observation)
        return Control(steer / self._vehicle.steer_max_rad, pedals.throttle, pedals.brake)


class Town:
    """A network with its signals, on which scenes are placed."""

    def __init__(self, net: Path) -> None:
        self.net, self.types = net, net.with_name("types.add.xml")
        self.network = read_network(net)
        self.signals = {tls.attrib["id"]: _signal(tls) for tls in ElementTree.parse(net).getroot().iterfind("tlLogic")}

    def vehicle(
        self,
        name: str,
        edges: Sequence[str],
        at_m: float,
        *,
        speed: float = 8.0,
        cruise: float = 13.0,
        model: ModelSpec = COMPACT,
        lane_index: int = 1,
        **more: Any,
    ) -> PlacedActor:
        """A vehicle whose front is `at_m` along the lane (0 is the sidewalk) of its first edge."""
        lane = self.network.edges[edges[0]].lanes[lane_index]
        x, y, heading = lane.line.at(at_m)
        return PlacedActor(
            id=name,
            model=model,
            control=more.pop("control", "sumo"),
            x=x,
            y=y,
            heading_rad=heading,
            speed_mps=speed,
            cruise_mps=cruise,
            lane=lane.id,
            route=tuple(edges),
            line=self.network.line(tuple(edges), start_lane=lane.id),
            **more,
        )

    def ego(self, edges: Sequence[str], at_m: float, **more: Any) -> PlacedActor:
        """The ego."""
        return self.vehicle("ego", edges, at_m, control="ego", **more)

    def walker(self, name: str, path: Iterable[tuple[float, float]], *, speed: float = 1.4, **more: Any) -> PlacedActor:
        """A pedestrian at the beginning of a path."""
        points = np.array(list(path), dtype=np.float64)
        heading = math.atan2(*(points[1] - points[0])[::-1])
        return PlacedActor(
            id=name,
            model=ADULT,
            control="path",
            x=float(points[0, 0]),
            y=float(points[0, 1]),
            heading_rad=heading,
            speed_mps=0.0 if more.get("waits") else speed,
            cruise_mps=speed,
            path=points,
            **more,
        )

    def crate(self, name: str, x: float, y: float, heading: float = 0.0) -> PlacedActor:
        """An obstacle."""
        return PlacedActor(id=name, model=CRATE, control="static", x=x, y=y, heading_rad=heading, speed_mps=0.0)

    def bundle(self, actors: Sequence[PlacedActor], *, end_s: float = 10.0, **more: Any) -> SumoBundle:
        """A scene with these actors, the ego first."""
        ego = actors[0]
        assert ego.line is not None
        start = ego.line.project(ego.x, ego.y)[0]
        goal = more.pop("goal_s", ego.line.end_s - 5.0)
        scene = Scene(actors=tuple(actors), start_s=start, goal_s=goal, end_s=end_s, **more)
        return SumoBundle(
            name="town",
            net_file=self.net,
            types_file=self.types,
            key=str(self.net),
            network=self.network,
            signals=self.signals,
            scene=scene,
        )

    def traffic(self, seed: int, count: int = 20, apart_m: float = 14.0) -> list[PlacedActor]:
        """Vehicles on random routes."""
        rng = random.Random(seed)
        lanes = sorted(lane.id for e in self.network.edges.values() for lane in e.lanes if "car" in lane.kinds)
        actors: list[PlacedActor] = []
        used: list[tuple[str, float]] = []
        while len(actors) < count:
            lane = self.network.lanes[rng.choice(lanes)]
            at = rng.uniform(8, lane.length_m - 10)
            if any(name == lane.id and abs(at - other) < apart_m for name, other in used):
                continue
            used.append((lane.id, at))
            model = rng.choice([COMPACT, VAN])
            speed, cruise = round(rng.uniform(0, 10), 3), round(rng.uniform(9, 17), 3)
            edges = self._random_route(rng, lane.edge)
            name = f"others_{len(actors):02d}"
            actors.append(self.vehicle(name, edges, at, speed=speed, cruise=cruise, model=model, lane_index=lane.index))
        return actors

    def _random_route(self, rng: random.Random, edge: str, length: int = 10) -> tuple[str, ...]:
        route = [edge]
        while len(route) < length:
            route.append(rng.choice(sorted({m.to_edge for m in self.network.movements_from(route[-1])})))
        return tuple(route)


def snapshot(bundle: SumoBundle, trace: Trace, frame: int, *, end_s: float = 10.0) -> SumoBundle:
    """Describe a frame as a clip does, with its rounding, and make a scene of the description."""
    actors = [
        described
        for k, placed in enumerate(bundle.scene.actors)
        if (described := _describe(bundle.network, placed, trace, frame, k)) is not None
    ]
    signals = tuple(
        (junction, trace.signal_stages[k][trace.stages[frame, k]], round(float(trace.elapsed[frame, k]), 3))
        for k, junction in enumerate(trace.signals)
    )
    began_s = bundle.scene.began_s + float(trace.time_s[frame])
    scene = replace(bundle.scene, actors=tuple(actors), signals=signals, end_s=end_s, clip=True, began_s=began_s)
    return replace(bundle, scene=scene)


def _describe(network: RoadNetwork, placed: PlacedActor, trace: Trace, frame: int, column: int) -> PlacedActor | None:
    x, y, heading, speed, acceleration, _, steer = (float(v) for v in trace.states[frame, column])
    if math.isnan(x):
        return None
    if placed.control in ("path", "static"):
        along = float(trace.along[frame, column])
        return replace(
            placed,
            x=round(x, 3),
            y=round(y, 3),
            speed_mps=round(speed, 3),
            along_m=round(along, 3) if along == along else 0.0,
        )
    half = placed.model.length_m / 2
    heading = math.radians(round(math.degrees(heading), 2))
    lane = trace.lane_ids[trace.lanes[frame, column]]
    done = 0
    for index in trace.lanes[: frame + 1, column]:
        edge = trace.lane_ids[index].rpartition("_")[0] if index >= 0 else ""
        if edge in placed.route[done:]:
            done = placed.route.index(edge, done)
    return replace(
        placed,
        x=round(x + half * math.cos(heading), 3),
        y=round(y + half * math.sin(heading), 3),
        heading_rad=heading,
        speed_mps=round(speed, 3),
        acceleration_mps2=round(acceleration, 3),
        steer_rad=math.radians(round(math.degrees(steer), 2)),
        lane=lane,
        route=placed.route[done:],
        line=network.line(placed.route[done:], start_lane=lane),
    )


def deviations(parent: Trace, child: Trace, frame: int) -> dict[str, float]:
    """Largest distance (m) of each actor from its parent's trace; infinite where only one has it."""
    found = {}
    span = min(parent.frames - frame, child.frames)
    for k, info in enumerate(child.actors):
        a = parent.states[frame : frame + span, parent.index(info.id), :2]
        b = child.states[:span, k, :2]
        gone = np.isnan(a[:, 0]) != np.isnan(b[:, 0])
        found[info.id] = math.inf if gone.any() else float(np.nanmax(np.hypot(*(a - b).T), initial=0.0))
    return found


def _signal(tls: ElementTree.Element) -> Signal:
    phases = [element.attrib for element in tls.iterfind("phase")]
    return Signal(
        junction=tls.attrib["id"],
        tls=tls.attrib["id"],
        stages=tuple(f"phase_{k}" for k in range(len(phases))),
        phases=tuple(Phase(k, p["state"], float(p["duration"]), 0.0) for k, p in enumerate(phases)),
    )
