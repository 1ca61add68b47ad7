"""The sensors of an agent: from our observation to the data that CARLA's leaderboard passes to `run_step`.

The errors are those of the run, as for every driver: the ego's place and heading are those of its localisation, with
errors of some centimetres; the object list behind the lidar is late and noisy, and hidden objects are missing. No
further noise is added, and no sensor adds a delay: CARLA's GNSS would have a standard deviation of 0.5 m.

The camera has flat colours for classes of things, from the view ahead of foresee-learned (docs/reference/rasters.md):
a network that was trained on photographs will not know what it sees. The view is that of a level camera behind the
windscreen. A pixel of the agent's camera takes the colour of the view's pixel in the same direction, so the place of
the agent's camera on the vehicle has no effect; directions that the view does not show are black.

The lidar has the boxes of the object list only: no ground, no buildings, no kerbs. Each beam ends at the nearest box
that it meets at a height at which the box is. The rates are those of the lidar of CARLA's leaderboard; a step has a
whole revolution, where CARLA's lidar turns half a revolution in 0.05 s.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from foresee_bridges.carla.coordinates import GeoReference, beside, compass_rad
from foresee_dsl.drivers.protocol import ActorClass, FloatArray, Observation, SeenActor, Views
from foresee_dsl.errors import DriverError, DriverUnavailableError
from foresee_dsl.kernels.constants import GRAVITY_MPS2

VIEW_ROWS, VIEW_COLUMNS, VIEW_FOCAL_PX = 64, 160, 80.0
"""Size and focal length of the view ahead (docs/reference/rasters.md)."""
COLOURS_BGR = (
    *((128, 64, 128), (255, 255, 255), (232, 35, 244), (81, 0, 81), (70, 70, 70)),
    *((142, 0, 0), (230, 0, 0), (60, 20, 220), (160, 190, 110), (0, 0, 255), (0, 190, 255), (0, 255, 0)),
)
"""Blue, green and red of the classes road, marking, footway, ground, building, vehicle, two-wheeler, pedestrian,
obstacle, red, amber and green light. The first nine are those of Cityscapes for similar classes; lights: ours."""
SKY_BGR = (180, 130, 70)
"""Colour above the horizon and beyond the visual range: Cityscapes' sky."""
LIDAR_RANGE_M = 85.0
LIDAR_CHANNELS = 64
UPPER_DEG, LOWER_DEG = 10.0, -30.0
POINTS_PER_SECOND, TURNS_PER_SECOND = 600_000, 10
ATTENUATION_PER_M = 0.004
"""The lidar of leaderboard 2.0 (`leaderboard/autoagents/agent_wrapper.py`)."""
HEIGHTS_M: dict[ActorClass, float] = {
    **{"car": 1.5, "van": 2.3, "truck": 3.5, "bus": 3.1},
    **{"motorcycle": 1.7, "bicycle": 1.75, "pedestrian": 1.75, "obstacle": 1.0},
}
"""Height of each class, m, for the object list has none. Ours: as in the pictures of foresee-learned."""
_BEAMS = POINTS_PER_SECOND // TURNS_PER_SECOND // LIDAR_CHANNELS
Spec = Mapping[str, Any]
Read = Callable[["Scene", Spec], Any]


@dataclass(frozen=True)
class Scene:
    """What the sensors read at a step. opendrive: text of the map; None: no map could be written."""

    observation: Observation
    reference: GeoReference
    opendrive: str | None


def readers(specs: Sequence[Spec]) -> list[tuple[str, Spec, Read]]:
    """Return id, description and reader of each sensor that an agent's `sensors()` names.

    Raises:
        DriverError: a sensor is not described as in the leaderboard, or cannot be simulated.
    """
    suite = []
    for spec in specs:
        kind = spec.get("type") if isinstance(spec, Mapping) else None
        if kind is None or "id" not in spec:
            raise DriverError(f"the agent's sensors() has {spec!r}: a sensor needs a `type` and an `id`")
        if kind not in READERS:
            raise DriverError(f"the agent asks for {kind}, which a run does not have: it has {', '.join(READERS)}")
        if float(spec.get("roll", 0.0)) or float(spec.get("pitch", 0.0)):
            raise DriverError(f"sensor {spec['id']!r} of the agent is tilted; a run's sensors are level")
        suite.append((str(spec["id"]), spec, READERS[kind]))
    return suite


def _mounted(scene: Scene, spec: Spec) -> tuple[float, float, float]:
    """Return place and heading of a sensor in our coordinates; CARLA's y is to the right of the vehicle."""
    ego = scene.observation.ego
    place = beside(ego.x, ego.y, ego.heading_rad, float(spec.get("x", 0.0)), -float(spec.get("y", 0.0)))
    return *place, ego.heading_rad - math.radians(float(spec.get("yaw", 0.0)))


def _gnss(scene: Scene, spec: Spec) -> NDArray[np.float64]:
    x, y, _ = _mounted(scene, spec)
    return np.array([*scene.reference.gps(x, y), float(spec.get("z", 0.0))])


def _imu(scene: Scene, spec: Spec) -> NDArray[np.float64]:
    """Return acceleration ahead, right and up, rates of roll, pitch and yaw (clockwise), and the compass."""
    ego = scene.observation.ego
    ahead, right = ego.acceleration_mps2, -ego.speed_mps * ego.yaw_rate_rad_s
    yaw = math.radians(float(spec.get("yaw", 0.0)))
    cos, sin = math.cos(yaw), math.sin(yaw)
    # On a level road, CARLA's accelerometer reads gravity upwards.
    acceleration = (ahead * cos + right * sin, right * cos - ahead * sin, GRAVITY_MPS2)
    return np.array([*acceleration, 0.0, 0.0, -ego.yaw_rate_rad_s, compass_rad(_mounted(scene, spec)[2])])


def _speedometer(scene: Scene, spec: Spec) -> dict[str, float]:
    return {"speed": scene.observation.ego.speed_mps}


def _map(scene: Scene, spec: Spec) -> dict[str, str]:
    if scene.opendrive is None:
        raise DriverError("the agent asks for sensor.opendrive_map, and this run has no map")
    return {"opendrive": scene.opendrive}


def _camera(scene: Scene, spec: Spec) -> NDArray[np.uint8]:
    size = int(spec["width"]), int(spec["height"])
    return picture(scene.observation.views, *size, float(spec["fov"]), float(spec.get("yaw", 0.0)))


def _lidar(scene: Scene, spec: Spec) -> NDArray[np.float32]:
    return point_cloud(scene.observation.actors, _mounted(scene, spec), float(spec.get("z", 0.0)))


READERS: dict[str, Read] = {
    "sensor.other.gnss": _gnss,
    "sensor.other.imu": _imu,
    "sensor.speedometer": _speedometer,
    "sensor.opendrive_map": _map,
    "sensor.camera.rgb": _camera,
    "sensor.lidar.ray_cast": _lidar,
}


# ---- the camera ------------------------------------------------------------------------------------------------------


def picture(views: Views | None, width: int, height: int, fov_deg: float, yaw_deg: float) -> NDArray[np.uint8]:
    """Return what `sensor.camera.rgb` gives: [height, width, 4] blue, green, red, alpha.

    Args:
        fov_deg: horizontal field of view. yaw_deg: yaw of the camera on the vehicle, clockwise.

    Raises:
        DriverUnavailableError: no installed package draws the view ahead.
    """
    if views is None:
        raise DriverUnavailableError(
            "cameras need the pictures of foresee-learned: pip install ./plugins/foresee-learned in a checkout"
        )
    channels = views.forward()[: len(COLOURS_BGR)]
    colours = np.array((*COLOURS_BGR, SKY_BGR), dtype=np.uint8)
    classes = np.where(channels.any(axis=0), channels.argmax(axis=0), len(COLOURS_BGR))
    rows, columns = _pixels(width, height, fov_deg, yaw_deg)
    inside = (rows >= 0) & (rows < VIEW_ROWS) & (columns >= 0) & (columns < VIEW_COLUMNS)
    image = np.zeros((height, width, 4), dtype=np.uint8)
    image[inside, :3] = colours[classes[rows[inside], columns[inside]]]
    image[..., 3] = 255
    return image


@lru_cache(maxsize=8)
def _pixels(width: int, height: int, fov_deg: float, yaw_deg: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return row and column of the view for each pixel of a camera; -1: behind the view's camera."""
    focal = width / 2 / math.tan(math.radians(fov_deg) / 2)
    right = (np.arange(width) + 0.5 - width / 2) / focal
    down = (np.arange(height) + 0.5 - height / 2) / focal
    cos, sin = math.cos(math.radians(yaw_deg)), math.sin(math.radians(yaw_deg))
    ahead, across = cos - right * sin, sin + right * cos
    with np.errstate(divide="ignore", invalid="ignore"):
        columns = np.floor(VIEW_COLUMNS / 2 + VIEW_FOCAL_PX * across / ahead)
        rows = np.floor(VIEW_ROWS / 2 + VIEW_FOCAL_PX * down[:, None] / ahead)
    columns, rows = np.broadcast_to(columns, rows.shape), np.asarray(rows)
    visible = (ahead > 0) & (np.abs(rows) < 1e6) & (np.abs(columns) < 1e6)
    return np.where(visible, rows, -1).astype(np.int64), np.where(visible, columns, -1).astype(np.int64)


# ---- the lidar -------------------------------------------------------------------------------------------------------


def point_cloud(actors: Sequence[SeenActor], pose: tuple[float, float, float], height_m: float) -> NDArray[np.float32]:
    """Return the points, [N, 4] float32: x ahead, y RIGHT, z up in the sensor's frame, m; intensity from 0 to 1.

    Args:
        pose: place and heading of the sensor in our coordinates. height_m: its height above the road.
    """
    azimuth = (np.arange(_BEAMS) + 0.5) * (2 * math.pi / _BEAMS)
    slope = np.tan(np.radians(np.linspace(UPPER_DEG, LOWER_DEG, LIDAR_CHANNELS)))
    directions = np.column_stack((np.cos(azimuth), np.sin(azimuth)))
    reach = np.full((_BEAMS, LIDAR_CHANNELS), np.inf)
    for actor in actors:
        distance = _distances(_box(actor, pose), directions)
        beams = np.flatnonzero(distance < LIDAR_RANGE_M)
        at = distance[beams, None]
        z = height_m + at * slope
        seen = (z > 0) & (z < HEIGHTS_M[actor.kind])
        reach[beams] = np.where(seen, np.minimum(reach[beams], at), reach[beams])
    beams, channels = np.nonzero(reach < LIDAR_RANGE_M)
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
