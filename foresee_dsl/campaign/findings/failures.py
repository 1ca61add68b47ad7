"""What is found out about a failure: whether a careful driver would have avoided it, by two models, and its story."""

from __future__ import annotations

from dataclasses import dataclass

from foresee_dsl.compile import compile_test_case
from foresee_dsl.derive import anticipating
from foresee_dsl.derive.anticipating import Anticipation
from foresee_dsl.derive.preventability import Preventability, Replayed, assess_bundle
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.measuring import Part
from foresee_dsl.simulate.results.verdict import RunResult
from foresee_dsl.story import Story, tell


@dataclass(frozen=True)
class Explained:
    """What is known of a failure; of another run nothing.

    Attributes:
        preventability: by the model of UN R157. anticipation: by the anticipating driver.
    """

    preventability: Preventability | None = None
    anticipation: Anticipation | None = None
    story: Story | None = None


NOTHING = Explained()
"""Of a run that did not fail."""


@Part.EXPLAIN.measured
def explained(case: TestCase, result: RunResult) -> Explained:
    """Return of a failure whether it was preventable, and its story."""
    if not result.verdict.is_failure:
        return NOTHING
    bundle = compile_test_case(case)
    replayed = Replayed(bundle, result)
    return Explained(
        assess_bundle(bundle, result, replayed),
        anticipating.assess_bundle(bundle, result, replayed),
        tell(result.trace, case, bundle),
    )
