"""Writes mutated test cases as scenarios that extend the original test case, and reads their lines back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from foresee_dsl.campaign.driving import relative_path
from foresee_dsl.campaign.regression.expectations import expected_of
from foresee_dsl.errors import ForeseeError
from foresee_dsl.language import model as m
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.parser import parse
from foresee_dsl.language.printer import print_item, print_model, quotable
from foresee_dsl.language.project.loading import Project
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_study.fuzz.mutation import Line
from foresee_study.fuzz.records import MutatedRun


@dataclass(frozen=True)
class Original:
    """A test case that is mutated.

    Attributes:
        file: its file, absolute.
        case: the name of its case; "" if the file has no cases.
        alone: lines that drop all other cases of the file.
    """

    file: Path
    case: str
    alone: tuple[m.ExtensionItem, ...]


def original_of(case: TestCase) -> Original:
    """Return a test case as the original of mutated ones.

    Raises:
        ForeseeError: it is a clip or a mutant, which no scenario can extend.
    """
    if case.clip is not None or case.mutant is not None:
        raise ForeseeError(f"{case.id} is a clip or a mutant, and only scenarios can be extended: "
                           f"`foresee expand {case.id}` makes a scenario of it")  # fmt: skip
    name = case.id.partition("::")[2]
    return Original(case.source, name, tuple(_alone(case.source, name)))


def _alone(file: Path, name: str) -> list[m.ExtensionItem]:
    """Return the lines that drop all cases of a file except one."""
    project = Project()
    written, drawn = project.whole_scenario(file, drawn=False), project.whole_scenario(file)
    lines: list[m.ExtensionItem] = [
        m.Drop(what="case", name=case.name) for case in written.all(m.Case) if case.name != name
    ]
    if written.all(m.Cases):
        lines.append(m.Drop(what="cases"))
        if all(case.name != name for case in written.all(m.Case)):
            lines += [m.Add(item=case) for case in drawn.all(m.Case) if case.name == name]
    return lines


def text_of(lines: Sequence[Line]) -> str:
    """Return the lines of a mutated test case as text, without the lines that depend on the folder of its file."""
    return "\n".join(print_item(line) for line in lines)


def lines_of(text: str) -> tuple[Line, ...]:
    """Return the lines of a text that `text_of` returned."""
    if not text:
        return ()
    model = parse(f'foresee 1\n\nscenario lines extends "seed" {{\n{text}\n}}\n', "a mutated test case").model
    assert isinstance(model, m.Extension)  # noqa: S101  (it says so)
    return tuple(item for item in model.body if isinstance(item, m.Add | m.Replace))


def file_text(
    name: str,
    original: Original,
    file: Path,
    text: str,
    *,
    about: str = "",
    driver: str = "",
    outcome: MutatedRun | None = None,
) -> str:
    """Return the whole file of a mutated test case.

    Args:
        name: name of the scenario.
        original: the test case that it extends.
        file: the path of the file.
        text: its lines, from `text_of`.
        about: a sentence for `doc`.
        driver, outcome: the driver of its run and the run's outcome, for an `expected` line; None without a run.
    """
    body: list[m.ExtensionItem] = [m.Doc(text=quotable(about))] if about else []
    # A timeout may not happen again on another machine.
    if outcome is not None and outcome.verdict is not Verdict.TIMEOUT:
        expected = expected_of(outcome, driver)
        body += [] if expected is None else [expected]
    body += [*original.alone, *lines_of(text)]
    return print_model(m.Extension(name=name, parent=relative_path(original.file, file.parent), body=tuple(body)))
