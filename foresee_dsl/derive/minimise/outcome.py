"""Results of minimising: what was left out, and from which value a number begins to fail."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from foresee_dsl.documents import every_field


@dataclass(frozen=True)
class DropCounts:
    """Numbers of the changes, actors, signals and triggers that were left out.

    `seconds`: by how much the clip was shortened.
    """

    changes: int = 0
    actors: int = 0
    signals: int = 0
    triggers: int = 0
    seconds: float = 0.0

    @property
    def text(self) -> str:
        """Return the counts in words, such as `1 change, 11 actors, 4.20 s`; "" if nothing was left out."""
        counts = ((getattr(self, f"{word}s"), word) for word in ("change", "actor", "signal", "trigger"))
        parts = [f"{count} {word}{'' if count == 1 else 's'}" for count, word in counts if count]
        return ", ".join((*parts, *((f"{self.seconds:.2f} s",) if self.seconds else ())))


Ended = Literal["fails", "passes", "otherwise"]


@dataclass(frozen=True)
class ValueTrial:
    """The run of one value.

    `ended`: whether it ended with the same failure, without a failure, or with another failure. `reason`: how it ended,
    in words.
    """

    value: float
    ended: Ended
    reason: str


@dataclass(frozen=True)
class Boundary:
    """The value from which one change fails, while the other changes stay as they are.

    Attributes:
        change: actor and property, such as `runner.timing`. unit: unit of the values, "" for a ratio.
        step: distance between two values.
        was: the unmutated value. first: the value of the unreduced mutant.
        fails: the value nearest to `was` that shows the same failure and is the edge of a stable region.
        also_fails: the value nearest to `was` that shows any failure.
        passes: the passing value nearest to `also_fails`; `was` if no run passed.
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
    tried: tuple[ValueTrial, ...]

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {**every_field(self), "sharp": self.sharp, "broken": self.broken, "sentence": self.sentence}

    @property
    def sharp(self) -> bool:
        """Return whether `also_fails` and `passes` are one step apart."""
        return abs(self.also_fails - self.passes) < 1.5 * self.step

    @property
    def sentence(self) -> str:
        """Return the boundary in words, such as `runner.timing fails at 1.12, passes at 1.11`."""
        other = ""
        if self.also_fails != self.fails:
            same = any(run.value == self.also_fails and run.ended == "fails" for run in self.tried)
            other = (
                f" (also at {self.text(self.also_fails)})"
                if same
                else (f" (in another way from {self.text(self.also_fails)} on)")
            )
        text = f"{self.change} fails at {self.text(self.fails)}{other}, passes at {self.text(self.passes)}"
        return f"{text}; the failing region has gaps: {self._pass_again}" if self.broken else text

    @property
    def broken(self) -> bool:
        """Return whether a value passes although a value nearer to `was` fails."""
        return bool(self._gaps)

    @property
    def _gaps(self) -> list[float]:
        nearest = min(abs(self.also_fails - self.was), abs(self.fails - self.was))
        return [run.value for run in self.tried if run.ended == "passes" and abs(run.value - self.was) > nearest]

    @property
    def _pass_again(self) -> str:
        """Return, in words, which larger changes pass again."""
        gaps = self._gaps
        if len(gaps) == 1:
            return f"{self.text(gaps[0])} passes again"
        low, high = sorted((gaps[0], gaps[-1]))
        if all(run.ended == "passes" for run in self.tried if low <= run.value <= high):
            return f"values from {self.text(gaps[0])} to {self.text(gaps[-1])} pass again"
        return f"{', '.join(map(self.text, gaps[:-1]))} and {self.text(gaps[-1])} pass again"

    def text(self, value: float) -> str:
        """Return a value as files write it, with its unit."""
        return f"{value:.2f}{f' {self.unit}' if self.unit else ''}"
