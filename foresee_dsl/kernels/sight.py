"""Lines of sight past boxes and walls, as kernels (see `kernels.compiling`).

Positions are relative to an eye at some height above flat ground. A body hides a point if the straight line from the
eye to the point crosses the body's footprint and is, somewhere on that stretch, lower than the body's top. So a parked
car hides a child but not an adult's head, and a lorry hides both. Buildings are infinitely high.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foresee_dsl.kernels.arrays import BoolArray, FloatArray, IntArray, Record, Records
from foresee_dsl.kernels.compiling import FLOAT, TABLE, compiled, inner
from foresee_dsl.kernels.lines import nearest_on_segment
from foresee_dsl.kernels.records import array_of, dtype_of

X, Y, HEADING, SPEED = range(4)
"""Columns of the states and poses of objects, as in `Trace.states`."""
MARKS = 5
"""Number of points of a body whose visibility is tested: its corners and its centre."""
_TINY = 1e-12
"""Replaces 0 in a division."""
_SLACK_M = 1e-6
"""Slack for rounding errors when many points are tested at once, m."""


class BodyRecord(NamedTuple):
    """The visible body of an object.

    Attributes:
        length, width: size of its footprint, m. top, high, low: its top and the two tested heights, above the eye, m.
        range: distance within which it can be seen, m. heading_spread: standard deviation of its measured heading, rad.
    """

    length: float
    width: float
    top: float
    high: float
    low: float
    range: float
    heading_spread: float


class Wall(NamedTuple):
    """A side of a building: its begin, and the vector to its end, counter-clockwise around the building, m."""

    x: float
    y: float
    way_x: float
    way_y: float


class SightLimits(NamedTuple):
    """The limits of a sensor.

    Attributes:
        reach: distance beyond which bodies hide nothing, m. ahead_share: cosine of half the field of view (less than
            -1: all around). least_marks: a body is in sight if at least this number of its marks are.
    """

    reach: float
    ahead_share: float
    least_marks: float


class _SeenBox(NamedTuple):
    """A footprint relative to the eye, m.

    Attributes:
        gap: distance of its centre from the eye.
        who: index of its object.
        radius: radius of the circle around it.
    """

    x: float
    y: float
    gap: float
    who: int
    cos: float
    sin: float
    half_length: float
    half_width: float
    top: float
    radius: float


class _FacingWall(NamedTuple):
    """A wall whose outer side faces the eye, relative to the eye, m.

    Attributes:
        from_x, from_y, to_x, to_y: its ends. outer_x, outer_y: a vector to its outer side. depth: distance of the eye
            on that side times the length of that vector (negative). from_m, to_m, outer_m: lengths of the vectors.
    """

    from_x: float
    from_y: float
    to_x: float
    to_y: float
    outer_x: float
    outer_y: float
    depth: float
    from_m: float
    to_m: float
    outer_m: float


BODIES, WALLS, LIMITS = array_of(BodyRecord), array_of(Wall), array_of(SightLimits)
_BOX, _FACING_WALL = dtype_of(_SeenBox), dtype_of(_FacingWall)


@compiled(FLOAT, FLOAT, WALLS, FLOAT)
def walls_near(x: float, y: float, walls: Records, reach_m: float) -> BoolArray:
    """Return, for each wall, whether it is within `reach_m` of a point, [M]."""
    near = np.empty(len(walls), dtype=np.bool_)
    for k in range(len(walls)):
        wall = walls[k]
        _, away = nearest_on_segment(x - wall["x"], y - wall["y"], wall["way_x"], wall["way_y"])
        near[k] = away <= reach_m * reach_m
    return near


@inner
def _facing(x: float, y: float, walls: Records) -> Records:
    """Return the walls whose outer side faces the eye: a line of sight enters a building through one of these."""
    facing = np.empty(len(walls), _FACING_WALL)
    count = 0
    for k in range(len(walls)):
        from_x, from_y = walls[k]["x"] - x, walls[k]["y"] - y
        outer_x, outer_y = walls[k]["way_y"], -walls[k]["way_x"]
        depth = from_x * outer_x + from_y * outer_y
        if depth < 0.0:
            wall = facing[count]
            wall["from_x"], wall["from_y"] = from_x, from_y
            wall["to_x"], wall["to_y"] = from_x + walls[k]["way_x"], from_y + walls[k]["way_y"]
            wall["outer_x"], wall["outer_y"], wall["depth"] = outer_x, outer_y, depth
            wall["from_m"] = math.sqrt(from_x * from_x + from_y * from_y)
            wall["to_m"] = math.sqrt(wall["to_x"] * wall["to_x"] + wall["to_y"] * wall["to_y"])
            wall["outer_m"] = math.sqrt(outer_x * outer_x + outer_y * outer_y)
            count += 1
    return facing[:count]


@inner
def _screen(px: float, py: float, room_m: float, facing: Records, screens: IntArray) -> int:
    """Fill `screens` with the indices of the walls that may hide points within `room_m` of a point; return their
    number."""
    count = 0
    for k in range(len(facing)):
        wall = facing[k]
        if px * wall["outer_x"] + py * wall["outer_y"] - room_m * wall["outer_m"] > wall["depth"]:
            continue  # the whole circle is in front of the wall, so the wall hides none of it
        left = px * wall["from_y"] - py * wall["from_x"]
        right = px * wall["to_y"] - py * wall["to_x"]
        room_left, room_right = room_m * wall["from_m"], room_m * wall["to_m"]
        if (left > room_left and right > room_right) or (left < -room_left and right < -room_right):
            continue  # both ends of the wall are on the same side of the whole circle
        screens[count] = k
        count += 1
    return count


@inner
def _walled(px: float, py: float, facing: Records, screens: IntArray, count: int) -> bool:
    """Return whether the line from the eye to a point crosses a building; `screens`, `count`: result of `_screen`."""
    for n in range(count):
        wall = facing[screens[n]]
        if px * wall["outer_x"] + py * wall["outer_y"] < wall["depth"]:
            # The wall's ends are on different sides of the line of sight if their cross products have different signs.
            left = px * wall["from_y"] - py * wall["from_x"]
            right = px * wall["to_y"] - py * wall["to_x"]
            if left * right <= 0.0:
                return True
    return False


@inner
def _boxes(x: float, y: float, poses: FloatArray, bodies: Records, reach_m: float) -> Records:
    """Return the footprints of the objects within reach, [K]."""
    boxes = np.empty(len(poses), _BOX)
    count = 0
    for k in range(len(poses)):
        dx, dy = poses[k, X] - x, poses[k, Y] - y
        gap = math.sqrt(dx * dx + dy * dy)
        if not gap <= reach_m:  # the comparison skips absent objects too, because it is False for NaN
            continue
        box, length, width = boxes[count], bodies[k]["length"], bodies[k]["width"]
        box["x"], box["y"], box["gap"], box["who"] = dx, dy, gap, k
        box["cos"], box["sin"] = math.cos(poses[k, HEADING]), math.sin(poses[k, HEADING])
        box["half_length"], box["half_width"] = length / 2, width / 2
        box["top"], box["radius"] = bodies[k]["top"], 0.5 * math.sqrt(length * length + width * width)
        count += 1
    return boxes[:count]


@inner
def _cross(px: float, py: float, room_m: float, own: int, boxes: Records, crossed: IntArray) -> int:
    """Fill `crossed` with the indices of the boxes that may hide points within `room_m` of a point; return their
    number.

    The box `own`, which contains these points, is left out.
    """
    gap = max(math.sqrt(px * px + py * py), _TINY)
    way_x, way_y = px / gap, py / gap
    count = 0
    for k in range(len(boxes)):
        box = boxes[k]
        room = box["radius"] + room_m
        sideways = abs(way_x * box["y"] - way_y * box["x"])
        along = way_x * box["x"] + way_y * box["y"]
        if k != own and sideways < room and -room < along < gap + room:
            crossed[count] = k
            count += 1
    return count


@inner
def _stretch(px: float, py: float, box: Record) -> tuple[float, float]:
    """Return where the line from the eye to a point enters and leaves a box, as shares of the distance.

    In the box's own axes the line is within half its length over one stretch and within half its width over another;
    it is in the box where both stretches overlap. If the line misses the box, the first share exceeds the second.
    """
    begin, end = 0.0, 1.0
    cos, sin = box["cos"], box["sin"]
    for axis in range(2):
        if axis == 0:
            along, way, half = box["x"] * cos + box["y"] * sin, px * cos + py * sin, box["half_length"]
        else:
            along, way, half = box["y"] * cos - box["x"] * sin, py * cos - px * sin, box["half_width"]
        per_m = 1.0 / (way if abs(way) >= _TINY else _TINY)
        middle, reach = along * per_m, half * abs(per_m)
        begin, end = max(begin, middle - reach), min(end, middle + reach)
    return begin, end


@inner
def _under(rise: float, enter: float, leave: float, top: float) -> bool:
    """Return whether a line is lower than `top` somewhere between the shares `enter` and `leave`.

    `rise`: its rise over the whole distance, m. It is lowest where it enters if it rises, else where it leaves.
    """
    return rise * (leave if rise < 0.0 else enter) < top


@inner
def _mark(box: Record, number: int) -> tuple[float, float]:
    """Return one of a body's tested points: front left, rear left, rear right, front right, centre."""
    along = 0.0 if number == MARKS - 1 else box["half_length"] if number in (0, 3) else -box["half_length"]
    left = 0.0 if number == MARKS - 1 else box["half_width"] if number < 2 else -box["half_width"]
    cos, sin = box["cos"], box["sin"]
    return box["x"] + cos * along - sin * left, box["y"] + sin * along + cos * left


@inner
def _shows(own: int, high: float, low: float, least: float, boxes: Records, facing: Records, numbers: IntArray) -> bool:
    """Return whether at least `least` marks of a body (the box `own`) are in sight.

    A mark with one visible height of two counts as half a mark. `numbers`: work space for indices of boxes or walls.
    """
    box = boxes[own]
    screens = _screen(box["x"], box["y"], box["radius"] + _SLACK_M, facing, numbers)
    clear = 0
    past_walls = 0  # one bit for each mark
    for k in range(MARKS):
        px, py = _mark(box, k)
        if not _walled(px, py, facing, numbers, screens):
            past_walls |= 1 << k
            clear += 1
    if clear < least:  # this box hides the mark, so the other boxes need not be tested
        return False
    count = _cross(box["x"], box["y"], box["radius"], own, boxes, numbers)
    halves = 0
    for k in range(MARKS):
        if not past_walls >> k & 1:
            continue
        px, py = _mark(box, k)
        high_clear, low_clear = 1, 1
        for n in range(count):
            other = boxes[numbers[n]]
            enter, leave = _stretch(px, py, other)
            if enter < leave:
                high_clear = 0 if _under(high, enter, leave, other["top"]) else high_clear
                low_clear = 0 if _under(low, enter, leave, other["top"]) else low_clear
        halves += high_clear + low_clear
    return halves / 2 >= least


@inner
def find(
    x: float, y: float, heading: float, poses: FloatArray, bodies: Records, walls: Records, limits: SightLimits
) -> tuple[Records, IntArray]:
    """Return the footprints of the objects within reach, [K], and the indices of those in sight, [S]; arguments as for
    `in_sight`."""
    boxes = _boxes(x, y, poses, bodies, limits.reach)
    facing = _facing(x, y, walls)
    cos, sin = math.cos(heading), math.sin(heading)
    least = limits.least_marks
    seen = np.empty(len(boxes), dtype=np.int64)
    numbers = np.empty(max(len(boxes), len(facing)), dtype=np.int64)
    count = 0
    for k in range(len(boxes)):
        box = boxes[k]
        body = bodies[box["who"]]
        ahead = box["x"] * cos + box["y"] * sin
        if box["gap"] > body["range"] or ahead < box["gap"] * limits.ahead_share:
            continue
        if least <= 0.0 or _shows(k, body["high"], body["low"], least, boxes, facing, numbers):
            seen[count] = k
            count += 1
    return boxes, seen[:count]


@compiled(FLOAT, FLOAT, FLOAT, TABLE, BODIES, WALLS, LIMITS)
def in_sight(
    x: float, y: float, heading: float, poses: FloatArray, bodies: Records, walls: Records, limits: Records
) -> IntArray:
    """Return the indices of the objects in sight of the ego, [S]; the eye is above its centre.

    `poses`: [N, >=3] NaN where absent. `bodies`: [N]. `walls`: [M] the near walls. `limits`: [1].
    """
    row = limits[0]
    values = SightLimits(row["reach"], row["ahead_share"], row["least_marks"])
    boxes, seen = find(x, y, heading, poses, bodies, walls, values)
    for k in range(len(seen)):
        seen[k] = boxes[seen[k]]["who"]
    return seen


@compiled(FLOAT, FLOAT, FLOAT, TABLE, TABLE, BODIES, WALLS, FLOAT)
def clear_points(
    x: float,
    y: float,
    eye_m: float,
    points: FloatArray,
    poses: FloatArray,
    bodies: Records,
    walls: Records,
    reach_m: float,
) -> BoolArray:
    """Return, for each point ([P, 3] x, y and height above the ground), whether nothing hides it from an eye, [P].

    `eye_m`: height of the eye. `poses`, `bodies`, `walls`: as for `in_sight`. `reach_m`: distance beyond which bodies
    hide nothing.
    """
    boxes = _boxes(x, y, poses, bodies, reach_m)
    facing = _facing(x, y, walls)
    clear = np.empty(len(points), dtype=np.bool_)
    numbers = np.empty(max(len(boxes), len(facing)), dtype=np.int64)
    for k in range(len(points)):
        px, py, rise = points[k, 0] - x, points[k, 1] - y, points[k, 2] - eye_m
        clear[k] = not _walled(px, py, facing, numbers, _screen(px, py, 0.0, facing, numbers))
        for n in range(_cross(px, py, 0.0, -1, boxes, numbers)):
            box = boxes[numbers[n]]
            enter, leave = _stretch(px, py, box)
            if enter < leave and _under(rise, enter, leave, box["top"]):
                clear[k] = False
    return clear
