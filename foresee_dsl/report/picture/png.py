"""A sheet as a PNG, drawn with pillow (the extra `pictures`) from the same shapes as the SVG."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from foresee_dsl.errors import ForeseeError
from foresee_dsl.report.picture.palette import PAINTS
from foresee_dsl.report.picture.sheet import PAD, Part, Shape, Sheet, Words
from foresee_dsl.report.show.png import MISSING, as_png, dashed, filled, places

if TYPE_CHECKING:
    from PIL.Image import Image

_FINER = 2
"""Pixels of the file for one of the sheet: letters are sharp on today's screens."""
_SMOOTH = 2
"""Drawn so many times larger still and then made smaller: edges become smooth."""


def png_of(sheet: Sheet, *, dark: bool = False) -> bytes:
    """Return a sheet as a PNG, twice as wide as the SVG.

    Raises:
        ForeseeError: pillow is not installed.
    """
    try:
        from PIL import Image
    except ImportError as err:
        raise ForeseeError(MISSING) from err
    scale = _FINER * _SMOOTH
    size = round(sheet.width * scale), round(sheet.height * scale)
    picture = Image.new("RGB", size, _colours("paper", dark)[0])
    frame = sheet.frame
    map_ = Image.new("RGB", (round(frame.width * scale), round(frame.height * scale)), _colours("grass", dark)[0])
    for part in sheet.parts:
        _part(map_, part, sheet, scale, dark=dark, halo=_colours("plate", dark)[0])
    picture.paste(map_, (round(PAD * scale), round(sheet.map_top * scale)))
    for part in sheet.around:
        _part(picture, part, sheet, scale, dark=dark, halo="")
    smaller = (round(sheet.width * _FINER), round(sheet.height * _FINER))
    return as_png(picture.resize(smaller, Image.Resampling.LANCZOS))


def _colours(paint: str, dark: bool) -> tuple[str, str, float]:
    found = PAINTS[paint]
    return (found.dark_fill, found.dark_line, found.opacity) if dark else (found.fill, found.line, found.opacity)


def _part(picture: Image, part: Part, sheet: Sheet, scale: float, *, dark: bool, halo: str) -> None:
    for shape in part.shapes:
        _shape(picture, shape, scale, dark=dark)
    for words in part.words:
        _words(picture, words, sheet, scale, dark=dark, halo=halo)


def _shape(picture: Image, shape: Shape, scale: float, *, dark: bool) -> None:
    from PIL import Image as Images
    from PIL import ImageDraw

    fill, line, opacity = _colours(shape.paint, dark)
    rings = [ring * scale for ring in shape.rings]
    points = np.vstack(rings)
    wide = max(round(shape.width * scale), 1) if shape.width else 0
    low = np.maximum(np.floor(points.min(axis=0)) - wide - 2, 0).astype(int)
    high = np.minimum(np.ceil(points.max(axis=0)) + wide + 2, picture.size).astype(int)
    if (high <= low).any():
        return
    size = (int(high[0] - low[0]), int(high[1] - low[1]))
    corner = (int(low[0]), int(low[1]))

    def paste(colour: str, mask: Image) -> None:
        weak = mask.convert("L").point(lambda v: int(v * opacity))
        picture.paste(colour, corner, weak)

    if shape.closed and fill:
        paste(fill, filled([ring - low for ring in rings], size))
    if line and wide:
        mask = Images.new("1", size)
        draw = ImageDraw.Draw(mask)
        for ring in rings:
            whole = np.vstack([ring, ring[:1]]) if shape.closed else ring
            on, off = (part * scale for part in shape.dash) if shape.dash else (0.0, 0.0)
            for piece in dashed(whole - low, on, off) if on else (whole - low,):
                draw.line(places(piece), fill=1, width=wide, joint="curve")
        paste(line, mask)


def _words(picture: Image, words: Words, sheet: Sheet, scale: float, *, dark: bool, halo: str) -> None:
    from PIL import Image, ImageDraw, ImageFont

    font = ImageFont.load_default(getattr(sheet.sizes, words.size) * scale)
    fill = _colours(words.paint, dark)[0]
    draw = ImageDraw.Draw(picture)
    thick = round(1.5 * scale) if halo else 0
    bold = round(0.25 * scale) if words.bold else 0
    x, y = words.x * scale, words.y * scale
    anchor = {"start": "lm", "middle": "mm", "end": "rm"}[words.anchor]
    if not words.angle_deg:
        if halo:
            draw.text((x, y), words.text, fill=halo, font=font, anchor=anchor, stroke_width=thick)
        draw.text((x, y), words.text, fill=fill, font=font, anchor=anchor, stroke_width=bold, stroke_fill=fill)
        return
    side = math.ceil(draw.textlength(words.text, font=font) + 4 * scale)
    sheet_of_words = Image.new("RGBA", (side, side))
    own = ImageDraw.Draw(sheet_of_words)
    own.text((side / 2, side / 2), words.text, fill=halo or fill, font=font, anchor="mm", stroke_width=thick)
    own.text((side / 2, side / 2), words.text, fill=fill, font=font, anchor="mm")
    turned = sheet_of_words.rotate(-words.angle_deg, Image.Resampling.BICUBIC)
    picture.paste(turned, (round(x - side / 2), round(y - side / 2)), turned)
