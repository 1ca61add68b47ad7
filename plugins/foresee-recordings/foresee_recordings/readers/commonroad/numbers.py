"""The numbers of a CommonRoad obstacle: the states of its trajectory, and the rectangle around its shape."""

from __future__ import annotations

import math
from dataclasses import dataclass
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

_SMALLEST_M = 0.1
"""Smallest length and width of a footprint, m. Ours: a point or a line has no area, and SUMO refuses such actors."""
_LARGEST_M = 1000.0
"""Largest length and width of a footprint, m. Ours: longer than any vehicle, shorter than a map."""


@dataclass(frozen=True)
class State:
    """A state: its time step, position, m, direction, rad, and speed, m/s; NaN for a missing number.

    `uncertain` is True if the file has a range for one of them.
    """

    step: float
    x: float
    y: float
    heading: float
    speed: float
    uncertain: bool


@dataclass(frozen=True)
class Footprint:
    """The rectangle around a shape, along its direction: its size (length and width, m) and its centre in the
    obstacle's frame, m."""

    size_m: tuple[float, float]
    centre: tuple[float, float]


def footprint_of(shape: Element) -> Footprint:
    """Return the rectangle around a `<shape>`.

    Raises:
        ValueError: it has no usable rectangle, circle or polygon.
    """
    corners = [corner for part in shape for corner in _corners(part)]
    if not corners:
        raise ValueError("its <shape> has no rectangle, circle or polygon")
    (low_x, high_x), (low_y, high_y) = ((min(axis), max(axis)) for axis in zip(*corners, strict=True))
    length_m, width_m = high_x - low_x, high_y - low_y
    if not (0.0 <= length_m < _LARGEST_M and 0.0 <= width_m < _LARGEST_M):
        raise ValueError(f"its shape of {length_m:g} m by {width_m:g} m has no usable size")
    size_m = max(length_m, _SMALLEST_M), max(width_m, _SMALLEST_M)
    return Footprint(size_m, ((low_x + high_x) / 2, (low_y + high_y) / 2))


def state_of(element: Element) -> State | None:
    """Return a state; None if it has no position or no time.

    Raises:
        ValueError: a number of it is not a number.
    """
    ranges: list[bool] = []
    position = element.find("position")
    place = None if position is None else _place(position, ranges)
    step = _value(element, "time", ranges)
    if place is None or math.isnan(step):
        return None
    heading, speed = _value(element, "orientation", ranges), _value(element, "velocity", ranges)
    lateral = _value(element, "velocityY", ranges)
    if math.isnan(heading) and not math.isnan(lateral):  # the point-mass state has a velocity vector instead
        heading, speed = math.atan2(lateral, speed), math.hypot(lateral, speed)
    return State(step, *place, heading, speed, any(ranges))


def number(element: Element, tag: str) -> float:
    """Return the number in a child; NaN without this child.

    Raises:
        ValueError: it is not a number.
    """
    text = element.findtext(tag)
    if text is None:
        return math.nan
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"<{tag}> holds {text.strip()[:20]!r}, not a number") from None


def point(element: Element) -> tuple[float, float]:
    """Return the `<x>` and `<y>` of a point, m; heights are left out.

    Raises:
        ValueError: one of them is missing or is not a number.
    """
    x, y = number(element, "x"), number(element, "y")
    if math.isnan(x) or math.isnan(y):
        raise ValueError(f"a <{element.tag}> has no <x> or no <y>")
    return x, y


def _value(element: Element, tag: str, ranges: list[bool]) -> float:
    """Return the exact number of a child, or the middle of its interval; NaN without one."""
    child = element.find(tag)
    if child is None:
        return math.nan
    exact = number(child, "exact")
    if not math.isnan(exact):
        return exact
    low, high = number(child, "intervalStart"), number(child, "intervalEnd")
    ranges.append(not math.isnan(low))
    return (low + high) / 2


def _place(position: Element, ranges: list[bool]) -> tuple[float, float] | None:
    """Return a position, m: the point, or the middle of the area; None for a reference to a lanelet."""
    at = position.find("point")
    if at is not None:
        return number(at, "x"), number(at, "y")
    corners = [corner for part in position for corner in _corners(part)]
    if not corners:
        return None
    ranges.append(True)
    (low_x, high_x), (low_y, high_y) = ((min(axis), max(axis)) for axis in zip(*corners, strict=True))
    return (low_x + high_x) / 2, (low_y + high_y) / 2


def _corners(part: Element) -> list[tuple[float, float]]:
    """Return the corners of a rectangle, a circle (of its bounding square) or a polygon; none for another element."""
    if part.tag == "polygon":
        return [point(corner) for corner in part.iterfind("point")]
    centre = part.find("center")
    x, y = (0.0, 0.0) if centre is None else point(centre)
    if part.tag == "circle":
        radius = number(part, "radius")
        return [(x - radius, y - radius), (x + radius, y + radius)]
    if part.tag != "rectangle":
        return []
    ahead, left = number(part, "length") / 2, number(part, "width") / 2
    turned = number(part, "orientation")
    cos, sin = (1.0, 0.0) if math.isnan(turned) else (math.cos(turned), math.sin(turned))
    corners = ((ahead, left), (-ahead, left), (-ahead, -left), (ahead, -left))
    return [(x + u * cos - v * sin, y + u * sin + v * cos) for u, v in corners]
