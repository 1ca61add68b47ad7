"""The answers of the anticipating driver's assessment."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar, Literal, Self

from foresee_dsl.avoidance.judge import ANTICIPATING
from foresee_dsl.documents import or_null, rounded

ShortAnswer = Literal["braking", "evading", "ahead", "no", "undecided"]


class Answer(StrEnum):
    """Whether an anticipating driver would have prevented the failure, and by which manoeuvre."""

    origin: ShortAnswer
    """The answer in a mutant's `origin`."""

    def __new__(cls, value: str, origin: ShortAnswer) -> Self:
        """Make a member."""
        member = str.__new__(cls, value)
        member._value_, member.origin = value, origin
        return member

    BRAKING = "preventable by braking", "braking"
    EVADING = "preventable by evading", "evading"
    AHEAD = "preventable by driving ahead of time", "ahead"
    NO = "not preventable", "no"
    UNDECIDED = "undecided", "undecided"

    @property
    def preventable(self) -> bool:
        """Whether the driver would have prevented the failure by any manoeuvre."""
        return self in (Answer.BRAKING, Answer.EVADING, Answer.AHEAD)


@dataclass(frozen=True)
class Anticipation:
    """The result of an assessment.

    Attributes:
        answer: whether the failure was preventable, and by which manoeuvre. why: a sentence for people, with figures.
        seen_s: time from which the driver could foresee the conflict. begins_s: time at which the manoeuvre begins.
        braking_mps2: hardest braking. sideways_m: how far it evades, left positive.
        slower_mps: how much slower the driver that drives ahead of time is when the conflict becomes foreseeable.
        spare_s: how much later R157's hardest braking could have begun if the others had moved as recorded.
        least_m: smallest distance to any actor in the run that confirms the answer; None without such a run.
        runs: number of simulation runs.
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

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "answer": self.answer,
            "why": self.why,
            "seen_s": rounded(or_null(self.seen_s), 2),
            "begins_s": rounded(or_null(self.begins_s), 2),
            "braking_mps2": rounded(or_null(self.braking_mps2), 1),
            "sideways_m": rounded(or_null(self.sideways_m), 1),
            "slower_mps": rounded(or_null(self.slower_mps), 1),
            "spare_s": rounded(or_null(self.spare_s), 2),
            "least_m": rounded(or_null(self.least_m), 2),
            "runs": self.runs,
        }

    @property
    def avoids(self) -> bool:
        """Return whether the driver avoids the failure; see `Judgement` for this property and the next ones."""
        return self.answer.preventable

    @property
    def settles(self) -> bool:
        """Whether the answer is decided."""
        return self.answer is not Answer.UNDECIDED

    @property
    def origin(self) -> tuple[str, str]:
        """The setting and value for a mutant's `origin`."""
        return "anticipating", self.answer.origin
