"""Results as JUnit XML, which Jenkins, GitLab and most build servers read.

The format has no standard. The output follows Jenkins' schema (xunit plugin, `junit-10.xsd`), which GitLab reads too:
it has no attributes of our own, and files are `[[ATTACHMENT|path]]` lines in `system-out`, which both servers support.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import PurePath

from foresee_dsl.files import rendered
from foresee_dsl.report.builds.case_results import BuildOutcome, CaseResult

_NO_XML = re.compile(r"[^\t\n\r\x20-\uD7FF\uE000-\uFFFD\U00010000-\U0010FFFF]")
"""Characters that XML 1.0 forbids (section 2.2), even escaped."""


@dataclass(frozen=True)
class _Suite:
    """The results of one file, as a test suite of JUnit."""

    name: str
    class_name: str
    results: tuple[CaseResult, ...]

    @property
    def failures(self) -> int:
        return sum(result.outcome is BuildOutcome.FAILED for result in self.results)

    @property
    def errors(self) -> int:
        return sum(result.outcome is BuildOutcome.ERROR for result in self.results)

    @property
    def time_s(self) -> float:
        return sum(result.time_s for result in self.results)


def to_junit(name: str, results: Sequence[CaseResult], *, properties: Sequence[tuple[str, str]] = ()) -> str:
    """Return an XML document with a test suite for each file; times are simulated seconds.

    `name`: the command. `properties`: names and values that each suite repeats, such as the driver.
    """
    by_suite = sorted(results, key=lambda result: result.suite)
    suites = [_Suite(suite, _class_name(suite), tuple(members))
              for suite, members in groupby(by_suite, key=lambda result: result.suite)]  # fmt: skip
    total = _Suite("", "", tuple(results))
    text = rendered("report/junit.xml", name=name, suites=suites, properties=properties, total=total)
    # Characters that XML cannot contain are written as escapes, such as the escape character of a terminal's colours.
    return _NO_XML.sub(lambda match: f"\\x{ord(match.group()):02x}", text)


def _class_name(suite: str) -> str:
    """Return a file as a dotted name; build servers turn the parts between dots into folders."""
    path = PurePath(suite)
    parts = (path.with_suffix("") if path.name else path).parts  # a suite can be `.`, which has no suffix
    parts = tuple(part for part in parts if part not in ("/", "..", "."))
    return ".".join(part.replace(".", "_") for part in parts) or "foresee"
