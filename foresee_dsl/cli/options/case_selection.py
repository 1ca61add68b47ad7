"""Options of `run`, `assess`, `campaign` and `plan` that choose among the test cases, or stop at the first failure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from foresee_dsl.language.project.document import TestCase

FirstOption = Annotated[int | None, typer.Option("--first", min=1, help="Use only the first N test cases.")]
OnlyOption = Annotated[
    list[str] | None,
    typer.Option(
        "--only", metavar="FAMILY|TAG", help="Use only test cases of this family or tag; repeat the option for several."
    ),
]
FailFastOption = Annotated[bool, typer.Option("--fail-fast", help="Stop at the first failure.")]


def selected(cases: Sequence[TestCase], first: int | None, only: Sequence[str] | None) -> tuple[TestCase, ...]:
    """Return the test cases that the options select, in their order.

    Raises:
        BadParameter: no test case has such a family or tag.
    """
    chosen = tuple(cases)
    if only:
        words_of_case = {case.id: _words(case) for case in chosen}
        for word in only:
            if not any(word in words for words in words_of_case.values()):
                there = ", ".join(sorted(set().union(*words_of_case.values()))) or "none"
                raise typer.BadParameter(f"no test case has the family or tag {word!r}; the test cases have: {there}",
                                         param_hint="--only")  # fmt: skip
        chosen = tuple(case for case in chosen if words_of_case[case.id].intersection(only))
    return chosen[:first]


def _words(case: TestCase) -> set[str]:
    from foresee_dsl.language.model import Tags

    tags = case.scenario.first(Tags)
    return {*(tags.names if tags is not None else ()), *([case.family] if case.family else ())}
