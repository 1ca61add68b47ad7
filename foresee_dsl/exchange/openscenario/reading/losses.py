"""What an import cannot take over: counted for the report, and said in a comment where it would have stood."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from foresee_dsl.exchange.naming import sentence


@dataclass
class Losses:
    """Counts of what is not taken over, in words.

    Attributes:
        left_out: what makes no difference to what happens to the driver, or is its own to decide.
        lost: actions, triggers and participants without which something else happens.
        notes: what was added or guessed, one sentence each.
    """

    left_out: Counter[str] = field(default_factory=Counter)
    lost: Counter[str] = field(default_factory=Counter)
    notes: dict[str, None] = field(default_factory=dict)
    _pending: list[str] = field(default_factory=list)

    def lose(self, what: str, of: str = "") -> None:
        """Count something that is lost; the next statement gets a comment on it. `of`: whose it is, in words."""
        self.lost[what] += 1
        self._pending.append(sentence(f"Lost: {what}{f', {of}' if of else ''}."))

    def leave(self, what: str, of: str = "") -> None:
        """Count something that is left out on purpose, with a comment as well."""
        self.left_out[what] += 1
        self._pending.append(sentence(f"Left out: {what}{f', {of}' if of else ''}."))

    def note(self, what: str) -> None:
        """Remember what was added or guessed."""
        self.notes[what] = None

    def remarks(self) -> list[str]:
        """Return the comments since this was asked last."""
        found, self._pending = self._pending, []
        return list(dict.fromkeys(found))
