"""The palette of all pictures: the colours of each kind of thing, in light and dark surroundings and in terminals."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import NamedTuple


class Paint(NamedTuple):
    """Colours of one kind of thing.

    Attributes:
        fill, line: colours in light surroundings, "" for none. dark_fill, dark_line: colours in dark surroundings.
        opacity: from 0 to 1. terminal: style in a terminal.
    """

    fill: str
    line: str
    dark_fill: str
    dark_line: str
    opacity: float = 1.0
    terminal: str = ""


def _tone(colour: str, dark: str, terminal: str) -> dict[str, Paint]:
    return {
        "": Paint(colour, "#ffffff", dark, "#11161c", terminal=terminal),
        "-way": Paint("", colour, "", dark, 0.85),
        "-arrow": Paint(colour, "", dark, "", 0.95),
        "-halo": Paint(colour, "", dark, "", 0.22),
        "-name": Paint(colour, "", dark, ""),
    }


# The tones of actors are those of Okabe and Ito, Color Universal Design (2008), darkened where white would not stand
# out from them; the dark ones are ours. A picture of a scene's start gives each actor a tone of its own (a0 to a5); a
# picture of a moment has one tone for the opponent and one for all others.
_TONES = {
    "ego": ("#1459b8", "#6fb1ff", "bold blue"),
    "opponent": ("#c2410c", "#ff9d5c", "bold red"),
    "other": ("#7a5a00", "#e8c547", "yellow"),
    "parked": ("#5f646b", "#a9b0ba", ""),
    "a0": ("#c2410c", "#ff9d5c", ""),
    "a1": ("#047857", "#3fd6a4", ""),
    "a2": ("#a21a6b", "#f18bc6", ""),
    "a3": ("#7a5a00", "#e8c547", ""),
    "a4": ("#5b3cc4", "#b5a2ff", ""),
    "a5": ("#0f6f86", "#5fd4ec", ""),
    "thing": ("#5f646b", "#a9b0ba", ""),
    "traffic": ("#8b8f96", "#747b86", ""),
}
PAINTS: Mapping[str, Paint] = MappingProxyType(
    {
        "paper": Paint("#ffffff", "", "#14181d", ""),
        "grass": Paint("#e9eee2", "", "#1b211c", ""),
        "footway": Paint("#d9d6ce", "", "#34383d", ""),
        "road": Paint("#b9bec5", "#8b9199", "#3b4149", "#59616b", terminal="dim"),
        "cycleway": Paint("#cdb3ac", "", "#5a3f3a", ""),
        "parking": Paint("#c9c8bd", "", "#454a44", ""),
        "bus_stop": Paint("#f2cf3b", "#8a6d00", "#8f7a1e", "#e8c547", 0.75),
        "edge_line": Paint("", "#ffffff", "", "#aab2bc"),
        "marking": Paint("", "#ffffff", "", "#8d95a0", terminal="dim"),
        "crossing": Paint("#ffffff", "", "#aab2bc", ""),
        "stop_line": Paint("", "#ffffff", "", "#aab2bc", terminal="dim"),
        "building": Paint("#cbb59c", "#a08a70", "#4d4338", "#6b5d4d", terminal="yellow dim"),
        "slippery": Paint("#58b4e0", "#2d86b5", "#3d8fb8", "#8fd3f5", 0.6, terminal="cyan"),
        "zone": Paint("#8a2be2", "#8a2be2", "#c79bff", "#c79bff", 0.13),
        "zone-line": Paint("", "#7a1fd1", "", "#c79bff", 0.9),
        "zone-name": Paint("#6a17b8", "", "#d3b1ff", ""),
        "green": Paint("", "#149447", "", "#2bd673", terminal="green"),
        "amber": Paint("", "#e69f00", "", "#ffc53d", terminal="yellow"),
        "red": Paint("", "#d92d20", "", "#ff6259", terminal="red"),
        "off": Paint("", "#8a8f98", "", "#8a8f98", terminal="dim"),
        "ghost": Paint("", "#3d4148", "", "#c3c9d2", terminal="magenta"),
        "mistake": Paint("", "#d92d20", "", "#ff6259"),
        "mistake-name": Paint("#b42318", "", "#ff8a80", ""),
        "forecast": Paint("", "#7c3aed", "", "#c4a1ff"),
        "contact": Paint("#d11a2a", "#d11a2a", "#ff6b6b", "#ff6b6b"),
        "fails": Paint("#c2410c", "", "#ff9d5c", ""),
        "passes": Paint("#dfe5ec", "", "#2f3843", ""),
        "shade": Paint("#263242", "", "#000000", "", 0.28),
        "leader": Paint("", "#5c636d", "", "#9aa3ae", 0.8),
        "junction-name": Paint("#2b3138", "", "#d5dbe3", ""),
        "road-name": Paint("#525a64", "", "#a9b2bd", ""),
        "ink": Paint("#1b1f24", "#1b1f24", "#e6eaf0", "#e6eaf0"),
        "scale": Paint("", "#1b1f24", "", "#e6eaf0"),
        "title": Paint("#1b1f24", "", "#e6eaf0", ""),
        "key-crossing": Paint("#ffffff", "#8b9199", "#aab2bc", "#59616b"),
        "quiet": Paint("#565d66", "", "#a3acb7", ""),
        "plate": Paint("#ffffff", "", "#14181d", "", 0.8),
        "frame": Paint("", "#b6bcc4", "", "#3a424c"),
        **{f"{tone}{end}": paint for tone, colours in _TONES.items() for end, paint in _tone(*colours).items()},
    }
)
"""The paint of each kind of shape or text, by the name of the kind."""


class TextColour(NamedTuple):
    """Colours of a word in light and in dark surroundings."""

    light: str
    dark: str


GOOD, BAD = TextColour("#17693a", "#7bd49b"), TextColour("#b3261e", "#ff9a91")
"""Colours of the verdict of a run that passed, and of any other. Ours: readable on the pages' backgrounds."""


def custom_properties(names: Iterable[str], *, dark: bool = False) -> str:
    """Return paints as CSS custom properties with their opacity: `--p-NAME` is the fill, `--p-NAME-line` the line."""
    properties = []
    for name in names:
        paint = PAINTS[name]
        alpha = f"{round(paint.opacity * 255):02x}" if paint.opacity < 1 else ""
        fill, line = (paint.dark_fill, paint.dark_line) if dark else (paint.fill, paint.line)
        properties += [f"--p-{name}: {fill}{alpha};"] if fill else []
        properties += [f"--p-{name}-line: {line}{alpha};"] if line else []
    return " ".join(properties)
