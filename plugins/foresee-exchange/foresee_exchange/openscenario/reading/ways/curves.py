"""Shapes of trajectories as points: polylines unchanged; clothoids, clothoid splines and NURBS sampled."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_dsl.compile.foreign.opendrive_geometry import Pose
from foresee_exchange.naming import number
from foresee_exchange.openscenario.losses import NotExpressed
from foresee_exchange.openscenario.reading.places import Places

_STEP_M = 0.5
"""Sampling distance of curves, m (ours: chords are within 2 mm of arcs of 15 m radius)."""
_LONGEST_M = 20_000.0
_INNER_STEPS = 10


@dataclass(frozen=True)
class Vertex:
    """A pose at a time, s (NaN: no time), and whether the file contains its heading."""

    time_s: float
    pose: Pose
    has_heading: bool = True


def vertices(trajectory: Element, places: Places) -> list[Vertex]:
    """Return the points of a `<Trajectory>`; `NotExpressed` for an unsupported shape."""
    shape = trajectory.find("Shape")
    inner = next(iter(shape), None) if shape is not None else None
    if inner is None:
        raise NotExpressed("trajectories: no shape")
    if inner.tag == "Polyline":
        return [_vertex(vertex, places) for vertex in inner.iterfind("Vertex")]
    if inner.tag == "Clothoid":
        return _clothoid(inner, places)
    if inner.tag == "ClothoidSpline":
        return _clothoid_spline(inner, places)
    if inner.tag == "Nurbs":
        return _nurbs(inner, places)
    raise NotExpressed(f"trajectories: {inner.tag}")


def _vertex(vertex: Element, places: Places) -> Vertex:
    position = vertex.find("Position")
    kind = next(iter(position), None) if position is not None else None
    if position is None or kind is None:
        raise NotExpressed("trajectories: vertices without a position")
    orientation = kind.find("Orientation")
    heading = (
        kind.get("h") if kind.tag == "WorldPosition" else orientation.get("h") if orientation is not None else None
    )
    return Vertex(_time(vertex, "time"), places.pose(position), heading is not None)


def _time(element: Element, name: str) -> float:
    return number(element, name, math.nan) if element.get(name) else math.nan


def _clothoid(shape: Element, places: Places) -> list[Vertex]:
    start = shape.find("Position")
    if start is None:
        raise NotExpressed("trajectories: Clothoid (without a position)")
    prime = number(shape, "curvaturePrime", number(shape, "curvatureDot", 0.0))
    length, begin, end = number(shape, "length"), _time(shape, "startTime"), _time(shape, "stopTime")
    return _spiral(places.pose(start), number(shape, "curvature"), prime, length, (begin, end))


def _clothoid_spline(shape: Element, places: Places) -> list[Vertex]:
    line: list[Vertex] = []
    pose: Pose | None = None
    end = _time(shape, "timeEnd")
    segments = shape.findall("ClothoidSplineSegment") or shape.findall("Segment")
    begin = 0.0 if segments and not math.isnan(_time(segments[0], "timeStart")) else math.nan
    for segment in segments:
        start = segment.find("PositionStart")
        if start is not None:
            pose = places.pose(start)
        if pose is None:
            raise NotExpressed("trajectories: ClothoidSpline (without a position)")
        length = number(segment, "length")
        curvature = number(segment, "curvatureStart")
        prime = (number(segment, "curvatureEnd") - curvature) / max(length, 1e-6)
        pose = Pose(pose.x, pose.y, pose.heading_rad + number(segment, "hOffset", 0.0))
        begin = begin if math.isnan(_time(segment, "timeStart")) else _time(segment, "timeStart")
        points = _spiral(pose, curvature, prime, length, (begin, math.nan))
        line += points[1:] if line else points
        pose = points[-1].pose
    if line and not math.isnan(end):
        line[-1] = Vertex(end, line[-1].pose)
    return line


def _spiral(start: Pose, curvature: float, prime: float, length: float, times: tuple[float, float]) -> list[Vertex]:
    """Return points along a clothoid; times are spread evenly from its beginning to its end."""
    if not 0 < length <= _LONGEST_M:
        raise NotExpressed("trajectories: curves without a length")
    steps = max(math.ceil(length / _STEP_M), 1)
    ds = length / steps / _INNER_STEPS
    x, y, s = start.x, start.y, 0.0
    line = [Vertex(times[0], start)]
    for k in range(1, steps + 1):
        for _ in range(_INNER_STEPS):  # the midpoint rule of integration
            middle = s + ds / 2
            heading = start.heading_rad + curvature * middle + prime * middle * middle / 2
            x, y, s = x + ds * math.cos(heading), y + ds * math.sin(heading), s + ds
        time_s = times[0] + (times[1] - times[0]) * k / steps
        line.append(Vertex(time_s, Pose(x, y, start.heading_rad + curvature * s + prime * s * s / 2)))
    return line


def _nurbs(shape: Element, places: Places) -> list[Vertex]:
    """Return points of a NURBS; the times of its first and last control point are spread evenly along it."""
    order = round(number(shape, "order"))
    controls = shape.findall("ControlPoint")
    knots = [number(knot, "value") for knot in shape.iterfind("Knot")]
    if not 2 <= order <= len(controls) or len(knots) != len(controls) + order or sorted(knots) != knots:
        raise NotExpressed("trajectories: Nurbs (knots and control points do not fit)")
    points = []
    for control in controls:
        position = control.find("Position")
        if position is None:
            raise NotExpressed("trajectories: Nurbs (without a position)")
        pose = places.pose(position)
        points.append((pose.x, pose.y, number(control, "weight", 1.0)))
    polygon = sum(math.dist(a[:2], b[:2]) for a, b in itertools.pairwise(points))
    steps = min(max(math.ceil(polygon / _STEP_M), 2), 10_000)
    low, high = knots[order - 1], knots[len(controls)]
    if high <= low:
        raise NotExpressed("trajectories: Nurbs (knots and control points do not fit)")
    curve = [_de_boor(points, knots, order, low + (high - low) * k / steps) for k in range(steps + 1)]
    begin, end = _time(controls[0], "time"), _time(controls[-1], "time")
    return [
        Vertex(begin + (end - begin) * k / steps, Pose(x, y, 0.0), has_heading=False) for k, (x, y) in enumerate(curve)
    ]


def _de_boor(
    points: Sequence[tuple[float, float, float]], knots: Sequence[float], order: int, u: float
) -> tuple[float, float]:
    """Return the point of a NURBS at a parameter."""
    degree, last = order - 1, len(points) - 1
    k = next((i for i in range(degree, last + 1) if knots[i] <= u < knots[i + 1]), None)
    if k is None:
        k = max(i for i in range(degree, last + 1) if knots[i] < knots[i + 1])
    row = [(x * w, y * w, w) for x, y, w in points[k - degree : k + 1]]
    for r in range(1, degree + 1):
        for j in range(degree, r - 1, -1):
            left = knots[j + k - degree]
            span = knots[j + 1 + k - r] - left
            share = (u - left) / span if span else 0.0
            before, now = row[j - 1], row[j]
            row[j] = (
                (1 - share) * before[0] + share * now[0],
                (1 - share) * before[1] + share * now[1],
                (1 - share) * before[2] + share * now[2],
            )
    x, y, w = row[degree]
    if abs(w) < 1e-12:
        raise NotExpressed("trajectories: Nurbs (weights of nothing)")
    return x / w, y / w
