"""Dimensions and units of measurement: every quantity in a file has a unit, and inside the tool every value is in SI
units."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal, get_args

Dimension = Literal["time", "length", "speed", "acceleration", "angle", "angular_rate", "mass", "ratio", "count"]

_WORDS: Mapping[Dimension, tuple[str, str]] = {
    "time": ("a time", "2.5 s"),
    "length": ("a length", "12 m"),
    "speed": ("a speed", "50 km/h"),
    "acceleration": ("an acceleration", "3 m/s^2"),
    "angle": ("an angle", "15 deg"),
    "angular_rate": ("a turning rate", "300 deg/s"),
    "mass": ("a mass", "1200 kg"),
    "ratio": ("a plain number", "0.3"),
    "count": ("a whole number", "2"),
}
NOUNS: Mapping[Dimension, str] = MappingProxyType({dimension: noun for dimension, (noun, _) in _WORDS.items()})
"""The name of each dimension in messages, with its article."""
EXAMPLES: Mapping[Dimension, str] = MappingProxyType({dimension: value for dimension, (_, value) in _WORDS.items()})
"""An example value of each dimension, for messages."""


def dimension_of(word: object) -> Dimension | None:
    """Return the dimension that a word names, such as the type of a parameter; None for any other word."""
    return next((dimension for dimension in NOUNS if dimension == word), None)


ROUNDING_S = 1e-6
"""Tolerance when two times are compared, s: clips round times, and sums of times have rounding errors."""


@dataclass(frozen=True, slots=True)
class Unit:
    """A word for a unit: its dimension, and the factor that converts a number in it to SI."""

    word: str
    dimension: Dimension
    to_si: float


_ALL = (  # for each dimension, the unit of generated files first
    Unit("s", "time", 1.0),
    Unit("ms", "time", 1e-3),
    Unit("min", "time", 60.0),
    Unit("m", "length", 1.0),
    Unit("cm", "length", 1e-2),
    Unit("km", "length", 1e3),
    Unit("m/s", "speed", 1.0),
    Unit("km/h", "speed", 1 / 3.6),
    Unit("mph", "speed", 0.44704),  # international mile per hour, exact
    Unit("m/s^2", "acceleration", 1.0),
    Unit("deg", "angle", math.pi / 180),
    Unit("rad", "angle", 1.0),
    Unit("deg/s", "angular_rate", math.pi / 180),
    Unit("kg", "mass", 1.0),
    Unit("t", "mass", 1e3),
)

UNITS = MappingProxyType({unit.word: unit for unit in _ALL})
"""Every unit of the language. A number without a unit has the dimension `ratio` or `count`, whichever its place
needs."""

_ALSO_WRITTEN = {
    "s": "sec secs second seconds",
    "min": "minute minutes",
    "m": "metre metres meter meters",
    "km/h": "kph kmph",
    "m/s": "mps",
    "m/s^2": "ms-2",
    "deg": "degree degrees °",
}
OTHER_WORDS = MappingProxyType({other: unit for unit, others in _ALSO_WRITTEN.items() for other in others.split()})
"""Other common spellings of units, each with the right one for messages."""

SI_WORD: MappingProxyType[Dimension, str] = MappingProxyType(
    {kind: next((unit.word for unit in _ALL if unit.dimension == kind), "") for kind in get_args(Dimension)}
)
"""The unit in which generated files write each dimension: SI, but degrees for angles, which people read more easily."""
