"""Words of stories: how names, sides, distances and speeds are written in their sentences."""

from __future__ import annotations

from foresee_dsl.simulate.trace import ActorInfo

LONGEST_NAME = 40
"""Maximum length of a name in a sentence, characters; longer names are cut. Ours: four times the longest of the bundled
scenarios."""
_SAYS_ITSELF = {"walker": "pedestrian", "pedestrian": "pedestrian", "cyclist": "bicycle", "bicycle": "bicycle"}
"""Names that state the class of their actor."""


def name_of(actor: ActorInfo) -> str:
    """Return an actor's name in quotes, or `the ego`."""
    return "the ego" if actor.id == "ego" else quoted(actor.id)


def quoted(name: str) -> str:
    """Return a name of the file in quotes, cut to `LONGEST_NAME` characters."""
    return f"'{short(name)}'"


def full_name(actor: ActorInfo) -> str:
    """Return an actor's name and, unless the name states it, its class: `'second' (van)`."""
    clear = _SAYS_ITSELF.get(actor.id) == actor.kind or actor.kind in actor.id or what_is(actor) in actor.id
    return name_of(actor) if clear else f"{name_of(actor)} ({what_is(actor)})"


def what_is(actor: ActorInfo) -> str:
    """Return an actor's class; for an obstacle its model's name without the class (`parked van`)."""
    model = actor.model.partition(".")[2] if actor.kind == "obstacle" else ""
    return short(model.replace("_", " ")) if model else actor.kind


def short(text: str) -> str:
    """Return a text of at most `LONGEST_NAME` characters."""
    return text if len(text) <= LONGEST_NAME else f"{text[: LONGEST_NAME - 3]}..."


def kmh(speed_mps: float) -> str:
    """Return a speed in words: `38 km/h`."""
    return f"{max(speed_mps, 0.0) * 3.6:.0f} km/h"


def metres(distance_m: float) -> str:
    """Return a distance in words: `14 m`, `2.4 m`, `0.71 m`."""
    return f"{distance_m:.{0 if distance_m >= 9.5 else 1 if distance_m >= 0.995 else 2}f} m"


def with_side(side: str) -> str:
    """Return a side of a vehicle in words: `front`, `right side`, `rear`."""
    return f"{side} side" if side in ("left", "right") else side
