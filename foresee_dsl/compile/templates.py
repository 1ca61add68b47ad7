"""Renders the XML files for SUMO from the templates in `templates/sumo`."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from foresee_dsl.files import data_folder, templates

if TYPE_CHECKING:
    from jinja2 import Environment


def rendered(template: str, **values: object) -> str:
    """Return the text of the template `templates/sumo/<template>.j2`, filled with values for all its variables."""
    return environment("sumo").get_template(f"{template}.j2").render(**values)


def render(template: str, out: Path, **values: object) -> Path:
    """Write the text of a template to a file, and return the file."""
    out.write_text(rendered(template, **values), encoding="utf-8", newline="\n")
    return out


def template_sources() -> tuple[bytes, ...]:
    """Return the bytes of all templates, in the order of their names; they are part of the cache key of nets."""
    return tuple(path.read_bytes() for path in sorted((data_folder("templates") / "sumo").glob("*.j2")))


def number(value: float, digits: int = 3) -> str:
    """Return a number as text, rounded (to the millimetre), without trailing zeros and without a sign on zero."""
    text = f"{value:.{digits}f}"
    if "." in text:
        text = text.rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def polyline(points: Iterable[tuple[float, float]]) -> str:
    """Return points in SUMO's format of a shape: `x,y x,y`."""
    return " ".join(f"{number(x)},{number(y)}" for x, y in points)


@cache
def environment(folder: str, *, xml: bool = True) -> Environment:
    """Return the templates of a folder in `templates/`, for XML or text, with the filters `number` and `polyline`."""
    jinja = templates(folder, markup=xml)
    jinja.filters |= {"number": number, "polyline": polyline}
    return jinja
