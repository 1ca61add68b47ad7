"""The sensors of an agent: from our observation to the data that CARLA's leaderboard passes to `run_step`.

The errors are those of the run, as for every driver: the ego's place and heading are those of its localisation, with
errors of some centimetres; the object list behind the lidar is late and noisy, and hidden objects are missing. No
further noise is added, and no sensor adds a delay: CARLA's GNSS would have a standard deviation of 0.5 m.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from foresee_bridges.carla import camera, lidar
from foresee_bridges.carla.coordinates import GeoReference, beside, compass_rad
from foresee_dsl.drivers.protocol import Observation
from foresee_dsl.errors import DriverError

GRAVITY_MPS2 = 9.81
"""What CARLA's accelerometer reads upwards on a level road, m/s^2."""
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
    return camera.picture(scene.observation.views, *size, float(spec["fov"]), float(spec.get("yaw", 0.0)))


def _lidar(scene: Scene, spec: Spec) -> NDArray[np.float32]:
    return lidar.point_cloud(scene.observation.actors, _mounted(scene, spec), float(spec.get("z", 0.0)))


READERS: dict[str, Read] = {
    "sensor.other.gnss": _gnss,
    "sensor.other.imu": _imu,
    "sensor.speedometer": _speedometer,
    "sensor.opendrive_map": _map,
    "sensor.camera.rgb": _camera,
    "sensor.lidar.ray_cast": _lidar,
}
