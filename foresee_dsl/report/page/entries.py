"""The entries of a report: its campaigns and their findings, with the runs that are shown."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from foresee_dsl.avoidance.responsibility import FOLDED, Responsibility
from foresee_dsl.campaign.findings.sureness import Sureness
from foresee_dsl.campaign.records import CaseRunOutcome, WrittenFinding
from foresee_dsl.campaign.triage.decisions import Decision
from foresee_dsl.campaign.triage.standing import Since, Standing
from foresee_dsl.campaign.written import WrittenCampaign
from foresee_dsl.documents import or_null
from foresee_dsl.report.page.runs import RunEntry

_NO_ANCHOR = re.compile(r"[^\w.-]+", re.ASCII)
_LONGEST_ANCHOR = 120


@dataclass(frozen=True)
class ReportedCampaign:
    """A campaign's recorded results, and how they compare with the campaign before.

    name: what tells the campaign from the others of the report, such as its driver; () if it is the only one.
    """

    campaign: WrittenCampaign
    standing: Standing
    name: tuple[str, ...] = ()


def case_runs(campaigns: Iterable[WrittenCampaign]) -> list[tuple[str, CaseRunOutcome]]:
    """Return the driver and the run of each test case; a run that campaigns of several rankers share comes once."""
    runs = ((campaign, case) for campaign in campaigns for case in campaign.test_cases)
    return list({(c.driver, c.settings.seed, case.id): (c.driver, case) for c, case in runs}.values())


@dataclass(frozen=True)
class FindingEntry:
    """A finding with its runs; the first run is its representative.

    Attributes:
        record: the finding as its campaign states it; with the values of its runs where an older version wrote none.
        key: an identifier that is unique in the report. title: what happens, in a sentence.
    """

    record: WrittenFinding
    key: str
    title: str
    label: str
    driver: str
    runs: tuple[RunEntry, ...]
    more: tuple[str, ...] = ()
    """Names of further runs, which are not shown."""
    diagnosis: str = ""
    """The part of the driver that causes the failure, in words; "" before `foresee diagnose` was run."""
    sure: Sureness | None = None
    """How sure the failure is; None before `foresee sure` was run."""
    since: Since = Since.FIRST
    """Whether the previous campaign had this finding, too."""
    triage: Decision | None = None
    """The decision that people recorded about it with `foresee triage`; None without one."""

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "number": self.number,
            "name": self.name,
            "judgement": {
                "word": self.judgement_word,
                "text": self.judgement_text,
                "reason": self.judgement_reason,
            },
            "title": or_null(self.record.title),
            "sentence": self.title,
            "class": self.record.class_,
            "verdict": self.verdict,
            "family": self.record.family,
            "driver": self.driver,
            "preventability": self.preventability,
            "anticipation": self.anticipation,
            "test_case": self.record.test_case,
            "diagnosis": self.diagnosis,
            "sure": self.sure,
            "rate": or_null(self.record.rate),
            "since": or_null(self.since),
            "triage": self.triage,
            "runs": self.runs,
            "more": self.more,
        }

    @property
    def number(self) -> int:
        """Return the number by which commands address the finding; 0 if it has none."""
        return self.record.number

    @property
    def verdict(self) -> str:
        """Return how the finding's runs end, in a word."""
        return self.record.verdict.value

    @property
    def preventability(self) -> str:
        """Return the answer of R157's driver; "" without one."""
        return self.record.preventability.value if self.record.preventability is not None else ""

    @property
    def anticipation(self) -> str:
        """Return the answer of the anticipating driver; "" without one."""
        return self.record.anticipation.value if self.record.anticipation is not None else ""

    def opinion_of(self, judge: str) -> str:
        """Return the answer of a further judge, by its name; "" without one."""
        return next((opinion.answer for opinion in self.record.opinions if opinion.name == judge), "")

    @property
    def judgement(self) -> Responsibility | None:
        """Return whose failure it is; None if the campaign was written by a version without judgements."""
        return self.record.judgement

    @property
    def judgement_word(self) -> str:
        """Return whose failure it is, as a word; "" without a judgement."""
        return self.judgement.word if self.judgement is not None else ""

    @property
    def judgement_text(self) -> str:
        """Return whose failure it is, in words; "" without a judgement."""
        return self.judgement.text if self.judgement is not None else ""

    @property
    def judgement_reason(self) -> str:
        """Return why it is whose failure; "" without a judgement."""
        return self.judgement.reason if self.judgement is not None else ""

    @property
    def count(self) -> int:
        """Return the number of failing runs with this story, without the minimised copy of the representative."""
        return sum(run.outcome.minimised is None for run in self.runs) + len(self.more)

    @property
    def unmutated(self) -> frozenset[tuple[str, int, str]]:
        """Return driver, seed and test case of each shown run of a test case without mutation."""
        return frozenset(key for run in self.runs if (key := run.outcome.unmutated) is not None)

    @property
    def folded(self) -> bool:
        """Return whether reports only count the finding: nothing follows from it for the driver, or it was triaged."""
        return self.triage is not None or (self.judgement is not None and self.judgement.whose in FOLDED)

    @property
    def standing(self) -> str:
        """Return whether the finding is new, and how it was triaged, in words; "" if there is nothing to say."""
        return ", ".join(part for part in (self.since.text, self.triage.text if self.triage else "") if part)

    @property
    def anchor(self) -> str:
        """Return the key, with only such characters as web addresses and file names can contain."""
        plain = _NO_ANCHOR.sub("_", self.key)
        if plain == self.key and len(plain) <= _LONGEST_ANCHOR:
            return plain
        return f"{plain[:_LONGEST_ANCHOR]}-{hashlib.sha256(self.key.encode()).hexdigest()[:8]}"

    @property
    def name(self) -> str:
        """Return the name of the representative."""
        return self.runs[0].outcome.name

    @property
    def others(self) -> tuple[str, ...]:
        """Return the names of the other runs that are shown."""
        return tuple(run.outcome.name for run in self.runs if run.outcome.name != self.name)

    @property
    def mutated(self) -> bool:
        """Return whether the runs are those of mutants, not of an unmutated test case."""
        return bool(self.runs[0].outcome.operators) or self.runs[0].outcome.parent_trace is not None


def failing_runs(findings: Sequence[FindingEntry]) -> int:
    """Return the number of failing runs of some findings; one that campaigns of several rankers share counts once."""
    cases = [run for finding in findings for run in finding.unmutated]
    return sum(finding.count for finding in findings) - len(cases) + len(set(cases))


def options_of(findings: Iterable[FindingEntry], key: Callable[[FindingEntry], str]) -> tuple[str, ...]:
    """Return the values that a filter of the findings offers."""
    return tuple(sorted({key(finding) for finding in findings} - {""}))
