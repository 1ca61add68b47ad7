"""Conversions between our coordinates and CARLA's.

Ours are right-handed: x east, y north, headings counter-clockwise from east in radians. CARLA's are left-handed
(Unreal's): x east, y SOUTH, yaw clockwise from east in degrees; in the frame of a vehicle or sensor x points ahead, y
to the RIGHT and z up. CARLA places OpenDRIVE maps in the same way: its y is the negative of the map's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

EARTH_RADIUS_M = 6_378_137.0
"""Radius of the sphere onto which CARLA projects latitudes and longitudes, m (leaderboard 2.0,
`leaderboard/utils/route_manipulation.py`; the equatorial radius of WGS 84)."""
STEER_GAIN_RAD = 0.36848336
FITTED_WHEELBASE_M = 1.4178275 - 0.090769015
"""Wheel angle at full steer and wheelbase of a bicycle that moves like CARLA's ego vehicle: Chen, Koltun and
Kraehenbuehl, "Learning to drive from a world on rails", ICCV 2021, the model fitted in their published code. The
nominal 70 degrees of `carla.WheelPhysicsControl` are not reached while driving."""


@dataclass(frozen=True, slots=True)
class GeoReference:
    """Latitude and longitude of the map's origin, degrees. Those of CARLA's towns are 0 and 0."""

    latitude_deg: float = 0.0
    longitude_deg: float = 0.0

    def gps(self, x: float, y: float) -> tuple[float, float]:
        """Return latitude and longitude, degrees, of a place in our coordinates: a Mercator projection, as in
        CARLA."""
        scale_m = EARTH_RADIUS_M * math.cos(math.radians(self.latitude_deg))
        north = math.log(math.tan(math.pi / 4 + math.radians(self.latitude_deg) / 2)) + y / scale_m
        longitude_deg = self.longitude_deg + math.degrees(x / scale_m)
        return math.degrees(2 * math.atan(math.exp(north)) - math.pi / 2), longitude_deg


def yaw_deg(heading_rad: float) -> float:
    """Return CARLA's yaw of a heading, degrees from -180 to 180."""
    return math.degrees(math.remainder(-heading_rad, 2 * math.pi))


def compass_rad(heading_rad: float) -> float:
    """Return what CARLA's IMU calls the compass: the angle clockwise from north, from 0 to 2 pi."""
    return (math.pi / 2 - heading_rad) % (2 * math.pi)


def wheel_angle_rad(steer: float, wheelbase_m: float) -> float:
    """Return the front-wheel angle, left positive, with which a vehicle drives the same curve as CARLA's ego vehicle.

    Args:
        steer: from -1 (left) to 1 (right), as in `carla.VehicleControl`.
    """
    return -math.atan(wheelbase_m / FITTED_WHEELBASE_M * math.tan(STEER_GAIN_RAD * steer))


def beside(x: float, y: float, heading_rad: float, ahead_m: float, left_m: float) -> tuple[float, float]:
    """Return the place `ahead_m` ahead and `left_m` to the left of a pose."""
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    return x + ahead_m * cos - left_m * sin, y + ahead_m * sin + left_m * cos
