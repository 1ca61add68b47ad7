"""A camera's picture from the view ahead of foresee-learned: flat colours for classes of things, not a photograph.

The view (docs/reference/rasters.md) is that of a level camera behind the windscreen. A pixel of the agent's camera
takes the colour of the view's pixel in the same direction, so the place of the agent's camera on the vehicle has no
effect; directions that the view does not show are black. A network that was trained on photographs will not know what
it sees.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.drivers.protocol import Views
from foresee_dsl.errors import DriverUnavailableError

ROWS, COLUMNS, FOCAL_PX = 64, 160, 80.0
"""Size and focal length of the view ahead (docs/reference/rasters.md)."""
COLOURS_BGR = (
    *((128, 64, 128), (255, 255, 255), (232, 35, 244), (81, 0, 81), (70, 70, 70)),
    *((142, 0, 0), (230, 0, 0), (60, 20, 220), (160, 190, 110), (0, 0, 255), (0, 190, 255), (0, 255, 0)),
)
"""Blue, green and red of the classes road, marking, footway, ground, building, vehicle, two-wheeler, pedestrian,
obstacle, red, amber and green light. The first nine are those of Cityscapes for similar classes; lights: ours."""
SKY_BGR = (180, 130, 70)
"""Colour above the horizon and beyond the visual range: Cityscapes' sky."""


def picture(views: Views | None, width: int, height: int, fov_deg: float, yaw_deg: float) -> NDArray[np.uint8]:
    """Return what `sensor.camera.rgb` gives: [height, width, 4] blue, green, red, alpha.

    Args:
        fov_deg: horizontal field of view. yaw_deg: yaw of the camera on the vehicle, clockwise.

    Raises:
        DriverUnavailableError: no installed package draws the view ahead.
    """
    if views is None:
        raise DriverUnavailableError("cameras need the pictures of foresee-learned: pip install 'foresee-dsl[learned]'")
    channels = views.forward()[: len(COLOURS_BGR)]
    colours = np.array((*COLOURS_BGR, SKY_BGR), dtype=np.uint8)
    classes = np.where(channels.any(axis=0), channels.argmax(axis=0), len(COLOURS_BGR))
    rows, columns = _pixels(width, height, fov_deg, yaw_deg)
    inside = (rows >= 0) & (rows < ROWS) & (columns >= 0) & (columns < COLUMNS)
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
        columns = np.floor(COLUMNS / 2 + FOCAL_PX * across / ahead)
        rows = np.floor(ROWS / 2 + FOCAL_PX * down[:, None] / ahead)
    columns, rows = np.broadcast_to(columns, rows.shape), np.asarray(rows)
    visible = (ahead > 0) & (np.abs(rows) < 1e6) & (np.abs(columns) < 1e6)
    return np.where(visible, rows, -1).astype(np.int64), np.where(visible, columns, -1).astype(np.int64)
