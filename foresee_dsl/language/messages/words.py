"""Words that messages share: what each dimension is called, and a value of each."""

from __future__ import annotations

from types import MappingProxyType

from foresee_dsl.language.units import Dimension

EXAMPLES: MappingProxyType[Dimension, str] = MappingProxyType(
    {
        "time": "2.5 s",
        "length": "12 m",
        "speed": "50 km/h",
        "acceleration": "3 m/s^2",
        "angle": "15 deg",
        "angular_rate": "300 deg/s",
        "mass": "1200 kg",
        "ratio": "0.3",
        "count": "2",
    }
)
"""A value of each dimension, for messages."""

NOUNS: MappingProxyType[Dimension, str] = MappingProxyType(
    {
        "time": "a time",
        "length": "a length",
        "speed": "a speed",
        "acceleration": "an acceleration",
        "angle": "an angle",
        "angular_rate": "a turning rate",
        "mass": "a mass",
        "ratio": "a plain number",
        "count": "a whole number",
    }
)
"""What each dimension is called in messages."""

ACTION_USAGE = "runner meets ego at j4 after 1.5 s"
"""How an action of a trigger is written."""
