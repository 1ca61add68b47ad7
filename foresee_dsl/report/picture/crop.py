"""Chooses the part of the world that a picture shows, and converts metres to its pixels."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from foresee_dsl.report.drawing.sheet import MapFrame
from foresee_dsl.report.picture.subject import FloatArray, SceneSubject, ShownWay

MARGIN_M, MARGIN_SHARE = 12.0, 0.06
"""Free margin around the relevant points: at least this many metres, and this share of the larger side. Ours: three
lanes, and more in a large picture."""
LEAST_M = 60.0
"""Smallest side of a picture, m. Ours: a junction with its approaches."""
SNAP_M = 10.0
"""Sides are multiples of this, m (of five times this in a large picture). Ours: while a user edits a text, the picture
stands still if an actor moves by a metre."""
FLATTEST, TALLEST = 0.5, 1.1
"""Smallest and largest ratio of height to width. Ours: both fit a screen beside a text, and an upright phone."""
_ZONE_REACH_M = 60.0
"""Largest side of a trigger place that must be completely in the picture, m (ours)."""


def frame_of(subject: SceneSubject, width: float, *, whole: bool) -> MapFrame:
    """Return the frame of a picture `width` pixels wide: around the actors and their ways, or the whole network."""
    points = [np.array(p) for p in _whole(subject)] if whole or not subject.bodies else list(_concerned(subject))
    if not points:
        points = [np.zeros((1, 2))]
    every = np.vstack(points)
    low, high = every.min(axis=0), every.max(axis=0)
    step = SNAP_M if float((high - low).max()) < 10 * SNAP_M else SNAP_M * 5
    low, high = np.floor(low / step) * step, np.ceil(high / step) * step
    middle, size = (low + high) / 2, high - low
    size = size + 2 * np.maximum(MARGIN_M, MARGIN_SHARE * size.max())
    if not whole and subject.bodies:
        size = np.maximum(size, LEAST_M)
    wide, high_m = float(size[0]), float(size[1])
    share = min(max(high_m / wide, FLATTEST), TALLEST)
    wide, high_m = max(wide, high_m / share), max(high_m, wide * share)
    scale = width / wide
    return MapFrame(width, round(high_m * scale), float(middle[0]) - wide / 2, float(middle[1]) + high_m / 2, scale)


def _whole(subject: SceneSubject) -> Iterator[FloatArray]:
    for lane in subject.network.lanes.values():
        if lane.shape:
            yield np.array(lane.shape)[:, :2]
    for outline in subject.network.buildings:
        yield np.array(outline)
    for body in subject.bodies:
        yield body.corners


def _concerned(subject: SceneSubject) -> Iterator[FloatArray]:
    for body in subject.bodies:
        if body.tone != "traffic":
            yield body.corners
            if body.before is not None:
                yield body.before
    for way in subject.ways:
        yield part_of(way)
    for patch in subject.patches:
        yield patch.outline
    yield from _rings(subject)
    for zone in subject.zones:
        for outline in zone.outlines:
            if float(np.ptp(outline, axis=0).max()) <= _ZONE_REACH_M:
                yield outline


def _rings(subject: SceneSubject) -> Iterator[FloatArray]:
    """Yield the outlines of the roundabouts that a visible way passes; a picture shows them as a whole."""
    ways = [part_of(way) for way in subject.ways]
    for ring in subject.network.rings.values():
        outline = np.array(ring.polygon)
        reach = np.hypot(*(outline - ring.centre).T).max()
        if any((np.hypot(*(way - ring.centre).T) <= reach).any() for way in ways):
            yield outline


def part_of(way: ShownWay) -> FloatArray:
    """Return the first part of a way, which should be in the picture, [N, 2] m."""
    steps = np.hypot(*np.diff(way.points, axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    return way.points[: max(int(np.searchsorted(along, way.matters_m)) + 1, 1)]
