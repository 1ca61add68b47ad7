"""A study's folder: the store, what is kept of each campaign, and what is written for people."""

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
from foresee_study.measured import Measured
from foresee_study.settings import StudySettings, Wanted

SCHEMA = 1
_KINDS = {"study campaign": Measured, "study fuzzing": Fuzzed}


@dataclass(frozen=True)
class Took:
    """What a question cost when it was last asked.

    Attributes:
        wall_s: None where its campaigns were run one by one, and joined. jobs: the number of workers.
    """

    wall_s: float | None
    jobs: int


@dataclass(frozen=True)
class Record:
    """What `study.json` holds.

    Attributes:
        settings: of the last run. asked: the questions that were asked, with what they took. notes: what was left out.
    """

    settings: StudySettings
    asked: dict[str, Took] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class StudyFolder:
    """Where everything of a study is."""

    at: Path

    @property
    def store(self) -> Path:
        """The store, where `--store` names no other."""
        return self.at / "store"

    @property
    def tables(self) -> Path:
        """Tables as Markdown, CSV and LaTeX."""
        return self.at / "tables"

    @property
    def figures(self) -> Path:
        """Figures as SVG and PDF."""
        return self.at / "figures"

    @property
    def page(self) -> Path:
        """All of it as one page."""
        return self.at / "results.md"

    @property
    def fuzzed(self) -> Path:
        """What DriveFuzz did, of rq4: a file for each driver, repetition and iteration."""
        return self.at / "fuzzed"

    @property
    def _measured(self) -> Path:
        return self.at / "measured"

    def keep(self, wanted: Wanted, measured: Measured) -> None:
        """Write what a campaign gave."""
        _save(self._measured / f"{wanted.name}.json", "study campaign", measured, "cases")

    def campaigns(self) -> tuple[Measured, ...]:
        """Return what all its campaigns gave, in the order of their files.

        Raises:
            ForeseeError: there are none, or one cannot be read.
        """
        files = sorted(self._measured.glob("*.json"))
        if not files:
            raise ForeseeError(f"there is no study in {self.at}: `foresee study rq1 --out {self.at}` makes one")
        return tuple(_load(file, "study campaign") for file in files)

    def keep_fuzzed(self, found: Fuzzed) -> None:
        """Write what DriveFuzz did in one iteration."""
        _save(self.fuzzed / f"{found.name}.json", "study fuzzing", found, "seeds")

    def fuzzings(self) -> tuple[Fuzzed, ...]:
        """Return what DriveFuzz did, in the order of the files."""
        return tuple(_load(file, "study fuzzing") for file in sorted(self.fuzzed.glob("*.json")))

    def write(self, record: Record) -> None:
        """Write `study.json`."""
        data = {"schema": SCHEMA, "document": "study", **asdict(record)}
        write_whole(self.at / "study.json", json.dumps(data, indent=2) + "\n")

    def read(self) -> Record:
        """Return what `study.json` holds.

        Raises:
            ForeseeError: there is none, or another version wrote it.
        """
        file = self.at / "study.json"
        if not file.is_file():
            raise ForeseeError(f"there is no study in {self.at}: `foresee study rq1 --out {self.at}` makes one")
        try:
            data: dict[str, Any] = json.loads(read_outside(file, "results"))
            given = data["settings"]
            lists = {name: tuple(value) for name, value in given.items() if isinstance(value, list)}
            settings = StudySettings(**{**given, **lists, "half": Half(given["half"])})
            asked = {name: Took(**took) for name, took in data["asked"].items()}
            return Record(settings, asked, tuple(data["notes"]))
        except (ValueError, KeyError, TypeError) as err:
            raise ForeseeError(f"{file} is no study that this version reads ({err}): run the study again") from err

    def noted(self, settings: StudySettings, asked: dict[str, Took], notes: tuple[str, ...]) -> Record:
        """Write, and return, what was asked now beside what was asked before."""
        try:
            before = self.read()
        except ForeseeError:
            before = Record(settings)
        record = replace(before, settings=settings, asked={**before.asked, **asked}, notes=notes)
        self.write(record)
        return record


def _save(file: Path, document: str, found: Any, rows: str) -> None:  # noqa: ANN401 - Measured or Fuzzed
    """Write a document with a line for each element of its field `rows`."""
    head = {"schema": SCHEMA, "document": document, **_adapter(document).dump_python(found, mode="json")}
    lines = ",\n".join(f"  {json.dumps(row, separators=(',', ':'))}" for row in head.pop(rows))
    write_whole(file, f'{json.dumps(head, indent=1)[:-2]},\n "{rows}": [\n{lines}\n ]\n}}\n')


def _load(file: Path, document: str) -> Any:  # noqa: ANN401 - Measured or Fuzzed
    """Read a document.

    Raises:
        ForeseeError: it is none, or another version's.
    """
    try:
        data = json.loads(read_outside(file, "results"))
        if (data.pop("schema", None), data.pop("document", None)) != (SCHEMA, document):
            raise ValueError("another kind of file")
        return _adapter(document).validate_python(data, strict=False)
    except ValueError as err:  # pydantic's errors are some of these
        why = type(err).__name__
        raise ForeseeError(f"{file} cannot be read ({why}): run the study again, its store has all") from err


@cache
def _adapter(document: str) -> Any:  # noqa: ANN401 - pydantic's own
    from pydantic import TypeAdapter

    return TypeAdapter(_KINDS[document])
