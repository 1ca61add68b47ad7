"""Converts pictures to colours for people to look at, and writes PNG files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from foresee_learned.rasters.layout import BIRDS_EYE_CHANNELS, FORWARD_CHANNELS

Colour = tuple[int, int, int]

_NOTHING: Colour = (226, 230, 220)
_SKY: Colour = (205, 225, 245)
_COLOURS: dict[str, Colour] = {
    **{"drivable": (120, 120, 125), "road": (120, 120, 125), "parking": (140, 135, 150), "ground": (196, 208, 180)},
    **{"footway": (190, 185, 175), "crossing": (215, 215, 190), "lane_centre": (140, 140, 150)},
    **{"route": (120, 170, 225), "marking": (240, 240, 240), "building": (125, 90, 75)},
    **{"stop_other": (90, 90, 90), "stop_red": (220, 30, 30), "stop_amber": (255, 170, 0)},
    **{"stop_green": (30, 170, 60), "red": (255, 0, 0), "amber": (255, 190, 0), "green": (0, 210, 70)},
    **{"vehicle": (30, 70, 160), "two_wheeler": (0, 150, 150), "pedestrian": (200, 40, 160)},
    **{"obstacle": (220, 120, 20), "ego": (255, 225, 0)},
}
"""Colours of the channels; later ones are painted over earlier ones."""


def coloured(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a picture of either view in colours, [H, W, 3]; velocities and depths are left out."""
    layouts = {len(BIRDS_EYE_CHANNELS): (BIRDS_EYE_CHANNELS, _NOTHING), len(FORWARD_CHANNELS): (FORWARD_CHANNELS, _SKY)}
    if len(picture) not in layouts:
        raise ValueError(f"a picture has {' or '.join(map(str, layouts))} channels, not {len(picture)}")
    channels, background = layouts[len(picture)]
    rgb = np.full((*picture.shape[1:], 3), background, np.uint8)
    for name, colour in _COLOURS.items():
        if name in channels:
            rgb[picture[channels.index(name)] > 0] = colour
    return rgb


def write_png(rgb: NDArray[np.uint8], file: Path, *, zoom: int = 1) -> None:
    """Write [H, W, 3] colours as a PNG in which each pixel is `zoom` by `zoom` large.

    It needs the package pillow (`pip install "foresee-dsl[pictures]"`).
    """
    from PIL import Image

    height, width = rgb.shape[:2]
    Image.fromarray(rgb).resize((width * zoom, height * zoom), Image.Resampling.NEAREST).save(file, "PNG")
