"""A study's folder: the store, the records of each campaign, and the tables, figures and page of results."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

from foresee_dsl.errors import ForeseeError
from foresee_dsl.files import read_outside, write_whole
from foresee_study.fuzzed import Fuzzed
from foresee_study.halves import Half
from foresee_study.measured import MeasuredCampaign
from foresee_study.settings import StudyCampaign, StudySettings

SCHEMA = 1
_KINDS = {"study campaign": MeasuredCampaign, "study fuzzing": Fuzzed}


@dataclass(frozen=True)
class Cost:
    """The cost of a question's last run.

    Attributes:
        wall_s: wall time, s; None if its campaigns were run in parts and joined. jobs: number of workers.
    """

    wall_s: float | None
    jobs: int


@dataclass(frozen=True)
class Record:
    """The content of `study.json`.

    Attributes:
        settings: settings of the last run. asked: the questions that were run, with their costs. notes: parts that were
            left out.
    """

    settings: StudySettings
    asked: dict[str, Cost] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class StudyFolder:
    """The files of a study, below the folder `at`."""

    at: Path

    @property
    def store(self) -> Path:
        """Return the store's folder, which is used unless `--store` names another one."""
        return self.at / "store"

    @property
    def tables(self) -> Path:
        """Return the folder of the tables as Markdown, CSV and LaTeX."""
        return self.at / "tables"

    @property
    def figures(self) -> Path:
        """Return the folder of the figures as SVG and PDF."""
        return self.at / "figures"

    @property
    def page(self) -> Path:
        """Return the path of the page with all results."""
        return self.at / "results.md"

    @property
    def fuzzed(self) -> Path:
        """Return the folder of DriveFuzz's results for rq4: a file for each driver, repetition and iteration."""
        return self.at / "fuzzed"

    @property
    def _measured(self) -> Path:
        return self.at / "measured"

    def keep(self, wanted: StudyCampaign, measured: MeasuredCampaign) -> None:
        """Write the record of a campaign."""
        _save(self._measured / f"{wanted.name}.json", "study campaign", measured, "cases")

    def campaigns(self) -> tuple[MeasuredCampaign, ...]:
        """Return the records of all campaigns, in the order of their files.

        Raises:
            ForeseeError: there are none, or one cannot be read.
        """
        files = sorted(self._measured.glob("*.json"))
        if not files:
            raise ForeseeError(f"there is no study in {self.at}: `foresee study rq1 --out {self.at}` begins one")
        return tuple(_load(file, "study campaign") for file in files)

    def keep_fuzzed(self, fuzzed: Fuzzed) -> None:
        """Write the result of DriveFuzz in one iteration."""
        _save(self.fuzzed / f"{fuzzed.name}.json", "study fuzzing", fuzzed, "seeds")

    def fuzzings(self) -> tuple[Fuzzed, ...]:
        """Return the results of DriveFuzz, in the order of the files."""
        return tuple(_load(file, "study fuzzing") for file in sorted(self.fuzzed.glob("*.json")))

    def write(self, record: Record) -> None:
        """Write `study.json`."""
        data = {"schema": SCHEMA, "document": "study", **asdict(record)}
        write_whole(self.at / "study.json", json.dumps(data, indent=2) + "\n")

    def read(self) -> Record:
        """Return the content of `study.json`.

        Raises:
            ForeseeError: there is none, or another version wrote it.
        """
        file = self.at / "study.json"
        if not file.is_file():
            raise ForeseeError(f"there is no study in {self.at}: `foresee study rq1 --out {self.at}` begins one")
        try:
            data: dict[str, Any] = json.loads(read_outside(file, "results"))
            values = data["settings"]
            lists = {name: tuple(value) for name, value in values.items() if isinstance(value, list)}
            settings = StudySettings(**{**values, **lists, "half": Half(values["half"])})
            costs = {name: Cost(**cost) for name, cost in data["asked"].items()}
            return Record(settings, costs, tuple(data["notes"]))
        except (ValueError, KeyError, TypeError) as err:
            raise ForeseeError(
                f"{file} is not a study that this version can read ({err}): run the study again"
            ) from err

    def noted(self, settings: StudySettings, costs: dict[str, Cost], notes: tuple[str, ...]) -> Record:
        """Add the costs of these questions to `study.json`; return its content."""
        try:
            before = self.read()
        except ForeseeError:
            before = Record(settings)
        record = replace(before, settings=settings, asked={**before.asked, **costs}, notes=notes)
        self.write(record)
        return record


def _save(file: Path, document: str, record: Any, rows: str) -> None:  # noqa: ANN401 - Measured or Fuzzed
    """Write a document with a line for each element of its field `rows`."""
    head = {"schema": SCHEMA, "document": document, **_adapter(document).dump_python(record, mode="json")}
    lines = ",\n".join(f"  {json.dumps(row, separators=(',', ':'))}" for row in head.pop(rows))
    write_whole(file, f'{json.dumps(head, indent=1)[:-2]},\n "{rows}": [\n{lines}\n ]\n}}\n')


def _load(file: Path, document: str) -> Any:  # noqa: ANN401 - Measured or Fuzzed
    """Read a document.

    Raises:
        ForeseeError: the file is not such a document, or has another version.
    """
    try:
        data = json.loads(read_outside(file, "results"))
        if (data.pop("schema", None), data.pop("document", None)) != (SCHEMA, document):
            raise ValueError("another kind of file")
        return _adapter(document).validate_python(data, strict=False)
    except ValueError as err:  # some of pydantic's errors are of this type
        why = type(err).__name__
        raise ForeseeError(
            f"{file} cannot be read ({why}): run the study again; the results of its runs are in the store"
        ) from err


@cache
def _adapter(document: str) -> Any:  # noqa: ANN401 - pydantic's own
    from pydantic import TypeAdapter

    return TypeAdapter(_KINDS[document])
