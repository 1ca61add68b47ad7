"""Traffic lights of CommonRoad: their cycles as the colours that were seen during the recording."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_recordings.readers.commonroad_numbers import number
from foresee_recordings.recording import SignalTrack

_COLOURS = {"red": "red", "redYellow": "red", "yellow": "amber", "green": "green", "inactive": "off"}
"""Our colour for each of CommonRoad's. `redYellow` is red: vehicles may not drive yet."""
_MOST_CHANGES = 100_000
"""Largest number of changes of one light. Ours: a change each second for a day."""


@dataclass(frozen=True)
class TrafficLight:
    """A light: its cycle of (duration in time steps, colour), which begins anew at `offset`, before it too."""

    id: str
    cycle: tuple[tuple[float, str], ...]
    offset: float

    @classmethod
    def of(cls, element: Element) -> TrafficLight:
        """Return the light of a `<trafficLight>`.

        Raises:
            ValueError: a duration or a colour is not one.
        """
        cycle = []
        for part in element.iterfind("cycle/cycleElement"):
            duration, colour = number(part, "duration"), (part.findtext("color") or "").strip()
            if not 0.0 < duration < math.inf or colour not in _COLOURS:
                raise ValueError(f"its cycle has {duration:g} time steps of {colour!r}")
            cycle.append((duration, _COLOURS[colour]))
        offset = number(element, "cycle/timeOffset")
        if (element.findtext("active") or "true").strip() in ("false", "0"):
            cycle = [(1.0, "off")]
        return cls(element.get("id", ""), tuple(cycle), 0.0 if math.isnan(offset) else offset)

    def changes(self, begin: float, end: float) -> list[tuple[float, str]]:
        """Return the time steps and colours of all changes from `begin` to `end`, the first at `begin`."""
        total = sum(duration for duration, _ in self.cycle)
        step = begin - (begin - self.offset) % total
        changes: list[tuple[float, str]] = []
        while step <= end and len(changes) < _MOST_CHANGES:
            for duration, colour in self.cycle:
                same = changes and changes[-1][1] == colour
                if step + duration > begin and step <= end and not same:
                    changes.append((max(step, begin), colour))
                step += duration
        return changes


def signal_tracks(
    lights: Sequence[TrafficLight],
    places: Mapping[str, tuple[float, float]],
    step_s: float,
    ends_s: tuple[float, float],
) -> tuple[SignalTrack, ...]:
    """Return the colours of all lights from the first to the last of the times `ends_s`; `places`: their stop lines."""
    tracks = []
    for light in lights:
        if not light.cycle:
            continue
        changes = light.changes(ends_s[0] / step_s, ends_s[1] / step_s)
        times, colours = zip(*((step * step_s, colour) for step, colour in changes), strict=True)
        tracks.append(SignalTrack(light.id, times, colours, places.get(light.id)))
    return tuple(tracks)
