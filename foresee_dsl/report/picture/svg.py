"""A sheet as an SVG document, either complete or for a page that defines the colours."""

from __future__ import annotations

from functools import cache
from typing import Literal

from foresee_dsl.compile.templates import number
from foresee_dsl.files import rendered, templates
from foresee_dsl.report.picture.palette import PAINTS
from foresee_dsl.report.picture.sheet import Shape, Sheet


def svg_of(sheet: Sheet, *, styled: bool = True, scheme: Literal["", "light", "dark"] = "") -> str:
    """Return a sheet as SVG; without `styled` the document does not define its colours (`style_of` returns them).

    `scheme`: light or dark colours; "": the scheme that the viewer prefers.
    """
    return rendered(
        "draw/picture.svg",
        sheet=sheet,
        scheme=scheme,
        style=style_of(sheet) if styled else "",
        path=_path,
        number=number,
        width=number(sheet.width, 1),
        height=number(sheet.height, 1),
    )


def style_of(sheet: Sheet) -> str:
    """Return the colours and letter sizes of a sheet as CSS, for light and dark surroundings and for phones."""
    return _style(sheet.sizes.text, sheet.sizes.small, sheet.sizes.title, sheet.sizes.room)


@cache
def _style(text: float, small: float, title: float, room: float) -> str:
    sizes = {"text": text, "small": small, "title": title}
    template = templates("draw", markup=False).get_template("picture.css.j2")
    return template.render(paints=PAINTS, sizes=sizes, room=room, number=number)


def _path(shape: Shape) -> str:
    """Return a shape as an SVG path, rounded to tenths of a pixel."""
    end = "Z" if shape.closed else ""
    rings = (" ".join(f"{number(x, 1)} {number(y, 1)}" for x, y in ring.tolist()) for ring in shape.rings)
    return "".join(f"M{ring}{end}" for ring in rings)
