"""The judges that examine every failure of a campaign.

To add a judge, add an instance of its class to `JUDGES`. It returns an `Opinion`, or a dataclass of its own, which
`AnyJudgement` must list.
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Discriminator, Tag

from foresee_dsl.avoidance.anticipating import AnticipatingDriver, Anticipation
from foresee_dsl.avoidance.judge import Failure, Judge, Opinion
from foresee_dsl.avoidance.r157.assessing import Preventability, R157Driver


def _kind(judgement: Any) -> str:  # noqa: ANN401 - a judgement, or a record read from a store
    names = judgement.keys() if isinstance(judgement, dict) else vars(judgement).keys()
    return "opinion" if "settled" in names else "r157" if "verdict" in names else "anticipating"


AnyJudgement = Annotated[
    Annotated[Preventability, Tag("r157")]
    | Annotated[Anticipation, Tag("anticipating")]
    | Annotated[Opinion, Tag("opinion")],
    Discriminator(_kind),
]
"""A judgement as stored in records."""
JUDGES: tuple[Judge[AnyJudgement], ...] = (R157Driver(), AnticipatingDriver())
"""All judges, in the order in which reports show their answers."""


def judged(failure: Failure) -> tuple[AnyJudgement, ...]:
    """Return the judgements of all judges about a failure."""
    return tuple(judge.judge(failure) for judge in JUDGES)
