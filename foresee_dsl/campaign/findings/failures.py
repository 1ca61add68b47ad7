"""What is found out about a failure: whether a careful driver would have avoided it, and its story."""

from __future__ import annotations

from foresee_dsl.compile import compile_test_case
from foresee_dsl.derive.preventability import Preventability, assess_bundle
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.simulate.results.verdict import RunResult
from foresee_dsl.story import Story, tell


def explained(case: TestCase, result: RunResult) -> tuple[Preventability | None, Story | None]:
    """Return of a failure whether it was preventable, and its story; of another run None."""
    if not result.verdict.is_failure:
        return None, None
    bundle = compile_test_case(case)
    return assess_bundle(bundle, result), tell(result.trace, case, bundle)
