"""Reads `campaign.json` into records; content that no campaign writes is reported with its place in the file."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from foresee_dsl.campaign.goal import GoalCounts
from foresee_dsl.campaign.records import CaseRunOutcome, ChildOutcome, ClipOutcome, WrittenFinding
from foresee_dsl.campaign.results import CampaignResult, breaking_only
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.documents import read_fields, shape
from foresee_dsl.errors import ForeseeError
from foresee_dsl.files import read_outside

JSON = "campaign.json"


@dataclass(frozen=True, kw_only=True)
class WrittenCampaign:
    """The result of a campaign as its `campaign.json` states it.

    Attributes:
        file: the file. findings: None in a file of an older version, which did not group failures.
    """

    file: Path
    driver: str
    ranker: str = ""
    preset: str = ""
    settings: CampaignSettings = field(default_factory=CampaignSettings)
    risky_points: int = 0
    clips: int = 0
    children: int = 0
    failures: Mapping[str, int] = field(default_factory=dict)
    preventability: Mapping[str, int] = field(default_factory=dict)
    anticipation: Mapping[str, int] = field(default_factory=dict)
    fidelity: Mapping[str, Any] = field(default_factory=dict)
    simulated_s: float = 0.0
    wall_s: float = 0.0
    interrupted: bool = False
    broken: tuple[str, ...] = ()
    deterministic: bool | None = None
    test_cases: tuple[CaseRunOutcome, ...]
    clip_runs: tuple[ClipOutcome, ...]
    findings: tuple[WrittenFinding, ...] | None = None
    goal: GoalCounts | None = None

    @property
    def within(self) -> float | None:
        """Return the share of the other actors in clips that stayed within 0.1 m of their places in the parent's run;
        None in a file of an older version.
        """
        share = self.fidelity.get("others", {}).get("within_0.1_m")
        return float(share) if share is not None else None

    @property
    def folder(self) -> Path:
        """Return the campaign's folder."""
        return self.file.parent

    @property
    def mutants(self) -> Iterator[ChildOutcome]:
        """Return the mutants of all clips."""
        return (child for clip in self.clip_runs for child in clip.children)

    @property
    def breaking(self) -> tuple[CaseRunOutcome | ChildOutcome, ...]:
        """Return the test cases and mutants that passed but broke an expectation."""
        return breaking_only(self.test_cases, self.mutants)

    @property
    def grouped(self) -> tuple[WrittenFinding, ...]:
        """Return the findings; `ForeseeError` if the file is of an older version, which did not group failures."""
        if self.findings is None:
            raise ForeseeError(_lacks(self.file, "findings"))
        return self.findings

    def require(self, finding: WrittenFinding, *keys: str) -> None:
        """Raise `ForeseeError` if the file is of an older version, which did not write these values of a finding."""
        if lacking := next((key for key in keys if not getattr(finding, key)), None):
            raise ForeseeError(_lacks(self.file, lacking))


def read_campaign_folder(folder: Path) -> WrittenCampaign:
    """Return the content of a campaign's `campaign.json`.

    Raises:
        ForeseeError: the file is missing, or a campaign did not write it.
    """
    campaign = read_campaign_file(folder / JSON)
    if campaign is None:
        raise ForeseeError(f"{folder / JSON} does not exist: `foresee campaign PATH --out {folder}` writes it")
    return campaign


def campaign_folders(folder: Path) -> tuple[Path, ...]:
    """Return the folders of campaigns in a folder: the folder itself, or one for each driver of a campaign with
    several.

    Raises:
        ForeseeError: it contains no campaign.
    """
    if (folder / JSON).is_file():
        return (folder,)
    below = tuple(sorted(file.parent for file in folder.glob(f"*/{JSON}")))
    if not below:
        raise ForeseeError(f"there is no {JSON} in {folder}: `foresee campaign PATH --out {folder}` writes it")
    return below


def read_campaign_file(file: Path) -> WrittenCampaign | None:
    """Return the content of a `campaign.json`; None if the file does not exist.

    Raises:
        ForeseeError: it cannot be read, or a campaign did not write it.
    """
    try:
        text = read_outside(file, "results")
    except FileNotFoundError:
        return None
    except OSError as err:
        raise ForeseeError(f"{file} cannot be read: {err}") from err
    try:
        data = _written().validate_json(text)
    except ValidationError:
        data = _older(file, text)
    try:
        return WrittenCampaign(**{**read_fields(WrittenCampaign, data | {"file": ""}), "file": file})
    except KeyError as err:
        raise ForeseeError(_lacks(file, err.args[0])) from err
    except (TypeError, ValueError) as err:
        raise ForeseeError(_other_version(file, str(err))) from err


def _older(file: Path, text: bytes) -> dict[str, Any]:
    """Return the content of a `campaign.json` that may lack keys, because an older version wrote it.

    Raises:
        ForeseeError: it is not JSON, or a value has not the type that a campaign writes.
    """
    try:
        data: dict[str, Any] = json.loads(text)
    except (ValueError, RecursionError) as err:
        raise ForeseeError(f"{file} cannot be read: {err}") from err
    try:
        _written().validate_python(data)
    except ValidationError as err:
        wrong = next((problem for problem in err.errors() if problem["type"] != "missing"), None)
        if wrong is not None:
            where = ".".join(map(str, wrong["loc"])) or "the whole file"
            raise ForeseeError(_other_version(file, f"{where}: {wrong['msg']}")) from err
    return data


def _lacks(file: Path, key: str) -> str:
    return f"{file} lacks {key!r} where a campaign of this version writes it: run the campaign again"


def _other_version(file: Path, why: str) -> str:
    return f"{file} was not written by a campaign of this version ({why}): run the campaign again"


@cache
def _written() -> TypeAdapter[Any]:
    return TypeAdapter(shape(CampaignResult))
