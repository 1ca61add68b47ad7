"""What a finished campaign's folder says of itself: `campaign.json`, read back."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from foresee_dsl.campaign.findings.written import JSON, read_written
from foresee_dsl.errors import ForeseeError


class _Part(BaseModel):
    """A part of the file; what this version does not know is left out."""

    model_config = ConfigDict(extra="ignore", frozen=True, populate_by_name=True)


class Preventability(_Part):
    """Whether a careful driver would have avoided a failure."""

    verdict: str
    why: str = ""


class Anticipation(_Part):
    """Whether a driver who anticipates would have prevented a failure, and by what."""

    answer: str
    why: str = ""


class Nearest(_Part):
    """A near miss: how near, when, and to whom."""

    value: float | None
    time_s: float
    with_: str = Field("", alias="with")


class Reference(_Part):
    """A failing mutant or test case, driven by another driver."""

    driver: str
    verdict: str
    reason: str = ""
    before_mutation: str | None = None
    avoids: bool = False
    how: tuple[str, ...] = ()


class Child(_Part):
    """A mutant as it was run; `file` where it failed, relative to the campaign's folder."""

    mutant: str
    operators: tuple[str, ...] = ()
    verdict: str
    broken_expectations: tuple[str, ...] = ()
    with_: str = Field("", alias="with")
    reason: str = ""
    file: str | None = None
    near_misses: dict[str, Nearest | None] | None = None
    preventability: Preventability | None = None
    anticipation: Anticipation | None = None
    references: tuple[Reference, ...] = ()
    round: int | None = None
    drawn_near: str | None = None


class ClipRun(_Part):
    """A clip as it was run, with its children."""

    clip: str
    test_case: str
    verdict: str
    children: tuple[Child, ...] = ()


class CaseRun(_Part):
    """A test case as it was run."""

    test_case: str
    family: str = ""
    verdict: str
    broken_expectations: tuple[str, ...] = ()
    reason: str = ""
    duration_s: float = 0.0
    risky_points: int = 0
    near_misses: dict[str, Nearest | None] | None = None
    preventability: Preventability | None = None
    anticipation: Anticipation | None = None
    references: tuple[Reference, ...] = ()
    trace: str | None = None


class Tried(_Part):
    """A value that was run at the boundary: it passes, fails, or ends otherwise."""

    value: float
    ended: str
    reason: str = ""


class Boundary(_Part):
    """Where a changed number begins to fail."""

    change: str
    unit: str = ""
    sentence: str = ""
    tried: tuple[Tried, ...] = ()


class Minimised(_Part):
    """A finding's representative, made smaller; files relative to the campaign's folder."""

    file: str
    reason: str = ""
    preventability: str | None = None
    anticipation: str | None = None
    references: tuple[Reference, ...] = ()
    boundary: tuple[Boundary, ...] = ()


class Finding(_Part):
    """Failures that tell one story."""

    name: str
    sentence: str
    class_: str = Field(alias="class")
    verdict: str
    test_case: str
    family: str = ""
    file: str
    siblings: tuple[str, ...] = ()
    sibling_files: tuple[str, ...] = ()
    preventability: str | None = None
    anticipation: str | None = None
    minimised: Minimised | None = None


class Campaign(_Part):
    """A campaign's result; `findings` is None in a file of a version that had none."""

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
    test_cases: tuple[CaseRun, ...] = ()
    clip_runs: tuple[ClipRun, ...] = ()
    findings: tuple[Finding, ...] | None = None


def read_campaign_folder(folder: Path) -> Campaign:
    """Read a campaign's `campaign.json`.

    Raises:
        ForeseeError: there is none, or it is not what a campaign writes.
    """
    file = folder / JSON
    written = read_written(folder)
    if not written:
        raise ForeseeError(f"{file} is not there: `foresee campaign PATH --out {folder}` writes it")
    try:
        return Campaign.model_validate(written)
    except ValidationError as err:
        first = err.errors()[0]
        where = ".".join(map(str, first["loc"])) or "the file"
        raise ForeseeError(
            f"{file} is not what a campaign writes ({where}: {first['msg']}): run the campaign again"
        ) from err


def campaign_folders(folder: Path) -> tuple[Path, ...]:
    """Return the campaigns under a folder: itself, or those of a campaign's file with several drivers.

    Raises:
        ForeseeError: there is none.
    """
    if (folder / "campaign.json").is_file():
        return (folder,)
    below = tuple(sorted(file.parent for file in folder.glob("*/campaign.json")))
    if not below:
        raise ForeseeError(f"there is no campaign.json in {folder}: `foresee campaign PATH --out {folder}` writes it")
    return below
