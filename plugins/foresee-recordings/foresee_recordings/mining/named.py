"""The named situations: conditions of the language, with the source of each threshold, and detectors."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from foresee_recordings.mining import detectors
from foresee_recordings.mining.query import Query
from foresee_recordings.mining.situation import Occurrence
from foresee_recordings.mining.traffic import Traffic
from foresee_recordings.recording import RecordingError

Detector = Callable[[Traffic, float], Iterator[Occurrence]]


@dataclass(frozen=True)
class Named:
    """A situation that can be searched for by its name.

    Attributes:
        what: one line for the list of situations.
        search: a condition, or a detector; a tuple: any of several.
        words: the sentence about a place where the condition holds, with `{ego}`, `{0}` and measures; detectors have
            their own.
    """

    what: str
    search: str | Detector | tuple[str | Detector, ...]
    words: str = ""

    @property
    def condition(self) -> str:
        """The condition to search for; empty if a detector searches."""
        return self.search if isinstance(self.search, str) else ""

    def occurrences(self, traffic: Traffic, within_m: float) -> Iterator[Occurrence]:
        """Yield where it happens."""
        searches = self.search if isinstance(self.search, tuple) else (self.search,)
        for search in searches:
            yield from (
                Query.of(search).occurrences(traffic, within_m)
                if isinstance(search, str)
                else search(traffic, within_m)
            )


SITUATIONS: Mapping[str, Named] = MappingProxyType(
    {
        "cut_in": Named("an actor comes from the side onto the ego's way, at most 2 s ahead of it", detectors.cut_ins),
        # Ours: harder than comfortable braking (2 to 3 m/s^2), long enough to be no error of tracking, and faster than
        # the last metres before a stop in a queue.
        "hard_braking": Named(
            "the ego brakes with more than 4 m/s^2",
            "ego.acceleration < -4 m/s^2 for 0.3 s and ego.speed > 3 m/s",
            "{ego} brakes with {braking_mps2:.1f} m/s^2",
        ),
        "unprotected_left": Named(
            "the ego turns left across the way of an oncoming vehicle, within 5 s of it", detectors.unprotected_lefts
        ),
        "crossing_pedestrian": Named(
            "a pedestrian crosses the ego's way, within 5 s of its passing", detectors.crossing_pedestrians
        ),
        # 1.5 s: Gettman et al., "Surrogate Safety Assessment Model and Validation" (FHWA-HRT-08-051, 2008), the default
        # for a conflict; not compared with its text. 0.2 s is ours: a single sample with a wrong heading does not
        # count. Boxes that overlap are left out: in recordings they are errors of sizes, and a real contact is found
        # before it happens.
        "low_ttc": Named(
            "two actors would touch within 1.5 s",
            "(ttc(ego, other) < 1.5 s and distance(ego, other) > 0 m) for 0.2 s and ego.speed > 1 m/s",
            "{ego} and {0} would touch within {ttc_s:.2f} s",
        ),
        "low_pet": Named("two actors pass a place within 1.5 s of each other, crossing", detectors.low_pets),
        # 0.9 s: the distance from which Germany fines drivers (BKatV, table 2 of the annex: less than half of half the
        # speedometer's value in metres); not compared with its text. The speed and the time are ours: without queues,
        # and no passing moment.
        "short_headway": Named(
            "the ego follows an actor with less than 0.9 s",
            "(headway(ego, other) < 0.9 s and distance(ego, other) > 0 m) for 2 s and ego.speed > 5 m/s "
            "and other ahead of ego and lateral(ego, other) <= 0 m and relative_speed(ego, other) < 5 m/s",
            "{ego} follows {0} with {headway_s:.2f} s",
        ),
        # Ours: two thirds of the bounds for a conflict.
        "near_miss": Named(
            "two actors would touch within 1 s, or pass a place within 1 s of each other",
            (
                "(ttc(ego, other) < 1 s and distance(ego, other) > 0 m) for 0.2 s and ego.speed > 1 m/s",
                detectors.nearly_touching,
            ),
            "{ego} and {0} would touch within {ttc_s:.2f} s",
        ),
    }
)
"""The named situations, in the order in which they are listed."""
DEFAULT = tuple(name for name in SITUATIONS if name != "near_miss")
"""Situations that are searched for if none is named; a near miss is a `low_ttc` or `low_pet` too."""


def situation_of(name: str) -> Named:
    """Return a named situation.

    Raises:
        RecordingError: there is none of this name; the message lists the names.
    """
    if name not in SITUATIONS:
        raise RecordingError(f"{name!r} is not a situation; there are {', '.join(SITUATIONS)}")
    return SITUATIONS[name]
