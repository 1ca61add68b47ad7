"""The strip as a PNG, drawn with pillow (the extra `pictures`) from the same shapes as the SVG."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from foresee_dsl.errors import ForeseeError
from foresee_dsl.report.ground import FloatArray
from foresee_dsl.report.safe_text import shortened
from foresee_dsl.report.show.drawing import GRASS, STYLES, Drawn, drawing
from foresee_dsl.report.show.panels import Panel, Strip
from foresee_dsl.report.strip import balanced, caption_of, legend_of, scale_bar

if TYPE_CHECKING:
    from PIL.Image import Image
    from PIL.ImageDraw import ImageDraw

SIDE_PX = 260
"""Side of a panel."""
_FINER = 2
"""Drawn so many times larger and then made smaller: edges become smooth."""
_GAP, _MARGIN, _CAPTION, _TITLE, _LEGEND, _FONT = 12, 10, 40, 24, 34, 14
_PAPER, _INK, _GREY, _FRAME = "#ffffff", "#1b1b1b", "#555555", "#8a8a8a"
_DASH_M = 1.2
MISSING = "pictures need the package pillow: pip install 'foresee-dsl[pictures]'"


def png_of(strips: Sequence[Strip], *, per_row: int = 6) -> bytes:
    """Return strips, one below the other, as a PNG.

    Raises:
        ForeseeError: pillow is not installed.
    """
    return as_png(image_of(strips, per_row=per_row))


def as_png(picture: Image) -> bytes:
    """Return a pillow image as a PNG file's bytes."""
    out = io.BytesIO()
    picture.save(out, "PNG", optimize=True)
    return out.getvalue()


def image_of(strips: Sequence[Strip], *, per_row: int = 6) -> Image:
    """Return strips as a pillow image; raises as `png_of`."""
    try:
        from PIL import Image, ImageDraw, ImageFont
    except ImportError as err:
        raise ForeseeError(MISSING) from err
    rows = []
    for strip in strips:
        step = balanced(len(strip.panels), per_row)
        rows += [(strip.title if start == 0 else "", strip.panels[start : start + step])
                 for start in range(0, len(strip.panels), step)]  # fmt: skip
    most = max((len(panels) for _, panels in rows), default=1)
    width = 2 * _MARGIN + most * (SIDE_PX + _GAP) - _GAP
    height = _MARGIN + sum(_CAPTION + SIDE_PX + _GAP + (_TITLE if title else 0) for title, _ in rows) + _LEGEND
    picture = Image.new("RGB", (width, height), _PAPER)
    draw, font, small = ImageDraw.Draw(picture), ImageFont.load_default(_FONT), ImageFont.load_default(_FONT - 2)
    y = _MARGIN
    for title, panels in rows:
        if title:
            draw.text((_MARGIN, y), shortened(title, 120), fill=_INK, font=font)
            y += _TITLE
        for k, panel in enumerate(panels):
            x, (caption, figures) = _MARGIN + k * (SIDE_PX + _GAP), caption_of(panel)
            draw.text((x, y), shortened(f"{panel.snapshot.letter}  {caption}", 36), fill=_INK, font=font)
            draw.text((x, y + 19), shortened(figures, 36), fill=_GREY, font=small)
            picture.paste(_panel(panel), (x, y + _CAPTION))
            _scale(draw, panel, x, y + _CAPTION + SIDE_PX)
            draw.text((x + 12, y + _CAPTION + SIDE_PX - 27), f"{scale_bar(panel.side_m)} m", fill=_INK, font=small)
        y += _CAPTION + SIDE_PX + _GAP
    at = float(_MARGIN)
    for role, name in legend_of(strips):
        style = STYLES[role]
        draw.rectangle((at, y + 6, at + 18, y + 16), fill=style.fill or None, outline=style.line)
        draw.text((at + 24, y + 3), name, fill=_INK, font=font)
        at += 24 + draw.textlength(name, font=font) + 18
    return picture


def _panel(panel: Panel) -> Image:
    from PIL import Image, ImageDraw

    side = SIDE_PX * _FINER
    scale = side / panel.side_m
    picture = Image.new("RGB", (side, side), GRASS)
    draw = ImageDraw.Draw(picture)
    for one in drawing(panel):
        _draw(picture, draw, one, scale)
    _north(draw, panel, side)
    draw.rectangle((0, 0, side - 1, side - 1), outline=_FRAME, width=_FINER)
    return picture.resize((SIDE_PX, SIDE_PX), Image.Resampling.LANCZOS)


def _draw(picture: Image, draw: ImageDraw, one: Drawn, scale: float) -> None:
    half = picture.width / 2
    rings = [ring * (scale, -scale) + half for ring in one.rings]
    if one.closed and one.style.fill:
        if len(rings) == 1:
            draw.polygon(places(rings[0]), fill=one.style.fill)
        else:
            picture.paste(one.style.fill, mask=filled(rings, picture.size))
    if one.style.line:
        wide = max(round(one.style.width_m * scale), _FINER)
        for ring in rings:
            points = np.vstack([ring, ring[:1]]) if one.closed else ring
            for piece in dashed(points, _DASH_M * scale, _DASH_M * scale) if one.style.dashed else (points,):
                draw.line(places(piece), fill=one.style.line, width=wide, joint="curve")


def filled(rings: Sequence[FloatArray], size: tuple[int, int]) -> Image:
    """Return what is inside of rings by the even-odd rule: a ring within another is a hole."""
    from PIL import Image, ImageChops, ImageDraw

    mask = Image.new("1", size)
    for ring in rings:
        inside = Image.new("1", size)
        ImageDraw.Draw(inside).polygon(places(ring), fill=1)
        mask = ImageChops.logical_xor(mask, inside)
    return mask


def dashed(points: FloatArray, length: float, gap: float) -> list[FloatArray]:
    """Return the dashes of a line, with gaps between them."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    found = []
    for start in np.arange(0.0, along[-1], length + gap).tolist():
        at = np.array([start, *along[(along > start) & (along < start + length)], min(start + length, along[-1])])
        found.append(np.column_stack([np.interp(at, along, points[:, 0]), np.interp(at, along, points[:, 1])]))
    return found


def _north(draw: ImageDraw, panel: Panel, side: int) -> None:
    middle, size, turn = np.array((side - 16 * _FINER, 16 * _FINER)), 9.0 * _FINER, panel.north_rad
    ahead = np.array((math.cos(turn), -math.sin(turn)))
    aside = np.array((ahead[1], -ahead[0]))
    points = [middle + size * (a * ahead + b * aside) for a, b in ((1, 0), (-0.7, 0.45), (-0.35, 0), (-0.7, -0.45))]
    draw.polygon(places(np.array(points)), fill=_INK, outline=_PAPER)


def _scale(draw: ImageDraw, panel: Panel, x: float, bottom: float) -> None:
    length = scale_bar(panel.side_m) / panel.side_m * SIDE_PX
    left, right, high, low = x + 8, x + 8 + length, bottom - 13, bottom - 9
    marks = np.array([(left, high), (left, low), (right, low), (right, high)])
    for a, b in pairwise(marks):
        draw.line(places(np.array([a, b])), fill=_INK, width=2)


def places(points: FloatArray) -> list[tuple[float, float]]:
    """Return points as pillow takes them."""
    return [(x, y) for x, y in points.tolist()]
