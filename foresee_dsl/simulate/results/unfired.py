"""Describes a trigger that never fired in a run: how near it came to firing."""

from __future__ import annotations

from dataclasses import dataclass

from foresee_dsl.documents import every_field


@dataclass(frozen=True)
class Nearest:
    """How near one part of a condition came to holding in a run in which the whole condition never held.

    Attributes:
        text: the part, as written. time_s: the time when it was nearest; None if it could never be evaluated.
        value: the value measured then, in `unit`; None for a fact without a number.
        short: the difference to the bound, in `unit`; None for a fact without a number.
        held_s: for a `for`, the longest time for which its condition held, s; None for other parts, or if the condition
            never held.
        held: whether the part held at some time, but not together with the other parts.
        note: for a fact with a distance, the reason why it did not hold, in a few words.
    """

    text: str
    time_s: float | None = None
    value: float | None = None
    short: float | None = None
    unit: str = ""
    held_s: float | None = None
    held: bool = False
    note: str = ""

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {**every_field(self), "words": self.words}

    @property
    def words(self) -> str:
        """The nearest approach in words, such as `nearest 7.3 s at 12.4 s`."""
        if self.time_s is None:
            return "it could not be evaluated at any time"
        at = f" at {self.time_s:.2f} s"
        if self.held_s is not None:
            return f"held for {self.held_s:.2f} s{at}"
        if self.value is not None:
            return f"nearest {self.value:.4g} {self.unit}".rstrip() + at + (f", {self.note}" if self.note else "")
        if self.short is not None:
            return f"{self.short:.4g} {self.unit} short{at}"
        return "it never held"


@dataclass(frozen=True)
class UnfiredTrigger:
    """A trigger, or a step of one, that never began in a run, although it waited for its condition.

    Attributes:
        text: its condition, as written.
        name: label of the trigger, or "".
        index: the trigger's number in the file.
        where: place of a step in the trigger; () for the trigger itself.
        since_s: time from which it waited, s.
        nearest: the nearest approach of each part that never held; if every part held at some time, that of each part
            that did not hold at the moment at which most parts held.
        together: whether every part held at some time, but never all at once.
    """

    text: str
    name: str
    index: int
    where: tuple[int, ...]
    since_s: float
    nearest: tuple[Nearest, ...]
    together: bool = False
