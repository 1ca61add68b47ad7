"""What mining returns: situations in a recording, with their actors, times and measures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from foresee_dsl.documents import rounded

UNITS = {"_m": "m", "_s": "s", "_mps": "m/s", "_mps2": "m/s^2", "_deg": "deg"}
"""Units of measures by the end of their names."""


@dataclass(frozen=True)
class Occurrence:
    """Where something happens: numbers of actors and frames in a `Traffic`.

    Attributes:
        ego, others: numbers of the actors. first, last: the frames during which it happens. moment: its decisive frame.
        measures: values by name; the name ends with the unit (`UNITS`).
        words: the sentence about it, with `{ego}`, `{0}`, `{1}` for the actors; empty: that of the search.
    """

    ego: int
    others: tuple[int, ...]
    first: int
    last: int
    moment: int
    measures: Mapping[str, float] = field(default_factory=dict)
    words: str = ""


@dataclass(frozen=True)
class Situation:
    """Something that was searched for, in a recording.

    Attributes:
        name: the named situation, or `find` for a condition.
        ego, others: ids of the actors. kinds: their classes, in the same order.
        begins_s, ends_s: the recording's times between which it happens. moment_s: its decisive moment.
        measures: values by name; the name ends with the unit.
        sentence: what happens, for people.
    """

    name: str
    ego: str
    others: tuple[str, ...]
    kinds: tuple[str, ...]
    begins_s: float
    ends_s: float
    moment_s: float
    measures: Mapping[str, float]
    sentence: str

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "name": self.name,
            "ego": self.ego,
            "others": self.others,
            "kinds": self.kinds,
            "begins_s": rounded(self.begins_s, 2),
            "ends_s": rounded(self.ends_s, 2),
            "moment_s": rounded(self.moment_s, 2),
            "measures": rounded(self.measures, 3),
            "sentence": self.sentence,
        }


def measure_text(name: str, value: float) -> str:
    """Return a measure as text: `ttc 1.20 s`."""
    for end, unit in sorted(UNITS.items(), key=lambda item: -len(item[0])):
        if name.endswith(end):
            return f"{name.removesuffix(end).replace('_', ' ')} {value:.2f} {unit}"
    return f"{name.replace('_', ' ')} {value:.2f}"
