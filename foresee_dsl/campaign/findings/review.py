"""Collects the data for a review of a finding: the story, the changes, the boundary, and the mutations that passed."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from foresee_dsl.campaign.findings.diagnosing import diagnosis_of
from foresee_dsl.campaign.findings.named_failure import NamedFailure
from foresee_dsl.campaign.findings.sureness import Sureness, sureness_of
from foresee_dsl.campaign.triage.standing import standing_of_written
from foresee_dsl.documents import or_null, where_set
from foresee_dsl.errors import ForeseeError


@dataclass(frozen=True)
class Mutation:
    """One mutation of the finding's clip. `margins`: its near misses by measure, as in `campaign.json`."""

    name: str
    changes: tuple[str, ...]
    verdict: str
    reason: str
    margins: Mapping[str, Mapping[str, Any] | None]

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "name": self.name,
            "changes": self.changes,
            "verdict": self.verdict,
            "reason": self.reason,
            "margins": or_null(self.margins),
        }


@dataclass(frozen=True)
class Review:
    """A finding with all data that a reviewer needs.

    Attributes:
        finding: its entry in `campaign.json`. asked: the requested name, which may be that of a sibling.
        others: the other mutations of its clip. driver, seed: those of the campaign. campaign: its folder. diagnosis:
            which part of the driver causes the failure, in words; "" before `foresee diagnose`.
    """

    finding: Mapping[str, Any]
    asked: str
    others: tuple[Mutation, ...]
    driver: str
    seed: int
    campaign: Path
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
            "others": self.others,
            "withstood": self.withstood,
            "files": {"as_found": self.as_found, "to_look_at": self.file},
            "commands": self.command_lines,
            "diagnosis": or_null(self.diagnosis),
            "sure": self.sure,
            "standing": or_null(self.standing),
            "why": where_set(self.why),
        }

    @property
    def minimised(self) -> Mapping[str, Any] | None:
        """Return the minimised representative; None for a test case, or before minimisation."""
        record: Mapping[str, Any] | None = self.finding.get("minimised")
        return record

    @property
    def withstood(self) -> tuple[str, ...]:
        """Return the names of the mutations that the driver passed."""
        return tuple(mutation.name for mutation in self.others if mutation.verdict == "pass")

    @property
    def as_found(self) -> str:
        """Return the representative's file before minimisation."""
        return str(self.finding["file"])

    @property
    def file(self) -> str:
        """Return the file to inspect: the minimised one if it exists."""
        if self.finding.get("clip") is None:
            return str(self.finding["file"])
        return (self.campaign / str((self.minimised or self.finding)["file"])).as_posix()

    @property
    def commands(self) -> tuple[tuple[str, str], ...]:
        """Return the next steps for the user: the description and the command of each."""
        mutant = self.finding.get("clip") is not None
        driver = f" --driver {shlex.quote(self.driver)}" if self.driver != "pdm" else ""
        seed = f" --seed {self.seed}" if self.seed else ""
        file = shlex.quote(self.file)
        next_steps = [("watch it", f"foresee show {file}"), ("drive it", f"foresee run {file}{driver}{seed}")]
        if mutant:
            out = f" --campaign {shlex.quote(str(self.campaign))}" if self.campaign != Path("out") else ""
            next_steps.append(("check that it still fails", f"foresee verify {file}"))
            next_steps.append(("see how sure it is", f"foresee sure {self.finding['name']}{out}"))
            next_steps.append(
                ("get it unreduced", f"foresee minimise {self.finding['name']}{out} --full --out unreduced")
            )
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
    finding = wanted.finding
    if wanted.campaign is None or finding is None:
        raise ForeseeError(
            f"{wanted.file} does not belong to a finding of a campaign: `foresee minimise` shows where it fails"
        )
    settings = wanted.data.get("settings", {})
    clip = Path(str(finding["clip"])).stem if finding.get("clip") else ""
    runs = (run["children"] for run in wanted.data.get("clip_runs", ()) if run["clip"] == clip)
    children = [child for of_clip in runs for child in of_clip]
    others = (child for child in children if child["mutant"] != finding["name"])
    reason = _reason_of(wanted, finding)
    return Review(
        finding=finding,
        asked=wanted.name,
        others=tuple(
            Mutation(child["mutant"], tuple(child.get("changes", ())), child["verdict"], child["reason"],
                     child.get("near_misses") or {})
            for child in others
        ),
        driver=str(settings.get("driver", "pdm")),
        seed=int(settings.get("seed", 0)),
        campaign=wanted.campaign,
        diagnosis=diagnosis_of(wanted.campaign, str(finding["name"]), reason),
        sure=sureness_of(wanted.campaign, str(finding["name"]), reason),
        standing=standing_of_written(wanted.data, wanted.campaign).words(str(finding.get("story", ""))),
        why=next((str(child.get("why", "")) for child in children if child["mutant"] == finding["name"]), ""),
    )  # fmt: skip


def _reason_of(wanted: NamedFailure, finding: Mapping[str, Any]) -> str:
    """Return how the run of a finding ended; all statements about the finding describe this run."""
    small = finding.get("minimised")
    if small and wanted.minimised is not None:
        return str(small["reason"])
    runs = (child for clip in wanted.data.get("clip_runs", ()) for child in clip["children"])
    mutants = (run for run in runs if run["mutant"] == finding["name"])
    tests = (run for run in wanted.data.get("test_cases", ()) if run["test_case"] == finding["file"])
    return next((str(run["reason"]) for run in (*mutants, *tests)), "")
