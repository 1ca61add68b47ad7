"""Lays out the picture of a scene's start: its map with names, its title above and its legend below."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

import numpy as np
import shapely

from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.report.drawing.ground import ground_of, lines_of, within
from foresee_dsl.report.drawing.labels import LINE, LabelBox, Room, width_of, wrapped
from foresee_dsl.report.drawing.shapes import DISC_PX, Shape, arrow, body_shapes, disc, ghost_shape, ground_shapes
from foresee_dsl.report.drawing.sheet import (
    PAD,
    DrawnPart,
    Key,
    Map,
    MapFrame,
    Sheet,
    Sizes,
    Words,
    legend,
    scale_and_north,
)
from foresee_dsl.report.picture.subject import Body, Name, Patch, SceneSubject, ShownWay, Zone
from foresee_dsl.report.safe_text import shortened

MARGIN_M, MARGIN_SHARE = 12.0, 0.06
"""Margin that stays free around the relevant points: at least this many metres, and at least this share of the larger
side. Ours: three lanes, and more in a large picture."""
LEAST_M = 60.0
"""Smallest side of a picture, m. Ours: a junction with its approaches."""
SNAP_M = 10.0
"""The sides of a picture are multiples of this, m; the sides of a large picture are multiples of five times this. Ours:
while a user edits a text, the picture stays the same if an actor moves by a metre."""
FLATTEST, TALLEST = 0.5, 1.1
"""Smallest and largest ratio of height to width. Ours: both fit a screen beside a text, and an upright phone."""
_ZONE_REACH_M = 60.0
"""A trigger place whose sides are not longer than this must be in the picture completely, m. Ours."""


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
    """Yield the outlines of the roundabouts that a visible way passes; a picture shows each of them completely."""
    ways = [part_of(way) for way in subject.ways]
    for ring in subject.network.rings.values():
        outline = np.array(ring.polygon)
        reach = np.hypot(*(outline - ring.centre).T).max()
        if any((np.hypot(*(way - ring.centre).T) <= reach).any() for way in ways):
            yield outline


def part_of(way: ShownWay) -> FloatArray:
    """Return the first part of a way, [N, 2] m, which should be in the picture."""
    steps = np.hypot(*np.diff(way.points, axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    return way.points[: max(int(np.searchsorted(along, way.matters_m)) + 1, 1)]


WIDTH = 720.0
"""Width of a picture in a file, px. Ours: a page's column; a phone shows it at half the size, with larger letters."""
_LONGEST_NAME = 22
_LINES_MOST = 6
"""Maximum number of a mutant's changes, and of errors, that are listed under the title. Ours."""
FILE_SIZES, LIVE_SIZES = Sizes(), Sizes(room=1.0)
_ARROW_PX, _GOAL_PX, _MISTAKE_PX = 9.0, 6.0, 16.0
"""Length of an arrowhead, and radii of the circles at a goal and around an error, px. Ours."""


def sheet_of(subject: SceneSubject, *, width: float = WIDTH, whole: bool = False, sizes: Sizes = FILE_SIZES) -> Sheet:
    """Return the sheet that shows a scene.

    Args:
        subject: the scene. width: width of the sheet, px. whole: show the whole network, not only the actors' part.
        sizes: sizes of letters: `FILE_SIZES` for a file that may be shown at any width, `LIVE_SIZES` for exactly this
            width.
    """
    head, top = _header(subject, width, sizes)
    frame = frame_of(subject, width - 2 * PAD, whole=whole)
    parts = (*_ground(subject.network, frame), *_MapParts(subject, frame, sizes).parts())
    there = {part.kind for part in parts}
    keys = (key for kind, key in _KEYS.items() if kind in there)
    below, height = legend(keys, width, top + frame.height + PAD, sizes)
    label = f"{subject.title}: {subject.about or 'a road network from above'}"
    return Sheet(width, height, (Map(PAD, top, frame, parts),), (*head, *below), shortened(label, 300), sizes)


# ---- around the map -------------------------------------------------------------------------------------------------


def _header(subject: SceneSubject, width: float, sizes: Sizes) -> tuple[list[DrawnPart], float]:
    words: list[Words] = []
    y = PAD
    most = width - 2 * PAD

    def add(text: str, paint: str, size: str, lines: int, *, bold: bool = False) -> None:
        nonlocal y
        px = getattr(sizes, size) * sizes.room
        for line in wrapped(shortened(text, 1000), px, most, lines):
            y += px * LINE / 2
            words.append(Words(paint, line, PAD, y, size, bold=bold))
            y += px * LINE / 2

    case = f" ({len(subject.cases)} cases)" if len(subject.cases) > 1 else ""
    add(f"{Path(subject.title).name}{case}", "title", "title", 2, bold=True)
    if subject.about:
        add(subject.about, "quiet", "text", 2)
    for change in subject.changes[:_LINES_MOST]:
        add(change, "title", "text", 2)
    for number, mistake in enumerate(subject.mistakes[:_LINES_MOST], start=1):
        add(f"{number}  {mistake.message}", "mistake-name", "text", 2, bold=True)
    return [DrawnPart("header", words=tuple(words))], y + PAD / 2


_KEYS = {  # the texts of the legend, by the kind of the part that each explains
    "way-route": Key("ego-way", "route", line=True),
    "way-path": Key("a0-way", "path off the lanes", line=True, dash=(5.0, 4.0)),
    "zone": Key("zone-line", "trigger place", line=True, dash=(5.0, 3.0)),
    "head-green": Key("green", "green", line=True),
    "head-amber": Key("amber", "amber", line=True),
    "head-red": Key("red", "red", line=True),
    "traffic": Key("traffic", "background traffic"),
    "thing": Key("thing", "stands"),
    "before": Key("ghost", "before the change", line=True, dash=(3.0, 3.0)),
    "mistake": Key("mistake", "mistake", line=True),
    "crossing": Key("key-crossing", "crossing"),
    "slippery": Key("slippery", "slippery"),
    "bus_stop": Key("bus_stop", "bus stop"),
    "building": Key("building", "building"),
}


@lru_cache(maxsize=12)
def _ground(network: RoadNetwork, frame: MapFrame) -> tuple[DrawnPart, ...]:
    """Return the roads of a frame; cached, because they stay the same while a user edits a scenario."""
    left, bottom, right, top = frame.bounds
    ground = ground_of(network, within(frame.bounds))
    cut = {
        layer: shapely.clip_by_rect(shape, left - 1, bottom - 1, right + 1, top + 1) for layer, shape in ground.items()
    }
    shapes = ground_shapes(cut, tolerance_m=0.25 / frame.scale)
    return tuple(DrawnPart(shape.paint, (shape,)) for shape in shapes)


# ---- the contents of the map ----------------------------------------------------------------------------------------


class _MapParts:
    """Builds the parts of a map. Names are placed one after the other, the most important ones first."""

    def __init__(self, subject: SceneSubject, frame: MapFrame, sizes: Sizes) -> None:
        self._subject, self._frame, self._sizes = subject, frame, sizes
        self._whole = LabelBox(2, 2, frame.width - 2, frame.height - 2)
        self._room = Room(self._whole)
        self._window = shapely.box(*frame.bounds)
        self._px = 1 / frame.scale
        """Length of a pixel in the world, m."""

    def parts(self) -> list[DrawnPart]:
        """Return all parts, from back to front."""
        bodies = [body for body in self._subject.bodies if self._sees(body)]
        for body in bodies:
            self._room.take(self._box(body))
        self._spare_ways()
        corner, covered = scale_and_north(self._frame, self._sizes)
        self._room.take(*(LabelBox(*outline.min(axis=0), *outline.max(axis=0)) for outline in covered))
        mistakes = self._mistakes()
        named = [self._body(body) for body in sorted(bodies, key=_rank)]
        zones = [self._zone(zone) for zone in self._subject.zones]
        patches = [self._patch(patch) for patch in self._subject.patches]
        names = [part for name in sorted(self._subject.names, key=_importance) if (part := self._name(name))]
        ways = [part for way in self._subject.ways if (part := self._way(way))]
        before = [self._before(body) for body in bodies if body.before is not None]
        heads = [self._head(k) for k in range(len(self._subject.heads))]
        shown_heads = [head for head in heads if head is not None]
        parts = [*patches, *ways, *zones, *shown_heads, *names, *before, *reversed(named), *mistakes, corner]
        return [part for part in parts if part is not None]

    def _spare_ways(self) -> None:
        """Mark the actors' ways, so that names avoid them if there is another place."""
        for way in self._subject.ways:
            line = shapely.LineString(self._frame.pixels(way.points))
            for mark in np.arange(0.0, min(line.length, 3000.0), 8.0).tolist():
                at = line.interpolate(mark)
                self._room.spare(LabelBox(at.x - 3, at.y - 3, at.x + 3, at.y + 3))

    def _sees(self, body: Body) -> bool:
        x, y = self._frame.point(*body.middle)
        return 0 <= x <= self._frame.width and 0 <= y <= self._frame.height

    def _box(self, body: Body) -> LabelBox:
        points = self._frame.pixels(body.corners)
        (left, top), (right, bottom) = points.min(axis=0).tolist(), points.max(axis=0).tolist()
        x, y = (left + right) / 2, (top + bottom) / 2
        least = DISC_PX * 0.8
        return LabelBox(min(left, x - least), min(top, y - least), max(right, x + least), max(bottom, y + least))

    def _words(
        self, paint: str, text: str, thing: LabelBox, *, size: str, insist: bool
    ) -> tuple[Words | None, Shape | None]:
        """Return a label beside a thing, and a line from the label to the thing if they are far apart."""
        px = getattr(self._sizes, size) * self._sizes.room
        box = self._room.beside(thing, width_of(text, px) + 4, px * LINE, insist=insist)
        if box is None:
            return None, None
        x, y = box.middle
        anchor = "middle"
        if box.left >= thing.right:
            x, anchor = box.left + 2, "start"
        elif box.right <= thing.left:
            x, anchor = box.right - 2, "end"
        words = Words(paint, text, x, y, size, anchor, bold=size == "text")
        tx, ty = thing.middle
        near_x, near_y = min(max(tx, box.left), box.right), min(max(ty, box.top), box.bottom)
        edge_x, edge_y = min(max(near_x, thing.left), thing.right), min(max(near_y, thing.top), thing.bottom)
        if math.hypot(near_x - edge_x, near_y - edge_y) < px:
            return words, None
        line = self._frame.metres(np.array([(edge_x, edge_y), (near_x, near_y)]))
        return words, Shape("leader", (line,), closed=False)

    def _body(self, body: Body) -> DrawnPart:
        shapes = body_shapes(body.corners, body.kind, body.tone, self._frame.scale)
        words: tuple[Words, ...] = ()
        if body.tone != "traffic":
            name, changes = shortened(body.name, _LONGEST_NAME), "".join(f", {change}" for change in body.changes)
            paint, thing = f"{body.tone}-name", self._box(body)
            label, leader = self._words(paint, name + changes, thing, size="text", insist=not changes)
            if label is None:  # there is no room for the changes here; the title lists them, too
                label, leader = self._words(paint, name, thing, size="text", insist=True)
            words = (label,) if label is not None else ()
            shapes = (leader, *shapes) if leader is not None else shapes
        title = f"{body.name}: {body.about}" + (f"; {body.mistake}" if body.mistake else "")
        kind = body.tone if body.tone in ("traffic", "thing") else "body"
        return DrawnPart(kind, shapes, words, title, body.name, body.text)

    def _before(self, body: Body) -> DrawnPart:
        assert body.before is not None  # noqa: S101 - the caller passes only such bodies
        return DrawnPart("before", (ghost_shape(body.before),), title=f"{body.name} before the change", name=body.name)

    def _patch(self, patch: Patch) -> DrawnPart:
        shape = Shape("slippery", (patch.outline,))
        return DrawnPart(
            "slippery", (shape,), (), f"{patch.name}: slippery, friction {patch.friction:g}", "", patch.text
        )

    def _zone(self, zone: Zone) -> DrawnPart:
        rings = zone.outlines
        shapes = [Shape("zone", rings, width=0.0)] if zone.closed else []
        width, dash = (1.4, (5.0, 3.0)) if zone.closed else (2.4, ())
        shapes.append(Shape("zone-line", rings, zone.closed, width=width, dash=dash))
        x, y = self._frame.point(*zone.at)
        thing = LabelBox(x - 5, y - 5, x + 5, y + 5)
        if zone.closed:  # the name of a small place is put at its edge
            points = self._frame.pixels(np.vstack(rings))
            low, high = points.min(axis=0).tolist(), points.max(axis=0).tolist()
            small = max(high[0] - low[0], high[1] - low[1]) < 160
            thing = LabelBox(low[0], low[1], high[0], high[1]) if small else thing
        words: tuple[Words, ...] = ()
        if thing.touches(self._whole):
            text = shortened(zone.label, 40)
            label, leader = self._words("zone-name", text, thing, size="small", insist=True)
            words = (label,) if label is not None else ()
            shapes = [*shapes, leader] if leader is not None else shapes
        return DrawnPart("zone", tuple(shapes), words, zone.label, "", zone.text)

    def _way(self, way: ShownWay) -> DrawnPart | None:
        inner = shapely.intersection(shapely.LineString(way.points), self._window)
        lines = [line for line in lines_of(inner) if len(line) > 1]
        if not lines:
            return None
        path = way.kind == "path"
        shapes = [Shape(f"{way.tone}-way", tuple(lines), closed=False, width=2.0, dash=(5.0, 4.0) if path else ())]
        last = lines[-1]
        shapes.append(Shape(f"{way.tone}-arrow", (arrow(last, _ARROW_PX * self._px),), width=0.0))
        whole = np.hypot(*(last[-1] - way.points[-1])) < self._px
        if way.goal and whole:
            shapes.append(Shape(f"{way.tone}-way", (disc(last[-1], _GOAL_PX * self._px),), width=2.0))
        what = "path" if path else "route"
        return DrawnPart(f"way-{what}", tuple(shapes), title=f"{what} of {way.actor}", place=way.text)

    def _head(self, number: int) -> DrawnPart | None:
        head = self._subject.heads[number]
        middle = head.line.mean(axis=0)
        if not shapely.contains_xy(self._window, *middle.tolist()):
            return None
        half = (head.line[0] - head.line[1]) / 2
        half_px = float(np.hypot(*half)) * self._frame.scale
        half = half * (max(half_px, 3.0) / max(half_px, 1e-6))
        width = min(max(half_px, 2.2), 3.4)
        shape = Shape(head.colour, (np.array([middle + half, middle - half]),), closed=False, width=width)
        return DrawnPart(f"head-{head.colour}", (shape,), title=f"signal: {head.colour}")

    def _name(self, name: Name) -> DrawnPart | None:
        points = self._frame.pixels(name.line)
        text = shortened(name.text, _LONGEST_NAME)
        if name.kind == "junction":
            x, y = points[0].tolist()
            if not (0 < x < self._frame.width and 0 < y < self._frame.height):
                return None
            text = f"{text}: {shortened(name.note, _LONGEST_NAME)}" if name.note else text
            thing = LabelBox(x - 1, y - 1, x + 1, y + 1)
            words, _ = self._words("junction-name", text, thing, size="small", insist=False)
            return (
                DrawnPart("junction", (), (words,), f"junction {name.text}", "", name.place)
                if words is not None
                else None
            )
        px = self._sizes.small * self._sizes.room
        map_ = shapely.box(0, 0, self._frame.width, self._frame.height)
        inner = shapely.intersection(shapely.LineString(points), map_)
        pieces = sorted(lines_of(inner), key=lambda line: -shapely.LineString(line).length)
        wide = width_of(text, px)
        if not pieces or shapely.LineString(pieces[0]).length < wide * 1.15:
            return None
        line = shapely.LineString(pieces[0])
        for share in (0.5, 0.35, 0.65, 0.22, 0.78):
            at = line.interpolate(share, normalized=True)
            ahead = line.interpolate(min(share + 0.03, 1.0), normalized=True)
            angle = math.atan2(ahead.y - at.y, ahead.x - at.x)
            angle = angle - math.pi * round(angle / math.pi) if abs(angle) > math.pi / 2 else angle
            if self._room.along(at.x, at.y, angle, wide, px):
                words = Words("road-name", text, at.x, at.y, "small", "middle", angle_deg=math.degrees(angle))
                return DrawnPart("road-name", (), (words,), f"road {name.text}", "", name.place)
        return None

    def _mistakes(self) -> list[DrawnPart]:
        marks = []
        for number, mistake in enumerate(self._subject.mistakes[:_LINES_MOST], start=1):
            if mistake.at is None:
                continue
            x, y = self._frame.point(*mistake.at)
            thing = LabelBox(x - 15, y - 15, x + 15, y + 15)
            label, _ = self._words("mistake-name", str(number), thing, size="text", insist=True)
            ring = Shape("mistake", (disc(np.array(mistake.at), _MISTAKE_PX * self._px),), width=2.4)
            words = (label,) if label is not None else ()
            marks.append(DrawnPart("mistake", (ring,), words, mistake.message, "", mistake.text))
        return marks


def _rank(body: Body) -> int:
    """Return the order in which names are placed: first the ego's, then those of other moving actors, then those of
    things.
    """
    return 0 if body.tone == "ego" else 2 if body.tone in ("thing", "traffic") else 1


def _importance(name: Name) -> tuple[bool, bool]:
    return not name.matters, name.kind == "road"
