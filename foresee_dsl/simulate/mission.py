"""Builds the driver's mission from a compiled test case: the ego's line, its junctions and the crossing traffic."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial

import numpy as np

from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.compile.roads.conflicts import Conflict, conflicts_of
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.route_line import Passage
from foresee_dsl.drivers.protocol import Foe, JunctionPassage, Mission
from foresee_dsl.drivers.road_map import build_road_map, lanes_along
from foresee_dsl.errors import SimulationError
from foresee_dsl.kernels.arrays import read_only
from foresee_dsl.simulate.trace import STEP_S

STOP_BEFORE_M = 1.0
"""Distance of the stop line from the lanes inside the junction, m; SUMO's vehicles stop there."""
BEYOND_GOAL_M = 80.0
"""Length of the line beyond the goal, m, as the driver protocol promises. A driver that plans 4 s ahead at 60 km/h
needs 67 m."""
NEAR_AHEAD_M, NEAR_RIGHT_M, NEAR_HEIGHT_M = 2.0, 3.0, 2.6
"""Position of a signal's near head relative to the point where the ego's lane meets the stop line, m. Ours: behind the
line, at the kerb of a lane of 3.3 m; 2.1 m is the usual least height over a pavement."""
FAR_AHEAD_M, FAR_HEIGHT_M = 20.0, 5.0
"""Position of the far-side signal head, m. Ours: about the far side of a junction of roads with two lanes per direction
and crossings; 4.5 m is the usual least height over a road."""
_HEADS_M = ((NEAR_AHEAD_M, -NEAR_RIGHT_M, NEAR_HEIGHT_M), (FAR_AHEAD_M, 0.0, FAR_HEIGHT_M))
"""Positions of both heads, m: how far ahead of the stop line, to the left of the lane's middle, and above the road."""
_GO, _GO_FIRST = "gGoO", "G"
"""SUMO's letters in the state of a signal: all letters that mean green, and the letter that means green with
priority."""


def mission_of(bundle: SumoBundle) -> Mission:
    """Return the ego's mission; raises `SimulationError` if the ego has no route.

    Its arrays are read-only, because they belong to the test case, which later runs use too.

    The mission's centreline continues for 80 m beyond the goal, or to the end of the network; where the route ends
    earlier, the line goes straight on.
    """
    ego = bundle.scene.ego
    line = ego.line
    if line is None:
        raise SimulationError(f"{bundle.name}: the ego has no route, so there is no mission for a driver")
    states = {signal.tls: tuple(phase.state for phase in signal.phases) for signal in bundle.signals.values()}
    goal_s = bundle.scene.goal_s
    n = int(np.searchsorted(line.s, goal_s + BEYOND_GOAL_M)) + 1
    lanes = lanes_along(line.pieces, 0.0, float(line.s[:n][-1]))
    return Mission(
        centreline=read_only(line.points[:n]),
        s=read_only(line.s[:n]),
        speed_limit_mps=read_only(np.minimum(line.speed_limit[:n], max(ego.cruise_mps, 0.1))),
        left_m=read_only(line.left_m[:n]),
        right_m=read_only(line.right_m[:n]),
        start_s=bundle.scene.start_s,
        goal_s=goal_s,
        junctions=tuple(_junction(p, bundle.network, states) for p in line.passages if p.entry_s < line.s[:n][-1]),
        step_s=STEP_S,
        build_map=partial(build_road_map, bundle.network, lanes, bundle.net_file),
    )


def heading_at(mission: Mission, s: float) -> tuple[float, float, float]:
    """Return x, y (m) and heading (rad) of the ego's line at a length along it; the heading is the mean over the metre
    before.
    """
    (x0, x), (y0, y) = (np.interp((s - 1.0, s), mission.s, mission.centreline[:, k]).tolist() for k in (0, 1))
    return x, y, math.atan2(y - y0, x - x0)


def signal_heads(mission: Mission, stop_s: float) -> list[tuple[float, float, float]]:
    """Return x, y and height over the road of the heads of a signal at a stop line, m."""
    x, y, heading = heading_at(mission, stop_s)
    c, s = math.cos(heading), math.sin(heading)
    return [(x + a * c - b * s, y + a * s + b * c, height) for a, b, height in _HEADS_M]


def _junction(passage: Passage, network: RoadNetwork, states: Mapping[str, tuple[str, ...]]) -> JunctionPassage:
    own = (passage.movement.tls or "", passage.movement.link)
    return JunctionPassage(
        junction=passage.junction,
        stop_s=passage.entry_s - STOP_BEFORE_M,
        exit_s=passage.exit_s,
        turn=passage.turn,
        signal=passage.signal,
        foes=tuple(_foe(c, passage.entry_s, own, states) for c in conflicts_of(network, passage.movement)),
    )


def _foe(conflict: Conflict, entry_s: float, own: tuple[str, int], states: Mapping[str, tuple[str, ...]]) -> Foe:
    return Foe(
        path=read_only(conflict.path),
        entry_s=conflict.entry_s,
        conflict_s=(entry_s + conflict.own[0], entry_s + conflict.own[1]),
        conflict_path_s=conflict.other,
        has_priority=_must_yield(conflict, own, states),
        pedestrian=conflict.pedestrian,
    )


def _must_yield(conflict: Conflict, own: tuple[str, int], states: Mapping[str, tuple[str, ...]]) -> bool:
    """Return whether the ego must give way to a stream of traffic at a time when both may go.

    At a signal the right-of-way matrix lists every pair of streams. Only pairs that are green together count, and of
    these only those in which the ego's green has no priority (SUMO's letter `g`).
    """
    tls, link = own
    phases = states.get(tls)
    if not conflict.yields or phases is None or link < 0 or conflict.tls != tls:
        return conflict.yields
    return any(state[link] in _GO and state[link] not in _GO_FIRST and state[conflict.link] in _GO for state in phases)
