"""What `foresee keep` is asked for: a finding of a campaign by its name, or a file; and what is known of it."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from foresee_dsl.campaign.driving import case_name
from foresee_dsl.campaign.regression.edits import as_text
from foresee_dsl.campaign.regression.expectations import ending_of, name_to_record, recorded_in
from foresee_dsl.errors import ForeseeError
from foresee_dsl.language import model as m
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.parser import load
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project import addresses as a
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.language.project.expand import expanded_model
from foresee_dsl.language.project.loading import load_test_case

_CHILDREN, _FINDINGS = "children", "findings"
"""The folders of a campaign: every failing child with its clip, and each finding's representative, minimised."""


@dataclass(frozen=True)
class Source:
    """A test case to keep.

    Attributes:
        name: of its file, without suffix. file: whose folder its paths count from. text: the file to be.
        case: as it is loaded now. minimised: it is the finding's minimised form.
        sentence: what happens, "" where no campaign tells. expected: what is recorded of it.
    """

    name: str
    file: Path
    text: str
    case: TestCase
    minimised: bool = False
    sentence: str = ""
    expected: m.Expected | None = None


def source_of(wanted: str, campaign: Path, *, full: bool = False) -> Source:
    """Find what is to be kept.

    Args:
        wanted: a finding's or child's name in the campaign, or the address of a mutant, clip or test case.
        campaign: the campaign's folder. full: the child as it failed first, not its minimised form.

    Raises:
        ForeseeError: there is none of this name. InputError: its files have mistakes, or it is stale.
    """
    path, case = a.parse_address(wanted)
    if not a.is_file(path):
        return _named(wanted, campaign, full=full)
    if case is None and a.kind_of(path) in ("mutant", "clip"):
        parents = list(a.absolute(path).parents)
        above = next((folder.parent for folder in parents if folder.name == _CHILDREN), None)
        return _child(path, above, full=full)
    return _test_case(wanted, {})


def _named(name: str, campaign: Path, *, full: bool) -> Source:
    if not campaign.is_dir():
        where = "to look for a finding of that name (`--campaign OUT` says where it is)"
        raise ForeseeError(f"there is no file {name!r}, and no campaign in {campaign} {where}")
    small = campaign / _FINDINGS / name / f"{name}{a.SUFFIX}"
    if small.is_file() and not full:
        return _child(small, campaign, full=True, minimised=True)
    told = _told(campaign)
    file = next((campaign / _CHILDREN).rglob(f"{name}{a.SUFFIX}"), None) if re.fullmatch(r"\w+", name) else None
    if file is not None:
        return _child(file, campaign, full=True)
    if name in told and a.is_file(a.parse_address(str(told[name].get("file")))[0]):
        return _test_case(str(told[name]["file"]), told[name])
    known = sorted({*told, *(file.stem for file in (campaign / _CHILDREN).rglob(f"*{a.SUFFIX}"))})
    hint = did_you_mean(name, known) if known else "the campaign found no failure"
    raise ForeseeError(f"there is no file {name!r}, and no finding of that name in {campaign}: {hint}")


def _child(file: Path, campaign: Path | None, *, full: bool, minimised: bool = False) -> Source:
    small = campaign / _FINDINGS / file.stem / file.name if campaign is not None else None
    if small is not None and not full and small.is_file():
        return _child(small, campaign, full=True, minimised=True)
    case = load_test_case(file)
    text = file.read_bytes().decode("utf-8")
    origin = case.mutant.origin if case.mutant is not None else None
    found = _told(campaign).get(file.stem, {}) if campaign is not None else {}
    sentence = str(found.get("sentence") or "")
    return Source(file.stem, a.absolute(file), text, case, minimised, sentence, recorded_in(origin))


def _test_case(address: str, finding: Mapping[str, Any]) -> Source:
    """A test case that fails unmutated: as one concrete scenario, without the parameters and the other cases."""
    case = load_test_case(address)
    model = expanded_model(case)
    doc = load(case.source).model
    docs = [item for item in getattr(doc, "body", ()) if isinstance(item, m.Doc)]
    sentence = as_text(str(finding.get("sentence") or ""))
    docs = [m.Doc(text=sentence), *docs] if sentence else docs
    body = tuple(item for item in model.body if not isinstance(item, m.Doc | m.Expected | m.Param | m.Case | m.Cases))
    name = case_name(case)
    text = print_model(m.Scenario(name=name, body=(*docs, *body)))
    ending = ending_of(str(finding.get("reason") or "")) if finding else None
    expected = ending.expected_of(name_to_record(str(finding["driver"]), "")) if ending else None
    return Source(name, case.source, text, case, False, sentence, expected)


def _told(campaign: Path) -> dict[str, dict[str, Any]]:
    """Return what `campaign.json` says of each failing child and test case, by its name: sentence, file, reason."""
    try:
        data = json.loads((campaign / "campaign.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return dict(_told_in(data)) if isinstance(data, dict) else {}


def _told_in(data: Mapping[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    reasons = {str(one.get("test_case")): one.get("reason") for one in data.get("test_cases", ())}
    for clip in data.get("clip_runs", ()):
        for child in clip.get("children", ()):
            if child.get("file"):
                story = child.get("story") or {}
                yield str(child["mutant"]), {"sentence": story.get("sentence"), "file": child["file"]}
    for finding in data.get("findings", ()):
        found = {name: finding.get(name) for name in ("sentence", "file")}
        yield str(finding["name"]), {**found, "driver": data.get("driver"), "reason": reasons.get(str(finding["file"]))}
