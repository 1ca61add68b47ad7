"""The inputs of `foresee keep`: a finding of a campaign by name, or a file, with what the campaign recorded."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from foresee_dsl.campaign.driving import case_name
from foresee_dsl.campaign.findings.named_failure import NamedFailure, find_failure
from foresee_dsl.campaign.regression.edits import as_text
from foresee_dsl.campaign.regression.expectations import expected_of, name_to_record, recorded_end, recorded_in
from foresee_dsl.files import read_outside
from foresee_dsl.language import model as m
from foresee_dsl.language.parser import load
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project import addresses as a
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.language.project.expand import expanded_model
from foresee_dsl.language.project.loading import load_test_case


@dataclass(frozen=True)
class Source:
    """A test case to keep.

    Attributes:
        name: name of its file without suffix. file: the present file, whose folder its paths refer to. text: its new
            file. case: the loaded test case. minimised: it is the minimised form of a finding.
        sentence: what happens; "" without a campaign. expected: the recorded result.
    """

    name: str
    file: Path
    text: str
    case: TestCase
    minimised: bool = False
    sentence: str = ""
    expected: m.Expected | None = None


def source_of(wanted: str, campaign: Path, *, full: bool = False) -> Source:
    """Return the test case to keep.

    Args:
        wanted: a finding's or child's name in the campaign, or the address of a mutant, clip or test case.
        campaign: the campaign's folder. full: the mutant in its original form, not the minimised one.

    Raises:
        ForeseeError: there is no finding of this name. InputError: its files have errors, or it is stale.
    """
    path, case = a.parse_address(wanted)
    kind = a.kind_of(path) if a.is_file(path) and case is None else None
    if kind == "clip":
        return _child(NamedFailure(path.stem, path), full=full)
    if a.is_file(path) and kind != "mutant":
        return _test_case(wanted)
    failure = find_failure(wanted, campaign, tests=True)
    return _child(failure, full=full) if failure.child else _test_case(str(failure.file), failure)


def _child(failure: NamedFailure, *, full: bool) -> Source:
    small = None if full else failure.minimised
    file = small or failure.file
    case = load_test_case(file)
    origin = case.mutant.origin if case.mutant is not None else None
    text = read_outside(file).decode("utf-8")
    sentence = failure.sentence if small is None else failure.sentence_minimised or failure.sentence
    return Source(file.stem, a.absolute(file), text, case, small is not None, sentence, recorded_in(origin))


def _test_case(address: str, failure: NamedFailure | None = None) -> Source:
    """Return a test case that fails without mutation, as one concrete scenario without parameters and other cases."""
    case = load_test_case(address)
    model = expanded_model(case)
    doc = load(case.source).model
    docs = [item for item in getattr(doc, "body", ()) if isinstance(item, m.Doc)]
    sentence = as_text(failure.sentence) if failure else ""
    docs = [m.Doc(text=sentence), *docs] if sentence else docs
    body = tuple(item for item in model.body if not isinstance(item, m.Doc | m.Expected | m.Param | m.Case | m.Cases))
    name = case_name(case)
    text = print_model(m.Scenario(name=name, body=(*docs, *body)))
    run = recorded_end(failure.reason) if failure else None
    expected = expected_of(run, name_to_record(str(failure.data["driver"]), "")) if failure and run else None
    return Source(name, case.source, text, case, False, sentence, expected)
