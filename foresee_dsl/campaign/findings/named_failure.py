"""Finds the failure that a command names: a finding or mutant of a campaign by name, or a mutant's file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from foresee_dsl.campaign.driving import DriverSetup, recorded_setup
from foresee_dsl.campaign.records import JudgedRun, WrittenFinding
from foresee_dsl.campaign.written import JSON, WrittenCampaign, read_campaign_file
from foresee_dsl.errors import ForeseeError, with_article
from foresee_dsl.files import absolute
from foresee_dsl.helps import Help
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.project.addresses import is_file, kind_of
from foresee_dsl.simulate.results.verdict import Verdict


@dataclass(frozen=True)
class NamedFailure:
    """A failure in its original form.

    Attributes:
        name: name of the mutant or test case. file: its file before minimisation; for a test case its address.
        campaign: its campaign, or None.
        child: True for a mutant (or clip), False for a test case that fails without mutation.
    """

    name: str
    file: Path
    campaign: WrittenCampaign | None = field(default=None, repr=False)
    child: bool = True

    @property
    def store(self) -> Path | None:
        """Return the store of its campaign; None without a campaign."""
        folder = self.campaign.folder / "store" if self.campaign is not None else None
        return folder if folder is not None and (folder / "runs.sqlite").is_file() else None

    @property
    def finding(self) -> WrittenFinding | None:
        """Return the finding to which the failure belongs."""
        others = (finding for finding in _findings(self.campaign) if self.name in finding.siblings)
        return self._own_finding or next(others, None)

    @property
    def minimised(self) -> Path | None:
        """Return the file of its minimised form, or None."""
        file = self.campaign.folder / "findings" / self.name / self.file.name if self.campaign is not None else None
        return file if file is not None and is_file(file) else None

    @property
    def sentence(self) -> str:
        """Return the failure's story in a sentence; "" without a campaign."""
        if self._own is not None and self._own.story is not None:
            return self._own.story.sentence
        return self._own_finding.sentence if self._own_finding is not None else ""

    @property
    def sentence_minimised(self) -> str:
        """Return the story of the minimised form in a sentence; "" without a campaign."""
        small = self._own_finding.minimised if self._own_finding is not None else None
        return (small.sentence if small is not None else "") or ""

    @property
    def reason(self) -> str:
        """Return how its run ended; "" without a campaign."""
        return self._own.reason if self._own is not None else ""

    @property
    def breaks_only_expectation(self) -> bool:
        """Return whether its run passed but for a broken expectation, so that it belongs to no finding."""
        return self._own is not None and self._own.verdict is Verdict.PASS and bool(self._own.broken_expectations)

    def setup(self, case: TestCase) -> DriverSetup:
        """Return the driver and seed of its run. A mutant's file records them; for a test case that fails as it is
        written they are those of the campaign.

        Args:
            case: its loaded file.
        """
        if case.mutant is not None or self.campaign is None:
            return recorded_setup(case)
        return DriverSetup(self.campaign.settings.driver, self.campaign.settings.seed)

    @property
    def _own(self) -> JudgedRun | None:
        if self.campaign is None:
            return None
        own = (run for run in self.campaign.mutants if self.child and run.name == self.name)
        return next(own, next((run for run in self.campaign.test_cases if run.id == str(self.file)), None))

    @property
    def _own_finding(self) -> WrittenFinding | None:
        return next((finding for finding in _findings(self.campaign) if finding.name == self.name), None)


def find_failure(
    wanted: str, campaign: Path, *, tests: bool = False, written: WrittenCampaign | None = None
) -> NamedFailure:
    """Return the failure of this name, number of a finding, or file.

    Args:
        campaign: folder in which names are looked up. tests: also accept a test case that fails without mutation.
        written: the campaign in the folder, if it was read already.

    Raises:
        ForeseeError: there is no failure of that name, or it is not a mutant.
    """
    path = Path(wanted)
    if is_file(path):
        return _by_file(path)
    written = written or read_campaign_file(campaign / JSON)
    if wanted.isdecimal():
        wanted = _name_of(int(wanted), written, campaign)
    children = {child.name: child.file for child in written.mutants if child.file} if written is not None else {}
    if wanted in children:
        return NamedFailure(wanted, campaign / children[wanted], written)
    others = {name: file for finding in _findings(written) for name, file in _files_of(finding) if name not in children}
    if wanted in others:
        if tests:
            return NamedFailure(wanted, Path(others[wanted]), written, child=False)
        raise ForeseeError(f"{wanted} is a test case that fails as it is written: there is no mutation to minimise")
    if written is None:
        raise ForeseeError(
            f"there is no file {wanted!r}, and no campaign in {campaign} with a finding of that name (write the "
            "campaign's folder with `--campaign OUT`)"
        )
    names = sorted({*children, *others})
    hint = did_you_mean(wanted, names) if names else "that campaign found no failure"
    raise ForeseeError(f"there is no file {wanted!r}, and no finding of that name in {campaign}: {Help.of(hint).text}")


def _name_of(number: int, written: WrittenCampaign | None, campaign: Path) -> str:
    """Return the name of the finding with a number."""
    findings = _findings(written)
    for finding in findings:
        if written is not None:
            written.require(finding, "number")
        if finding.number == number:
            return finding.name
    has = (
        f"has findings 1 to {len(findings)}"
        if findings
        else "has no findings (`--campaign OUT` chooses another folder)"
    )
    raise ForeseeError(f"there is no finding {number}: the campaign in {campaign} {has}")


def _by_file(path: Path) -> NamedFailure:
    kind = kind_of(path)
    if kind != "mutant":
        what = with_article(kind) if kind else "no definition"
        raise ForeseeError(f"{path} contains {what}, not a mutant: write a mutant's file, or a finding of a campaign")
    above = next((folder for folder in absolute(path).parents if is_file(folder / JSON)), None)
    campaign = read_campaign_file(above / JSON) if above is not None else None
    mutants = campaign.mutants if campaign is not None else ()
    child = next((child for child in mutants if child.name == path.stem and child.file), None)
    if above is None or child is None:
        return NamedFailure(path.stem, path)
    # A file in `findings` is already minimised: return the mutant that it was made from.
    own = above / child.file
    inside = absolute(path).parent in (absolute(own).parent, absolute(above / "findings" / path.stem))
    return NamedFailure(path.stem, own, campaign) if inside else NamedFailure(path.stem, path)


def _findings(campaign: WrittenCampaign | None) -> tuple[WrittenFinding, ...]:
    return (campaign.findings if campaign is not None else None) or ()


def _files_of(finding: WrittenFinding) -> Iterator[tuple[str, str]]:
    yield finding.name, finding.file
    yield from zip(finding.siblings, finding.sibling_files, strict=False)
