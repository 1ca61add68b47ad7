"""The result of `foresee mine`: what was read, the situations in it, and the files that were written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from foresee_dsl.documents import rounded
from foresee_recordings.mining.situation import Situation


@dataclass(frozen=True)
class WrittenCase:
    """A test case that was made of a recording, or why it was not.

    Attributes:
        situation: number of the situation in the list, from 1; 0 for the seconds of a chosen ego.
        file: the scenario; None if it was not written. reason: why it was not written.
        actors: number of actors beside the ego. left_out: number of actors that were left out.
        notes: what a reader of the test case should know, a sentence each.
    """

    situation: int
    file: Path | None
    reason: str = ""
    actors: int = 0
    left_out: int = 0
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Mined:
    """The situations of a recording.

    Attributes:
        recording: the file. sha256: its hash. reader: the reader's name. actors: number of actors.
        begins_s, ends_s: times of the recording. left_out: counts of what the file has and the recording has not.
        notes: what was guessed. situations: those listed. total: number of those that were found.
        pictures: files of the pictures. cases: test cases that were written.
    """

    recording: Path
    sha256: str
    reader: str
    actors: int
    begins_s: float
    ends_s: float
    left_out: Mapping[str, int]
    notes: tuple[str, ...]
    situations: tuple[Situation, ...]
    total: int
    pictures: tuple[Path, ...] = field(default=())
    cases: tuple[WrittenCase, ...] = field(default=())

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "recording": self.recording,
            "sha256": self.sha256,
            "reader": self.reader,
            "actors": self.actors,
            "begins_s": rounded(self.begins_s, 3),
            "ends_s": rounded(self.ends_s, 3),
            "left_out": self.left_out,
            "notes": self.notes,
            "situations": self.situations,
            "total": self.total,
            "pictures": self.pictures,
            "cases": self.cases,
        }
