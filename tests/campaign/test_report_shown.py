"""What a campaign's report says: findings and what broke first, or the nearest misses and what to try next."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from foresee_dsl.campaign.records import CaseRunOutcome
from foresee_dsl.campaign.results import CampaignResult
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.report.terminal.campaign import print_campaign
from foresee_dsl.simulate.results.near_misses import NearMiss, NearMisses
from foresee_dsl.simulate.results.verdict import Verdict

PASSED = CaseRunOutcome("a.foresee::r01", "7", "a", Verdict.PASS, "arrived", 10.0, 1.0)
CRASH = "the driver raised ValueError: \x1b[31mno\u202e, at mine.py:12 (Mine.step)"


def shown(result: CampaignResult, width: int = 10_000) -> str:
    text = io.StringIO()
    print_campaign(Console(file=text, width=width, highlight=False), result, Path("out"))
    assert "\x1b" not in text.getvalue() and "\u202e" not in text.getvalue()
    return text.getvalue()


def test_a_driver_that_crashes_everywhere_is_the_headline() -> None:
    seeds = tuple(replace(PASSED, id=f"a.foresee::r{k}", verdict=Verdict.CRASH, reason=CRASH) for k in range(120))
    text = shown(CampaignResult(CampaignSettings(driver="mine"), seeds, (), 1.0))
    headline = text.split("\n")[1]
    assert headline.startswith("the driver crashed in 120 of 120 test cases: ValueError: \\x1b[31mno")
    assert headline.endswith("at mine.py:12 (Mine.step)")
    assert "... and 115 more" in text and "foresee run a.foresee::r0 --driver mine" in text
    assert "no failures" not in text and "What to try next" not in text


def test_late_and_hanging_test_cases_are_counted_first() -> None:
    seeds = (PASSED, replace(PASSED, verdict=Verdict.TIMEOUT, reason="timeout: did not arrive within 45.00 s"))
    lines = shown(CampaignResult(CampaignSettings(), seeds, (), 1.0)).split("\n")
    assert lines[1] == "1 of 2 test cases failed: 1 timeout"


def test_without_failures_it_tells_the_nearest_misses_and_what_to_try_next() -> None:
    near = NearMisses(NearMiss(0.31, 4.35, "walker\x1b[0m"), None, None, None)
    settings = CampaignSettings(before_s=3.0, seed=7)
    text = shown(CampaignResult(settings, (replace(PASSED, near=near),), (), 1.0))
    assert "0.31 m from walker\\x1b[0m at 4.35 s  a.foresee::r01" in text
    begins = "foresee campaign a.foresee --driver pdm --out out --before 3 --seed 7"
    assert f"{begins} --risky-points 8 --children 8 " in text and f"{begins} --ranker exhaustive " in text


def test_paths_stay_whole_on_a_narrow_terminal() -> None:
    name = f"{'folder/' * 30}a.foresee::r01"
    failed = replace(PASSED, id=name, verdict=Verdict.F2, reason="F2 collision with walker (pedestrian) at 1.00 s")
    assert name in shown(CampaignResult(CampaignSettings(), (failed,), (), 1.0), width=80)
