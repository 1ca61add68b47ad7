"""Commands on the folder of a campaign with several drivers or rankers, which holds a campaign for each of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from foresee_dsl.campaign.folder import as_text, campaign_document
from foresee_dsl.campaign.records import CaseRunOutcome, ChildOutcome, ClipOutcome
from foresee_dsl.campaign.results import CampaignResult
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.written import campaign_folders
from foresee_dsl.report.page.contents import contents_of
from foresee_dsl.report.page.runs import Reader
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.story import ContactClass, Story
from tests.support.first_project import foresee

PASSED = CaseRunOutcome("a.foresee::r01", "7", "a", 1.0, verdict=Verdict.PASS, reason="arrived", duration_s=10.0)
LATE = replace(PASSED, id="a.foresee::r02", verdict=Verdict.TIMEOUT, reason="timeout: did not arrive within 45.00 s")
HIT = replace(
    PASSED,
    id="a.foresee::r03",
    verdict=Verdict.F2,
    reason="F2 collision with walker (pedestrian) at 1.00 s",
    story=Story((), "the walker steps out", "walker", "pedestrian", ContactClass.BOTH_MOVING, "turns", "comes", "here"),
)
CHILD = ChildOutcome("a_r01_p1_m1", verdict=Verdict.PASS, reason="arrived", duration_s=10.0)
BREAKS = replace(CHILD, broken_expectations=("room > 1 m: 0.4 m",))
CLIP = ClipOutcome(PASSED.id, name="a_r01_p1", verdict=Verdict.PASS, reason="arrived", duration_s=10.0)
CLIPS = {"foresee": replace(CLIP, children=(BREAKS, BREAKS)), "reach": replace(CLIP, children=(CHILD,))}
RANKERS = ("foresee", "reach")
HEADLINE = (
    "1 finding in 1 failing run, and 2 runs break an expectation without another failure, "
    "among 3 children of 2 clips from 3 test cases\n"
)


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a campaign of one driver with two rankers, which share the runs of its three test cases."""
    folder = tmp_path_factory.mktemp("several") / "out"
    for ranker in RANKERS:
        result = CampaignResult(
            CampaignSettings(driver="idm", ranker=ranker), (PASSED, LATE, HIT), (CLIPS[ranker],), 1.0
        )
        below = folder / f"idm_{ranker}"
        below.mkdir(parents=True)
        (below / "campaign.json").write_text(as_text(campaign_document(result)))
    return folder


@pytest.mark.parametrize(
    "words",
    [
        "review 1 --campaign",
        "review --campaign",
        "triage --campaign",
        "show 1 --campaign",
        "keep 1 --campaign",
        "minimise 1 --campaign",
        "diagnose 1 --campaign",
        "diagnose --all --campaign",
        "sure 1 --campaign",
        "view 1 --campaign",
        "compare nothing",
    ],
)
def test_a_command_for_one_campaign_names_those_below(words: str, out: Path) -> None:
    said = str(foresee(*words.split(), out, expect=1).exception)
    folders = f"{out / 'idm_foresee'}, {out / 'idm_reach'}"
    assert said == f"{out} holds several campaigns, each in a folder of its own: name one of {folders}"


def test_the_joint_report_counts_runs_that_campaigns_share_once(out: Path) -> None:
    text = foresee("report", out, "--format", "text").stdout
    assert text.startswith(HEADLINE), text
    assert "\nOf 3 test cases, 1 ended with timeout: see the overview.\nOf 3 children, 2 broke an expectation" in text
    assert text.count("the walker steps out") == 1
    title, *lines = text.rstrip().split("\n\n")[-1].split("\n")
    assert title == "Children that break an expectation without another failure"
    assert lines == ["  idm, a_r01_p1_m1, a.foresee::r01, room > 1 m: 0.4 m"] * 2


def test_the_joint_page_names_the_ranker_where_the_driver_does_not_tell_campaigns_apart(out: Path) -> None:
    contents = contents_of(campaign_folders(out), Reader(plays=False))
    failed = next(table for table in contents.overview if table.title == "Test cases that fail without mutation")
    assert [row[:2] for row in failed.rows] == [("idm", LATE.id), ("idm", HIT.id)]
    figures = dict(row[:2] for row in contents.numbers[0].rows)
    assert figures["failing children, as found"] == "0", "the overview counts findings, by their minimised mutants"
    titles = [table.title for table in contents.numbers]
    assert "The campaign idm, foresee" in titles and "The campaign idm, reach" in titles
    assert len(set(titles)) == len(titles)
