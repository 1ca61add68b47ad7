"""Reads `campaign.json` into records; content that no campaign writes is reported with its place in the file."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Self

from pydantic import TypeAdapter, ValidationError

from foresee_dsl.avoidance.anticipating import Answer, Anticipation
from foresee_dsl.avoidance.judge import Opinion
from foresee_dsl.avoidance.judges import AnyJudgement
from foresee_dsl.avoidance.r157.assessing import Preventability, Preventable
from foresee_dsl.avoidance.references import ReferenceRun
from foresee_dsl.avoidance.responsibility import Responsibility
from foresee_dsl.campaign.goal import GoalCounts
from foresee_dsl.campaign.records import CaseRunOutcome, ClipOutcome
from foresee_dsl.campaign.results import CampaignResult
from foresee_dsl.derive.minimise.outcome import Boundary
from foresee_dsl.documents import read_fields, read_record, shape
from foresee_dsl.errors import ForeseeError
from foresee_dsl.files import read_outside
from foresee_dsl.simulate.results.verdict import Verdict

JSON = "campaign.json"


@dataclass(frozen=True)
class WrittenMinimised:
    """A finding's minimised representative; files are relative to the campaign's folder."""

    file: str
    reason: str = ""
    sentence: str | None = None
    references: tuple[ReferenceRun, ...] = ()
    boundary: tuple[Boundary, ...] = ()


@dataclass(frozen=True)
class WrittenFinding:
    """A finding as the file states it: its story, and the answers of the judges about its representative.

    Older versions wrote neither a number nor a judgement.
    """

    name: str
    sentence: str
    class_: str
    verdict: Verdict
    test_case: str
    file: str | None
    family: str = ""
    number: int = 0
    judgement: Responsibility | None = None
    story: str = ""
    title: str = ""
    rate: str | None = None
    siblings: tuple[str, ...] = ()
    sibling_files: tuple[str, ...] = ()
    preventability: Preventable | None = None
    why: str | None = None
    anticipation: Answer | None = None
    anticipation_why: str | None = None
    opinions: tuple[Opinion, ...] = ()
    minimised: WrittenMinimised | None = None

    @classmethod
    def from_document(cls, data: Mapping[str, Any]) -> Self:
        """Return the finding that a JSON document states."""
        return cls(**read_fields(cls, {**data, "class_": data["class"]}))

    @property
    def judgements(self) -> tuple[AnyJudgement, ...]:
        """Return the answers of the judges, with their reasons but without their figures."""
        braking = (Preventability(self.preventability, self.why or ""),) if self.preventability is not None else ()
        ahead = (Anticipation(self.anticipation, self.anticipation_why or ""),) if self.anticipation is not None else ()
        return (*braking, *ahead, *self.opinions)


@dataclass(frozen=True)
class WrittenCampaign:
    """The result of a campaign; `findings` is None in a file of an older version, which did not group failures."""

    driver: str
    ranker: str = ""
    preset: str = ""
    settings: Mapping[str, Any] = field(default_factory=dict)
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
    test_cases: tuple[CaseRunOutcome, ...] = ()
    clip_runs: tuple[ClipOutcome, ...] = ()
    findings: tuple[WrittenFinding, ...] | None = None
    goal: GoalCounts | None = None


def read_campaign_folder(folder: Path) -> WrittenCampaign:
    """Return the content of a campaign's `campaign.json`.

    Raises:
        ForeseeError: the file is missing, or a campaign did not write it.
    """
    written, file = read_written(folder), folder / JSON
    if not written:
        raise ForeseeError(f"{file} does not exist: `foresee campaign PATH --out {folder}` writes it")
    try:
        return read_record(WrittenCampaign, written)
    except KeyError as err:
        raise ForeseeError(_lacks(file, err.args[0])) from err
    except (TypeError, ValueError) as err:
        raise ForeseeError(
            f"{file} was not written by a campaign of this version ({err}): run the campaign again"
        ) from err


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


def read_written(campaign: Path) -> dict[str, Any]:
    """Return the contents of a folder's `campaign.json`; {} if there is none.

    All values have the types that a campaign writes. Keys that an older version did not write may be missing; access as
    `data[key]` then raises.

    Raises:
        ForeseeError: it cannot be read, or a value is not one that a campaign writes.
    """
    file = campaign / JSON
    try:
        data = json.loads(read_outside(file, "results"), object_hook=lambda pairs: _Object(file, pairs))
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, RecursionError) as err:
        raise ForeseeError(f"{file} cannot be read: {err}") from err
    try:
        _written().validate_python(data)
    except ValidationError as err:
        wrong = next((problem for problem in err.errors() if problem["type"] != "missing"), None)
        if wrong is not None:
            where = ".".join(map(str, wrong["loc"])) or "the whole file"
            raise ForeseeError(
                f"{file} was not written by a campaign of this version ({where}: {wrong['msg']}): "
                "run the campaign again"
            ) from err
    return _Object(file, data)


class _Object(dict[str, Any]):
    """A JSON object of the file; access to a missing key raises an error that says what to do."""

    def __init__(self, file: Path, pairs: dict[str, Any]) -> None:
        super().__init__(pairs)
        self._file = file

    def __missing__(self, key: str) -> Any:  # noqa: ANN401 - it always raises
        raise ForeseeError(_lacks(self._file, key))


def _lacks(file: Path, key: str) -> str:
    return f"{file} lacks {key!r} where a campaign of this version writes it: run the campaign again"


@cache
def _written() -> TypeAdapter[Any]:
    return TypeAdapter(shape(CampaignResult))
