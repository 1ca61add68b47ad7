"""Explains a failure: the judges' answers and its story."""

from __future__ import annotations

from dataclasses import dataclass

from foresee_dsl.avoidance.judge import Failure
from foresee_dsl.avoidance.judges import AnyJudgement, judged
from foresee_dsl.compile import compile_test_case
from foresee_dsl.language.document import TestCase
from foresee_dsl.measuring import Part
from foresee_dsl.simulate.results.verdict import RunResult
from foresee_dsl.story import Story, tell


@dataclass(frozen=True)
class Explanation:
    """The explanation of a failure; for a run that did not fail, all fields are empty."""

    judgements: tuple[AnyJudgement, ...] = ()
    story: Story | None = None


NOTHING = Explanation()
"""The explanation of a run that did not fail."""


@Part.EXPLAIN.measured
def explained(case: TestCase, result: RunResult) -> Explanation:
    """Return the judges' answers and the story of a failure."""
    if not result.verdict.is_failure:
        return NOTHING
    bundle = compile_test_case(case)
    return Explanation(judged(Failure.of(result, bundle)), tell(result.trace, case, bundle))
