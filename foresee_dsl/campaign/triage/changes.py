"""The campaigns of a folder in order, each with the stories that were new and gone since its driver's previous
campaign.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from foresee_dsl.campaign.triage.history import FILE, PastCampaign, read_history


@dataclass(frozen=True)
class CampaignChange:
    """A campaign of a folder.

    Attributes:
        folder: its folder; if a campaign has several drivers or rankers, each has a folder. counts: number of its
            findings by judgement. new, still, gone: numbers of stories that are new, still there and gone
            (`PastCampaign.gone`) since the previous campaign; None for a driver's first campaign.
    """

    folder: Path
    campaign: PastCampaign
    counts: Mapping[str, int]
    new: int | None
    still: int | None
    gone: int | None

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "folder": self.folder,
            "ended": self.campaign.ended,
            "driver": self.campaign.driver,
            "ranker": self.campaign.ranker,
            "preset": self.campaign.preset,
            "seed": self.campaign.seed,
            "test_cases": self.campaign.case_count,
            "counts": self.counts,
            "new": self.new,
            "still": self.still,
            "gone": self.gone,
            "findings": self.campaign.findings,
        }


def changes_of(folder: Path) -> tuple[CampaignChange, ...]:
    """Return the campaigns of a folder and of the folders in it, sorted by folder and then by time, the oldest first.

    Raises:
        ForeseeError: a history cannot be read.
    """
    folders = [folder, *sorted(file.parent for file in folder.glob(f"*/{FILE}"))]
    return tuple(change for place in folders for change in _changes(place))


def _changes(folder: Path) -> list[CampaignChange]:
    last: dict[str, PastCampaign] = {}
    changes = []
    for campaign in read_history(folder):
        before = last.get(campaign.driver)
        counts = Counter(finding.judgement for finding in campaign.findings)
        new = still = gone = None
        if before is not None:
            new, still = len(campaign.stories - before.stories), len(campaign.stories & before.stories)
            gone = len(before.gone(campaign.stories, campaign.test_cases))
        changes.append(CampaignChange(folder, campaign, counts, new, still, gone))
        last[campaign.driver] = campaign
    return changes
