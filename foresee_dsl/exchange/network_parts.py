"""Parts of a network as other formats describe them: the borders of lanes, the lanes beside them, before and after
them, signal heads, and the states of signals in a run."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from foresee_dsl.compile.bundle import Signal
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import Points
from foresee_dsl.compile.roads.topology import Crossing, Lane, Movement
from foresee_dsl.drivers.protocol import FloatArray
from foresee_dsl.simulate.mission import NEAR_AHEAD_M, NEAR_RIGHT_M
from foresee_dsl.simulate.signals import state_at
from foresee_dsl.simulate.trace import Trace

_MITRE = 2.0
"""Largest stretch of an offset corner, as a multiple of the offset. Ours: bounds spikes at sharp corners."""


def lane_links(network: RoadNetwork) -> dict[str, tuple[tuple[str, ...], tuple[str, ...]]]:
    """Return the ids of the lanes before and after each lane, by its id; a lane without any is absent."""
    before: dict[str, list[str]] = {}
    after: dict[str, list[str]] = {}
    for movement in network.movements:
        chain = (movement.from_lane, *movement.via, movement.to_lane)
        for first, second in pairwise(chain):
            if second not in after.setdefault(first, []):
                after[first].append(second)
                before.setdefault(second, []).append(first)
    return {
        lane: (tuple(before.get(lane, ())), tuple(after.get(lane, ()))) for lane in dict.fromkeys((*before, *after))
    }


def beside(network: RoadNetwork, lane: Lane, side: int) -> Lane | None:
    """Return the lane of the same edge to the left (1) or right (-1), if any; None inside junctions."""
    return None if lane.internal else network.lane_beside(lane, side)


def shifted(line: Points, left_m: float) -> FloatArray:
    """Return a line that runs beside another, `left_m` to its left, with mitred corners, [N, 2]."""
    points = np.asarray(line, dtype=np.float64)[:, :2]
    legs = np.diff(points, axis=0)
    legs /= np.maximum(np.linalg.norm(legs, axis=1, keepdims=True), 1e-9)
    normals = np.stack((-legs[:, 1], legs[:, 0]), axis=1)
    before, after = np.vstack((normals[:1], normals)), np.vstack((normals, normals[-1:]))
    corners = before + after
    corners /= np.maximum(np.linalg.norm(corners, axis=1, keepdims=True), 1e-9)
    stretch = np.minimum(1 / np.maximum(np.einsum("ij,ij->i", corners, after), 1e-9), _MITRE)
    line_beside: FloatArray = points + left_m * corners * stretch[:, None]
    return line_beside


BULB_M = 0.2
"""Diameter of a bulb, and distance of the heads of one lane, m: the smaller size of EN 12368 (200 mm)."""
_ICONS = {"left": "ARROW_LEFT", "right": "ARROW_RIGHT", "straight": "ARROW_STRAIGHT_AHEAD"}


@dataclass(frozen=True)
class Head:
    """A signal head: the bulbs that show one state to one lane.

    Attributes:
        link: the index in the states of the signal `tls`. colours: of its bulbs. icon: OSI's name without `ICON_`.
        x, y, yaw_rad: its place, m, and the direction from which it is seen. lanes: the lanes that obey it.
    """

    tls: str
    link: int
    colours: tuple[str, ...]
    icon: str
    x: float
    y: float
    yaw_rad: float
    lanes: tuple[str, ...]


def heads_of(network: RoadNetwork, signals: Mapping[str, Signal]) -> list[Head]:
    """Return the heads of all signals: one for each lane and state that its movements have in common.

    The places are ours, those that the drivers' sensors use for the ego: `NEAR_AHEAD_M` behind the stop line,
    `NEAR_RIGHT_M` to the right of the lane's middle.
    """
    states = {signal.tls: [phase.state for phase in signal.phases] for signal in signals.values()}
    heads = []
    groups: dict[tuple[str, str, tuple[str, ...]], list[Movement]] = {}
    for movement in network.movements:
        if movement.tls in states and "car" in movement.kinds and movement.link >= 0:
            column = tuple(state[movement.link] for state in states[movement.tls])
            groups.setdefault((movement.tls, movement.from_lane, column), []).append(movement)
    of_lane: dict[str, int] = {}
    for (tls, lane_id, _), movements in groups.items():
        k = of_lane[lane_id] = of_lane.get(lane_id, -1) + 1
        line = network.lanes[lane_id].line
        x, y, heading = line.at(line.length_m, -NEAR_RIGHT_M - 2 * BULB_M * k)
        x, y = x + NEAR_AHEAD_M * math.cos(heading), y + NEAR_AHEAD_M * math.sin(heading)
        turns = {movement.turn for movement in movements}
        shares = sum(1 for _, lane, _ in groups if lane == lane_id) > 1
        icon = _ICONS.get(next(iter(turns)), "NONE") if shares and len(turns) == 1 else "NONE"
        colours = ("red", "yellow", "green")
        heads.append(Head(tls, movements[0].link, colours, icon, x, y, heading + math.pi, (lane_id,)))
    heads.extend(_crossing_head(crossing) for crossing in network.crossings.values() if crossing.tls in states)
    return heads


def _crossing_head(crossing: Crossing) -> Head:
    """Return the head of a crossing's signal, at the end of the crossing (ours)."""
    line = crossing.lane.line
    x, y, heading = line.at(line.length_m)
    return Head(
        crossing.tls or "", crossing.link, ("red", "green"), "PEDESTRIAN", x, y, heading + math.pi, (crossing.lane.id,)
    )


def signal_states(signals: Mapping[str, Signal], trace: Trace, frame: int) -> dict[str, str]:
    """Return the state of each signal at a frame of a run, in SUMO's letters, by the signal's `tls`."""
    states = {}
    for k, junction in enumerate(trace.signals):
        signal = next(signal for signal in signals.values() if signal.junction == junction)
        states[signal.tls] = state_at(signal, trace, k, frame)
    return states
