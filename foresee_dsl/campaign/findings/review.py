"""Collects the data for a review of a finding: the story, the changes, the boundary, and the mutations that passed."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

from foresee_dsl.campaign.findings.diagnosing import diagnosis_of
from foresee_dsl.campaign.findings.named_failure import NamedFailure
from foresee_dsl.campaign.findings.sureness import Sureness, sureness_of
from foresee_dsl.campaign.goal import only_expectation
from foresee_dsl.campaign.records import ChildOutcome, WrittenFinding
from foresee_dsl.campaign.triage.standing import standing_of_written
from foresee_dsl.campaign.written import WrittenCampaign
from foresee_dsl.documents import or_null, where_set
from foresee_dsl.drivers.consent import is_program
from foresee_dsl.errors import ForeseeError
from foresee_dsl.simulate.results.verdict import Verdict


@dataclass(frozen=True)
class Review:
    """A finding with all data that a reviewer needs.

    Attributes:
        asked: the requested name, which may be that of a sibling. others: the other mutations of its clip.
        diagnosis: which part of the driver causes the failure, in words; "" before `foresee diagnose`.
    """

    campaign: WrittenCampaign
    finding: WrittenFinding
    asked: str
    others: tuple[ChildOutcome, ...]
    diagnosis: str = ""
    sure: Sureness | None = None
    """How sure the failure is; None before `foresee sure` was run."""
    standing: str = ""
    """Whether the finding is new since the previous campaign, and how it was triaged, in words."""
    why: str = ""
    """Why its mutant was made, in a sentence; "" if the campaign records no reason."""

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "finding": self.finding,
            "asked": self.asked,
            "others": [
                {
                    "name": other.name,
                    "changes": other.changes,
                    "verdict": other.verdict,
                    "reason": other.reason,
                    "margins": other.near,
                }
                for other in self.others
            ],
            "withstood": self.withstood,
            "files": {"as_found": self.as_found, "to_look_at": self.file},
            "commands": self.command_lines,
            "diagnosis": or_null(self.diagnosis),
            "sure": self.sure,
            "standing": or_null(self.standing),
            "why": where_set(self.why),
        }

    @property
    def withstood(self) -> tuple[str, ...]:
        """Return the names of the mutations that the driver passed."""
        return tuple(mutation.name for mutation in self.others if mutation.verdict is Verdict.PASS)

    @property
    def as_found(self) -> str:
        """Return the representative's file before minimisation."""
        return self.finding.file

    @property
    def file(self) -> str:
        """Return the file to inspect: the minimised one if it exists."""
        if self.finding.clip is None:
            return self.finding.file
        return (self.campaign.folder / (self.finding.minimised or self.finding).file).as_posix()

    @property
    def commands(self) -> tuple[tuple[str, str], ...]:
        """Return the next steps for the user: the description and the command of each."""
        settings, folder, name = self.campaign.settings, self.campaign.folder, self.finding.name
        driver = f" --driver {shlex.quote(settings.driver)}" if settings.driver != "pdm" else ""
        seed = f" --seed {settings.seed}" if settings.seed else ""
        file = shlex.quote(self.file)
        recorded = f"{driver}{seed}" if self.finding.clip is None else ""  # a mutant's file records them
        next_steps = [
            ("watch it", f"foresee show {file}{recorded}"),
            ("drive it", f"foresee run {file}{driver}{seed}"),
        ]
        if self.finding.clip is not None:
            out = f" --campaign {shlex.quote(str(folder))}" if folder != Path("out") else ""
            consent = " --run-programs" if is_program(settings.driver) else ""
            next_steps.append(("check that it still fails", f"foresee verify {file}{consent}"))
            next_steps.append(("see how sure it is", f"foresee sure {name}{out}{consent}"))
            next_steps.append(("get it unreduced", f"foresee minimise {name}{out} --full --out unreduced"))
        return tuple(next_steps)

    @property
    def command_lines(self) -> tuple[str, ...]:
        """Return the commands without descriptions."""
        return tuple(command for _, command in self.commands)


def review_of(wanted: NamedFailure) -> Review:
    """Return the review of a finding.

    Raises:
        ForeseeError: no campaign has such a finding.
    """
    campaign, finding = wanted.campaign, wanted.finding
    if wanted.breaks_only_expectation and finding is None:
        raise ForeseeError(only_expectation(wanted.name, wanted.reason, "reviewed"))
    if campaign is None or finding is None:
        raise ForeseeError(
            f"{wanted.file} does not belong to a finding of a campaign: `foresee minimise` shows where it fails"
        )
    campaign.require(finding, "number", "title", "judgement")
    clip = Path(finding.clip).stem if finding.clip else ""
    children = [child for run in campaign.clip_runs if run.name == clip for child in run.children]
    own = next((child for child in children if child.name == finding.name), None)
    reason = _reason_of(wanted, campaign, finding)
    return Review(
        campaign=campaign,
        finding=finding,
        asked=wanted.name,
        others=tuple(child for child in children if child.name != finding.name),
        diagnosis=diagnosis_of(campaign.folder, finding.name, reason),
        sure=sureness_of(campaign.folder, finding.name, reason),
        standing=standing_of_written(campaign).words(finding.story),
        why=own.why if own is not None else "",
    )


def _reason_of(wanted: NamedFailure, campaign: WrittenCampaign, finding: WrittenFinding) -> str:
    """Return how the run of a finding ended; all statements about the finding describe this run."""
    if finding.minimised is not None and wanted.minimised is not None:
        return finding.minimised.reason
    mutants = (run.reason for run in campaign.mutants if run.name == finding.name)
    tests = (run.reason for run in campaign.test_cases if run.id == finding.file)
    return next(chain(mutants, tests), "")
