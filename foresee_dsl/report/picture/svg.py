"""A sheet as an SVG document that stands on its own, or to be put into a page that has the colours."""

from __future__ import annotations

from functools import cache
from typing import Literal

from foresee_dsl.compile.templates import number
from foresee_dsl.files import rendered, templates
from foresee_dsl.report.picture.palette import PAINTS
from foresee_dsl.report.picture.sheet import Shape, Sheet


def svg_of(sheet: Sheet, *, styled: bool = True, scheme: Literal["", "light", "dark"] = "") -> str:
    """Return a sheet as SVG; without `styled` it has no colours of its own (`style_of` gives them).

    `scheme`: its colours; "": those that its surroundings prefer.
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
    """Return the colours and letters of a sheet as CSS: for light and dark surroundings, and for a phone."""
    return _style(sheet.sizes.text, sheet.sizes.small, sheet.sizes.title, sheet.sizes.room)


@cache
def _style(text: float, small: float, title: float, room: float) -> str:
    sizes = {"text": text, "small": small, "title": title}
    template = templates("draw", markup=False).get_template("picture.css.j2")
    return template.render(paints=PAINTS, sizes=sizes, room=room, number=number)


def _path(shape: Shape) -> str:
    """Return a shape as SVG writes a path, in tenths of a pixel."""
    end = "Z" if shape.closed else ""
    rings = (" ".join(f"{number(x, 1)} {number(y, 1)}" for x, y in ring.tolist()) for ring in shape.rings)
    return "".join(f"M{ring}{end}" for ring in rings)
