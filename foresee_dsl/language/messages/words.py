"""Words that several messages share: the name of each dimension and an example value of it."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from foresee_dsl.language.units import Dimension

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

ACTION_USAGE = "runner meets ego at j4 after 1.5 s"
"""An example of an action, for messages."""
