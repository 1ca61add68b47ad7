"""The signals of a run as OSI traffic lights: a message for each bulb, with its state at each frame."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from foresee_bridges.osi.library import Numbers, add_reference, osi3, set_size, set_vector, set_yaw
from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.exchange.network_parts import BULB_M, Head, heads_of, signal_states
from foresee_dsl.simulate.mission import NEAR_HEIGHT_M
from foresee_dsl.simulate.trace import Trace

_STEPS_M: Mapping[str, float] = {"red": 2.0, "yellow": 1.0, "green": 0.0}
"""Place of a bulb above the lowest one, in bulbs of 1.5 times the diameter."""
_ON: Mapping[str, tuple[str, ...]] = {"r": ("red",), "s": ("red",), "u": ("red", "yellow"), "y": ("yellow",),
                                      "g": ("green",), "G": ("green",), "O": (), "o": ()}  # fmt: skip
"""The bulbs that are on, by SUMO's letter in a state; at `o` the yellow one flashes."""


def lights_on(state: str, colour: str) -> str:
    """Return OSI's mode of a bulb, without `MODE_`, at a state of its link in SUMO's letters."""
    if state == "o" and colour == "yellow":
        return "FLASHING"
    return "CONSTANT" if colour in _ON.get(state, ()) else "OFF"


class Lights:
    """The traffic lights of a run's ground truth."""

    def __init__(self, bundle: SumoBundle, numbers: Numbers) -> None:
        self._signals = bundle.signals
        self._heads = heads_of(bundle.network, bundle.signals)
        self._messages = [
            (head, colour, _bulb(head, k, colour, numbers))
            for k, head in enumerate(self._heads)
            for colour in head.colours
        ]

    def at(self, trace: Trace, frame: int) -> Iterator[Any]:
        """Yield the traffic lights at a frame; the messages are used again for the next frame."""
        modes = osi3().osi_trafficlight_pb2.TrafficLight.Classification
        states = signal_states(self._signals, trace, frame)
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
