"""The map of a failure over two changed values, or one value and the sensor seed, as a picture for the page."""

from __future__ import annotations

from collections.abc import Iterator

from foresee_dsl.campaign.findings.sureness import HeatMap
from foresee_dsl.report.drawing.labels import width_of
from foresee_dsl.report.drawing.shapes import Shape
from foresee_dsl.report.drawing.sheet import DrawnPart, Sheet, Sizes, Words, rectangle
from foresee_dsl.report.drawing.svg import svg_of

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
