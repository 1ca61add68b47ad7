"""Results as JUnit XML: what Jenkins, GitLab and most build servers read.

There is no standard. The shape is what Jenkins' schema (xunit plugin, `junit-10.xsd`) allows, which GitLab reads too:
no attributes of our own, files as `[[ATTACHMENT|path]]` lines in `system-out`, which both take.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import PurePath

from foresee_dsl.files import rendered
from foresee_dsl.report.builds.case_results import CaseResult, Outcome

_NO_XML = re.compile(r"[^\t\n\r\x20-\uD7FF\uE000-\uFFFD\U00010000-\U0010FFFF]")
"""The characters that XML 1.0 does not allow (section 2.2), not even escaped."""


@dataclass(frozen=True)
class _Suite:
    """The results of one file."""

    name: str
    class_name: str
    results: tuple[CaseResult, ...]

    @property
    def failures(self) -> int:
        return sum(one.outcome is Outcome.FAILED for one in self.results)

    @property
    def errors(self) -> int:
        return sum(one.outcome is Outcome.ERROR for one in self.results)

    @property
    def time_s(self) -> float:
        return sum(one.time_s for one in self.results)


def to_junit(name: str, results: Sequence[CaseResult], *, properties: Sequence[tuple[str, str]] = ()) -> str:
    """Return one XML document: a test suite for each file; times are simulated seconds.

    `name`: the command. `properties`: name and value, the same in each suite, such as the driver.
    """
    by_suite = sorted(results, key=lambda one: one.suite)
    suites = [_Suite(suite, _class_name(suite), tuple(found))
              for suite, found in groupby(by_suite, key=lambda one: one.suite)]  # fmt: skip
    total = _Suite("", "", tuple(results))
    text = rendered("report/junit.xml", name=name, suites=suites, properties=properties, total=total)
    # What XML cannot hold is written out, such as the escape character of a terminal's colours.
    return _NO_XML.sub(lambda found: f"\\x{ord(found.group()):02x}", text)


def _class_name(suite: str) -> str:
    """A file as a dotted name: servers make folders of the dots."""
    parts = [part for part in PurePath(suite).with_suffix("").parts if part not in ("/", "..", ".")]
    return ".".join(part.replace(".", "_") for part in parts) or "foresee"
