"""What the anticipating driver's assessment answers."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar, Literal, Self

from foresee_dsl.avoidance.judge import ANTICIPATING

ShortAnswer = Literal["braking", "evading", "ahead", "no", "undecided"]


class Answer(StrEnum):
    """Would a driver who anticipates have prevented it, and by what?"""

    origin: ShortAnswer
    """How a mutant's `origin` says it."""

    def __new__(cls, value: str, origin: ShortAnswer) -> Self:
        """Make a member."""
        made = str.__new__(cls, value)
        made._value_, made.origin = value, origin
        return made

    BRAKING = "preventable by braking", "braking"
    EVADING = "preventable by evading", "evading"
    AHEAD = "preventable by driving ahead of time", "ahead"
    NO = "not preventable", "no"
    UNDECIDED = "undecided", "undecided"

    @property
    def preventable(self) -> bool:
        """Whether the driver would have prevented it in one way or another."""
        return self in (Answer.BRAKING, Answer.EVADING, Answer.AHEAD)


@dataclass(frozen=True)
class Anticipation:
    """What was found.

    Attributes:
        answer: by what it was preventable. why: a sentence for people, with figures.
        seen_s: from when on the driver could tell. begins_s: when what prevents it begins.
        braking_mps2: how hard it brakes. sideways_m: how far it evades, left positive.
        slower_mps: how much slower it drives when the other becomes a risk, of driving ahead of time.
        spare_s: how much later braking as hard as R157 allows could have begun, by the recorded motion of the others.
        least_m: least distance to anybody in the run that confirms it; None without such a run.
        runs: how many runs it took.
    """

    answer: Answer
    why: str
    seen_s: float | None = None
    begins_s: float | None = None
    braking_mps2: float | None = None
    sideways_m: float | None = None
    slower_mps: float | None = None
    spare_s: float | None = None
    least_m: float | None = None
    runs: int = 0

    name: ClassVar[str] = ANTICIPATING
    answers: ClassVar[tuple[str, ...]] = tuple(answer.value for answer in Answer)

    shown = "answer why seen_s?:2 begins_s?:2 braking_mps2?:1 sideways_m?:1 slower_mps?:1 spare_s?:2 least_m?:2 runs"

    @property
    def avoids(self) -> bool:
        """As of a `Judgement`, like all that follow."""
        return self.answer.preventable

    @property
    def settles(self) -> bool:
        """Whether it is decided."""
        return self.answer is not Answer.UNDECIDED

    @property
    def origin(self) -> tuple[str, str]:
        """The line of a mutant's origin."""
        return "anticipating", self.answer.origin
