"""The goal of a campaign: which test cases have it, and how many of its runs break it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from foresee_dsl.errors import ForeseeError
from foresee_dsl.helps import Help, HelpText, meant_word
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.messages.suggest import closest
from foresee_dsl.language.model import Expect


@dataclass(frozen=True)
class GoalCounts:
    """How many runs of a campaign break its goal.

    Attributes:
        name: the goal. test_cases: number of test cases that break it without mutation.
        children, findings: number of children that break it, and of findings whose representative does.
        others: number of failing children that keep it.
    """

    name: str
    test_cases: int
    children: int
    findings: int
    others: int


def only_expectation(name: str, reason: str, command: str) -> str:
    """Return the message that a run which breaks only an expectation belongs to no finding, and what makes it one.

    Args:
        name: the mutant. reason: how its run ended. command: what the user asked for, such as `reviewed`.
    """
    return (
        f"{name} breaks only an expectation, which is {command} only as the goal of a campaign: {reason}. `foresee "
        "campaign PATH --goal LABEL` makes findings of the runs that break the expectation with this label"
    )


def with_goal(cases: Sequence[TestCase], goal: str) -> list[TestCase]:
    """Return the test cases that have an expectation of this name, with it as their goal; all of them without a goal.

    Raises:
        ForeseeError: none of them has it, or clips do not check it.
    """
    if not goal:
        return list(cases)
    if (problem := problem_with(cases, goal)) is not None:
        message, help = problem
        raise ForeseeError(f"{message}: {Help.of(help).text}")
    return [replace(case, goal=goal) for case, expect in _named(cases, goal) if expect.mode != "eventually"]


def problem_with(cases: Sequence[TestCase], goal: str) -> tuple[str, HelpText] | None:
    """Return why none of the test cases can have this goal, and what to write instead; None if one of them can."""
    named = _named(cases, goal)
    if not named:
        labels = sorted({e.name for case in cases for e in case.scenario.all(Expect) if e.name is not None})
        nearest = closest(goal, labels)
        all_labels = f"their labels: {', '.join(labels)}" if labels else _UNLABELLED
        help = meant_word(nearest, goal) if nearest is not None else all_labels
        return f"no test case has an expectation called '{goal}'", help
    if all(expect.mode == "eventually" for _, expect in named):
        why = f"'{goal}' is an `expect eventually`, which clips do not check, because it may hold before a clip begins"
        return why, "a goal is an `expect always` or `expect never`"
    return None


def _named(cases: Sequence[TestCase], goal: str) -> list[tuple[TestCase, Expect]]:
    return [(case, expect) for case in cases for expect in case.scenario.all(Expect) if expect.name == goal]


def left_out(cases: Sequence[TestCase], goal: str) -> str:
    """Return the note on test cases that a campaign with this goal leaves out; "" if there are none."""
    count = len(cases) - len(with_goal(cases, goal))
    if not count:
        return ""
    has, is_ = ("has", "is") if count == 1 else ("have", "are")
    return f"{count} of {len(cases)} test cases {has} no `expect {goal}: always ...` (or `never`) and {is_} left out"


_UNLABELLED = "they have no labels: write `expect NAME: always ...`"
