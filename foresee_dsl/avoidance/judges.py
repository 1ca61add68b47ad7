"""The judges that examine every failure of a campaign.

To add a judge, add an instance of its class to `JUDGES`. It returns an `Opinion`, which records, reports and reviews
show. The two other records have keys of their own in `campaign.json`, for the figures of their models.
"""

from __future__ import annotations

from foresee_dsl.avoidance.anticipating import AnticipatingDriver, Anticipation
from foresee_dsl.avoidance.judge import Failure, Judge, Opinion
from foresee_dsl.avoidance.r157.assessing import Preventability, R157Driver

AnyJudgement = Preventability | Anticipation | Opinion
"""A judgement as stored in records (`campaign.records`); that of a further judge is an `Opinion`."""
JUDGES: tuple[Judge[AnyJudgement], ...] = (R157Driver(), AnticipatingDriver())
"""All judges, in the order in which reports show their answers."""


def judged(failure: Failure) -> tuple[AnyJudgement, ...]:
    """Return the judgements of all judges about a failure."""
    return tuple(judge.judge(failure) for judge in JUDGES)
