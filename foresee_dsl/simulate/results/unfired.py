"""What is said of a trigger that never fired in a run: how near it came."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Nearest:
    """How near a part of a condition came to holding.

    Attributes:
        text: the part, as written. time_s: when it was nearest; None where it could never be said.
        value: what was measured then, in `unit`; None for a fact without a number.
        short: by how much it was missed, in `unit`; None where there is no number.
        held_s: of a `for`, the longest time for which what it is about held; None for others, and where it never did.
        held: it held at some time, but not together with the others.
        note: of a fact that a distance tells of, why it did not hold, in a few words.
    """

    text: str
    time_s: float | None = None
    value: float | None = None
    short: float | None = None
    unit: str = ""
    held_s: float | None = None
    held: bool = False
    note: str = ""

    shown = "* words"

    @property
    def words(self) -> str:
        """How near it came, in words: `nearest 7.3 s at 12.4 s`."""
        if self.time_s is None:
            return "it could not be said at any time"
        at = f" at {self.time_s:.2f} s"
        if self.held_s is not None:
            return f"held for {self.held_s:.2f} s{at}"
        if self.value is not None:
            return f"nearest {self.value:.4g} {self.unit}".rstrip() + at + (f", {self.note}" if self.note else "")
        if self.short is not None:
            return f"{self.short:.4g} {self.unit} short{at}"
        return "it never held"


@dataclass(frozen=True)
class Unfired:
    """A trigger, or a step of one, that never came.

    Attributes:
        text: its condition, as written. name: of the trigger, its label or "".
        index: the trigger's number in the file. where: of a step, its place in the trigger; () for the trigger itself.
        since_s: from when on it waited.
        nearest: of each part that never held how near it came; where all did at some time, of those that did not hold
            at the moment at which most did.
        together: every part held at some time, but never all together.
    """

    text: str
    name: str
    index: int
    where: tuple[int, ...]
    since_s: float
    nearest: tuple[Nearest, ...]
    together: bool = False
