"""Classes and sizes of recorded actors: words of the formats to our kinds, and usual sizes where a file has none."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

USUAL_SIZES_M: Mapping[str, tuple[float, float]] = {
    "car": (4.75, 1.84), "van": (5.95, 2.05), "truck": (8.20, 2.50), "bus": (12.00, 2.55), "motorcycle": (2.15, 0.80),
    "bicycle": (1.85, 0.65), "pedestrian": (0.40, 0.55), "obstacle": (1.00, 1.20),
}  # fmt: skip
"""Length and width of each kind, m: those of the bundled models `car.sedan`, `van.delivery`, `truck.rigid`, `bus.city`,
`motorcycle.street`, `bicycle.city`, `pedestrian.adult` and `obstacle.crate`."""
_LONGEST_M = 60.0
"""Longest footprint, m. Ours: more than the longest road trains of the world (53.5 m, Australia)."""
_WORDS: Mapping[str, str] = {
    word: kind
    for kind, words in {
        "car": "car passenger taxi vehicle auto suv pickup evehicle private emergency authority army vip hov custom "
        "sedan hatchback limousine ego vehtype av",
        "van": "van delivery minibus minivan shuttle",
        "truck": "truck lorry trailer semitrailer hgv",
        "bus": "bus coach tram",
        "motorcycle": "motorcycle motorbike motorcyclist moped scooter",
        "bicycle": "bicycle bike cyclist biketype",
        "pedestrian": "pedestrian person ped pedtype walker adult child wheelchair",
        "obstacle": "obstacle static object construction barrier",
    }.items()
    for word in words.split()
}
"""Kinds by the words with which SUMO's classes (`vClass`), data sets and users name them."""


@dataclass(frozen=True)
class Shape:
    """The class and footprint of an actor: one of `KINDS`, m, and whether the file has the size."""

    kind: str
    length_m: float
    width_m: float
    sized: bool = True


def kind_of(word: str) -> str | None:
    """Return the kind that a word of a file means, such as `truck` for `truck_bus`; None if it is not known.

    A word of several parts (`veh_passenger`, `heavyTruck`) has the kind of the first part that is known.
    """
    parts = _parts(word)
    return next((_WORDS[part] for part in ("".join(parts), *parts) if part in _WORDS), None)


def _parts(word: str) -> list[str]:
    """Return the words in a name, in lower case: `heavyTruck2` has `heavy` and `truck`."""
    spaced = "".join(f" {c}" if c.isupper() and word[k - 1 : k].islower() else c for k, c in enumerate(word))
    return "".join(c.lower() if c.isalpha() else " " for c in spaced).split()


def usual_shape(kind: str) -> Shape:
    """Return the usual footprint of a kind; `sized` is False."""
    length_m, width_m = USUAL_SIZES_M[kind]
    return Shape(kind, length_m, width_m, sized=False)


def shape_of(kind: str, length_m: float, width_m: float) -> Shape:
    """Return a footprint, or the usual one of its kind if the size is not a possible one (0, negative, not a number,
    longer than any vehicle)."""
    if math.isfinite(length_m + width_m) and 0 < length_m <= _LONGEST_M and 0 < width_m <= _LONGEST_M:
        return Shape(kind, length_m, width_m)
    return usual_shape(kind)


def have(count: int, noun: str = "actor") -> str:
    """Return the beginning of a note: `1 actor has`, `3 actors have`."""
    return f"1 {noun} has" if count == 1 else f"{count} {noun}s have"


def kind_by_size(length_m: float, width_m: float) -> str:
    """Return the likely kind of an actor of unknown class from its size, m (limits between the usual sizes)."""
    limits = ((1.3, 1.3, "pedestrian"), (2.6, 1.2, "bicycle"), (5.4, 3.0, "car"), (7.0, 3.0, "van"))
    return next((kind for most_m, wide_m, kind in limits if length_m <= most_m and width_m <= wide_m), "truck")
