"""Compares the findings of a campaign with those of the previous one and with what people decided about them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path

from foresee_dsl.campaign.results import CampaignResult
from foresee_dsl.campaign.triage.decisions import Decision, counted_decisions, read_decisions, story_key, triage_file
from foresee_dsl.campaign.triage.history import PastCampaign, PastFinding, digest_of, read_history
from foresee_dsl.campaign.written import JSON, WrittenCampaign
from foresee_dsl.files import read_outside_text


class Since(StrEnum):
    """Whether the previous campaign found a story too."""

    NEW = "new"
    STILL = "still there"
    FIRST = ""
    """There is no previous campaign."""

    @property
    def text(self) -> str:
        """The value in words for a sentence."""
        return "new since the last campaign" if self is Since.NEW else self.value


@dataclass(frozen=True)
class Standing:
    """How the findings of a campaign compare with those of the previous one, and what people decided about them.

    Attributes:
        since: for each story, whether it is new or still there; empty if there is no previous campaign. gone: findings
          of the previous campaign whose test cases ran again without that story. decisions: the decisions about stories
          that were triaged, by story. unmatched: decisions about stories that an earlier campaign in this folder found,
          and this one does not although it ran their test cases again. file: the file of the decisions.
    """

    since: Mapping[str, Since] = field(default_factory=dict)
    gone: tuple[PastFinding, ...] = ()
    decisions: Mapping[str, Decision] = field(default_factory=dict)
    unmatched: tuple[Decision, ...] = ()
    file: Path = Path()

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "since": self.since,
            "gone": self.gone,
            "triage": self.decisions,
            "unmatched": self.unmatched,
        }

    def of(self, story: str) -> Since:
        """Return whether the previous campaign found a story too."""
        return self.since.get(story, Since.FIRST)

    def words(self, story: str) -> str:
        """Return in words whether a story is new and what people decided about it; "" if there is nothing to say."""
        decision = self.decisions.get(story)
        return ", ".join(part for part in (self.of(story).text, decision.text if decision else "") if part)

    @property
    def change(self) -> str:
        """The change since the previous campaign: `2 new, 5 still there, 1 gone`; "" if there was none."""
        counts = Counter(self.since.values())
        if not self.since and not self.gone:
            return ""
        return f"{counts[Since.NEW]} new, {counts[Since.STILL]} still there, {len(self.gone)} gone"

    @property
    def triaged(self) -> str:
        """The number of triaged findings by kind: `3 triaged (2 known, 1 not ours)`; "" if there are none."""
        return counted_decisions(self.decisions.values())

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences for a reader: how the findings changed, which of them no longer occur, and which decisions belong
        to no finding.
        """
        notes = []
        if self.change:
            gone = f": {'; '.join(finding.title for finding in self.gone)}" if self.gone else ""
            notes.append(f"Since the last campaign: {self.change}{gone}.")
        if self.unmatched:
            lines = ", ".join(str(decision.line) for decision in self.unmatched)
            which = f"line {lines} has" if len(self.unmatched) == 1 else f"lines {lines} have"
            notes.append(f"{self.file.name}: {which} a story that this campaign does not find any more.")
        return tuple(notes)


def standing_of(result: CampaignResult, folder: Path) -> Standing:
    """Return how the findings of a campaign compare with those of the previous one; the campaign's folder is written
    already.

    Raises:
        ForeseeError: the history or the decisions cannot be read.
    """
    stories = {finding.story_key: finding.test_case for finding in result.findings}
    cases = [seed.id for seed in result.seeds]
    return _standing(folder, result.settings.driver, stories, cases, whole=not result.interrupted)


def standing_of_written(campaign: WrittenCampaign) -> Standing:
    """Return how the findings of a written campaign compare with those of the previous one in its folder.

    Raises:
        ForeseeError: the history or the decisions cannot be read.
    """
    stories = {finding.story: finding.test_case for finding in campaign.findings or () if finding.story}
    cases = [run.id for run in campaign.test_cases]
    return _standing(campaign.folder, campaign.driver, stories, cases, whole=not campaign.interrupted)


def _standing(
    folder: Path, driver: str, stories: Mapping[str, str], cases: Collection[str], *, whole: bool
) -> Standing:
    file = triage_file(cases)
    decisions = read_decisions(file)
    keys = {story_key(driver, story): story for story in stories}
    history = [past for past in read_history(folder) if past.driver == driver]
    before = _before(folder, history)
    # The project's other campaigns have decisions in the same file, so only stories of this folder can be missing.
    earlier = {f.story for past in history for f in past.gone(stories, frozenset(cases))} if whole else set()
    missing = {story_key(driver, story) for story in earlier}
    return Standing(
        since={} if before is None else {s: Since.STILL if s in before.stories else Since.NEW for s in stories},
        gone=before.gone(stories, frozenset(cases)) if whole and before is not None else (),
        decisions={story: decisions[key] for key, story in keys.items() if key in decisions},
        unmatched=tuple(decision for key, decision in decisions.items() if key in missing),
        file=file,
    )


def _before(folder: Path, history: Sequence[PastCampaign]) -> PastCampaign | None:
    """Return the campaign before the one in the folder; None if there is none."""
    if not history:
        return None
    own = digest_of(read_outside_text(folder / JSON, "results"))
    return next((past for past in reversed(history) if past.digest != own), None)
