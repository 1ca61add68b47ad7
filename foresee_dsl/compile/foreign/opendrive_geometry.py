"""Computes positions on OpenDRIVE roads from reference lines, lane sections and lane widths."""

from __future__ import annotations

import bisect
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_dsl.compile.nets.safe_xml import parse_xml
from foresee_dsl.errors import CompileError, ForeseeError

_SPIRAL_STEP_M = 0.25
"""Step of the integral over a clothoid, m (ours: at a curvature of 0.1 1/m, the error of Simpson's rule is then below a
micrometre).
"""

_LARGEST = 1e12
"""Largest accepted number in a map (ours: far beyond any coordinate, and its cube is still finite)."""


@dataclass(frozen=True)
class Pose:
    """A point, m, a heading, rad, counter-clockwise from east (NaN: unknown), and a height, m (None: unknown)."""

    x: float
    y: float
    heading_rad: float
    z: float | None = None

    def beside(self, left_m: float) -> Pose:
        """Return the pose `left_m` to the left."""
        sine, cosine = math.sin(self.heading_rad), math.cos(self.heading_rad)
        return Pose(self.x - left_m * sine, self.y + left_m * cosine, self.heading_rad)

    def ahead(self, by_m: float) -> Pose:
        """Return the pose `by_m` ahead."""
        sine, cosine = math.sin(self.heading_rad), math.cos(self.heading_rad)
        return Pose(self.x + by_m * cosine, self.y + by_m * sine, self.heading_rad)


class OpenDriveRoads:
    """The roads of an OpenDRIVE map, by id."""

    def __init__(self, root: Element) -> None:
        """Take the root of the map; a road is parsed on each access."""
        self._roads = {road.get("id", ""): road for road in root.iterfind("road")}

    @classmethod
    def read(cls, path: Path) -> OpenDriveRoads:
        """Return the roads of a map file."""
        return cls(parse_xml(path, "OpenDRIVE", "an OpenDRIVE map"))

    def at(self, road: str, s: float, t: float) -> Pose:
        """Return the pose on a road at position `s` along it, `t` to the left of its reference line, m."""
        element = self._road(road)
        geometries = element.findall("planView/geometry")
        length = number(element, "length", math.inf)
        if not geometries or not -1e-3 <= s <= length + 0.1:
            raise CompileError(f"the map's road {road} is {length:.1f} m long, so it has no place at {s:g} m")
        geometry = _last_before(geometries, s)
        return _along(geometry, s - number(geometry, "s")).beside(t)

    def lane(self, road: str, lane: int, s: float, offset: float = 0.0) -> Pose:
        """Return the pose in the middle of a lane, or `offset` m to its left, in the road's direction."""
        element = self._road(road)
        side = 1 if lane > 0 else -1
        t = cubic_at(element.iterfind("lanes/laneOffset"), "s", s)
        sections = element.findall("lanes/laneSection")
        if not sections:
            raise CompileError(f"the map's road {road} has no lanes")
        section = _last_before(sections, s, 0.0)
        ds = s - number(section, "s", 0.0)
        lanes = {int(number(e, "id")): e for e in section.iterfind(f"{'left' if lane > 0 else 'right'}/lane")}
        for k in range(side, lane + side, side):
            if k not in lanes:
                raise CompileError(f"the map's road {road} has no lane {lane} at {s:g} m")
            width = cubic_at(lanes[k].iterfind("width"), "sOffset", ds)
            t += side * (width / 2 if k == lane else width)
        return self.at(road, s, t + offset)

    def _road(self, road: str) -> Element:
        if road not in self._roads:
            raise CompileError(f"the map has no road {road}")
        return self._roads[road]


def _last_before(elements: Sequence[Element], s: float, default: float | None = None) -> Element:
    """Return the last of some elements that begins at a length along the road, or before it."""
    starts = [number(element, "s", default) for element in elements]
    return elements[max(bisect.bisect_right(starts, s) - 1, 0)]


def _along(geometry: Element, ds: float) -> Pose:
    """Return the pose on one piece of a reference line."""
    x, y, heading = (number(geometry, name) for name in ("x", "y", "hdg"))
    shape = next(iter(geometry), None)
    if shape is None or shape.tag == "line":
        u, v, turned = ds, 0.0, 0.0
    elif shape.tag == "arc":
        curvature = number(shape, "curvature")
        u, v, turned = ds, 0.0, curvature * ds
        if abs(curvature) >= 1e-12:
            u, v = math.sin(turned) / curvature, (1 - math.cos(turned)) / curvature
    elif shape.tag == "spiral":
        length = max(number(geometry, "length"), 1e-9)
        start, end = number(shape, "curvStart"), number(shape, "curvEnd")
        u, v, turned = _spiral(start, (end - start) / length, ds)
    elif shape.tag == "poly3":
        u, v, turned = _explicit([number(shape, name) for name in "abcd"], ds)
    elif shape.tag == "paramPoly3":
        whole = shape.get("pRange", "arcLength") != "normalized"
        p = ds if whole else ds / max(number(geometry, "length"), 1e-9)
        us, vs = ([number(shape, f"{c}{axis}") for c in "abcd"] for axis in "UV")
        u, v = _poly(us, p), _poly(vs, p)
        turned = math.atan2(_slope(vs, p), _slope(us, p))
    else:
        raise CompileError(f"the map has a piece of road of the unknown kind <{shape.tag}>")
    cosine, sine = math.cos(heading), math.sin(heading)
    return Pose(x + u * cosine - v * sine, y + u * sine + v * cosine, heading + turned)


def _spiral(curvature: float, change: float, ds: float) -> tuple[float, float, float]:
    """Return the point and the turn at a position along a clothoid."""

    def turned(s: float) -> float:
        return curvature * s + change * s * s / 2

    steps = 2 * max(math.ceil(abs(ds) / _SPIRAL_STEP_M), 1)
    u = _integral(lambda s: math.cos(turned(s)), ds, steps)
    v = _integral(lambda s: math.sin(turned(s)), ds, steps)
    return u, v, turned(ds)


def _explicit(cubic: Sequence[float], ds: float) -> tuple[float, float, float]:
    """Return the point at a position along v = cubic(u); Newton's method computes u."""
    u = ds
    for _ in range(20):
        length = _integral(lambda u: math.hypot(1, _slope(cubic, u)), u, 20)
        u -= (length - ds) / math.hypot(1.0, _slope(cubic, u))
        if abs(length - ds) < 1e-9:
            break
    return u, _poly(cubic, u), math.atan(_slope(cubic, u))


def _integral(of: Callable[[float], float], until: float, steps: int) -> float:
    """Integrate from 0 by Simpson's rule."""
    h = until / steps
    return sum((1 if k in (0, steps) else 4 if k % 2 else 2) * of(k * h) for k in range(steps + 1)) * h / 3


def _poly(cubic: Sequence[float], p: float) -> float:
    a, b, c, d = cubic
    return a + p * (b + p * (c + p * d))


def _slope(cubic: Sequence[float], p: float) -> float:
    _, b, c, d = cubic
    return b + p * (2 * c + 3 * d * p)


def cubic_at(elements: Iterable[Element], start: str, s: float) -> float:
    """Return a + b ds + c ds^2 + d ds^3 of the last element that begins at `s` or before (by its attribute `start`); 0
    if there is none."""
    value = 0.0
    for element in elements:
        begins = number(element, start, 0.0)
        cubic = [number(element, name, 0.0) for name in "abcd"]
        if begins <= s + 1e-9:
            value = _poly(cubic, s - begins)
    return value


def number(
    element: Element,
    name: str,
    default: float | None = None,
    *,
    error: type[ForeseeError] = CompileError,
    of: str = "the map's",
) -> float:
    """Return an attribute as a number.

    Raises:
        error: the attribute is missing without a default, is not a number, or is absurdly large; `of` names its file in
            the message.
    """
    text = element.get(name)
    if text is None and default is not None:
        return default
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    if not abs(value) <= _LARGEST:  # this comparison is also False for NaN
        fault = "is missing" if text is None else f"is '{text[:50]}', which is not a usable number"
        raise error(f"{of} attribute {name} of <{element.tag}> {fault}")
    return value
