"""A panel as shapes to fill and lines to draw, back to front: what the SVG and the PNG of a strip have in common."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from foresee_dsl.report.ground import FloatArray, Layer, lines_of, rings_of, zebra
from foresee_dsl.report.show.panels import Footprint, Panel, Role


class Style(NamedTuple):
    """How something is drawn: colours as `#rrggbb` ("" for none), the line's width in metres, and dashes or not."""

    fill: str
    line: str
    width_m: float
    dashed: bool = False


GRASS = "#e4ebdc"
"""Where nothing else lies."""
STYLES: dict[Layer | Role, Style] = {
    Layer.FOOTWAY: Style("#d3d0c8", "", 0.0),
    Layer.ROAD: Style("#8d9299", "#5f646b", 0.2),
    Layer.CYCLEWAY: Style("#a58a84", "", 0.0),
    Layer.PARKING: Style("#a3a39a", "", 0.0),
    Layer.MARKING: Style("", "#f4f4f0", 0.15, dashed=True),
    Layer.BUS_STOP: Style("#d9be4a", "#8a6d00", 0.12),
    Layer.EDGE_LINE: Style("", "#f4f4f0", 0.15),
    Layer.CROSSING: Style("#f4f4f0", "", 0.0),
    Layer.STOP_LINE: Style("", "#f4f4f0", 0.4),
    Layer.SLIPPERY: Style("#a9d4ec", "#3d7ea6", 0.12),
    Layer.BUILDING: Style("#b79f85", "#7d6853", 0.2),
    Role.PARKED: Style("#c9ced6", "#4f555d", 0.12),
    Role.OTHER: Style("#f0d264", "#6e5a10", 0.12),
    Role.GHOST: Style("", "#2b2b2b", 0.15),
    Role.OPPONENT: Style("#d7263d", "#5e0d19", 0.15),
    Role.EGO: Style("#1f6fd6", "#0b2c57", 0.15),
}
"""Ours. Ego and opponent also differ in lightness, for people and printers that see no colours."""
NAMES = {
    Role.EGO: "ego",
    Role.OPPONENT: "opponent",
    Role.OTHER: "others",
    Role.PARKED: "parked, obstacles",
    Role.GHOST: "in the parent's run",
}
SCREEN = 0.35
"""A vehicle has a bar across, the windscreen, this share of its length behind its front: so one sees where it heads."""
LEAST_M = 0.9
"""A pedestrian is drawn at least this wide. Ours: 0.5 m would be a pixel or two."""


@dataclass(frozen=True)
class Drawn:
    """One thing to draw.

    Attributes:
        name: the layer or role. style: of it. rings: [N, 2] points each, m; filled by the even-odd rule.
        closed: outlines, else lines. title: who it is, for a tooltip; "" for the map.
    """

    name: Layer | Role
    style: Style
    rings: tuple[FloatArray, ...]
    closed: bool = True
    title: str = ""


def drawing(panel: Panel) -> tuple[Drawn, ...]:
    """Return what a panel shows, back to front."""
    return (*_ground(panel), *(one for footprint in panel.footprints for one in _footprint(footprint)))


def _ground(panel: Panel) -> Iterator[Drawn]:
    for layer in Layer:
        shape = panel.ground.get(layer)
        if shape is None:
            continue
        if layer is Layer.CROSSING:
            shape = zebra(shape)
        closed = bool(STYLES[layer].fill)
        rings = tuple(rings_of(shape) if closed else lines_of(shape))
        if rings:
            yield Drawn(layer, STYLES[layer], rings, closed)


def _footprint(footprint: Footprint) -> Iterator[Drawn]:
    style, title = STYLES[footprint.role], footprint.actor
    outline = widened(footprint.corners)
    yield Drawn(footprint.role, style, (outline,), title=title)
    if footprint.kind not in ("pedestrian", "obstacle") and footprint.role is not Role.GHOST:
        front_left, rear_left, rear_right, front_right = outline
        left, right = front_left + SCREEN * (rear_left - front_left), front_right + SCREEN * (rear_right - front_right)
        across = np.array((left, right))
        yield Drawn(footprint.role, style, (across,), closed=False, title=title)


def widened(outline: FloatArray) -> FloatArray:
    """Return a footprint's corners with sides of at least `LEAST_M`."""
    middle = outline.mean(axis=0)
    along, left = (outline[0] - outline[1]) / 2, (outline[0] - outline[3]) / 2
    along, left = (side * max(1.0, LEAST_M / 2 / max(float(np.hypot(*side)), 1e-6)) for side in (along, left))
    return np.array([middle + along + left, middle - along + left, middle - along - left, middle + along - left])
