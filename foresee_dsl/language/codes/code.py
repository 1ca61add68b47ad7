"""What a code is, and the words that messages share. The codes themselves are in `language.registry`."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

from foresee_dsl.language.keywords import USAGE
from foresee_dsl.language.units import Dimension

__all__ = ["ACTION_USAGE", "EXAMPLES", "NOUNS", "USAGE", "Code"]


@dataclass(frozen=True, slots=True)
class Code:
    """What a code means.

    Attributes:
        code: its name, such as `FS012`.
        title: a few words, lower-case start, no full stop.
        explanation: one or two sentences: why it is wrong, what to do.
        wrong, right: an example that earns the code, and the same put right; `language.examples` says in what form.
            Empty only where no file of a user can earn it.
        frame: what stands around the examples, a name of `examples.FRAMES`.
        severity: `error` or `warning`.
    """

    code: str
    title: str
    explanation: str
    wrong: str
    right: str
    frame: str = "scenario"
    severity: str = "error"


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
