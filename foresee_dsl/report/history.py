"""The campaigns of a folder as a table, and as a page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from foresee_dsl.avoidance.responsibility import Whose
from foresee_dsl.campaign.triage.history import CampaignChange
from foresee_dsl.files import write_whole
from foresee_dsl.report.page.contents import Contents
from foresee_dsl.report.page.html import rendered
from foresee_dsl.report.page.runs import Reader
from foresee_dsl.report.page.tables import Table
from foresee_dsl.report.safe_text import counted


def history_table(changes: Sequence[CampaignChange]) -> Table:
    """Return the table of campaigns, the latest first: findings by judgement, new, still there and gone."""
    several = len({change.folder for change in changes}) > 1
    judgements = ("driver's fault" if whose is Whose.DRIVER else whose.value for whose in Whose)
    headings = (*(("folder",) if several else ()), "ended", "driver", "cases", *judgements, "all", "new", "still",
                "gone")  # fmt: skip
    rows = tuple(
        (
            *((change.folder.name,) if several else ()),
            change.campaign.ended,
            change.campaign.driver,
            str(change.campaign.case_count),
            *(str(change.counts.get(whose.value, 0)) for whose in Whose),
            str(len(change.campaign.findings)),
            *("" if count is None else str(count) for count in (change.new, change.still, change.gone)),
        )
        for change in reversed(changes)
    )
    return Table("Campaigns", headings, rows, texts=2 + several)


def write_history(folder: Path, changes: Sequence[CampaignChange], file: Path) -> None:
    """Write the page: the table, and the findings of each campaign.

    Raises:
        OSError: the file cannot be written.
    """
    headings = ("judgement", "finding", "test case", "story")
    findings = tuple(
        Table(
            f"{change.campaign.ended}, {change.campaign.driver}",
            headings,
            tuple((f.judgement, f.title, f.test_case, f.story) for f in change.campaign.findings),
            texts=len(headings),
        )
        for change in reversed(changes)
    )
    contents = Contents(
        title="history",
        headline=f"{counted(len(changes), 'campaign')} of {folder}",
        subtitle="findings by judgement; new, still there and gone since the campaign before",
        findings=(),
        notes=(),
        overview=(history_table(changes),),
        numbers=findings,
        nothing="The findings of each campaign are below.",
    )
    write_whole(file, rendered(contents, Reader(plays=False)))
