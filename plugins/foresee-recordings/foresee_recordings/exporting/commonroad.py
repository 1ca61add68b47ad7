"""Runs as CommonRoad scenarios (XML, version 2020a): lanelets, speed limits, signals, and an obstacle for each actor.

The ego is the obstacle 1, in the motion of the run. The schema asks for a planning problem: it is the ego's, from its
first state to its last place. A planner that solves it must leave obstacle 1 out.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.topology import Lane
from foresee_dsl.exchange.network_parts import Head, beside, heads_of, lane_links, shifted, signal_states
from foresee_dsl.simulate.trace import STEP_S
from foresee_recordings.exporting.runs import Run, lost_in_all, render
from foresee_recordings.recording import FloatArray, Track

_TYPES: Mapping[str, str] = {
    "car": "car", "van": "car", "truck": "truck", "bus": "bus", "motorcycle": "motorcycle", "bicycle": "bicycle",
    "pedestrian": "pedestrian", "obstacle": "unknown",
}  # fmt: skip
"""CommonRoad's types of obstacles for our kinds; it has none for vans."""
_COLOURS: Mapping[str, str] = {"r": "red", "s": "red", "u": "redYellow", "y": "yellow", "g": "green", "G": "green"}
"""CommonRoad's colours of SUMO's letters; others (off, flashing) are inactive."""
_DIRECTIONS: Mapping[str, str] = {"ARROW_LEFT": "left", "ARROW_RIGHT": "right", "ARROW_STRAIGHT_AHEAD": "straight"}
"""CommonRoad's directions of the icons of signal heads; others are for all."""
_STILL_M = 1e-3
"""An obstacle that moves less is a static one, m. Ours."""


class _Lanelet(NamedTuple):
    """A lane: its id and borders, the ids of those before, after and beside it, its type, users and speed sign."""

    id: int
    left: FloatArray
    right: FloatArray
    predecessors: list[int]
    successors: list[int]
    left_id: int | None
    right_id: int | None
    type: str
    users: tuple[str, ...]
    sign: int | None
    lights: list[int]


class _Light(NamedTuple):
    """A traffic light: its id, colours with their durations (time steps), place, m, direction, and lanes by id."""

    id: int
    cycle: list[tuple[int, str]]
    place: tuple[float, float]
    direction: str
    lanes: tuple[str, ...]


class _Obstacle(NamedTuple):
    """An actor: its id, type, size, and states (time step, x, y, heading, speed); `is_still`: it never moves."""

    id: int
    type: str
    length_m: float
    width_m: float
    states: list[tuple[int, float, float, float, float]]
    is_still: bool


def write(folder: Path, run: Run) -> None:
    """Write the file of a run."""
    obstacles = [_obstacle(k, track) for k, track in enumerate(run.recording.tracks, start=1)]
    network = run.bundle.network
    first_light = len(obstacles) + 1
    signals = run.bundle.signals
    states = [signal_states(signals, run.trace, frame) for frame in range(run.trace.frames)]
    lights = [_light(first_light + k, head, states) for k, head in enumerate(heads_of(network, signals))]
    first_lanelet = first_light + len(lights)
    lanelets, signs = _lanelets(network, first_lanelet, lights)
    render(
        folder / f"{run.name}.xml",
        "commonroad.xml",
        benchmark=f"ZAM_{''.join(re.findall('[A-Za-z0-9]+', run.name.title())) or 'Run'}-1_1_T-1",
        step=STEP_S,
        ego=obstacles[0],
        problem=first_lanelet + len(lanelets) + len(signs),
        lanelets=lanelets,
        signs=signs,
        lights=lights,
        still=[obstacle for obstacle in obstacles if obstacle.is_still],
        moving=[obstacle for obstacle in obstacles if not obstacle.is_still],
    )


def left_out(run: Run) -> Counter[str]:
    """Return counts of what the file does not express."""
    network, tracks = run.bundle.network, run.recording.tracks
    counts = {
        "buildings": len(network.buildings),
        "right of way at junctions": len({movement.junction for movement in network.movements}),
        "classes of vans, which are cars": sum(track.kind == "van" for track in tracks),
        "classes of obstacles, which are unknown": sum(track.kind == "obstacle" for track in tracks),
    }
    return lost_in_all(run) + Counter(counts)


def _obstacle(id_: int, track: Track) -> _Obstacle:
    steps = (track.time_s / STEP_S).round().astype(int).tolist()
    states = [(step, *state) for step, state in zip(steps, track.states.tolist(), strict=True)]
    spread = (track.states[:, :2].max(axis=0) - track.states[:, :2].min(axis=0)).max()
    is_still = track.kind == "obstacle" and spread < _STILL_M
    return _Obstacle(id_, _TYPES[track.kind], track.length_m, track.width_m, states, is_still)


def _light(id_: int, head: Head, states: Sequence[Mapping[str, str]]) -> _Light:
    """Return the traffic light of a head, whose cycle is what it showed in the run: `states` of each frame by `tls`."""
    cycle: list[tuple[int, str]] = []
    for state in states:
        colour = _COLOURS.get(state[head.tls][head.link], "inactive")
        steps = cycle.pop()[0] if cycle and cycle[-1][1] == colour else 0
        cycle.append((steps + 1, colour))
    return _Light(id_, cycle, (head.x, head.y), _DIRECTIONS.get(head.icon, "all"), head.lanes)


def _lanelets(
    network: RoadNetwork, first_id: int, lights: Sequence[_Light]
) -> tuple[list[_Lanelet], list[tuple[int, float]]]:
    """Return the lanes that have users, and the signs of their speed limits: id and limit, m/s."""
    lanes = [lane for lane in network.lanes.values() if lane.kinds and len(lane.shape) > 1]
    ids = {lane.id: first_id + k for k, lane in enumerate(lanes)}
    limits = sorted({lane.speed_mps for lane in lanes if _has_limit(lane)})
    signs = {limit: first_id + len(lanes) + k for k, limit in enumerate(limits)}
    links = lane_links(network)
    lanelets = []
    for lane in lanes:
        before, after = links.get(lane.id, ((), ()))
        sides = [beside(network, lane, side) for side in (1, -1)]
        left_id, right_id = (None if other is None else ids.get(other.id) for other in sides)
        type_, users = _use(lane)
        lanelets.append(
            _Lanelet(
                ids[lane.id],
                shifted(lane.shape, lane.width_m / 2),
                shifted(lane.shape, -lane.width_m / 2),
                [ids[name] for name in before if name in ids],
                [ids[name] for name in after if name in ids],
                left_id,
                right_id,
                type_,
                users,
                signs[lane.speed_mps] if _has_limit(lane) else None,
                [light.id for light in lights if lane.id in light.lanes],
            )
        )
    return lanelets, [(id_, limit) for limit, id_ in signs.items()]


def _has_limit(lane: Lane) -> bool:
    """Return whether a lane's speed is its limit; inside junctions it is SUMO's speed of turning."""
    return "car" in lane.kinds and not lane.internal


def _use(lane: Lane) -> tuple[str, tuple[str, ...]]:
    """Return CommonRoad's type of a lanelet, and its users."""
    if "car" in lane.kinds:
        return ("intersection" if lane.internal else "urban"), ("vehicle",)
    if "pedestrian" in lane.kinds:
        return ("crosswalk" if lane.internal else "sidewalk"), ("pedestrian",)
    if "bicycle" in lane.kinds and "bus" not in lane.kinds:
        return "bicycleLane", ("bicycle",)
    return ("busLane", ("bus",)) if "bus" in lane.kinds else ("unknown", ("vehicle",))
