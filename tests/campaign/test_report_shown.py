"""What a campaign's report says: findings and what broke first, or the nearest misses and what to try next."""

from __future__ import annotations

import io
from dataclasses import fields, replace
from itertools import product
from pathlib import Path

import pytest
from rich.console import Console

from foresee_dsl.avoidance.responsibility import Whose
from foresee_dsl.campaign.folder import as_text, campaign_document
from foresee_dsl.campaign.grouping import TELLING_WORDS
from foresee_dsl.campaign.records import CaseRunOutcome, ChildOutcome, ClipOutcome
from foresee_dsl.campaign.results import CampaignResult
from foresee_dsl.campaign.settings import CampaignSettings, Shard
from foresee_dsl.campaign.written import JSON, WrittenCampaign
from foresee_dsl.drivers.registry import reference_drivers
from foresee_dsl.report.page.html import write_report
from foresee_dsl.report.page.markdown import as_text as page_as_text
from foresee_dsl.report.page.markdown import write_markdown
from foresee_dsl.report.terminal.campaign import REPEATED, SCREEN_LINES, print_campaign, print_findings
from foresee_dsl.report.terminal.findings_table import FindingRow, table_lines
from foresee_dsl.simulate.results.near_misses import NearMiss, NearMisses
from foresee_dsl.simulate.results.verdict import ExpectationResult, Impact, Verdict
from foresee_dsl.story.story import ContactClass, Grounds, Story

PASSED = CaseRunOutcome("a.foresee::r01", "7", "a", 1.0, verdict=Verdict.PASS, reason="arrived", duration_s=10.0)
CRASH = "the driver raised ValueError: \x1b[31mno\u202e, at mine.py:12 (Mine.step)"


def shown(result: CampaignResult, width: int = 10_000) -> str:
    text = io.StringIO()
    print_campaign(Console(file=text, width=width, highlight=False), result, Path("out"))
    assert "\x1b" not in text.getvalue() and "\u202e" not in text.getvalue()
    return text.getvalue()


def test_a_driver_that_crashes_everywhere_is_the_headline() -> None:
    seeds = tuple(replace(PASSED, id=f"a.foresee::r{k}", verdict=Verdict.CRASH, reason=CRASH) for k in range(120))
    text = shown(CampaignResult(CampaignSettings(driver="mine"), seeds, (), 1.0))
    headline = text.split("\n")[-3]
    assert headline.startswith("the driver crashed in 120 of 120 test cases: ValueError: \\x1b[31mno")
    assert headline.endswith("at mine.py:12 (Mine.step)")
    assert "... and 117 more" in text and "foresee run a.foresee::r0 --driver mine" in text
    assert "no failures" not in text and "What to try next" not in text


def test_late_and_hanging_test_cases_are_counted_first() -> None:
    seeds = (PASSED, replace(PASSED, verdict=Verdict.TIMEOUT, reason="timeout: did not arrive within 45.00 s"))
    lines = shown(CampaignResult(CampaignSettings(), seeds, (), 1.0)).split("\n")
    assert lines[-3] == "1 of 2 test cases failed: 1 timeout"


def test_without_failures_it_tells_the_nearest_misses_and_what_to_try_next() -> None:
    near = NearMisses(NearMiss(0.31, 4.35, "walker\x1b[0m"), None, None, None)
    settings = CampaignSettings(before_s=3.0, seed=7, against=reference_drivers("pdm"))
    text = shown(CampaignResult(settings, (replace(PASSED, near=near),), (), 1.0))
    assert "0.31 m from walker\\x1b[0m at 4.35 s  a.foresee::r01" in text
    begins, chosen = "foresee campaign a.foresee::r01 --driver pdm --out out", "--before 3 --seed 7"
    assert f"{begins} {chosen} --risky-points 6 --children 8 " in text
    assert f"{begins} --ranker exhaustive {chosen} " in text
    settings = replace(settings, preset="lawful", allocation="stories", risky_points=2)
    text = shown(CampaignResult(settings, (replace(PASSED, near=near),), (), 1.0))
    chosen = f"{chosen} --allocation stories --risky-points 2"
    assert f"{begins} --ranker exhaustive --preset lawful {chosen}   # other moments" in text
    assert f"{begins} --preset paper {chosen} --repeat 2   # other mutations" in text


def test_clips_that_are_not_mutated_are_stated_in_every_report(tmp_path: Path) -> None:
    strays = ClipOutcome(PASSED.id, name="a_r01_p1", verdict=Verdict.PASS, largest_m=11.32)
    fails = replace(strays, name="a_r01_p2", verdict=Verdict.F2, largest_m=0.0)
    fine = replace(strays, name="a_r01_p3", largest_m=0.75)
    result = CampaignResult(CampaignSettings(), (PASSED,), (strays, fails, fine), 1.0)
    why = "1 clip does not pass without mutation; 1 clip strays 11.32 m from its parent (0.75 m are allowed)"
    line = f"not mutated: {why}"
    assert f"\n{line}\n" in shown(result)
    (tmp_path / JSON).write_text(as_text(campaign_document(result)))
    write_report([tmp_path], tmp_path / "report.html")
    contents = write_markdown([tmp_path], tmp_path / "report.md")
    assert f"\n{line}.\n" in page_as_text(contents)
    for page in ("report.html", "report.md"):
        assert line.partition(";")[0] in (tmp_path / page).read_text(encoding="utf-8")
    assert "not mutated" not in shown(replace(result, clips=(fine,)))
    assert "not mutated" not in shown(replace(result, settings=CampaignSettings(children=0)))
    two = shown(replace(result, clips=(strays, replace(strays, name="a_r01_p4", largest_m=2.0))))
    assert "\nnot mutated: 2 clips stray up to 11.32 m from their parents (0.75 m are allowed)\n" in two


def test_broken_expectations_are_counted_in_runs_whatever_was_measured() -> None:
    def breaking(*results: list[ExpectationResult]) -> CampaignResult:
        child = ChildOutcome("", verdict=Verdict.PASS, reason="arrived")
        sentences = (tuple(result.broken_sentence for result in of) for of in results)
        children = tuple(replace(child, name=f"m{k}", broken_expectations=s) for k, s in enumerate(sentences))
        clip = ClipOutcome(PASSED.id, name="a_r01_p1", verdict=Verdict.PASS, children=children)
        return CampaignResult(CampaignSettings(), (PASSED,), (clip,), 1.0)

    room = [ExpectationResult("expect room: always a > 1 m", held=False, value=k / 10, unit="m", decides="a > 1 m")
            for k in range(6)]  # fmt: skip
    arrives = ExpectationResult("expect eventually arrived(ego)", held=False)
    others = [ExpectationResult(f"expect e{k}", held=False, margin=-2.0) for k in range(3)]
    text = shown(breaking(*([result] for result in (*room, arrives, *others))))
    assert (
        "\nExpectations that do not hold, in 10 runs without another failure:\n"
        "  does not hold: expect room: always a > 1 m\n"
        "    m0 (0.00 m in `a > 1 m`)\n"
        "    ... and 5 more runs\n"
        "  does not hold: expect eventually arrived(ego)\n"
        "    m6\n"
        "  does not hold: expect e0\n"
        "    m7 (by 2.00)\n"
        "  ... and 2 more expectations in 2 more runs: campaign.json has all\n"
    ) in text
    text = shown(breaking([room[0], arrives, *others[:2]]))
    assert "\n  ... and 1 more expectation: campaign.json has all\n" in text, "its run is named already"


def test_a_suggested_command_repeats_the_store_and_the_reference_drivers_and_derives_something() -> None:
    settings = CampaignSettings(against=(), children=0)
    console = Console(record=True, width=300, file=io.StringIO())
    print_campaign(console, CampaignResult(settings, (PASSED,), (), 1.0), Path("out"), Path("kept"))
    text = console.export_text()
    begins = "foresee campaign a.foresee::r01 --driver pdm --out out --store kept"
    assert f"{begins} --against none --risky-points 6 --children 8   # more points, more children" in text
    assert f"{begins} --ranker exhaustive --against none   # other moments" in text
    assert "--children 0" not in text
    settings = CampaignSettings(against=("idm", "a,b"))
    text = shown(CampaignResult(settings, (PASSED,), (), 1.0))
    assert """--out out --against 'idm,"a,b"' --risky-points""" in text


def test_a_suggested_command_names_single_test_cases_beside_a_whole_file() -> None:
    seeds = tuple(replace(PASSED, id=name) for name in (*(f"b.foresee::r{k}" for k in range(4)), "a.foresee::r01"))
    text = shown(CampaignResult(CampaignSettings(), seeds, (), 1.0))
    assert "foresee campaign a.foresee::r01 b.foresee --driver pdm" in text


def test_an_interrupted_campaign_without_failures_promises_nothing() -> None:
    near = NearMisses(NearMiss(0.31, 4.35, "walker"), None, None, None)
    text = shown(CampaignResult(CampaignSettings(), (replace(PASSED, near=near),), (), 1.0, interrupted=True))
    assert "no failures so far" in text and "0.31 m from walker" in text and "was interrupted" in text
    assert "What to try next" not in text


def test_a_suggested_command_repeats_every_setting() -> None:
    names = {field.name for field in fields(CampaignSettings)}
    assert names - {"driver", "fidelity_limit_m"} == set(REPEATED)


def test_the_seeds_and_the_broken_expectations_of_mutants_are_counted() -> None:
    broke = ChildOutcome("m1", verdict=Verdict.PASS, broken_expectations=("does not hold: expect always a",))
    clip = ClipOutcome(PASSED.id, name="a_p1", verdict=Verdict.PASS, children=(broke, replace(broke, name="m2")))
    settings = CampaignSettings(seed=3, repeat=4, first_from="old/out")
    text = shown(CampaignResult(settings, (PASSED,), (clip,), 1.0))
    assert "0 of 2 mutated children failed, 2 broke only an expectation\n" in text
    assert "x 4 children, seeds 3 to 6, first the failures of old/out; 1 clip, " in text
    part = CampaignResult(CampaignSettings(), (PASSED,), (), 1.0, shard=Shard(2, 8))
    assert "x 4 children, seed 0, shard 2/8; 0 clips, " in shown(part) and "--out out --shard 2/8 " in shown(part)
    assert "x 4 children, seed 0; 0 clips, " in shown(CampaignResult(CampaignSettings(), (PASSED,), (), 1.0))


def test_paths_stay_whole_on_a_narrow_terminal() -> None:
    name = f"{'folder/' * 30}a.foresee::r01"
    failed = replace(PASSED, id=name, verdict=Verdict.F2, reason="F2 collision with walker (pedestrian) at 1.00 s")
    assert name in shown(CampaignResult(CampaignSettings(), (failed,), (), 1.0), width=80)


def failing(number: int, grounds: Grounds, kind: str = "van", speed_mps: float = 5.0) -> CaseRunOutcome:
    """Return a failing test case with a story and a contact of this speed."""
    story = Story((), f"the story of {number}", "other", kind, ContactClass.BOTH_MOVING, f"manoeuvre {number}", "comes",
                  "the road", title=f"{kind} comes, ego turning left, they collide", grounds=grounds)  # fmt: skip
    impact = Impact("other", "left", "front", 0.0, 0.0, 0.0, "both", speed_mps, 1.0, 1.0, 1.0)
    return replace(PASSED, id=f"folder/a.foresee::a_long_name_of_case_{number:02}", verdict=Verdict.F4,
                   reason="F4 lateral collision", story=story, impact=impact)  # fmt: skip


def is_row(line: str) -> bool:
    """Return whether a line is a row of the table of findings."""
    return line[:3].strip().isdecimal() and line[3:5] == "  "


MANY = (
    *(failing(k, Grounds(seen_s=5.0, acts_s=5.0, steered=k % 2 == 0)) for k in range(60)),
    failing(60, Grounds(seen_s=5.0, acts_s=5.0), "pedestrian", 1.0),
    failing(61, Grounds(seen_s=5.0, acts_s=5.0), speed_mps=9.0),
    failing(62, Grounds(seen_s=5.0, breaks_rule="on red"), "pedestrian", 9.0),
)


def test_many_findings_fit_one_screen_in_order() -> None:
    late = tuple(
        replace(PASSED, id=f"b.foresee::r{k}", verdict=Verdict.TIMEOUT, reason=f"timeout {k} " * 16) for k in range(9)
    )
    for count in (5, 6, 9):  # few findings: what else went wrong gives way to them
        few = CampaignResult(CampaignSettings(), (*MANY[1 : 2 * count : 2], *late), (), 1.0)
        screen = shown(few, 80).split("\n")
        assert sum(max(1, -(-len(line) // 80)) for line in screen) <= SCREEN_LINES - 2, count
    result = CampaignResult(CampaignSettings(), (*MANY, *late), (), 1.0)
    for console_width, width in ((10_000, 80), (80, 80), (160, 160)):  # the first is a pipe
        lines = shown(result, console_width).split("\n")
        assert sum(max(1, -(-len(line) // width)) for line in lines) <= SCREEN_LINES - 2
        assert all(len(line) <= width for line in lines if is_row(line))
    table = [line.split()[:2] for line in lines if is_row(line)]
    assert table[0] == ["1", "F4"] and len(table) > 8 and "     the driver's fault" in lines
    assert "that no driver can be expected to avoid" in lines[-4] and "foresee keep 1" in "\n".join(lines)
    ordered = result.findings
    assert [finding.number for finding in ordered] == list(range(1, 64))
    assert [f.story.sentence for f in ordered[:2]] == ["the story of 60", "the story of 61"]  # a person, then speed
    ranks = [finding.responsibility.whose for finding in ordered]
    assert ranks == sorted(ranks, key=lambda whose: whose.rank) and ranks.count(Whose.UNAVOIDABLE) == 30


def test_titles_are_short_and_differ_in_their_first_words() -> None:
    titles = [finding.title for finding in CampaignResult(CampaignSettings(), MANY, (), 1.0).findings]
    assert all(len(title.split()) <= 12 for title in titles)
    assert len({tuple(title.split()[:TELLING_WORDS]) for title in titles}) == len(titles)


def test_titles_that_begin_alike_get_the_name_of_the_case_as_it_is_written() -> None:
    result = CampaignResult(CampaignSettings(), MANY, (), 1.0)
    told = [(f.title.partition(": ")[0], f) for f in result.findings if f.title != f.story.title]
    assert told
    for name, finding in told:
        path, _, case = finding.test_case.partition("::")
        assert name in (case or Path(path).stem, finding.name)


def test_all_findings_can_be_listed() -> None:
    findings = tuple(finding.written for finding in CampaignResult(CampaignSettings(), MANY, (), 1.0).findings)
    written = WrittenCampaign(file=Path(JSON), driver="pdm", test_cases=MANY, clip_runs=(), findings=findings)
    text = io.StringIO()
    print_findings(Console(file=text, width=80, highlight=False), written)
    lines = text.getvalue().split("\n")
    assert sum(is_row(line) for line in lines) == len(MANY) and max(map(len, lines)) <= 80
    assert [line.strip() for line in lines if line.strip() in {whose.text for whose in Whose}] == [
        "the driver's fault", "arguable", "no driver can be expected to avoid it"
    ]  # fmt: skip


@pytest.mark.parametrize("width", [60, 80, 160])
def test_no_text_of_the_table_is_cut(width: int) -> None:
    title = "commuter at mill street: ego and pedestrian out of hiding collide before it"
    changes = ("walker.timing 1.33", "as written", "a_car_with_a_long_name.timing 1.00 +3", "")
    record = CampaignResult(CampaignSettings(), MANY, (), 1.0).findings[0].written
    rows = [
        FindingRow(replace(record, number=k, title=words, rate=code), change, since)
        for k, (code, words, change, since) in enumerate(
            product(("F2", "stuck"), (title, "ego stops"), changes, ("", "new"))
        )
    ]
    lines, count = table_lines(rows, width)
    texts = [line.plain for line in lines]
    assert count == len(rows) and max(map(len, texts)) <= width
    flat = " ".join(" ".join(texts).split())
    for row in rows:
        lead = " ".join(f"{row.record.number} {row.since} {row.code}".split())
        assert f"{lead} {row.record.title} {row.change}".strip() in flat, row
    for room in (5, 10, 20):
        some, count = table_lines(rows, width, room)
        assert len(some) <= room and some == lines[: len(some)] and 0 < count < len(rows)
