"""The formats in which commands report: one for people, and a registry of formats for other tools.

A format is a function from a `CommandReport` to a text. Ours are in `OURS`; a package adds its own by the entry-point
group `foresee_dsl.report_formats`, and all commands with `--format` offer it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from foresee_dsl.errors import Diagnostic, ForeseeError
from foresee_dsl.plugins import PluginGroup

if TYPE_CHECKING:
    from foresee_dsl.language.codes import Code
    from foresee_dsl.report.builds.case_results import CaseResult

PEOPLE = ("text", "full", "table")
"""The names of the format for people; each command offers one of them."""

REPORT_FORMATS = PluginGroup("foresee_dsl.report_formats", "report format", ForeseeError)


@dataclass(frozen=True)
class CommandReport:
    """The contents of a command's report; each part is computed when a format needs it.

    Attributes:
        command: the command's name, such as `check`.
        data: its JSON document (docs/schemas), as text.
        results: the results of test cases and children; empty for a command that does not run any.
        mistakes: the errors and lints of files; None if the results that did not pass are reported instead.
        properties: names and values that hold for all results, such as the driver.
        forms: the command's own forms by name, such as `markdown`; a form in this mapping is written instead of the
            format with its name.
    """

    command: str
    data: Callable[[], str]
    results: Callable[[], Sequence[CaseResult]] = tuple
    mistakes: Callable[[], Sequence[Diagnostic]] | None = None
    properties: Sequence[tuple[str, str]] = ()
    forms: Mapping[str, Callable[[], str]] = field(default_factory=dict)

    def document(self) -> dict[str, Any]:
        """Return the JSON document as data."""
        document: dict[str, Any] = json.loads(self.data())
        return document

    def diagnostics(self) -> Sequence[Diagnostic]:
        """Return the errors with their places: errors and lints of files, or test cases that did not pass."""
        if self.mistakes is not None:
            return self.mistakes()
        from foresee_dsl.report.builds.case_results import as_diagnostics

        return tuple(as_diagnostics(self.results()))

    def codes(self) -> Mapping[str, Code]:
        """Return the explanations of the diagnostics' codes, by code."""
        if self.mistakes is not None:
            from foresee_dsl.language.codes import every_code

            return every_code()
        from foresee_dsl.report.builds.case_results import rules

        return rules()


ReportFormat = Callable[[CommandReport], str]
"""Converts a report to text, which is written to standard output or to the file of `--output`."""


def _junit(report: CommandReport) -> str:
    from foresee_dsl.report.builds.junit import to_junit

    return to_junit(f"foresee {report.command}", report.results(), properties=report.properties)


def _github(report: CommandReport) -> str:
    from foresee_dsl.report.builds.github import render_github

    return "".join(f"{line}\n" for line in render_github(report.diagnostics(), report.codes()).splitlines())


def _sarif(report: CommandReport) -> str:
    from foresee_dsl.report.builds.sarif import to_sarif

    return json.dumps(to_sarif(report.diagnostics(), report.codes()), indent=2) + "\n"


def _concise(report: CommandReport) -> str:
    from foresee_dsl.language.messages.diagnostics import render_concise

    return "".join(f"{render_concise(diagnostic)}\n" for diagnostic in report.diagnostics())


OURS: Mapping[str, ReportFormat] = MappingProxyType(
    {"json": lambda report: report.data(), "junit": _junit, "github": _github, "sarif": _sarif, "concise": _concise}
)


def rendered(name: str, report: CommandReport) -> str:
    """Return a report in one of its command's own forms or in a format, ours or another package's.

    Raises:
        ForeseeError: no package offers the format, or it is broken; the message names its package.
    """
    own, ours = report.forms.get(name), OURS.get(name)
    if own is not None:
        return own()
    if ours is not None:
        return ours(report)
    entry = REPORT_FORMATS.find(name)
    with REPORT_FORMATS.loading(entry):
        text = entry.load()(report)
        if not isinstance(text, str):
            raise TypeError(f"it returned {type(text).__name__} instead of a text")
    return text
