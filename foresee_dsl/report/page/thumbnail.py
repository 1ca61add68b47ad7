"""The thumbnail of a run: roads, the ways of ego and opponent, and where both are at the most critical moment.

It is drawn once for the list, and once more, larger, where the page's scripts do not run.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.kernels.boxes import corners, pairwise_box_distance
from foresee_dsl.report.drawing.ground import FloatArray, Layer, ground_of, rings_of, within
from foresee_dsl.report.show.panels import VIEW_S, PanelWindow, Role, cut, key_frame, role_of, window_before
from foresee_dsl.simulate.trace import STEP_S, Trace, X, Y

LAYERS = (Layer.FOOTWAY, Layer.ROAD, Layer.CROSSING, Layer.BUILDING)
"""The layers of the ground that are drawn; a thumbnail is too small for lines."""
TOLERANCE_M = 0.4
"""Outlines of the ground are simplified with this tolerance, m. Ours: a pixel of a thumbnail."""
_DM = 10.0
"""Coordinates are whole decimetres."""
_WAY_S = 0.25
"""Time between two points of a way, s. Ours: 3.5 m at 50 km/h."""


@dataclass(frozen=True)
class Thumbnail:
    """A thumbnail as SVG paths, whose coordinates are decimetres with y downwards.

    Attributes:
        side: width and height. paths: kind (a paint, or `way-ROLE`) and path of each shape, from back to front.
    """

    side: int
    paths: tuple[tuple[str, str], ...]

    @property
    def box(self) -> str:
        """The SVG's `viewBox`, whose middle is the origin."""
        half = self.side // 2
        return f"{-half} {-half} {self.side} {self.side}"


def thumbnail(trace: Trace, bundle: SumoBundle, opponent: str) -> Thumbnail:
    """Return the thumbnail of a run; `opponent`: id of the opponent, "" for none."""
    other = next((k for k, info in enumerate(trace.actors) if k and info.id == opponent), None)
    gap = np.full(trace.frames, np.nan) if other is None else pairwise_box_distance(trace.boxes(0), trace.boxes(other))
    frame = key_frame(trace, gap)
    window = window_before(trace, bundle, opponent if other is not None else "", frame)
    return Thumbnail(round(window.side_m * _DM), tuple(_paths(trace, bundle, opponent, other, frame, window)))


def _paths(
    trace: Trace, bundle: SumoBundle, opponent: str, other: int | None, frame: int, window: PanelWindow
) -> Iterator[tuple[str, str]]:
    ground = cut(ground_of(bundle.network, within(window.bounds)), window)
    for layer in LAYERS:
        if (shape := ground.get(layer)) is not None:
            yield layer.value, "".join(f"{_line(ring)}z" for ring in rings_of(shape.simplify(TOLERANCE_M)))
    first = max(frame - round(VIEW_S / STEP_S), 0)
    frames = np.unique(np.append(np.arange(frame, first - 1, -round(_WAY_S / STEP_S)), first))
    ours = [0] if other is None else [other, 0]
    for actor in ours:
        way = trace.states[frames][:, actor, [X, Y]]
        way = way[~np.isnan(way[:, 0])]
        if len(way) > 1:
            yield f"way-{role_of(trace, actor, opponent).value}", _line(window.points(way))
    for actor in [*(k for k in range(1, len(trace.actors)) if k != other), *ours]:
        box = trace.boxes(actor)[frame]
        if math.isnan(box[0]):
            continue
        outline = window.points(corners(box))
        if np.abs(outline).max() <= window.side_m / 2 or actor in ours:
            role = role_of(trace, actor, opponent)
            small = role in (Role.EGO, Role.OPPONENT) and trace.actors[actor].kind == "pedestrian"
            if small:  # a person is a pixel wide
                middle, reach = outline.mean(axis=0), window.side_m / 30
                outline = middle + reach * np.array([(1, 0), (0, 1), (-1, 0), (0, -1)])
            yield role.value, f"{_line(outline)}z"


def _line(points: FloatArray) -> str:
    """Return points as an SVG path: the first point is absolute, each other one relative to the point before."""
    whole = np.rint(points * (_DM, -_DM)).astype(np.int64)
    steps = np.diff(whole, axis=0)
    steps = steps[(steps != 0).any(axis=1)]
    x, y = whole[0].tolist()
    return f"M{x} {y}" + (f"l{' '.join(f'{dx} {dy}' for dx, dy in steps.tolist())}" if len(steps) else "")
