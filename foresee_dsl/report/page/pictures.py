"""Small pictures of the page: the thumbnail of a run, and the map of a failure over two changed values, or over one
value and the sensor seed.

A thumbnail shows roads, the ways of ego and opponent, and where both are at the most critical moment. It is drawn once
for the list, and once more, larger, where the page's scripts do not run.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from foresee_dsl.campaign.findings.sureness import HeatMap
from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.boxes import box_distance, corners
from foresee_dsl.report.drawing.ground import Layer, ground_of, rings_of, within
from foresee_dsl.report.drawing.labels import width_of
from foresee_dsl.report.drawing.shapes import Shape
from foresee_dsl.report.drawing.sheet import DrawnPart, Sheet, Sizes, Words, rectangle
from foresee_dsl.report.drawing.svg import svg_of
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
    gap = np.full(trace.frames, np.nan) if other is None else box_distance(trace.boxes(0), trace.boxes(other))
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


PAINTS = ("fails", "passes", "ink", "quiet")
"""The paints of a map."""
_CELL_PX, _GAP_PX = 30.0, 2.0
"""Side of a cell and the gap between two, px. Ours: nine cells with their names fit the width of a phone."""
_SIZES = Sizes(text=11.5, small=10.5, title=11.5, room=1.0)
"""Sizes of letters, px. Ours: a value with two decimals is as wide as a cell."""
_EDGE_PX = 4.0
"""Margin around the map, px."""
_ENDINGS = {True: "fails", False: "passes", None: "not possible"}


def heat_map_svg(heat_map: HeatMap) -> str:
    """Return the map as SVG without colours: the page defines those of `PAINTS`."""
    return svg_of(heat_map_sheet(heat_map), styled=False)


def heat_map_sheet(heat_map: HeatMap) -> Sheet:
    """Return the map as a picture: a cell for each run, and the values at the left and the lower side.

    The unmutated values are bold.
    """
    left = _EDGE_PX + _SIZES.text * 1.6 + max(width_of(_number(name), _SIZES.small) for name in heat_map.rows)
    wide, high = len(heat_map.columns) * _CELL_PX, len(heat_map.rows) * _CELL_PX
    bottom = _EDGE_PX + high
    outcomes = [fails for row in heat_map.fails for fails in row]
    label = (
        f"Map of {len(outcomes)} runs, of which {outcomes.count(True)} fail: {heat_map.across} across, "
        f"{heat_map.down} down"
    )
    sides = (
        Words("ink", _side(heat_map.across, heat_map.columns), left + wide / 2, bottom + 32, "text", "middle"),
        Words("ink", _side(heat_map.down, heat_map.rows), _EDGE_PX + _SIZES.text / 2, _EDGE_PX + high / 2, "text",
              "middle", angle_deg=-90.0),
    )  # fmt: skip
    parts = (*_cells(heat_map, left), DrawnPart("sides", words=(*_values(heat_map, left, bottom), *sides)))
    return Sheet(left + wide + _EDGE_PX, bottom + 42, (), parts, label, _SIZES)


def _cells(heat_map: HeatMap, left: float) -> Iterator[DrawnPart]:
    own = heat_map.own
    for row, (down, line) in enumerate(zip(heat_map.rows, heat_map.fails, strict=True)):
        for column, (across, fails) in enumerate(zip(heat_map.columns, line, strict=True)):
            x, y = left + column * _CELL_PX, _EDGE_PX + row * _CELL_PX
            cell = rectangle(x + _GAP_PX / 2, y + _GAP_PX / 2, x + _CELL_PX - _GAP_PX / 2, y + _CELL_PX - _GAP_PX / 2)
            paint = {True: "fails", False: "passes", None: "quiet"}[fails]
            shapes = [Shape(paint, (cell,), closed=fails is not None, width=1.0)]
            if (row, column) == own:
                frame = rectangle(x + 1, y + 1, x + _CELL_PX - 1, y + _CELL_PX - 1)
                shapes.append(Shape("ink", (frame[[0, 1, 2, 3, 0]],), closed=False, width=2.4))
            title = f"{heat_map.across} {across}, {heat_map.down} {down}: {_ENDINGS[fails]}"
            yield DrawnPart("cell", tuple(shapes), title=f"{title}, the finding" if (row, column) == own else title)


def _values(heat_map: HeatMap, left: float, bottom: float) -> Iterator[Words]:
    across, *down = heat_map.unmutated
    for column, name in enumerate(heat_map.columns):
        x = left + (column + 0.5) * _CELL_PX
        yield Words("quiet", _number(name), x, bottom + 10, "small", "middle", bold=name == across)
    for row, name in enumerate(heat_map.rows):
        y = _EDGE_PX + (row + 0.5) * _CELL_PX
        yield Words("quiet", _number(name), left - 4, y, "small", "end", bold=name in down)


def _number(value: str) -> str:
    """Return the number of a value without its unit, which stands at the side."""
    return value.partition(" ")[0]


def _side(change: str, values: tuple[str, ...]) -> str:
    unit = values[0].partition(" ")[2]
    name = "sensor seed" if change == "seed" else change
    return f"{name}, {unit}" if unit else name
