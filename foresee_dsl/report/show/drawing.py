"""The shapes and lines of a panel from back to front, from which the SVG and the PNG of a strip are drawn."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from foresee_dsl.report.ground import FloatArray, Layer, lines_of, rings_of, zebra
from foresee_dsl.report.show.panels import Footprint, Panel, Role


class Style(NamedTuple):
    """The style of a shape: colours as `#rrggbb` ("" for none), width of the line, m, and whether it is dashed."""

    fill: str
    line: str
    width_m: float
    dashed: bool = False


GRASS = "#e4ebdc"
"""Colour of the background."""
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
"""Styles by layer or role (ours). Ego and opponent also differ in lightness, for colour-blind readers and printers."""
NAMES = {
    Role.EGO: "ego",
    Role.OPPONENT: "opponent",
    Role.OTHER: "others",
    Role.PARKED: "parked, obstacles",
    Role.GHOST: "in the parent's run",
}
SCREEN = 0.35
"""Distance of the windscreen, a line across a vehicle, from its front, as a share of the length; it shows which end is
the front."""
LEAST_M = 0.9
"""Smallest side of a drawn footprint, m. Ours: a pedestrian of 0.5 m would be one or two pixels wide."""


@dataclass(frozen=True)
class Drawn:
    """Shapes to draw in one style.

    Attributes:
        name: the layer or role. style: its style. rings: [N, 2] points of each shape, m; filled by the even-odd rule.
        closed: the shapes are outlines, not lines. title: the actor's id, for a tooltip; "" for the map.
    """

    name: Layer | Role
    style: Style
    rings: tuple[FloatArray, ...]
    closed: bool = True
    title: str = ""


def drawing(panel: Panel) -> tuple[Drawn, ...]:
    """Return the shapes of a panel from back to front."""
    return (*_ground(panel), *(shape for footprint in panel.footprints for shape in _footprint(footprint)))


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
