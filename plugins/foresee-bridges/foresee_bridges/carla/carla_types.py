"""The types of CARLA's package that agents use without a world: for agents whose `import carla` finds no CARLA.

The behaviour is that of carla 0.9.16 (left-handed, degrees); the tests compare the two where that package is
installed. What asks for CARLA's world is in `world.py`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import NDArray


@dataclass(slots=True)
class Vector3D:
    """A vector of three numbers, with CARLA's operations."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0

    def __add__(self, other: Vector3D) -> Self:
        return type(self)(self.x + other.x, self.y + other.y, self.z + other.z)

    def __sub__(self, other: Vector3D) -> Self:
        return type(self)(self.x - other.x, self.y - other.y, self.z - other.z)

    def __mul__(self, factor: float) -> Self:
        return type(self)(self.x * factor, self.y * factor, self.z * factor)

    __rmul__ = __mul__

    def __truediv__(self, factor: float) -> Self:
        return type(self)(self.x / factor, self.y / factor, self.z / factor)

    def __abs__(self) -> Self:
        return type(self)(abs(self.x), abs(self.y), abs(self.z))

    def length(self) -> float:
        """Return the length."""
        return math.hypot(self.x, self.y, self.z)

    def squared_length(self) -> float:
        """Return the square of the length."""
        return self.dot(self)

    def dot(self, other: Vector3D) -> float:
        """Return the scalar product."""
        return self.x * other.x + self.y * other.y + self.z * other.z

    def cross(self, other: Vector3D) -> Vector3D:
        """Return the vector product."""
        return Vector3D(
            self.y * other.z - self.z * other.y,
            self.z * other.x - self.x * other.z,
            self.x * other.y - self.y * other.x,
        )

    def distance(self, other: Vector3D) -> float:
        """Return the distance to the end of another vector."""
        return math.dist((self.x, self.y, self.z), (other.x, other.y, other.z))

    def distance_2d(self, other: Vector3D) -> float:
        """Return the distance in the plane."""
        return math.hypot(self.x - other.x, self.y - other.y)

    def make_unit_vector(self) -> Vector3D:
        """Return the vector of length 1 in the same direction."""
        return Vector3D(self.x, self.y, self.z) / max(self.length(), 1e-12)


class Location(Vector3D):
    """A place, m."""

    __slots__ = ()


@dataclass(slots=True)
class Vector2D:
    """A vector of two numbers."""

    x: float = 0.0
    y: float = 0.0

    def length(self) -> float:
        """Return the length."""
        return math.hypot(self.x, self.y)


@dataclass(slots=True)
class Rotation:
    """An orientation, degrees: yaw is clockwise seen from above."""

    pitch: float = 0.0
    yaw: float = 0.0
    roll: float = 0.0

    def get_forward_vector(self) -> Vector3D:
        """Return the direction ahead."""
        return _column(self, 0)

    def get_right_vector(self) -> Vector3D:
        """Return the direction to the right."""
        return _column(self, 1)

    def get_up_vector(self) -> Vector3D:
        """Return the direction up."""
        return _column(self, 2)


@dataclass(slots=True)
class Transform:
    """A place and an orientation."""

    location: Location = field(default_factory=Location)
    rotation: Rotation = field(default_factory=Rotation)

    def get_matrix(self) -> list[list[float]]:
        """Return the 4 x 4 matrix from the frame of this transform to the world's."""
        matrix: list[list[float]] = _matrix(self).tolist()
        return matrix

    def get_inverse_matrix(self) -> list[list[float]]:
        """Return the 4 x 4 matrix from the world's frame to that of this transform."""
        inverse: list[list[float]] = np.linalg.inv(_matrix(self)).tolist()
        return inverse

    def transform(self, point: Vector3D) -> Location:
        """Return a place of this frame in the world's."""
        return Location(*(_matrix(self)[:3] @ (point.x, point.y, point.z, 1.0)).tolist())

    def transform_vector(self, vector: Vector3D) -> Vector3D:
        """Return a direction of this frame in the world's."""
        return Vector3D(*(_matrix(self)[:3, :3] @ (vector.x, vector.y, vector.z)).tolist())

    def inverse_transform(self, point: Vector3D) -> Location:
        """Return a place of the world in this frame."""
        return Location(*(np.linalg.inv(_matrix(self))[:3] @ (point.x, point.y, point.z, 1.0)).tolist())

    def get_forward_vector(self) -> Vector3D:
        """Return the direction ahead."""
        return self.rotation.get_forward_vector()

    def get_right_vector(self) -> Vector3D:
        """Return the direction to the right."""
        return self.rotation.get_right_vector()

    def get_up_vector(self) -> Vector3D:
        """Return the direction up."""
        return self.rotation.get_up_vector()


@dataclass(slots=True)
class VehicleControl:
    """What an agent answers: throttle and brake from 0 to 1, steer from -1 (left) to 1 (right)."""

    throttle: float = 0.0
    steer: float = 0.0
    brake: float = 0.0
    hand_brake: bool = False
    reverse: bool = False
    manual_gear_shift: bool = False
    gear: int = 0


@dataclass(slots=True)
class GeoLocation:
    """A place on Earth: degrees, and m above the ellipsoid."""

    latitude: float = 0.0
    longitude: float = 0.0
    altitude: float = 0.0


@dataclass(slots=True)
class Color:
    """A colour, for drawing."""

    r: int = 0
    g: int = 0
    b: int = 0
    a: int = 255


def _matrix(transform: Transform) -> NDArray[np.float64]:
    """Return the matrix of a transform: Unreal's order of rotations, yaw, then pitch, then roll."""
    angles = (transform.rotation.yaw, transform.rotation.pitch, transform.rotation.roll)
    (cy, cp, cr), (sy, sp, sr) = np.cos(np.radians(angles)), np.sin(np.radians(angles))
    place = transform.location
    return np.array(
        [
            [cp * cy, cy * sp * sr - sy * cr, -cy * sp * cr - sy * sr, place.x],
            [cp * sy, sy * sp * sr + cy * cr, -sy * sp * cr + cy * sr, place.y],
            [sp, -cp * sr, cp * cr, place.z],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def _column(rotation: Rotation, index: int) -> Vector3D:
    return Vector3D(*_matrix(Transform(rotation=rotation))[:3, index].tolist())
