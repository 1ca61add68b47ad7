"""A sheet: the shapes and texts of a picture in pixels, from which the SVG, the PNG and the live page are drawn."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import shapely

from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.report.ground import LINES, Layer, ground_of, lines_of, rings_of, within, zebra
from foresee_dsl.report.picture.crop import Frame, frame_of
from foresee_dsl.report.picture.labels import LINE, Box, Room, width_of, wrapped
from foresee_dsl.report.picture.subject import Body, FloatArray, Name, Patch, Subject, TextPlace, Way, Zone
from foresee_dsl.report.safe_text import shortened

WIDTH = 720.0
"""Width of a picture in a file, px. Ours: a page's column; a phone shows it at half the size, with larger letters."""
PAD = 14.0
_LONGEST_NAME = 22
_SMALLEST_PX = 15.0
"""A shorter body gets a disc behind it, px. Ours: the size that an eye notices and a fingertip hits."""
_DISC_PX = 10.0
_LINES_MOST = 6
"""Maximum number of a mutant's changes, and of errors, that are listed under the title (ours)."""


@dataclass(frozen=True)
class Sizes:
    """Sizes of letters, px: names and text, small text, title."""

    text: float = 13.0
    small: float = 11.5
    title: float = 16.0
    room: float = 1.45
    """Factor by which letters are larger on a phone; names are placed for the larger letters."""


FILE_SIZES, LIVE_SIZES = Sizes(), Sizes(room=1.0)


@dataclass(frozen=True)
class Shape:
    """Outlines (closed) or lines in one paint; `width` and `dash` of the line, px."""

    paint: str
    rings: tuple[FloatArray, ...]
    closed: bool = True
    width: float = 1.0
    dash: tuple[float, ...] = ()


@dataclass(frozen=True)
class Words:
    """A line of text; `x` is its left end, middle or right end by `anchor`, `y` its middle, px."""

    paint: str
    text: str
    x: float
    y: float
    size: str = "text"
    anchor: str = "start"
    bold: bool = False
    angle_deg: float = 0.0


@dataclass(frozen=True)
class Part:
    """The shapes and words of one object, such as a body or a trigger place; `place`: where it is written."""

    kind: str
    shapes: tuple[Shape, ...] = ()
    words: tuple[Words, ...] = ()
    title: str = ""
    name: str = ""
    place: TextPlace | None = None


@dataclass(frozen=True)
class Sheet:
    """A whole picture; `parts` are in the map's pixels, `around` in the sheet's pixels."""

    width: float
    height: float
    map_top: float
    frame: Frame
    parts: tuple[Part, ...]
    around: tuple[Part, ...]
    label: str
    sizes: Sizes
    places: tuple[Path, ...] = ()


def sheet_of(subject: Subject, *, width: float = WIDTH, whole: bool = False, sizes: Sizes = FILE_SIZES) -> Sheet:
    """Return the sheet of a subject.

    Args:
        subject: the contents. width: width of the sheet, px. whole: show the whole network, not only the actors' part.
        sizes: letters: `FILE_SIZES` for a file that is shown at any width, `LIVE_SIZES` for exactly this width.
    """
    head, top = _header(subject, width, sizes)
    frame = frame_of(subject, width - 2 * PAD, whole=whole)
    parts = (*_ground(subject.network, frame), *_Map(subject, frame, sizes).parts())
    below, height = _legend(parts, width, top + frame.height + PAD, sizes)
    label = f"{subject.title}: {subject.about or 'a road network from above'}"
    files = {part.place.path for part in parts if part.place is not None}
    around = (*head, *below)
    return Sheet(width, height, top, frame, parts, around, shortened(label, 300), sizes, tuple(sorted(files)))


# ---- around the map -------------------------------------------------------------------------------------------------


def _header(subject: Subject, width: float, sizes: Sizes) -> tuple[list[Part], float]:
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
    return [Part("header", words=tuple(words))], y + PAD / 2


_KEYS = (  # entries of the legend: kind of part, paint, whether it is a line, dashes, words
    ("way-route", "ego-way", True, (), "route"),
    ("way-path", "a0-way", True, (5.0, 4.0), "path off the lanes"),
    ("zone", "zone-line", True, (5.0, 3.0), "trigger place"),
    ("head-green", "green", True, (), "green"),
    ("head-amber", "amber", True, (), "amber"),
    ("head-red", "red", True, (), "red"),
    ("traffic", "traffic", False, (), "background traffic"),
    ("thing", "thing", False, (), "stands"),
    ("before", "before", True, (3.0, 3.0), "before the change"),
    ("mistake", "mistake", True, (), "mistake"),
    ("crossing", "key-crossing", False, (), "crossing"),
    ("slippery", "slippery", False, (), "slippery"),
    ("bus_stop", "bus_stop", False, (), "bus stop"),
    ("building", "building", False, (), "building"),
)


def _legend(parts: tuple[Part, ...], width: float, top: float, sizes: Sizes) -> tuple[list[Part], float]:
    there = {part.kind for part in parts}
    px = sizes.small * sizes.room
    x, y = PAD, top + px * LINE / 2
    keys: list[Part] = []
    for kind, paint, line, dash, text in _KEYS:
        if kind not in there:
            continue
        wide = 24 + width_of(text, px)
        if x + wide > width - PAD and x > PAD:
            x, y = PAD, y + px * 1.6
        mark = np.array([(x, y), (x + 18, y)]) if line else _rectangle(x + 1, y - 5, x + 17, y + 5)
        shape = Shape(paint, (mark,), closed=not line, width=3.0 if line else 1.0, dash=dash)
        keys.append(Part("key", (shape,), (Words("quiet", text, x + 24, y, "small"),)))
        x += wide + 14
    return keys, (y + px * LINE / 2 + PAD if keys else top)


def _rectangle(left: float, top: float, right: float, bottom: float) -> FloatArray:
    return np.array([(left, top), (right, top), (right, bottom), (left, bottom)])


# ---- the ground -----------------------------------------------------------------------------------------------------


@lru_cache(maxsize=12)
def _ground(network: RoadNetwork, frame: Frame) -> tuple[Part, ...]:
    """Return the roads of a frame; cached, because they do not change while a user edits a scenario."""
    left, bottom, right, top = frame.bounds
    ground = ground_of(network, within(frame.bounds))
    # lines are true to scale, but neither thicker than a pencil line nor too thin to see
    marking = min(max(0.15 * frame.scale, 0.5), 1.6)
    layers = []
    for layer, shape in ground.items():
        cut = shapely.clip_by_rect(shape, left - 1, bottom - 1, right + 1, top + 1)
        if cut.is_empty:
            continue
        if layer is Layer.CROSSING:
            cut = zebra(cut)
        lined = layer in LINES
        if layer is not Layer.STOP_LINE:
            cut = shapely.simplify(cut, 0.25 / frame.scale)
        rings = tuple(frame.pixels(ring) for ring in (lines_of(cut) if lined else rings_of(cut)))
        dash = (max(1.5 * frame.scale, 2.5),) * 2 if layer is Layer.MARKING else ()
        width = marking * (2 if layer is Layer.STOP_LINE else 1)
        if rings:
            layers.append(Part(layer.value, (Shape(layer.value, rings, not lined, width, dash),)))
    return tuple(layers)


# ---- the contents of the map ----------------------------------------------------------------------------------------


class _Map:
    """Builds the parts of a map; names are placed one after the other, in the order of importance."""

    def __init__(self, subject: Subject, frame: Frame, sizes: Sizes) -> None:
        self._subject, self._frame, self._sizes = subject, frame, sizes
        self._whole = Box(2, 2, frame.width - 2, frame.height - 2)
        self._room = Room(self._whole)
        self._window = shapely.box(0, 0, frame.width, frame.height)

    def parts(self) -> list[Part]:
        """Return all parts in the order of drawing, from back to front."""
        bodies = [body for body in self._subject.bodies if self._sees(body)]
        for body in bodies:
            self._room.take(self._box(body))
        self._spare_ways()
        corner = self._scale_and_north()
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
        """Mark the ways, so that names avoid them if there is another place."""
        for way in self._subject.ways:
            line = shapely.LineString(self._frame.pixels(way.points))
            for mark in np.arange(0.0, min(line.length, 3000.0), 8.0).tolist():
                at = line.interpolate(mark)
                self._room.spare(Box(at.x - 3, at.y - 3, at.x + 3, at.y + 3))

    def _sees(self, body: Body) -> bool:
        x, y = self._frame.point(*body.middle)
        return 0 <= x <= self._frame.width and 0 <= y <= self._frame.height

    def _box(self, body: Body) -> Box:
        points = self._frame.pixels(body.corners)
        (left, top), (right, bottom) = points.min(axis=0).tolist(), points.max(axis=0).tolist()
        x, y = (left + right) / 2, (top + bottom) / 2
        least = _DISC_PX * 0.8
        return Box(min(left, x - least), min(top, y - least), max(right, x + least), max(bottom, y + least))

    def _words(
        self, paint: str, text: str, thing: Box, *, size: str, insist: bool
    ) -> tuple[Words | None, Shape | None]:
        """Return a label beside a thing, and the line to the thing if the label is not close to it."""
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
        return words, Shape("leader", (np.array([(edge_x, edge_y), (near_x, near_y)]),), closed=False, width=1.0)

    def _body(self, body: Body) -> Part:
        points = self._frame.pixels(body.corners)
        length = float(np.hypot(*(points[0] - points[1])))
        shapes: list[Shape] = []
        x, y = points.mean(axis=0).tolist()
        if body.tone != "traffic" and length < _SMALLEST_PX:
            shapes.append(Shape(f"{body.tone}-halo", (_disc(x, y, _DISC_PX),), width=0.0))
        if body.kind == "pedestrian":
            shapes.append(Shape(body.tone, (_disc(x, y, max(length / 2, 3.5 if body.tone != "traffic" else 2.0)),)))
        else:
            outline = points if length >= 5 else (points - (x, y)) * (5 / max(length, 0.1)) + (x, y)
            shapes.append(Shape(body.tone, (outline,), width=0.8))
            if body.kind != "obstacle" and length > 6:
                front_left, rear_left, rear_right, front_right = outline
                screen = (front_left + 0.22 * (rear_left - front_left), front_right + 0.22 * (rear_right - front_right))
                nose = (front_left + front_right) / 2 + 0.02 * (rear_left - front_left)
                shapes.append(Shape("plate", (np.array([screen[0], nose, screen[1]]),), width=0.0))
        words: tuple[Words, ...] = ()
        if body.tone != "traffic":
            name, changes = shortened(body.name, _LONGEST_NAME), "".join(f", {change}" for change in body.changes)
            paint, thing = f"{body.tone}-name", self._box(body)
            label, leader = self._words(paint, name + changes, thing, size="text", insist=not changes)
            if label is None:  # no room for the changes, which the title lists too
                label, leader = self._words(paint, name, thing, size="text", insist=True)
            words = (label,) if label is not None else ()
            shapes = [leader, *shapes] if leader is not None else shapes
        title = f"{body.name}: {body.about}" + (f"; {body.mistake}" if body.mistake else "")
        kind = body.tone if body.tone in ("traffic", "thing") else "body"
        return Part(kind, tuple(shapes), words, title, body.name, body.text)

    def _before(self, body: Body) -> Part:
        assert body.before is not None  # noqa: S101 - the caller passes only such bodies
        shape = Shape("before", (self._frame.pixels(body.before),), width=1.3, dash=(3.0, 3.0))
        return Part("before", (shape,), title=f"{body.name} before the change", name=body.name)

    def _patch(self, patch: Patch) -> Part:
        shape = Shape("slippery", (self._frame.pixels(patch.outline),))
        return Part("slippery", (shape,), (), f"{patch.name}: slippery, friction {patch.friction:g}", "", patch.text)

    def _zone(self, zone: Zone) -> Part:
        rings = tuple(self._frame.pixels(outline) for outline in zone.outlines)
        shapes = [Shape("zone", rings, width=0.0)] if zone.closed else []
        width, dash = (1.4, (5.0, 3.0)) if zone.closed else (2.4, ())
        shapes.append(Shape("zone-line", rings, zone.closed, width, dash))
        x, y = self._frame.point(*zone.at)
        thing = Box(x - 5, y - 5, x + 5, y + 5)
        if zone.closed:  # the name of a small place stands at its edge
            low, high = np.vstack(rings).min(axis=0).tolist(), np.vstack(rings).max(axis=0).tolist()
            small = max(high[0] - low[0], high[1] - low[1]) < 160
            thing = Box(low[0], low[1], high[0], high[1]) if small else thing
        words: tuple[Words, ...] = ()
        if thing.touches(self._whole):
            text = shortened(zone.label, 40)
            label, leader = self._words("zone-name", text, thing, size="small", insist=True)
            words = (label,) if label is not None else ()
            shapes = [*shapes, leader] if leader is not None else shapes
        return Part("zone", tuple(shapes), words, zone.label, "", zone.text)

    def _way(self, way: Way) -> Part | None:
        inner = shapely.intersection(shapely.LineString(self._frame.pixels(way.points)), self._window)
        lines = [line for line in lines_of(inner) if len(line) > 1]
        if not lines:
            return None
        path = way.kind == "path"
        shapes = [Shape(f"{way.tone}-way", tuple(lines), False, 2.0, (5.0, 4.0) if path else ())]
        last = lines[-1]
        shapes.append(Shape(f"{way.tone}-arrow", (_arrow(last),), width=0.0))
        whole = np.hypot(*(last[-1] - self._frame.pixels(way.points[-1:])[0])) < 1
        if way.goal and whole:
            x, y = last[-1].tolist()
            shapes.append(Shape(f"{way.tone}-way", (_disc(x, y, 6.0),), width=2.0))
        what = "path" if path else "route"
        return Part(f"way-{what}", tuple(shapes), title=f"{what} of {way.actor}", place=way.text)

    def _head(self, number: int) -> Part | None:
        head = self._subject.heads[number]
        line = self._frame.pixels(head.line)
        middle = line.mean(axis=0)
        if not shapely.contains_xy(self._window, *middle.tolist()):
            return None
        half = (line[0] - line[1]) / 2
        size = float(np.hypot(*half))
        half = half * (max(size, 3.0) / max(size, 1e-6))
        shape = Shape(head.colour, (np.array([middle + half, middle - half]),), False, min(max(size, 2.2), 3.4))
        return Part(f"head-{head.colour}", (shape,), title=f"signal: {head.colour}")

    def _name(self, name: Name) -> Part | None:
        points = self._frame.pixels(name.line)
        text = shortened(name.text, _LONGEST_NAME)
        if name.kind == "junction":
            x, y = points[0].tolist()
            if not shapely.contains_xy(self._window, x, y):
                return None
            text = f"{text}: {shortened(name.note, _LONGEST_NAME)}" if name.note else text
            thing = Box(x - 1, y - 1, x + 1, y + 1)
            words, _ = self._words("junction-name", text, thing, size="small", insist=False)
            return (
                Part("junction", (), (words,), f"junction {name.text}", "", name.place) if words is not None else None
            )
        px = self._sizes.small * self._sizes.room
        inner = shapely.intersection(shapely.LineString(points), self._window)
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
                return Part("road-name", (), (words,), f"road {name.text}", "", name.place)
        return None

    def _mistakes(self) -> list[Part]:
        marks = []
        for number, mistake in enumerate(self._subject.mistakes[:_LINES_MOST], start=1):
            if mistake.at is None:
                continue
            x, y = self._frame.point(*mistake.at)
            thing = Box(x - 15, y - 15, x + 15, y + 15)
            label, _ = self._words("mistake-name", str(number), thing, size="text", insist=True)
            ring = Shape("mistake", (_disc(x, y, 16.0),), width=2.4)
            words = (label,) if label is not None else ()
            marks.append(Part("mistake", (ring,), words, mistake.message, "", mistake.text))
        return marks

    def _scale_and_north(self) -> Part:
        frame = self._frame
        metres = next((m for m in (2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000) if m * frame.scale > 55), 10_000)
        length, y = metres * frame.scale, frame.height - 12
        px = self._sizes.small * self._sizes.room
        plate = _rectangle(6, y - px - 9, max(length, width_of(f"{metres} m", px)) + 26, frame.height - 5)
        bar = np.array([(14, y - 4), (14, y), (14 + length, y), (14 + length, y - 4)])
        right = frame.width - 18
        north = np.array([(right, 8), (right + 6, 26), (right, 22), (right - 6, 26)])
        self._room.take(Box(0, plate[0][1], plate[1][0], frame.height), Box(right - 10, 0, frame.width, 30))
        shapes = (
            Shape("plate", (plate,), width=0.0),
            Shape("ink", (bar,), closed=False, width=1.6),
            Shape("ink", (north,), width=0.6),
        )
        words = Words("ink", f"{metres} m", 18, y - 5 - px / 2, "small")
        return Part("scale", shapes, (words,), "scale; north is up")


def _rank(body: Body) -> int:
    """Return the order in which names are placed: the ego's, then other moving actors', then those of things."""
    return 0 if body.tone == "ego" else 2 if body.tone in ("thing", "traffic") else 1


def _importance(name: Name) -> tuple[bool, bool]:
    return not name.matters, name.kind == "road"


def _disc(x: float, y: float, radius: float) -> FloatArray:
    turns = np.linspace(0, 2 * math.pi, 24, endpoint=False)
    return np.column_stack((x + radius * np.cos(turns), y + radius * np.sin(turns)))


def _arrow(line: FloatArray, size: float = 9.0) -> FloatArray:
    """Return an arrowhead at a line's end."""
    end = line[-1]
    back = next((p for p in line[::-1] if np.hypot(*(end - p)) > size / 2), line[0])
    way = end - back
    ahead = way / max(float(np.hypot(*way)), 1e-6)
    aside = np.array((-ahead[1], ahead[0]))
    return np.array([end, end - size * ahead + size * 0.42 * aside, end - size * ahead - size * 0.42 * aside])
