"""The point cloud of a lidar from the boxes of the object list: no ground, no buildings, no kerbs.

Each beam ends at the nearest box that it meets at a height at which the box is. The rates are those of the lidar of
CARLA's leaderboard; a step has a whole revolution, where CARLA's lidar turns half a revolution in 0.05 s.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.drivers.protocol import ActorClass, FloatArray, SeenActor

RANGE_M = 85.0
CHANNELS = 64
UPPER_DEG, LOWER_DEG = 10.0, -30.0
POINTS_PER_SECOND, TURNS_PER_SECOND = 600_000, 10
ATTENUATION_PER_M = 0.004
"""The lidar of leaderboard 2.0 (`leaderboard/autoagents/agent_wrapper.py`)."""
HEIGHTS_M: dict[ActorClass, float] = {
    **{"car": 1.5, "van": 2.3, "truck": 3.5, "bus": 3.1},
    **{"motorcycle": 1.7, "bicycle": 1.75, "pedestrian": 1.75, "obstacle": 1.0},
}
"""Height of each class, m, for the object list has none. Ours: as in the pictures of foresee-learned."""
_BEAMS = POINTS_PER_SECOND // TURNS_PER_SECOND // CHANNELS


def point_cloud(actors: Sequence[SeenActor], pose: tuple[float, float, float], height_m: float) -> NDArray[np.float32]:
    """Return the points, [N, 4] float32: x ahead, y RIGHT, z up in the sensor's frame, m; intensity from 0 to 1.

    Args:
        pose: place and heading of the sensor in our coordinates. height_m: its height above the road.
    """
    azimuth = (np.arange(_BEAMS) + 0.5) * (2 * math.pi / _BEAMS)
    slope = np.tan(np.radians(np.linspace(UPPER_DEG, LOWER_DEG, CHANNELS)))
    directions = np.column_stack((np.cos(azimuth), np.sin(azimuth)))
    reach = np.full((_BEAMS, CHANNELS), np.inf)
    for actor in actors:
        distance = _distances(_box(actor, pose), directions)
        beams = np.flatnonzero(distance < RANGE_M)
        at = distance[beams, None]
        z = height_m + at * slope
        seen = (z > 0) & (z < HEIGHTS_M[actor.kind])
        reach[beams] = np.where(seen, np.minimum(reach[beams], at), reach[beams])
    beams, channels = np.nonzero(reach < RANGE_M)
    at = reach[beams, channels]
    rise = at * slope[channels]
    intensity = np.exp(-ATTENUATION_PER_M * np.hypot(at, rise))
    points = np.column_stack((at * directions[beams, 0], -at * directions[beams, 1], rise, intensity))
    return points.astype(np.float32)


def _box(actor: SeenActor, pose: tuple[float, float, float]) -> tuple[float, float, float, float, float]:
    """Return centre, heading, half length and half width of an actor in the sensor's frame, y left."""
    x, y, heading = pose
    cos, sin, dx, dy = math.cos(heading), math.sin(heading), actor.x - x, actor.y - y
    return dx * cos + dy * sin, dy * cos - dx * sin, actor.heading_rad - heading, actor.length_m / 2, actor.width_m / 2


def _distances(box: tuple[float, float, float, float, float], directions: FloatArray) -> FloatArray:
    """Return for each direction the distance from the origin to the box, m; infinity: it misses, or starts inside."""
    x, y, heading, half_length, half_width = box
    turn = np.array([[math.cos(heading), -math.sin(heading)], [math.sin(heading), math.cos(heading)]])
    origin, along = -np.array([x, y]) @ turn, directions @ turn
    half = np.array([half_length, half_width])
    with np.errstate(divide="ignore", invalid="ignore"):
        sides = np.stack(((-half - origin) / along, (half - origin) / along))
    near, far = sides.min(axis=0).max(axis=1), sides.max(axis=0).min(axis=1)
    return np.where((near > 0) & (near <= far), near, np.inf)
