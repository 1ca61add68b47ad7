"""Converts a sheet to an SVG document, either complete or for a page that defines the colours, and an SVG document to a
PNG with resvg (the extra `pictures`)."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Literal

from foresee_dsl.compile.templates import number
from foresee_dsl.errors import ForeseeError
from foresee_dsl.files import rendered, templates
from foresee_dsl.report.drawing.palette import PAINTS
from foresee_dsl.report.drawing.shapes import Shape
from foresee_dsl.report.drawing.sheet import DrawnPart, MapFrame, Sheet

Scheme = Literal["", "light", "dark"]
_ALWAYS = ("paper", "grass", "frame")
"""Paints of every sheet and map."""


def svg_of(sheet: Sheet, *, styled: bool = True, scheme: Scheme = "") -> str:
    """Return a sheet as SVG; without `styled` the document does not define its colours (`style_of` returns them).

    `scheme`: light or dark colours; "" for the scheme that the viewer prefers.
    """
    return rendered(
        "draw/picture.svg",
        sheet=sheet,
        scheme=scheme,
        style=style_of(sheet, scheme) if styled else "",
        path=_path,
        number=number,
    )


def style_of(sheet: Sheet, scheme: Scheme = "") -> str:
    """Return the colours and letter sizes of a sheet as CSS, for light and dark surroundings and for phones."""
    sizes = {"text": sheet.sizes.text, "small": sheet.sizes.small, "title": sheet.sizes.title}
    names = {*_ALWAYS, *_paints(sheet)}
    paints = {name: paint for name, paint in PAINTS.items() if name in names}
    template = templates("draw", markup=False).get_template("picture.css.j2")
    return template.render(
        paints=paints, every=PAINTS, scheme=scheme, sizes=sizes, room=sheet.sizes.room, number=number
    )


def _paints(sheet: Sheet) -> Iterator[str]:
    parts: list[DrawnPart] = [*sheet.around, *(part for map_ in sheet.maps for part in map_.parts)]
    for part in parts:
        yield from (shape.paint for shape in part.shapes)
        yield from (words.paint for words in part.words)


def _path(shape: Shape, frame: MapFrame | None) -> str:
    """Return a shape as an SVG path, rounded to tenths of a pixel; `frame`: the map in which the shape lies."""
    end = "Z" if shape.closed else ""
    rings = (frame.pixels(ring) if frame is not None else ring for ring in shape.rings)
    points = (" ".join(f"{number(x, 1)} {number(y, 1)}" for x, y in ring.tolist()) for ring in rings)
    return "".join(f"M{ring}{end}" for ring in points)


MISSING = "this picture needs the package {}: pip install 'foresee-dsl[pictures]'"
"""Message without a package; `format` puts its name in."""
_FONTS = ("/usr/share/fonts", "/usr/local/share/fonts", "~/.fonts", "~/.local/share/fonts")
"""Folders in which resvg looks for fonts on Linux (resvg-py 0.5.0)."""


def png_of_svg(svg: str, *, zoom: float = 2.0) -> bytes:
    """Return an SVG document as a PNG, enlarged by the factor `zoom`.

    Raises: ForeseeError: resvg-py is not installed, or the system has no font for the names in the picture.
    """
    try:
        import resvg_py
    except ImportError as err:
        raise ForeseeError(MISSING.format("resvg-py")) from err
    return bytes(resvg_py.svg_to_bytes(svg_string=svg, zoom=zoom, font_files=list(_own_fonts())))


@cache
def _own_fonts() -> tuple[str, ...]:
    """Return font files of matplotlib if the system has no fonts, otherwise none.

    Raises:
        ForeseeError: matplotlib is not installed either; without a font resvg-py 0.5.0 leaves out every text without an
            error.
    """
    folders = [Path(folder).expanduser() for folder in _FONTS]
    if not sys.platform.startswith("linux") or any(next(f.rglob("*.[to]tf"), None) for f in folders if f.is_dir()):
        return ()
    if find_spec("matplotlib") is None:
        raise ForeseeError("this picture needs a font for its names, and this system has none: install one, such as "
                           "`apt-get install fonts-dejavu-core`, or matplotlib, which brings one")  # fmt: skip
    import matplotlib as mpl

    fonts = Path(mpl.get_data_path()) / "fonts" / "ttf"
    return tuple(str(fonts / name) for name in ("DejaVuSans.ttf", "DejaVuSans-Bold.ttf"))
