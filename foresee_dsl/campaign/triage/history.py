"""Keeps the findings of a folder's campaigns in `history.jsonl`, one line a campaign, and compares each campaign with
its driver's previous one."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from foresee_dsl.campaign.results import CampaignResult
from foresee_dsl.documents import plain
from foresee_dsl.errors import ForeseeError
from foresee_dsl.files import read_outside_text, write_whole

FILE = "history.jsonl"
"""Name of the file in a campaign's folder."""


@dataclass(frozen=True)
class PastFinding:
    """A finding of an earlier campaign. `judgement`: the word that says whose failure it was."""

    story: str
    judgement: str
    title: str
    test_case: str


@dataclass(frozen=True)
class PastCampaign:
    """An earlier campaign of a folder.

    Attributes:
        ended: date and time (UTC) at which it first ended. digest: hash of its `campaign.json` without the wall time.
            test_cases: addresses of its test cases.
    """

    ended: str
    digest: str
    driver: str
    ranker: str
    preset: str
    seed: int
    test_cases: tuple[str, ...]
    findings: tuple[PastFinding, ...]

    @property
    def case_count(self) -> int:
        """Number of its test cases."""
        return len(self.test_cases)

    @property
    def stories(self) -> frozenset[str]:
        """The stories of its findings."""
        return frozenset(finding.story for finding in self.findings)

    def gone(self, stories: Collection[str], test_cases: Collection[str]) -> tuple[PastFinding, ...]:
        """Return the findings that a later campaign does not have although it ran their test cases again.

        Args:
            stories: the stories that the later campaign found. test_cases: the test cases that it ran.
        """
        return tuple(f for f in self.findings if f.story not in stories and f.test_case in test_cases)


def digest_of(document: str) -> str:
    """Return the hash of the text of a `campaign.json` without its wall time."""
    lines = (line for line in document.splitlines() if not line.startswith('  "wall_s"'))
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()[:16]


def append_campaign(folder: Path, result: CampaignResult, document: str) -> None:
    """Add a finished campaign to its folder's history, unless the last entry has the same results.

    Raises:
        ForeseeError: the history cannot be read. OSError: it cannot be written.
    """
    history, digest = read_history(folder), digest_of(document)
    if history and history[-1].digest == digest:
        return
    settings = result.settings
    campaign = PastCampaign(
        ended=datetime.now(UTC).isoformat(timespec="seconds"),
        digest=digest,
        driver=settings.driver,
        ranker=settings.ranker,
        preset=settings.preset,
        seed=settings.seed,
        test_cases=tuple(seed.id for seed in result.seeds),
        findings=tuple(
            PastFinding(f.story_key, f.responsibility.whose.value, f.title, f.test_case) for f in result.findings
        ),
    )
    text = "".join(f"{json.dumps(plain(past), ensure_ascii=False)}\n" for past in (*history, campaign))
    write_whole(folder / FILE, text)


def read_history(folder: Path) -> tuple[PastCampaign, ...]:
    """Return the campaigns of a folder, the oldest first; () if there are none.

    Raises:
        ForeseeError: the file cannot be read, or a campaign did not write it.
    """
    file = folder / FILE
    try:
        lines = read_outside_text(file, "results").splitlines()
    except FileNotFoundError:
        return ()
    except (OSError, UnicodeDecodeError) as err:
        raise ForeseeError(f"{file} cannot be read: {err}") from err
    reader = TypeAdapter(PastCampaign)
    history = []
    for number, line in enumerate(lines, start=1):
        try:
            history.append(reader.validate_json(line))
        except ValidationError as err:
            first = err.errors()[0]
            where = ".".join(map(str, first["loc"]))
            raise ForeseeError(
                f"{file}:{number}: this is not what a campaign writes ({where + ': ' if where else ''}{first['msg']}): "
                "remove the line"
            ) from err
    return tuple(history)


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
