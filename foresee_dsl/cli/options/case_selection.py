"""Which test cases of those named are run, and when it stops: options of `run`, `assess`, `campaign` and `plan`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from foresee_dsl.language.project.document import TestCase

FirstOption = Annotated[int | None, typer.Option("--first", min=1, help="Only the first so many test cases.")]
OnlyOption = Annotated[
    list[str] | None,
    typer.Option("--only", metavar="FAMILY|TAG", help="Only test cases of this family or tag; several are allowed."),
]
FailFastOption = Annotated[bool, typer.Option("--fail-fast", help="Stop at the first failure.")]


def selected(cases: Sequence[TestCase], first: int | None, only: Sequence[str] | None) -> tuple[TestCase, ...]:
    """Return the test cases that the options leave, in their order.

    Raises:
        BadParameter: no test case has such a family or tag.
    """
    kept = tuple(cases)
    if only:
        known = {case.id: _words(case) for case in kept}
        for word in only:
            if not any(word in words for words in known.values()):
                there = ", ".join(sorted(set().union(*known.values()))) or "none"
                raise typer.BadParameter(f"no test case has the family or tag {word!r}; there are: {there}",
                                         param_hint="--only")  # fmt: skip
        kept = tuple(case for case in kept if known[case.id].intersection(only))
    return kept[:first]


def _words(case: TestCase) -> set[str]:
    from foresee_dsl.language.model import Tags

    tags = case.scenario.one(Tags)
    return {*(tags.names if tags is not None else ()), *([case.family] if case.family else ())}
