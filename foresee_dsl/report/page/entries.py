"""What a report lists: its campaigns, and their findings with every run that is shown."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from foresee_dsl.report.page.recorded import Campaign
from foresee_dsl.report.page.runs import Run
from foresee_dsl.report.terminal.raw_numbers import FAMILY_TITLES

_NO_ANCHOR = re.compile(r"[^\w.-]+", re.ASCII)
_LONGEST_ANCHOR = 120


@dataclass(frozen=True)
class Source:
    """A campaign's folder and what it recorded."""

    folder: Path
    campaign: Campaign


@dataclass(frozen=True)
class Found:
    """A finding with its runs; the first is its representative.

    `key`: what tells it from all others of the report.
    """

    key: str
    title: str
    class_: str
    verdict: str
    label: str
    family: str
    driver: str
    preventability: str
    anticipation: str
    test_case: str
    runs: tuple[Run, ...]
    more: tuple[str, ...] = ()
    """Names of further runs, which are only named."""

    shown = "name sentence=title class=class_ verdict family driver preventability anticipation test_case runs more"

    @property
    def count(self) -> int:
        """How many failing runs tell it; one that was made smaller is not counted again."""
        return sum(run.outcome.minimised is None for run in self.runs) + len(self.more)

    @property
    def anchor(self) -> str:
        """The key, as addresses and file names can hold it."""
        plain = _NO_ANCHOR.sub("_", self.key)
        if plain == self.key and len(plain) <= _LONGEST_ANCHOR:
            return plain
        return f"{plain[:_LONGEST_ANCHOR]}-{hashlib.sha256(self.key.encode()).hexdigest()[:8]}"

    @property
    def name(self) -> str:
        """The representative's."""
        return self.runs[0].outcome.name

    @property
    def others(self) -> tuple[str, ...]:
        """The names of the other runs that are shown."""
        return tuple(run.outcome.name for run in self.runs if run.outcome.name != self.name)

    @property
    def mutated(self) -> bool:
        """Whether its runs are mutants' (or those of a test case as it is)."""
        return bool(self.runs[0].outcome.operators) or self.runs[0].outcome.parent_trace is not None


def family_title(family: str) -> str:
    """Return a family's number and what it is about."""
    return f"{family} {FAMILY_TITLES.get(family, '')}".strip() or "(no family)"


def options_of(findings: Iterable[Found], key: Callable[[Found], str]) -> tuple[str, ...]:
    """Return the values that a filter offers."""
    return tuple(sorted({key(found) for found in findings} - {""}))
