"""The parts of OpenSCENARIO that an import cannot take over: errors, and counted parts with a comment at their
place.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from enum import StrEnum

from foresee_dsl.exchange.outcome import ExchangeError
from foresee_exchange.naming import sentence


class SourceError(ExchangeError):
    """Raised if the foreign file itself is incomplete, contradictory, or of another kind."""


class NotExpressed(Exception):  # noqa: N818 - not an error: it is counted and reported
    """Raised for a part of the source that has no counterpart in the other format; its text describes the part for the
    report.
    """


class Coordinates(StrEnum):
    """Handedness of world positions."""

    auto = "auto"
    right = "right-handed"
    left = "left-handed"


@dataclass
class Losses:
    """Counts of the parts that are not taken over, by description.

    Attributes:
        left_out: parts that do not change what the driver meets, or that the driver decides.
        lost: actions, triggers and participants whose absence changes the scenario.
        notes: additions and guesses of the import, one sentence each.
    """

    left_out: Counter[str] = field(default_factory=Counter)
    lost: Counter[str] = field(default_factory=Counter)
    notes: dict[str, None] = field(default_factory=dict)
    _pending: list[str] = field(default_factory=list)

    def lose(self, what: str, of: str = "") -> None:
        """Count a lost part and comment on it before the next statement. `of`: the event or entity that it belongs
        to."""
        self.lost[what] += 1
        self._pending.append(sentence(f"Lost: {what}{f', {of}' if of else ''}."))

    def leave(self, what: str, of: str = "") -> None:
        """Count a part that is left out on purpose, also with a comment."""
        self.left_out[what] += 1
        self._pending.append(sentence(f"Left out: {what}{f', {of}' if of else ''}."))

    def note(self, what: str) -> None:
        """Record an addition or guess of the import."""
        self.notes[what] = None

    def remarks(self) -> list[str]:
        """Return the comments since the last call."""
        pending, self._pending = self._pending, []
        return list(dict.fromkeys(pending))
