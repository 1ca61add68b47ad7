"""Signal heads of a network as other formats describe them, and the states of the signals in a run."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from foresee_dsl.compile.bundle import Signal
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.topology import Crossing, Movement
from foresee_dsl.simulate.mission import NEAR_AHEAD_M, NEAR_RIGHT_M
from foresee_dsl.simulate.trace import Trace

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
        stage = trace.signal_stages[k][int(trace.stages[frame, k])]
        phase, _ = signal.phase_at(stage, float(trace.elapsed[frame, k]))
        states[signal.tls] = signal.phases[phase].state
    return states
