"""Renders a report as one HTML file with its styles and its script; its security policy allows no other script."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from foresee_dsl.avoidance.responsibility import Whose
from foresee_dsl.files import data_folder, templates, write_whole
from foresee_dsl.report.drawing.ground import Layer
from foresee_dsl.report.drawing.palette import BAD, GOOD, custom_properties
from foresee_dsl.report.drawing.shapes import LIMITS
from foresee_dsl.report.page.contents import Contents, contents_of
from foresee_dsl.report.page.entries import options_of
from foresee_dsl.report.page.pictures import PAINTS as MAP_PAINTS
from foresee_dsl.report.page.pictures import heat_map_svg
from foresee_dsl.report.page.playback import MEASURES
from foresee_dsl.report.page.runs import Reader
from foresee_dsl.report.safe_text import safe
from foresee_dsl.report.show.panels import VIEW_S, Role
from foresee_dsl.report.terminal.raw_numbers import family_title
from foresee_dsl.simulate.sensing.settings import STANDARD

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup

LONGEST = 2000
"""Maximum length of a text on the page, characters. Ours: the reasons of drivers that raise are half as long."""
SCRIPTS = ("run.js", "scene.js", "curves.js", "player.js", "page.js")
"""The parts of the page's script, in the order in which they are joined."""
PAINTS = (
    *("grass", "plate", "ink", "shade", "forecast", "contact", "green", "amber", "red", "off"),
    *(layer.value for layer in Layer),
    *(role.value for role in Role),
    *(f"{role}-halo" for role in Role if role is not Role.GHOST),
)
"""The paints with which the page's canvas draws."""
_DRAWING = {
    "paints": PAINTS,
    "limits": LIMITS,
    "measures": MEASURES,
    "eye_m": STANDARD.eye_m,
    "view_s": VIEW_S,
}


def write_report(folders: Sequence[Path], file: Path, *, reasons: bool = False) -> Contents:
    """Write the page of finished campaigns, and return its contents.

    `reasons`: whether to drive the failing runs again, for the driver's own reasons at each moment.

    Raises:
        ForeseeError: a folder does not hold a campaign.
        OSError: the file cannot be written.
    """
    reader = Reader(reasons=reasons)
    contents = contents_of(folders, reader)
    write_whole(file, rendered(contents, reader))
    return contents


def rendered(contents: Contents, reader: Reader) -> str:
    """Return the page as HTML; names and reasons are escaped, so that they are shown as text."""
    from markupsafe import Markup

    style = page_style()
    script = "\n".join(map(_source, SCRIPTS))
    script = f"(() => {{\n'use strict';\n{script}\n}})();\n"
    findings = contents.findings
    judges = tuple(dict.fromkeys(opinion.name for finding in findings for opinion in finding.record.opinions))
    filters = {
        "judgement": [(j.value, j.text) for j in Whose if any(f.judgement_word == j.value for f in findings)],
        "family": [(f, family_title(f)) for f in options_of(findings, lambda finding: finding.record.family)],
        "class": [(c, c) for c in options_of(findings, lambda finding: finding.record.class_)],
        "verdict": [(v, v) for v in options_of(findings, lambda finding: finding.verdict)],
        "preventability": [(p, p) for p in options_of(findings, lambda finding: finding.preventability)],
        "anticipation": [(a, a) for a in options_of(findings, lambda finding: finding.anticipation)],
        "driver": [(d, d) for d in options_of(findings, lambda finding: finding.driver)],
    }
    for k, judge in enumerate(judges):
        filters[f"opinion{k}"] = [(a, a) for a in sorted({finding.opinion_of(judge) for finding in findings} - {""})]
    template = page_templates().get_template("page.html.j2")
    return template.render(
        contents=contents,
        filters={name: options for name, options in filters.items() if len(options) > 1},
        judges=judges,
        labels={f"opinion{k}": judge for k, judge in enumerate(judges)},
        style=style,
        script=script,
        style_hash=hash_of(style),
        script_hash=hash_of(script),
        family_title=family_title,
        heat_map_svg=lambda heat_map: Markup(heat_map_svg(heat_map)),  # noqa: S704 - the template of pictures escapes
        data={
            name: _data(value)
            for name, value in {"drawing": _DRAWING, **reader.roads.as_dict(), **reader.playbacks}.items()
        },
    )


@cache
def page_style() -> str:
    """Return the style of the page."""
    template = templates("report", markup=False).get_template("page.css.j2")
    paints = tuple(dict.fromkeys((*PAINTS, *MAP_PAINTS)))
    return template.render(
        light=custom_properties(paints),
        dark=custom_properties(paints, dark=True),
        map_paints=MAP_PAINTS,
        good=GOOD,
        bad=BAD,
    )


@cache
def page_templates() -> Environment:
    """Return the templates of reports.

    Control characters and hidden characters in every inserted text are made visible.
    """
    # Text that a template has marked as markup is inserted unchanged.
    return templates("report").overlay(finalize=lambda value: safe(value, LONGEST) if type(value) is str else value)


def _data(value: object) -> Markup:
    """Return JSON for a script element; texts in it cannot end the element."""
    from jinja2.utils import htmlsafe_json_dumps

    return htmlsafe_json_dumps(_safe_strings(value), separators=(",", ":"), allow_nan=False)


def _safe_strings(value: Any) -> Any:  # noqa: ANN401 - as above
    if isinstance(value, str):
        return safe(value, LONGEST)
    if isinstance(value, dict):
        return {safe(key, LONGEST): _safe_strings(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        # A list this long contains only numbers, so its items need not be searched for texts.
        return value if len(value) > 50 and isinstance(value[0], int) else [_safe_strings(item) for item in value]
    return value


@cache
def _source(name: str) -> str:
    return (data_folder("templates") / "report" / name).read_text(encoding="utf-8")


def hash_of(text: str) -> str:
    """Return the hash by which a content security policy allows an inline style or script."""
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
