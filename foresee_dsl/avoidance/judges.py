"""The judges that are asked about every failure of a campaign.

A further one is a class in `JUDGES`. It returns an `Opinion`, or a dataclass of its own that `AnyJudgement` names.
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Discriminator, Tag

from foresee_dsl.avoidance.anticipating import AnticipatingDriver, Anticipation
from foresee_dsl.avoidance.judge import Failure, Judge, Opinion
from foresee_dsl.avoidance.r157.assessing import Preventability, R157Driver


def _kind(found: Any) -> str:  # noqa: ANN401 - a judgement, or what is read from a store
    names = found.keys() if isinstance(found, dict) else vars(found).keys()
    return "opinion" if "settled" in names else "r157" if "verdict" in names else "anticipating"


AnyJudgement = Annotated[
    Annotated[Preventability, Tag("r157")]
    | Annotated[Anticipation, Tag("anticipating")]
    | Annotated[Opinion, Tag("opinion")],
    Discriminator(_kind),
]
"""A judgement as records keep it."""
JUDGES: tuple[Judge[AnyJudgement], ...] = (R157Driver(), AnticipatingDriver())
"""In the order in which reports show their answers."""


def judged(failure: Failure) -> tuple[AnyJudgement, ...]:
    """Ask all judges about a failure."""
    return tuple(judge.judge(failure) for judge in JUDGES)
