"""Traffic lights of CommonRoad: their cycles as the colours that were seen during the recording."""

from __future__ import annotations

import math
from collections.abc import Mapping
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_recordings.maps.signals import SignalCycle
from foresee_recordings.readers.commonroad.numbers import number
from foresee_recordings.recording import SignalTrack

_COLOURS = {"red": "red", "redYellow": "red", "yellow": "amber", "green": "green", "inactive": "off"}
"""Our colour for each of CommonRoad's. `redYellow` is red: vehicles may not drive yet."""


def cycle_of(element: Element, step_s: float) -> SignalCycle | None:
    """Return the cycle of a `<trafficLight>`; None if it has none.

    Raises:
        ValueError: a duration or a colour is not one.
    """
    if (element.findtext("active") or "true").strip() in ("false", "0"):
        return SignalCycle(((step_s, "off"),))
    colours = []
    for part in element.iterfind("cycle/cycleElement"):
        duration, colour = number(part, "duration"), (part.findtext("color") or "").strip()
        if not 0.0 < duration < math.inf or colour not in _COLOURS:
            raise ValueError(f"its cycle has {duration:g} time steps of {colour!r}")
        colours.append((duration * step_s, _COLOURS[colour]))
    offset = number(element, "cycle/timeOffset")
    return SignalCycle(tuple(colours), 0.0 if math.isnan(offset) else offset * step_s) if colours else None


def signal_tracks(
    cycles: Mapping[str, SignalCycle], places: Mapping[str, tuple[float, float]], begin_s: float, end_s: float
) -> tuple[SignalTrack, ...]:
    """Return the colours of all lights from one time to another; `places`: their stop lines, m."""
    tracks = []
    for id_, cycle in cycles.items():
        times, colours = zip(*cycle.changes(begin_s, end_s), strict=True)
        tracks.append(SignalTrack(id_, times, colours, places.get(id_)))
    return tuple(tracks)
