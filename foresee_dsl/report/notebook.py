"""What notebooks show: a test case as a picture, a run as a strip, a finding with its story and a playback."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path

from foresee_dsl.campaign.written import campaign_folders
from foresee_dsl.errors import ForeseeError
from foresee_dsl.files import templates
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.report.drawing.palette import BAD, GOOD
from foresee_dsl.report.drawing.svg import svg_of
from foresee_dsl.report.page.contents import Contents, contents_of
from foresee_dsl.report.page.entries import FindingEntry
from foresee_dsl.report.page.html import rendered
from foresee_dsl.report.page.runs import Reader
from foresee_dsl.report.picture.draw import draw
from foresee_dsl.report.show.strip import strip_svg
from foresee_dsl.report.terminal.tables import near_lines
from foresee_dsl.simulate.results.verdict import RunResult, Verdict
from foresee_dsl.story import tell

PLAYBACK_PX = 560
"""Height of a playback in a notebook, px. Ours: the scene with its curves, without scrolling."""


@dataclass(frozen=True)
class Playback:
    """The page of one finding, whose playback a notebook shows."""

    page: str = field(repr=False)

    def _repr_html_(self) -> str:
        return _rendered("playback", page=self.page, height=PLAYBACK_PX)

    def save(self, file: Path | str) -> None:
        """Write the page to a file, which a browser opens."""
        Path(file).write_text(self.page, encoding="utf-8")


@dataclass(frozen=True)
class Finding(FindingEntry):
    """A finding of a campaign's folder: its story (`title`, `runs[0].moments`), its judgement, and its runs.

    Attributes:
        folder: the campaign's folder. reader: has the playbacks of all findings of the folder.
    """

    folder: Path = field(default=Path("out"), kw_only=True)
    reader: Reader = field(default_factory=Reader, kw_only=True, repr=False, compare=False)

    @property
    def class_(self) -> str:
        """Return the class of the failure."""
        return self.record.class_

    @property
    def family(self) -> str:
        """Return the scenario family."""
        return self.record.family

    @property
    def test_case(self) -> str:
        """Return the address of the test case."""
        return self.record.test_case

    @property
    def rate(self) -> str:
        """Return how many runs fail if the driver is not deterministic: `7/10`; "" if it is."""
        return self.record.rate or ""

    def playback(self) -> Playback:
        """Return the finding's part of the report, with its playback."""
        contents = Contents(self.name, self.title, f"driver {self.driver}", (self,), ())
        return Playback(rendered(contents, self.reader.only(run.id for run in self.runs)))

    def _repr_html_(self) -> str:
        """Return the finding's story, judgement and strip."""
        run = self.runs[0]
        return _rendered("finding", finding=self, run=run, strip=self.reader.strip(run.outcome))


def read_findings(folder: Path) -> tuple[Finding, ...]:
    """Return the findings of a campaign's folder, in the order of reports; those of several drivers one after another.

    Raises:
        ForeseeError: the folder does not hold a campaign.
    """
    return tuple(finding for part in campaign_folders(folder) for finding in _findings(part))


def _findings(folder: Path) -> Sequence[Finding]:
    reader = Reader()
    return [
        Finding(
            **{entry.name: getattr(finding, entry.name) for entry in fields(FindingEntry)}, folder=folder, reader=reader
        )
        for finding in contents_of([folder], reader).findings
    ]


def html_of_case(case: TestCase) -> str:
    """Return a test case as HTML: its scene at the beginning, from above."""
    try:
        picture = svg_of(draw(case.id).sheet, scheme="light")
    except ForeseeError:  # it was built in memory, or its file has changed
        picture = ""
    return _rendered("case", case=case, picture=picture)


def html_of_run(result: RunResult) -> str:
    """Return a run as HTML: how it ended, what came nearest, and a strip of its moments."""
    strip, sentence = "", ""
    try:
        case = load_test_case(str(result.trace.meta.get("test_case", "")), check_pin=False)
        if case.meaning == result.trace.meta.get("meaning"):
            story = tell(result.trace, case)
            strip, sentence = strip_svg(result.trace, case, story), story.sentence
    except ForeseeError:  # as above
        pass
    colour = (GOOD if result.verdict is Verdict.PASS else BAD).light
    return _rendered(
        "run", result=result, colour=colour, near=near_lines(result.near_misses), sentence=sentence, strip=strip
    )


def _rendered(name: str, **values: object) -> str:
    return templates("notebook").get_template(f"{name}.html.j2").render(**values)
