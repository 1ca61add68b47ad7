"""Commands on the folder of a campaign with several drivers or rankers, which holds a campaign for each of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from foresee_dsl.campaign.folder import as_text, campaign_document
from foresee_dsl.campaign.records import CaseRunOutcome
from foresee_dsl.campaign.results import CampaignResult
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.simulate.results.verdict import Verdict
from tests.support.first_project import foresee

PASSED = CaseRunOutcome("a.foresee::r01", "7", "a", 1.0, verdict=Verdict.PASS, reason="arrived", duration_s=10.0)
LATE = replace(PASSED, id="a.foresee::r02", verdict=Verdict.TIMEOUT, reason="timeout: did not arrive within 45.00 s")
RANKERS = ("foresee", "reach")


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a campaign of one driver with two rankers, which share the runs of its two test cases."""
    folder = tmp_path_factory.mktemp("several") / "out"
    for ranker in RANKERS:
        result = CampaignResult(CampaignSettings(driver="idm", ranker=ranker), (PASSED, LATE), (), 1.0)
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
