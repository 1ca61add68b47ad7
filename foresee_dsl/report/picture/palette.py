"""The colours of a picture for light and dark surroundings, by the kind of thing."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple


class Paint(NamedTuple):
    """Colours of one kind of thing: fill and line in light surroundings ("" for none), then in dark ones; opacity."""

    fill: str
    line: str
    dark_fill: str
    dark_line: str
    opacity: float = 1.0


def _tone(colour: str, dark: str) -> dict[str, Paint]:
    return {
        "": Paint(colour, "#ffffff", dark, "#11161c"),
        "-way": Paint("", colour, "", dark, 0.85),
        "-arrow": Paint(colour, "", dark, "", 0.95),
        "-halo": Paint(colour, "", dark, "", 0.22),
        "-name": Paint(colour, "", dark, ""),
    }


# The six tones of actors: Okabe and Ito, Color Universal Design (2008), darkened where white would not stand out from
# them; the ego's blue and the ground are those of the strip (`report.show.drawing`), the dark ones ours.
_TONES = {
    "ego": ("#1459b8", "#6fb1ff"),
    "a0": ("#c2410c", "#ff9d5c"),
    "a1": ("#047857", "#3fd6a4"),
    "a2": ("#a21a6b", "#f18bc6"),
    "a3": ("#7a5a00", "#e8c547"),
    "a4": ("#5b3cc4", "#b5a2ff"),
    "a5": ("#0f6f86", "#5fd4ec"),
    "thing": ("#5f646b", "#a9b0ba"),
    "traffic": ("#8b8f96", "#747b86"),
}
PAINTS: Mapping[str, Paint] = MappingProxyType(
    {
        "paper": Paint("#ffffff", "", "#14181d", ""),
        "grass": Paint("#e9eee2", "", "#1b211c", ""),
        "footway": Paint("#d9d6ce", "", "#34383d", ""),
        "road": Paint("#b9bec5", "#8b9199", "#3b4149", "#59616b"),
        "cycleway": Paint("#cdb3ac", "", "#5a3f3a", ""),
        "parking": Paint("#c9c8bd", "", "#454a44", ""),
        "bus_stop": Paint("#f2cf3b", "#8a6d00", "#8f7a1e", "#e8c547", 0.75),
        "edge_line": Paint("", "#ffffff", "", "#aab2bc"),
        "marking": Paint("", "#ffffff", "", "#8d95a0"),
        "crossing": Paint("#ffffff", "", "#aab2bc", ""),
        "stop_line": Paint("", "#ffffff", "", "#aab2bc"),
        "building": Paint("#cbb59c", "#a08a70", "#4d4338", "#6b5d4d"),
        "slippery": Paint("#58b4e0", "#2d86b5", "#3d8fb8", "#8fd3f5", 0.6),
        "zone": Paint("#8a2be2", "#8a2be2", "#c79bff", "#c79bff", 0.13),
        "zone-line": Paint("", "#7a1fd1", "", "#c79bff", 0.9),
        "zone-name": Paint("#6a17b8", "", "#d3b1ff", ""),
        "green": Paint("", "#149447", "", "#2bd673"),
        "amber": Paint("", "#e69f00", "", "#ffc53d"),
        "red": Paint("", "#d92d20", "", "#ff6259"),
        "off": Paint("", "#8a8f98", "", "#8a8f98"),
        "before": Paint("", "#3d4148", "", "#c3c9d2"),
        "mistake": Paint("", "#d92d20", "", "#ff6259"),
        "mistake-name": Paint("#b42318", "", "#ff8a80", ""),
        "leader": Paint("", "#5c636d", "", "#9aa3ae", 0.8),
        "junction-name": Paint("#2b3138", "", "#d5dbe3", ""),
        "road-name": Paint("#525a64", "", "#a9b2bd", ""),
        "ink": Paint("#1b1f24", "#1b1f24", "#e6eaf0", "#e6eaf0"),
        "title": Paint("#1b1f24", "", "#e6eaf0", ""),
        "key-crossing": Paint("#ffffff", "#8b9199", "#aab2bc", "#59616b"),
        "quiet": Paint("#565d66", "", "#a3acb7", ""),
        "plate": Paint("#ffffff", "", "#14181d", "", 0.8),
        "frame": Paint("", "#b6bcc4", "", "#3a424c"),
        **{f"{tone}{end}": paint for tone, pair in _TONES.items() for end, paint in _tone(*pair).items()},
    }
)
"""Paints by the class of the shape or text."""
