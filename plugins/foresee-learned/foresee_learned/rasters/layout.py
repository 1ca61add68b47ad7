"""Channels, sizes and values of the pictures (docs/reference/rasters.md shows the same as tables)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from foresee_dsl.drivers.protocol import Window

BIRDS_EYE_CHANNELS = (
    *("drivable", "lane_centre", "marking", "crossing", "footway", "parking", "building", "route"),
    *("stop_red", "stop_amber", "stop_green", "stop_other"),
    *("vehicle", "two_wheeler", "pedestrian", "obstacle"),
    *("velocity_ahead", "velocity_left", "ego"),
)
"""Channels of the bird's-eye view. The first eight are the bits of `GroundMap.bits`, the lowest bit first."""
FORWARD_CHANNELS = (
    *("road", "marking", "footway", "ground", "building"),
    *("vehicle", "two_wheeler", "pedestrian", "obstacle"),
    *("red", "amber", "green", "inverse_depth"),
)
"""Channels of the forward view: planes of classes, of which a pixel has at most one, and the inverse depth."""
MAP_BITS = BIRDS_EYE_CHANNELS[:8]
GROUPS: tuple[str, ...] = ("vehicle", "two_wheeler", "pedestrian", "obstacle")
"""Kinds of road users that a picture distinguishes; arrays contain the index."""
GROUP_OF: dict[str, int] = {
    **{"car": 0, "van": 0, "truck": 0, "bus": 0},
    **{"motorcycle": 1, "bicycle": 1, "pedestrian": 2, "obstacle": 3},
}
HEIGHTS_M: dict[str, float] = {
    **{"car": 1.5, "van": 2.3, "truck": 3.5, "bus": 3.1},
    **{"motorcycle": 1.7, "bicycle": 1.75, "pedestrian": 1.75, "obstacle": 1.0},
}
"""Heights by kind, including riders, m, for recorded runs, whose traces contain none. Ours: average models of each
kind."""
VELOCITY_ZERO = 128
"""Value of a velocity channel on a road user that stands; where there is no road user, the value is 0."""
VELOCITY_PER_MPS = 5
"""Steps of a velocity channel per m/s. Ours: reaches 25 m/s (91 km/h) in both directions, in steps of 0.2 m/s."""
INVERSE_DEPTH_SCALE = 510.0
"""Value of the inverse depth at 1 m. Ours: the largest value, 255, is then that of 2 m, a distance that occurs only in
a crash; 100 m have the value 5."""
CAMERA_HEIGHT_M = 1.4
"""Height of the camera, m. Ours: behind the windscreen of a car 1.5 m high."""
CAMERA_AHEAD_M = 0.3
"""Distance from the middle of the footprint to the camera, m. Ours: the upper edge of a car's windscreen."""
BUILDING_HEIGHT_M = 9.0
"""Height of every building, m: the network contains outlines only. Ours: three storeys, which hide everything behind
them."""
SIGNAL_HEIGHT_M = 1.0
"""Height of a signal head, m. Ours: three lamps of 0.3 m (EN 12368 has 0.2 m and 0.3 m) with their frame."""
SIGNAL_WIDTH_M = 0.5
"""Width of a signal head, m. Ours: a lamp of 0.3 m with its backplate."""


@dataclass(frozen=True, slots=True)
class BirdsEyeLayout:
    """Size and scale of the bird's-eye view; the ego's centre is in the middle of its columns, its heading is up.

    Attributes:
        rows, columns: numbers of rows and columns of pixels.
        m_per_px: side of a pixel. Ours: at 0.5 m the view reaches 48 m each way, which is the braking distance from
            70 km/h with 4 m/s^2; a lane is 6 to 7 pixels wide, a car 4 by 9.
        rows_ahead: rows in front of the ego's centre; half of `rows` puts it in the middle of the picture.
    """

    rows: int = 192
    columns: int = 192
    m_per_px: float = 0.5
    rows_ahead: int = 96

    @property
    def shape(self) -> tuple[int, int, int]:
        """Return the numbers of channels, rows and columns."""
        return len(BIRDS_EYE_CHANNELS), self.rows, self.columns

    def pixel(self, ahead_m: float, left_m: float) -> tuple[int, int]:
        """Return row and column of a point in the ego's frame; they can lie outside the picture."""
        row = math.floor(self.rows_ahead - ahead_m / self.m_per_px)
        return row, math.floor(self.columns / 2 - left_m / self.m_per_px)


@dataclass(frozen=True, slots=True)
class ForwardLayout:
    """Size and lens of the forward view: a level pinhole camera, the horizon between the two middle rows.

    Attributes:
        rows, columns: numbers of rows and columns of pixels, both even. view_rad: angle between the outermost columns'
            outer edges.
    """

    rows: int = 64
    columns: int = 160
    view_rad: float = math.pi / 2

    @property
    def shape(self) -> tuple[int, int, int]:
        """Return the numbers of channels, rows and columns."""
        return len(FORWARD_CHANNELS), self.rows, self.columns

    @property
    def focal_px(self) -> float:
        """Return the focal length in pixels (80 by default)."""
        return self.columns / 2 / math.tan(self.view_rad / 2)

    def pixel(self, ahead_m: float, left_m: float, height_m: float) -> tuple[int, int]:
        """Return row and column of a point in the camera's frame, with its height above the road; `ahead_m` is
        positive."""
        row = math.floor(self.rows / 2 - (height_m - CAMERA_HEIGHT_M) / ahead_m * self.focal_px)
        return row, math.floor(self.columns / 2 - left_m / ahead_m * self.focal_px)


BIRDS_EYE = BirdsEyeLayout()
FORWARD = ForwardLayout()
WHOLE = Window(0, 0, BIRDS_EYE.rows, BIRDS_EYE.columns)
"""The whole view from above."""
