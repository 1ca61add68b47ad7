"""Lines of sight past boxes and walls, compiled (`foresee_dsl.kernels.compiling` says what that asks for).

All is relative to an eye at some height over a flat ground. A body hides a point when the straight line from the eye to
the point runs through the body's footprint and, somewhere on that stretch, lower than the body's top. So a child
behind a parked car is hidden, an adult's head behind it is not, and a lorry hides both. Buildings are as high as one
likes.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.kernels.compiling import FLOAT, FLOATS, TABLE, compiled, inner

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]

X, Y, HEADING = range(3)
"""Columns of poses."""
LENGTH, WIDTH, TOP, HIGH, LOW, RANGE = range(6)
"""Columns of bodies: m; the top and the two heights that are looked at, over the eye; how far it is seen."""
WALL_X, WALL_Y, WAY_X, WAY_Y = range(4)
"""Columns of walls: where one begins and how it goes on, counter-clockwise about its building, m."""
BOX_X, BOX_Y, GAP, WHO, _COS, _SIN, _HALF_LENGTH, _HALF_WIDTH, _TOP, _RADIUS = range(10)
"""Columns of boxes: places relative to the eye, the distance, and which object it is."""
_FROM_X, _FROM_Y, _TO_X, _TO_Y, _OUTER_X, _OUTER_Y, _DEPTH, _FROM, _TO, _OUTER = range(10)
"""Columns of facing walls: both ends relative to the eye, a vector to its outer side, how far the eye is on that side
(negative), and the lengths of these three vectors."""
MARKS = 5
"""Points at which a body is looked at: its corners and its centre."""
_TINY = 1e-12
"""Stands for 0 in a division."""
_SLACK_M = 1e-6
"""More than rounding takes, where many points are judged at once."""
REACH, AHEAD_SHARE, LEAST_MARKS = range(3)
"""Places of limits: what is farther, m, hides nothing either; the cosine of half of the field of view (less than -1:
all around); how many of a body's marks must be in sight."""


@compiled(FLOAT, FLOAT, TABLE, FLOAT)
def walls_near(x: float, y: float, walls: FloatArray, reach_m: float) -> BoolArray:
    """Say which walls come nearer to a point than `reach_m`, [M]."""
    near = np.empty(len(walls), dtype=np.bool_)
    for k in range(len(walls)):
        way_x, way_y = walls[k, WAY_X], walls[k, WAY_Y]
        dx, dy = x - walls[k, WALL_X], y - walls[k, WALL_Y]
        share = (dx * way_x + dy * way_y) / max(way_x * way_x + way_y * way_y, _TINY)
        share = min(max(share, 0.0), 1.0)
        dx, dy = dx - share * way_x, dy - share * way_y
        near[k] = dx * dx + dy * dy <= reach_m * reach_m
    return near


@inner
def _facing(x: float, y: float, walls: FloatArray) -> FloatArray:
    """Return the walls on whose outer side the eye is: a line that enters a building does so through one of these."""
    facing = np.empty((len(walls), 10))
    count = 0
    for k in range(len(walls)):
        from_x, from_y = walls[k, WALL_X] - x, walls[k, WALL_Y] - y
        outer_x, outer_y = walls[k, WAY_Y], -walls[k, WAY_X]
        depth = from_x * outer_x + from_y * outer_y
        if depth < 0.0:
            wall = facing[count]
            wall[_FROM_X], wall[_FROM_Y] = from_x, from_y
            wall[_TO_X], wall[_TO_Y] = from_x + walls[k, WAY_X], from_y + walls[k, WAY_Y]
            wall[_OUTER_X], wall[_OUTER_Y], wall[_DEPTH] = outer_x, outer_y, depth
            wall[_FROM] = math.sqrt(from_x * from_x + from_y * from_y)
            wall[_TO] = math.sqrt(wall[_TO_X] * wall[_TO_X] + wall[_TO_Y] * wall[_TO_Y])
            wall[_OUTER] = math.sqrt(outer_x * outer_x + outer_y * outer_y)
            count += 1
    return facing[:count]


@inner
def _screen(px: float, py: float, room_m: float, facing: FloatArray, screens: IntArray) -> int:
    """Find the walls that may hide something within `room_m` of a point. Their numbers go into `screens`.

    Returns:
        How many they are.
    """
    count = 0
    for k in range(len(facing)):
        wall = facing[k]
        if px * wall[_OUTER_X] + py * wall[_OUTER_Y] - room_m * wall[_OUTER] > wall[_DEPTH]:
            continue  # all of it is in front of the wall
        left = px * wall[_FROM_Y] - py * wall[_FROM_X]
        right = px * wall[_TO_Y] - py * wall[_TO_X]
        room_left, room_right = room_m * wall[_FROM], room_m * wall[_TO]
        if (left > room_left and right > room_right) or (left < -room_left and right < -room_right):
            continue  # both ends are to one side of all of it
        screens[count] = k
        count += 1
    return count


@inner
def _walled(px: float, py: float, facing: FloatArray, screens: IntArray, count: int) -> bool:
    """Say whether the line from the eye to a point runs through a building, given what `_screen` found."""
    for n in range(count):
        wall = facing[screens[n]]
        if px * wall[_OUTER_X] + py * wall[_OUTER_Y] < wall[_DEPTH]:
            # The wall's ends lie on both sides of the line: crosswise products with them have different signs.
            left = px * wall[_FROM_Y] - py * wall[_FROM_X]
            right = px * wall[_TO_Y] - py * wall[_TO_X]
            if left * right <= 0.0:
                return True
    return False


@inner
def _boxes(x: float, y: float, poses: FloatArray, bodies: FloatArray, reach_m: float) -> FloatArray:
    """Return the footprints of those within reach, [K, 10]."""
    boxes = np.empty((len(poses), 10))
    count = 0
    for k in range(len(poses)):
        dx, dy = poses[k, X] - x, poses[k, Y] - y
        gap = math.sqrt(dx * dx + dy * dy)
        if not gap <= reach_m:  # NaN is not
            continue
        box, length, width = boxes[count], bodies[k, LENGTH], bodies[k, WIDTH]
        box[BOX_X], box[BOX_Y], box[GAP], box[WHO] = dx, dy, gap, k
        box[_COS], box[_SIN] = math.cos(poses[k, HEADING]), math.sin(poses[k, HEADING])
        box[_HALF_LENGTH], box[_HALF_WIDTH] = length / 2, width / 2
        box[_TOP], box[_RADIUS] = bodies[k, TOP], 0.5 * math.sqrt(length * length + width * width)
        count += 1
    return boxes[:count]


@inner
def _cross(px: float, py: float, room_m: float, own: int, boxes: FloatArray, crossed: IntArray) -> int:
    """Find the boxes near enough to the line to a point to hide what lies within `room_m` of it.

    Not the `own` one: it lies around the points. Their numbers go into `crossed`.

    Returns:
        How many they are.
    """
    gap = max(math.sqrt(px * px + py * py), _TINY)
    way_x, way_y = px / gap, py / gap
    count = 0
    for k in range(len(boxes)):
        box = boxes[k]
        room = box[_RADIUS] + room_m
        aside = abs(way_x * box[BOX_Y] - way_y * box[BOX_X])
        along = way_x * box[BOX_X] + way_y * box[BOX_Y]
        if k != own and aside < room and -room < along < gap + room:
            crossed[count] = k
            count += 1
    return count


@inner
def _stretch(px: float, py: float, box: FloatArray) -> tuple[float, float]:
    """Return where the line from the eye to a point enters and leaves a box, as shares of the way.

    In the box's own axes it is the set of points within half its length and half its width; a line is within each over
    one stretch, and runs through the box where the stretches meet. A line that misses it enters after it leaves.
    """
    begin, end = 0.0, 1.0
    cos, sin = box[_COS], box[_SIN]
    for axis in range(2):
        if axis == 0:
            along, way, half = box[BOX_X] * cos + box[BOX_Y] * sin, px * cos + py * sin, box[_HALF_LENGTH]
        else:
            along, way, half = box[BOX_Y] * cos - box[BOX_X] * sin, py * cos - px * sin, box[_HALF_WIDTH]
        per_m = 1.0 / (way if abs(way) >= _TINY else _TINY)
        middle, reach = along * per_m, half * abs(per_m)
        begin, end = max(begin, middle - reach), min(end, middle + reach)
    return begin, end


@inner
def _under(rise: float, enter: float, leave: float, top: float) -> bool:
    """Say whether a line that rises by so much runs, somewhere on a stretch of it, lower than a top: it is lowest where
    it leaves the stretch, or where it enters when it rises."""
    return rise * (leave if rise < 0.0 else enter) < top


@inner
def _mark(box: FloatArray, number: int) -> tuple[float, float]:
    """Return one of the points at which a body is looked at: front left, rear left, rear right, front right, centre."""
    along = 0.0 if number == MARKS - 1 else box[_HALF_LENGTH] if number in (0, 3) else -box[_HALF_LENGTH]
    left = 0.0 if number == MARKS - 1 else box[_HALF_WIDTH] if number < 2 else -box[_HALF_WIDTH]
    cos, sin = box[_COS], box[_SIN]
    return box[BOX_X] + cos * along - sin * left, box[BOX_Y] + sin * along + cos * left


@inner
def _shows(
    own: int, high: float, low: float, least: float, boxes: FloatArray, facing: FloatArray, numbers: IntArray
) -> bool:
    """Say whether at least so many marks of a body (the box `own`) are in sight.

    A mark of which one height of two is in sight is half one. `numbers` is room for those of boxes or walls.
    """
    box = boxes[own]
    screens = _screen(box[BOX_X], box[BOX_Y], box[_RADIUS] + _SLACK_M, facing, numbers)
    clear = 0
    past_walls = 0  # a bit for each mark
    for k in range(MARKS):
        px, py = _mark(box, k)
        if not _walled(px, py, facing, numbers, screens):
            past_walls |= 1 << k
            clear += 1
    if clear < least:  # it needs no look at the others
        return False
    count = _cross(box[BOX_X], box[BOX_Y], box[_RADIUS], own, boxes, numbers)
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
                high_clear = 0 if _under(high, enter, leave, other[_TOP]) else high_clear
                low_clear = 0 if _under(low, enter, leave, other[_TOP]) else low_clear
        halves += high_clear + low_clear
    return halves / 2 >= least


@inner
def find(
    x: float, y: float, heading: float, poses: FloatArray, bodies: FloatArray, walls: FloatArray, limits: FloatArray
) -> tuple[FloatArray, IntArray]:
    """Find who is in sight (arguments as in `in_sight`).

    Returns:
        [K, 10] the footprints of those within reach; [S] the rows of those in sight.
    """
    boxes = _boxes(x, y, poses, bodies, limits[REACH])
    facing = _facing(x, y, walls)
    cos, sin = math.cos(heading), math.sin(heading)
    least = limits[LEAST_MARKS]
    seen = np.empty(len(boxes), dtype=np.int64)
    numbers = np.empty(max(len(boxes), len(facing)), dtype=np.int64)
    count = 0
    for k in range(len(boxes)):
        box = boxes[k]
        body = bodies[int(box[WHO])]
        ahead = box[BOX_X] * cos + box[BOX_Y] * sin
        if box[GAP] > body[RANGE] or ahead < box[GAP] * limits[AHEAD_SHARE]:
            continue
        if least <= 0.0 or _shows(k, body[HIGH], body[LOW], least, boxes, facing, numbers):
            seen[count] = k
            count += 1
    return boxes, seen[:count]


@compiled(FLOAT, FLOAT, FLOAT, TABLE, TABLE, TABLE, FLOATS)
def in_sight(
    x: float, y: float, heading: float, poses: FloatArray, bodies: FloatArray, walls: FloatArray, limits: FloatArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return who is in sight.

    Args:
        x, y, heading: of the ego; the eye is over its centre. poses: [N, >=3] NaN where there is none.
        bodies: [N, >=6]. walls: [M, 4] the near ones. limits: [>=3].

    Returns:
        [S] which objects; [S, 2] their centres relative to the ego (not turned), m; [S] their distances, m.
    """
    boxes, seen = find(x, y, heading, poses, bodies, walls, limits)
    who, offsets, gaps = np.empty(len(seen), dtype=np.int64), np.empty((len(seen), 2)), np.empty(len(seen))
    for k in range(len(seen)):
        box = boxes[seen[k]]
        who[k], offsets[k, 0], offsets[k, 1], gaps[k] = int(box[WHO]), box[BOX_X], box[BOX_Y], box[GAP]
    return who, offsets, gaps


@compiled(FLOAT, FLOAT, FLOAT, TABLE, TABLE, TABLE, TABLE, FLOAT)
def clear_points(
    x: float,
    y: float,
    eye_m: float,
    points: FloatArray,
    poses: FloatArray,
    bodies: FloatArray,
    walls: FloatArray,
    reach_m: float,
) -> BoolArray:
    """Say which points nothing hides, [P].

    Args:
        x, y: of the ego. eye_m: height of the eye. points: [P, 3] x, y and height over the ground.
        poses, bodies, walls: as in `in_sight`. reach_m: what is farther hides nothing.
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
            if enter < leave and _under(rise, enter, leave, box[_TOP]):
                clear[k] = False
    return clear
