"""Finds the failure that a command names: a finding or mutant of a campaign by name, or a mutant's file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from foresee_dsl.campaign.findings.written import JSON, read_written
from foresee_dsl.errors import ForeseeError
from foresee_dsl.files import absolute
from foresee_dsl.helps import Help
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.project.addresses import is_file, kind_of


@dataclass(frozen=True)
class NamedFailure:
    """A failure in its original form.

    Attributes:
        name: name of the mutant or test case. file: its file before minimisation; for a test case its address.
        campaign: folder of its campaign, or None. data: contents of `campaign.json`.
        child: True for a mutant (or clip), False for a test case that fails without mutation.
    """

    name: str
    file: Path
    campaign: Path | None = None
    data: Mapping[str, Any] = field(default_factory=dict, repr=False)
    child: bool = True

    @property
    def store(self) -> Path | None:
        """Return the store of its campaign; None without a campaign."""
        folder = self.campaign / "store" if self.campaign is not None else None
        return folder if folder is not None and (folder / "runs.sqlite").is_file() else None

    @property
    def finding(self) -> Mapping[str, Any] | None:
        """Return the entry in `campaign.json` of the finding to which the failure belongs."""
        all_found: list[Mapping[str, Any]] = list(self.data.get("findings", ()))
        own = (finding for finding in all_found if finding["name"] == self.name)
        return next(own, next((finding for finding in all_found if self.name in finding.get("siblings", ())), None))

    @property
    def minimised(self) -> Path | None:
        """Return the file of its minimised form, or None."""
        file = self.campaign / "findings" / self.name / self.file.name if self.campaign is not None else None
        return file if file is not None and is_file(file) else None

    @property
    def sentence(self) -> str:
        """Return the failure's story in a sentence; "" without a campaign."""
        own_sentence = (self._own.get("story") or {}).get("sentence")
        finding = self.finding or {}
        return str(own_sentence or (finding.get("sentence") if finding.get("name") == self.name else "") or "")

    @property
    def sentence_minimised(self) -> str:
        """Return the story of the minimised form in a sentence; "" without a campaign."""
        finding = self.finding or {}
        return str((finding.get("minimised") or {}).get("sentence") or "") if finding.get("name") == self.name else ""

    @property
    def reason(self) -> str:
        """Return how its run ended; "" without a campaign."""
        return str(self._own.get("reason") or "")

    @property
    def _own(self) -> Mapping[str, Any]:
        own = (run for run in _children(self.data) if self.child and run["mutant"] == self.name)
        tests = (run for run in self.data.get("test_cases", ()) if run["test_case"] == str(self.file))
        return next(own, next(tests, {}))


def find_failure(wanted: str, campaign: Path, *, tests: bool = False) -> NamedFailure:
    """Return the failure of this name, number of a finding, or file.

    Args:
        campaign: folder in which names are looked up. tests: also accept a test case that fails without mutation.

    Raises:
        ForeseeError: there is no failure of that name, or it is not a mutant.
    """
    path = Path(wanted)
    if is_file(path):
        return _by_file(path)
    data = read_written(campaign)
    if wanted.isdecimal():
        wanted = _name_of(int(wanted), data, campaign)
    children = {str(child["mutant"]): child for child in _children(data) if child.get("file")}
    if wanted in children:
        return NamedFailure(wanted, campaign / str(children[wanted]["file"]), campaign, data)
    others = {
        name: file for finding in data.get("findings", ()) for name, file in _files_of(finding) if name not in children
    }
    if wanted in others:
        if tests:
            return NamedFailure(wanted, Path(others[wanted]), campaign, data, child=False)
        raise ForeseeError(f"{wanted} is a test case that fails as it is written: there is no mutation to minimise")
    if not data:
        raise ForeseeError(
            f"there is no file {wanted!r}, and no campaign in {campaign} with a finding of that name (write the "
            "campaign's folder with `--campaign OUT`)"
        )
    names = sorted({*children, *others})
    hint = did_you_mean(wanted, names) if names else "that campaign found no failure"
    raise ForeseeError(f"there is no file {wanted!r}, and no finding of that name in {campaign}: {Help.of(hint).text}")


def _name_of(number: int, data: Mapping[str, Any], campaign: Path) -> str:
    """Return the name of the finding with a number."""
    findings = data.get("findings", ())
    name = next((str(finding["name"]) for finding in findings if finding["number"] == number), None)
    if name is not None:
        return name
    has = (
        f"has findings 1 to {len(findings)}"
        if findings
        else "has no findings (`--campaign OUT` chooses another folder)"
    )
    raise ForeseeError(f"there is no finding {number}: the campaign in {campaign} {has}")


def _by_file(path: Path) -> NamedFailure:
    kind = kind_of(path)
    if kind != "mutant":
        what = f"a {kind}" if kind else "no definition"
        raise ForeseeError(f"{path} contains {what}, not a mutant: write a mutant's file, or a finding of a campaign")
    above = next((folder for folder in absolute(path).parents if is_file(folder / JSON)), None)
    data = read_written(above) if above is not None else {}
    child = next((child for child in _children(data) if child["mutant"] == path.stem and child.get("file")), None)
    if above is None or child is None:
        return NamedFailure(path.stem, path)
    # A file in `findings` is already minimised: return the mutant that it was made from.
    own = above / str(child["file"])
    inside = absolute(path).parent in (absolute(own).parent, absolute(above / "findings" / path.stem))
    return NamedFailure(path.stem, own, above, data) if inside else NamedFailure(path.stem, path)


def _children(data: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    for clip in data.get("clip_runs", ()):
        yield from clip.get("children", ())


def _files_of(finding: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    yield finding["name"], finding["file"]
    yield from zip(finding.get("siblings", ()), finding.get("sibling_files", ()), strict=False)
