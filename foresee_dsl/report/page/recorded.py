"""Reads `campaign.json` in the folder of a finished campaign."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from foresee_dsl.campaign.findings.written import JSON, read_written
from foresee_dsl.errors import ForeseeError


class _Part(BaseModel):
    """A part of the file. Keys that this version does not know are ignored."""

    model_config = ConfigDict(extra="ignore", frozen=True, populate_by_name=True)


class Preventability(_Part):
    """The judgement whether a careful driver would have avoided a failure."""

    verdict: str
    why: str = ""


class Anticipation(_Part):
    """The judgement whether an anticipating driver would have prevented a failure, and how."""

    answer: str
    why: str = ""


class Nearest(_Part):
    """A near miss: the value of its measure, its time and the other actor."""

    value: float | None
    time_s: float
    with_: str = Field("", alias="with")


class Reference(_Part):
    """The run of a failing mutant or test case with another driver."""

    driver: str
    verdict: str
    reason: str = ""
    before_mutation: str | None = None
    avoids: bool = False
    how: tuple[str, ...] = ()
    apart: str | None = None


class _Run(_Part):
    """The facts that a campaign records of each run that it judges."""

    verdict: str
    broken_expectations: tuple[str, ...] = ()
    reason: str = ""
    near_misses: dict[str, Nearest | None] | None = None
    preventability: Preventability | None = None
    anticipation: Anticipation | None = None
    references: tuple[Reference, ...] = ()


class ChildRun(_Run):
    """A run of a mutant; `file`: the mutant's file in the campaign's folder, if the run failed."""

    mutant: str
    operators: tuple[str, ...] = ()
    file: str | None = None
    round: int | None = None
    drawn_near: str | None = None


class ClipRun(_Part):
    """A run of a clip, with the runs of its children."""

    clip: str
    test_case: str
    verdict: str
    children: tuple[ChildRun, ...] = ()


class CaseRun(_Run):
    """A run of a test case."""

    test_case: str
    family: str = ""
    risky_points: int = 0
    trace: str | None = None


class BoundaryRun(_Part):
    """A run near the boundary of a failure: the value of the changed number, and whether the run passes, fails, or ends
    otherwise.
    """

    value: float
    ended: str
    reason: str = ""


class Boundary(_Part):
    """The value of a changed number from which on the run fails."""

    change: str
    unit: str = ""
    sentence: str = ""
    tried: tuple[BoundaryRun, ...] = ()


class Minimised(_Part):
    """A finding's minimised representative; files are relative to the campaign's folder."""

    file: str
    reason: str = ""
    sentence: str | None = None
    preventability: str | None = None
    anticipation: str | None = None
    references: tuple[Reference, ...] = ()
    boundary: tuple[Boundary, ...] = ()


class Judgement(_Part):
    """The judgement on a finding: whose failure it is, as a word and in words, and why."""

    word: str = ""
    text: str = ""
    reason: str = ""


NO_JUDGEMENT = Judgement()


class Finding(_Part):
    """Failures with the same story. Older versions wrote neither a number nor a judgement."""

    number: int = 0
    judgement: Judgement = NO_JUDGEMENT

    name: str
    story: str = ""
    title: str = ""
    rate: str | None = None
    sentence: str
    class_: str = Field(alias="class")
    verdict: str
    test_case: str
    family: str = ""
    file: str
    siblings: tuple[str, ...] = ()
    sibling_files: tuple[str, ...] = ()
    preventability: str | None = None
    why: str | None = None
    anticipation: str | None = None
    anticipation_why: str | None = None
    minimised: Minimised | None = None


class GoalCounts(_Part):
    """How many runs break the goal of a campaign."""

    name: str
    children: int = 0
    findings: int = 0
    others: int = 0


class Campaign(_Part):
    """The result of a campaign; `findings` is None in a file of an older version, which did not group failures."""

    driver: str
    ranker: str = ""
    preset: str = ""
    settings: dict[str, Any] = {}
    risky_points: int = 0
    clips: int = 0
    children: int = 0
    failures: dict[str, int] = {}
    preventability: dict[str, int] = {}
    anticipation: dict[str, int] = {}
    fidelity: dict[str, Any] = {}
    simulated_s: float = 0.0
    wall_s: float = 0.0
    interrupted: bool = False
    broken: tuple[str, ...] = ()
    deterministic: bool | None = None
    test_cases: tuple[CaseRun, ...] = ()
    clip_runs: tuple[ClipRun, ...] = ()
    findings: tuple[Finding, ...] | None = None
    goal: GoalCounts | None = None


def read_campaign_folder(folder: Path) -> Campaign:
    """Return the content of a campaign's `campaign.json`.

    Raises:
        ForeseeError: the file is missing, or a campaign did not write it.
    """
    file = folder / JSON
    written = read_written(folder)
    if not written:
        raise ForeseeError(f"{file} does not exist: `foresee campaign PATH --out {folder}` writes it")
    try:
        return Campaign.model_validate(written)
    except ValidationError as err:
        first = err.errors()[0]
        where = ".".join(map(str, first["loc"])) or "the file"
        raise ForeseeError(
            f"{file} was not written by a campaign of this version ({where}: {first['msg']}): run the campaign again"
        ) from err


def campaign_folders(folder: Path) -> tuple[Path, ...]:
    """Return the folders of campaigns in a folder: the folder itself, or one for each driver of a campaign with
    several.

    Raises:
        ForeseeError: it contains no campaign.
    """
    if (folder / "campaign.json").is_file():
        return (folder,)
    below = tuple(sorted(file.parent for file in folder.glob("*/campaign.json")))
    if not below:
        raise ForeseeError(f"there is no campaign.json in {folder}: `foresee campaign PATH --out {folder}` writes it")
    return below
