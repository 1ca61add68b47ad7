"""The judges of failures: one protocol, one list, and what follows from a further one."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages
from typing import get_args

import pytest
from lxml import html

from foresee_dsl import avoidance
from foresee_dsl.avoidance import judges
from foresee_dsl.avoidance.anticipating import Answer, Anticipation
from foresee_dsl.avoidance.judge import ANTICIPATING, R157, Failure, Judge, Judgement, Opinion
from foresee_dsl.avoidance.r157.assessing import Preventability, Preventable
from foresee_dsl.avoidance.references import reference_run
from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.campaign.records import ChildOutcome, ClipOutcome, decode, encode
from foresee_dsl.campaign.steps.explanations import explained
from foresee_dsl.campaign.triage.standing import Standing
from foresee_dsl.campaign.workers.pool import RunOptions
from foresee_dsl.campaign.written import read_campaign_folder
from foresee_dsl.compile import compile_test_case
from foresee_dsl.documents import plain
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.report.builds.case_results import _details
from foresee_dsl.report.page.contents import contents_of
from foresee_dsl.report.page.entries import ReportedCampaign
from foresee_dsl.report.page.html import rendered, write_report
from foresee_dsl.report.page.markdown import write_markdown
from foresee_dsl.report.page.runs import Reader
from foresee_dsl.report.page.tables import numbers
from foresee_dsl.simulate.results.verdict import RunResult, Verdict
from tests.support.first_project import checked, foresee
from tests.support.small_campaign import SETTINGS, TEXT, InThisProcess, campaign, write_project

EARLY_BIRD = "an early bird", "there before", "other came too late for it"


class EarlyBird:
    """A judge of somebody's own: whoever was there a minute earlier avoids it."""

    def judge(self, failure: Failure) -> Opinion:
        assert failure.contact is not None
        return Opinion("an early bird", "there before", f"{failure.contact.with_} came too late for it", avoids=True)


@pytest.fixture(scope="module")
def struck(tmp_path_factory: pytest.TempPathFactory) -> tuple[TestCase, RunResult]:
    file = write_project(tmp_path_factory.mktemp("judges"))
    file.write_text(TEXT.replace("case after { gap = -0.8 s }", "case struck { gap = 0 s }"))
    case = load_test_case(f"{file}::struck")
    return case, run_test_case(case, "pdm", 0)


def child(judgements: tuple[judges.AnyJudgement, ...]) -> ChildOutcome:
    return ChildOutcome(
        "m", "m.foresee", verdict=Verdict.F4, with_="x", reason="F4", time_s=1.0, duration_s=2.0, judgements=judgements
    )


def test_a_further_judge_is_asked_stored_and_shown(
    struck: tuple[TestCase, RunResult], monkeypatch: pytest.MonkeyPatch
) -> None:
    before = explained(*struck).judgements
    assert decode(encode(child(before)), ChildOutcome) == child(before)
    monkeypatch.setattr(judges, "JUDGES", (*judges.JUDGES, EarlyBird()))
    after = explained(*struck).judgements
    assert after[:-1] == before
    assert after[-1] == Opinion("an early bird", "there before", "other came too late for it", True)
    made = child(after)
    assert decode(encode(made), ChildOutcome) == made
    assert made.avoidable
    assert "an early bird: there before: other came too late for it" in _details(made)
    assert {R157, ANTICIPATING} <= {found.name for found in before}
    assert {made.preventability, made.anticipation} <= {*before}


def test_the_answer_of_a_further_judge_is_written_and_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(judges, "JUDGES", (*judges.JUDGES, EarlyBird()))
    file, out = write_project(tmp_path), tmp_path / "out"
    text, _, _ = TEXT.partition("  case after")
    file.write_text(f"{text}  case struck {{ gap = 0 s }}\n}}\n")
    result, _ = campaign(file, out, replace(SETTINGS, driver="pdm"), options=RunOptions(executor=InThisProcess))
    (case,), (finding,) = result.seeds, result.findings
    answer, line = Opinion(*EARLY_BIRD, avoids=True), ": ".join(EARLY_BIRD)

    written = read_campaign_folder(out)
    assert written.findings is not None and written.findings[0].judgements[-1] == answer
    assert written.test_cases[0].opinions == case.opinions == (answer,)
    data = checked(foresee("review", finding.name, "--campaign", out, "--json").stdout)
    assert data["finding"]["opinions"] == [{**asdict(answer), "origin": None}]
    assert f"  {line}\n" in foresee("review", finding.name, "--campaign", out).stdout
    write_report([out], out / "report.html")
    page = html.document_fromstring((out / "report.html").read_text())
    assert line in [paragraph.text_content() for paragraph in page.iter("p")]
    reader = Reader(plays=False)
    contents = contents_of([out], reader)
    (entry,) = contents.findings
    late = replace(entry, key="late", record=replace(entry.record, opinions=(replace(answer, answer="too late"),)))
    page = html.document_fromstring(rendered(replace(contents, findings=(entry, late)), reader))
    (options,) = page.xpath(f"//select[@aria-label='{EARLY_BIRD[0]}']")
    assert [option.get("value") for option in options.iter("option")] == ["", EARLY_BIRD[1], "too late"]
    name = options.get("data-filter")
    assert [item.get(f"data-{name}") for item in page.xpath("//li[@data-driver]")] == [EARLY_BIRD[1], "too late"]
    clip = ClipOutcome("a", name="a_p1", verdict=Verdict.PASS, children=(child((answer,)),))
    figures, *_ = numbers([ReportedCampaign(replace(written, clip_runs=(clip,)), Standing())])
    assert (f"  {EARLY_BIRD[0]}: {EARLY_BIRD[1]}", "1") in figures.rows
    write_markdown([out], out / "report.md")
    assert f"- {EARLY_BIRD[0]}: **{EARLY_BIRD[1]}**: {EARLY_BIRD[2]}\n" in (out / "report.md").read_text()


def test_every_judge_is_asked() -> None:
    modules = walk_packages(avoidance.__path__, f"{avoidance.__name__}.")
    every = {kind for module in modules for kind in vars(import_module(module.name)).values() if isinstance(kind, type)}
    classes = {kind for kind in every if "judge" in vars(kind)} - {Judge}
    assert classes == {type(judge) for judge in judges.JUDGES}


def test_every_kind_of_answer_is_read_again_as_what_it_was() -> None:
    found = (
        Preventability(Preventable.NO, "too late", braked_s=1.25),
        Anticipation(Answer.UNDECIDED, "who knows", runs=3),
        Opinion("third", "undecided", "no idea", avoids=False),
    )
    assert {type(answer) for answer in found} == set(get_args(judges.AnyJudgement)), "a further judge gives an Opinion"
    again = decode(encode(child(found)), ChildOutcome)
    assert again == child(found)
    assert ChildOutcome.from_document(json.loads(json.dumps(plain(child(found))))).judgements == found
    assert [one.avoids for one in again.judgements] == [False, False, False]
    assert not child(found).avoidable


@pytest.mark.parametrize(
    ("judgement", "avoids"),
    [(Preventability(answer, ""), answer is Preventable.YES) for answer in Preventable]
    + [(Anticipation(answer, ""), answer in (Answer.BRAKING, Answer.EVADING, Answer.AHEAD)) for answer in Answer],
)
def test_what_a_judge_says_decides_what_is_opened_first(judgement: Judgement, avoids: bool) -> None:
    assert judgement.avoids is avoids
    assert judgement.answer in {*Preventable, *Answer}
    assert child((judgement,)).avoidable is avoids


def test_a_reference_driver_is_compared_with_the_trace_of_the_failure(struck: tuple[TestCase, RunResult]) -> None:
    case, failed = struck
    bundle, drives = compile_test_case(case), run_test_case(case, "idm", 0)
    other = reference_run("pdm", failed, failed.trace, bundle)
    assert (other.avoids, other.verdict, other.reason) == (False, failed.verdict, failed.reason)
    found = reference_run("idm", drives, failed.trace, bundle)
    assert found.verdict is Verdict.PASS or not found.avoids
    assert bool(found.how) <= found.passes
    assert reference_run("idm", drives, None, bundle).how == ()


def test_a_run_that_passed_is_not_a_failure(struck: tuple[TestCase, RunResult]) -> None:
    case, failed = struck
    with pytest.raises(ValueError, match="did not fail"):
        Failure.of(replace(failed, verdict=Verdict.PASS), case)
