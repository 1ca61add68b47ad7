"""The signals of a run as OSI traffic lights: a message for each bulb, with its state at each frame."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from foresee_bridges.osi.library import Numbers, add_reference, osi3, set_size, set_vector, set_yaw
from foresee_dsl.compile.bundle import Signal, SumoBundle
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.topology import Crossing, Movement
from foresee_dsl.simulate.mission import NEAR_AHEAD_M, NEAR_HEIGHT_M, NEAR_RIGHT_M
from foresee_dsl.simulate.trace import Trace

BULB_M = 0.2
"""Diameter of a bulb, and distance of the heads of one lane, m: the smaller size of EN 12368 (200 mm)."""
_STEPS_M: Mapping[str, float] = {"red": 2.0, "yellow": 1.0, "green": 0.0}
"""Place of a bulb above the lowest one, in bulbs of 1.5 times the diameter."""
_ON: Mapping[str, tuple[str, ...]] = {"r": ("red",), "s": ("red",), "u": ("red", "yellow"), "y": ("yellow",),
                                      "g": ("green",), "G": ("green",), "O": (), "o": ()}  # fmt: skip
"""The bulbs that are on, by SUMO's letter in a state; at `o` the yellow one flashes."""
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


def lights_on(state: str, colour: str) -> str:
    """Return OSI's mode of a bulb, without `MODE_`, at a state of its link in SUMO's letters."""
    if state == "o" and colour == "yellow":
        return "FLASHING"
    return "CONSTANT" if colour in _ON.get(state, ()) else "OFF"


class Lights:
    """The traffic lights of a run's ground truth."""

    def __init__(self, bundle: SumoBundle, numbers: Numbers) -> None:
        self._signals = {signal.tls: signal for signal in bundle.signals.values()}
        self._heads = heads_of(bundle.network, bundle.signals)
        self._messages = [
            (head, colour, _bulb(head, k, colour, numbers))
            for k, head in enumerate(self._heads)
            for colour in head.colours
        ]

    def at(self, trace: Trace, frame: int) -> Iterator[Any]:
        """Yield the traffic lights at a frame; the messages are used again for the next frame."""
        modes = osi3().osi_trafficlight_pb2.TrafficLight.Classification
        states = {}
        for k, junction in enumerate(trace.signals):
            signal = next(signal for signal in self._signals.values() if signal.junction == junction)
            stage = trace.signal_stages[k][int(trace.stages[frame, k])]
            phase, _ = signal.phase_at(stage, float(trace.elapsed[frame, k]))
            states[signal.tls] = signal.phases[phase].state
        for head, colour, message in self._messages:
            letter = states[head.tls][head.link]
            message.classification.mode = getattr(modes, f"MODE_{lights_on(letter, colour)}")
            message.classification.is_out_of_service = letter == "O"
            yield message


def _bulb(head: Head, k: int, colour: str, numbers: Numbers) -> Any:  # noqa: ANN401
    lights = osi3().osi_trafficlight_pb2.TrafficLight
    message = lights()
    message.id.value = numbers.of("bulb", str(k), colour)
    add_reference(message.source_reference, "signal", head.tls, str(head.link), colour)
    set_size(message.base.dimension, BULB_M, BULB_M, BULB_M)
    set_vector(message.base.position, head.x, head.y, NEAR_HEIGHT_M + 1.5 * BULB_M * _STEPS_M[colour])
    set_yaw(message.base.orientation, head.yaw_rad)
    facts = message.classification
    facts.color = getattr(lights.Classification, f"COLOR_{colour.upper()}")
    facts.icon = getattr(lights.Classification, f"ICON_{head.icon}")
    for lane in head.lanes:
        facts.assigned_lane_id.add().value = numbers.of("lane", lane)
    return message
