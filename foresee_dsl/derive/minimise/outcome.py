"""What minimising gives, as immutable records: what was left out, and where a number begins to fail."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Dropped:
    """What is left out: how many of each. `seconds`: by how much the clip is shorter."""

    changes: int = 0
    actors: int = 0
    signals: int = 0
    triggers: int = 0
    seconds: float = 0.0

    @property
    def text(self) -> str:
        """Return it in words: `1 change, 11 actors, 4.20 s`; "" where nothing is left out."""
        counts = ((getattr(self, f"{word}s"), word) for word in ("change", "actor", "signal", "trigger"))
        parts = [f"{count} {word}{'' if count == 1 else 's'}" for count, word in counts if count]
        return ", ".join((*parts, *((f"{self.seconds:.2f} s",) if self.seconds else ())))


Ended = Literal["fails", "passes", "otherwise"]


@dataclass(frozen=True)
class Tried:
    """One value that was run. `ended`: with the same failure, with none, or with another one. `reason`: how."""

    value: float
    ended: Ended
    reason: str


@dataclass(frozen=True)
class Boundary:
    """Where one change begins to fail, the other changes staying as they are.

    Attributes:
        change: what is changed, `runner.timing`. unit: of the values, "" for a ratio. step: between two values.
        was: unmutated. first: as it was mutated. fails: the value nearest to `was` that was found to fail.
        also_fails: the value nearest to `was` that fails in whatever way, where that is nearer; else `fails`.
        passes: the value nearest to that which passes; `was` where none was found.
        tried: the values that were run, from `was` outwards.
    """

    change: str
    unit: str
    step: float
    was: float
    first: float
    fails: float
    also_fails: float
    passes: float
    tried: tuple[Tried, ...]

    shown = "* sharp sentence"

    @property
    def sharp(self) -> bool:
        """Whether the two values are one step apart."""
        return abs(self.also_fails - self.passes) < 1.5 * self.step

    @property
    def sentence(self) -> str:
        """Return it in words: `runner.timing fails at 1.12, passes at 1.11`."""
        other = f" (in another way from {self.text(self.also_fails)} on)" if self.also_fails != self.fails else ""
        return f"{self.change} fails at {self.text(self.fails)}{other}, passes at {self.text(self.passes)}"

    def text(self, value: float) -> str:
        """Return a value as files write it."""
        return f"{value:.2f}{f' {self.unit}' if self.unit else ''}"
