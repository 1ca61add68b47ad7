"""Reads and writes `triage.toml`: what people decided about the stories of findings, one entry a line.

Each line is a TOML entry of its own, so that git can merge two versions line by line (`merge=union`):

    "pdm | 3 | pedestrian | brakes | walks from the left | the road | ego drove into | front" = { triage = "known", note = "#12" }
"""  # noqa: E501 - an entry is one line

from __future__ import annotations

import json
import os
import tomllib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from foresee_dsl.errors import ForeseeError
from foresee_dsl.files import absolute, read_outside_text, write_whole
from foresee_dsl.helps import Help
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.project.addresses import marked, project_folder

FILE = "triage.toml"
"""Name of the file in a project's folder."""
_HEAD = (
    "# What was decided about findings: one line a story. `foresee triage N known --note TEXT` writes it;",
    "# see https://git-scm.com/docs/gitattributes for `merge=union`, with which git joins two versions of it.",
)
_KEYS = ("triage", "note")


class Triage(StrEnum):
    """What people decided about a finding."""

    KNOWN = "known"
    """A fault that is being worked on."""
    NOT_OURS = "not-ours"
    """Not a fault of this driver but of the simulator, the scenario or another part."""
    ACCEPTED = "accepted"
    """A fault that stays."""

    @property
    def text(self) -> str:
        """The decision in words."""
        return self.value.replace("-", " ")


@dataclass(frozen=True)
class Decision:
    """A line of the file. `story`: key of the finding's story with its driver. `line`: number of the line, from 1; 0 if
    it is not written yet.
    """

    story: str
    triage: Triage
    note: str
    line: int = 0

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {"story": self.story, "triage": self.triage, "note": self.note}

    @property
    def text(self) -> str:
        """The decision in words, with its note."""
        return f"triaged as {self.triage.text}: {self.note}"

    @property
    def entry(self) -> str:
        """Its line in the file."""
        note = json.dumps(self.note, ensure_ascii=False)
        return f'{json.dumps(self.story, ensure_ascii=False)} = {{ triage = "{self.triage}", note = {note} }}'


def counted_decisions(decisions: Iterable[Decision]) -> str:
    """Return the number of triaged findings by kind: `3 triaged (2 known, 1 not ours)`; "" if there are none."""
    counts = Counter(decision.triage for decision in decisions)
    kinds = ", ".join(f"{counts[kind]} {kind.text}" for kind in Triage if counts[kind])
    return f"{counts.total()} triaged ({kinds})" if kinds else ""


def story_key(driver: str, story: str) -> str:
    """Return the key of a driver's story in the file."""
    return f"{driver} | {story}"


def triage_file(test_cases: Iterable[str]) -> Path:
    """Return the file with the decisions about some test cases: that of the project to which all of them belong.

    Without a marker of a project above them it lies in the working folder, if the test cases are below that, or else in
    the folder that they have in common. Without test cases it is the file of the working folder's project.
    """
    here = absolute(Path())
    folders = [absolute(Path(address.partition("::")[0]).parent) for address in test_cases]
    common = _common(folders) if folders else here
    project = project_folder(common)
    return (here if not marked(project) and common.is_relative_to(here) else project) / FILE


def _common(folders: Sequence[Path]) -> Path:
    """Return the innermost folder that contains all folders; the first folder if none does, as on other drives."""
    try:
        return Path(os.path.commonpath(folders))
    except ValueError:
        return folders[0]


def read_decisions(file: Path) -> dict[str, Decision]:
    """Return the decisions of a file by story; {} if there is no file.

    Raises:
        ForeseeError: it cannot be read, or a line is not an entry.
    """
    decisions: dict[str, Decision] = {}
    for number, line in enumerate(_lines(file), start=1):
        decision = _decision(line, number, file)
        if decision is None:
            continue
        if (other := decisions.get(decision.story)) is not None:
            raise ForeseeError(
                f"{file}:{number}: the story {decision.story!r} has another entry in line {other.line}: remove one of "
                "the two lines"
            )
        decisions[decision.story] = decision
    return decisions


def decide(file: Path, story: str, decision: Decision | None) -> None:
    """Write a decision about a story into the file, in place of an older one; None removes it.

    Other lines stay as they are, with their comments; a new one comes before the first whose story is greater.

    Raises:
        ForeseeError: the file cannot be read, or a line is not an entry. OSError: it cannot be written.
    """
    decisions = read_decisions(file)
    lines = _lines(file) or list(_HEAD)
    if story in decisions:
        del lines[decisions[story].line - 1]
    if decision is not None:
        later = (k for k, line in enumerate(lines) if (own := _decision(line, k + 1, file)) and own.story > story)
        lines.insert(next(later, len(lines)), decision.entry)
    write_whole(file, "\n".join(lines) + "\n")


def _lines(file: Path) -> list[str]:
    try:
        return read_outside_text(file).splitlines()
    except FileNotFoundError:
        return []
    except (OSError, UnicodeDecodeError) as err:
        raise ForeseeError(f"{file} cannot be read: {err}") from err


def _decision(line: str, number: int, file: Path) -> Decision | None:
    """Return the decision of a line; None for an empty line or a comment."""
    where = f"{file}:{number}"
    example = 'write "STORY" = { triage = "known", note = "WHY" } in one line'
    try:
        values = tomllib.loads(line)
    except tomllib.TOMLDecodeError as err:
        raise ForeseeError(f"{where}: this is not an entry ({err}): {example}") from err
    for story, entry in values.items():
        if not isinstance(entry, Mapping):
            raise ForeseeError(f"{where}: this is not an entry: {example}")
        wrong = next((key for key in entry if key not in _KEYS), None)
        missing = next((key for key in _KEYS if not isinstance(entry.get(key), str) or not entry[key].strip()), None)
        if wrong is not None:
            raise ForeseeError(f"{where}: an entry has no {wrong!r}: {Help.of(did_you_mean(wrong, _KEYS)).text}")
        if missing is not None:
            raise ForeseeError(f"{where}: the entry lacks its {missing!r}, a text: {example}")
        if entry["triage"] not in list(Triage):
            help_ = Help.of(did_you_mean(str(entry["triage"]), [kind.value for kind in Triage])).text
            raise ForeseeError(f"{where}: {entry['triage']!r} is not a kind of triage: {help_}")
        return Decision(story, Triage(entry["triage"]), entry["note"], number)
    return None
