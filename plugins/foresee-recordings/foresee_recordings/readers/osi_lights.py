"""Traffic lights of ASAM OSI: each message is one bulb; bulbs at one place for the same lanes are one signal."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from foresee_recordings.recording import SignalTrack

_COLOURS = {"RED": "red", "YELLOW": "amber", "GREEN": "green"}
"""Our colours of OSI's; blue and white lights are not traffic signals of roads."""
_LIT = ("CONSTANT", "FLASHING", "COUNTING")
_APART_M = 0.5
"""Bulbs that are nearer to each other on the ground are of one head, m. Ours: more than the width of a head."""
_KEPT_SAMPLES = 10
"""Number of samples that take the memory of a lane's end, a signal or a change of its colour. Ours: some 400 bytes."""
_ORDER = ("red", "amber", "green")
"""The colour that counts, if several bulbs are lit: red and amber together still mean stop."""


class Lights:
    """The colours of all signals while the ground truths of a trace are read.

    `take_room` is called for each thing that is kept, with the number of samples that take as much memory.
    """

    def __init__(self, take_room: Callable[[int], None]) -> None:
        self._take_room = take_room
        self._changes: dict[tuple[Any, ...], list[tuple[float, str]]] = {}
        self._ids: dict[tuple[Any, ...], str] = {}
        self._lanes: dict[tuple[Any, ...], int] = {}
        self._stop_lines: dict[int, tuple[float, float]] = {}

    def add(self, message: Any, time_s: float, *, within: bool) -> None:  # noqa: ANN401
        """Add the lights of a ground truth; outside the request's times only its lanes are used."""
        for lane in message.lane:
            line = lane.classification.centerline
            if line:
                if lane.id.value not in self._stop_lines:
                    self._take_room(_KEPT_SAMPLES)
                end = line[-1] if lane.classification.centerline_is_driving_direction else line[0]
                self._stop_lines[lane.id.value] = end.x, end.y
        colours: dict[tuple[Any, ...], set[str]] = {}
        for bulb in message.traffic_light if within else ():
            facts = bulb.classification
            colour = _COLOURS.get(type(facts).Color.Name(facts.color).removeprefix("COLOR_"))
            if colour is None:
                continue
            head = _head(bulb)
            self._ids.setdefault(head, str(bulb.id.value))
            if facts.assigned_lane_id:
                self._lanes.setdefault(head, facts.assigned_lane_id[0].value)
            is_lit = type(facts).Mode.Name(facts.mode).removeprefix("MODE_") in _LIT
            colours.setdefault(head, set()).update({colour} if is_lit else ())
        for head, lit in colours.items():
            colour = next((colour for colour in _ORDER if colour in lit), "off")
            changes = self._changes.setdefault(head, [])
            if not changes or changes[-1][1] != colour:
                self._take_room(_KEPT_SAMPLES)
                changes.append((time_s, colour))

    def tracks(self) -> tuple[SignalTrack, ...]:
        """Return the recorded signals; the place is the end of the first lane that obeys it."""
        return tuple(
            SignalTrack(
                self._ids[head],
                tuple(time_s for time_s, _ in changes),
                tuple(colour for _, colour in changes),
                self._stop_lines.get(self._lanes.get(head, -1)),
            )
            for head, changes in self._changes.items()
        )


def _head(bulb: Any) -> tuple[Any, ...]:  # noqa: ANN401
    """Return what the bulbs of one head have in common."""
    place = bulb.base.position
    lanes = tuple(sorted(lane.value for lane in bulb.classification.assigned_lane_id))
    return round(place.x / _APART_M), round(place.y / _APART_M), bulb.classification.icon, lanes
