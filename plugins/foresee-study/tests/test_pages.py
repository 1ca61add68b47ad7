"""The figures in the pages are those of the stored measurements (`benchmarks/study`, `benchmarks/idm_study`)."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable
from pathlib import Path
from statistics import mean

import pytest
from foresee_study.beside import in_words
from foresee_study.curves import Clock
from foresee_study.folder import StudyFolder
from foresee_study.measured import Child, Counted, MeasuredCampaign, avoided
from foresee_study.report import _cost_lines
from foresee_study.results import Results
from foresee_study.settings import EXHAUSTIVE
from foresee_study.tables.effectiveness import effectiveness
from foresee_study.tables.efficiency import _an_hour
from foresee_study.tables.generality import generality
from foresee_study.tables.rankers import moments

ROOT = next(folder for folder in Path(__file__).parents if (folder / "benchmarks").is_dir())
STORED = {"results": "study", "results-idm": "idm_study"}
"""By page, the folder under `benchmarks` that it is made from."""


@pytest.fixture(scope="module")
def stored() -> dict[str, Results]:
    return {page: Results.of(StudyFolder(ROOT / "benchmarks" / folder)) for page, folder in STORED.items()}


@pytest.fixture(scope="module")
def again() -> Results:
    """The rankers that were run again by the present reading of what is avoidable."""
    return Results.of(StudyFolder(ROOT / "benchmarks" / "default_study"))


def page(name: str) -> str:
    """A page as one line, so that a sentence is found wherever its lines break."""
    return " ".join((ROOT / "docs" / "background" / f"{name}.md").read_text(encoding="utf-8").split())


def between(figures: Iterable[float], form: str = "") -> str:
    """The least and the largest of some figures, as the pages write them."""
    low, *_, high = sorted(figures)
    return f"{low:{form}} to {high:{form}}"


@pytest.mark.parametrize("name", STORED)
@pytest.mark.parametrize("question", ["rq1", "rq2", "rq4", "rq5"])  # rq3's areas take half a minute
def test_the_sentences_of_the_results_are_those_of_the_stored_measurements(
    stored: dict[str, Results], name: str, question: str
) -> None:
    text = page(name)
    for sentence in in_words(stored[name], question, headlines=True):
        assert f"- {sentence}" in text


@pytest.mark.parametrize("name", STORED)
def test_the_costs_of_the_results_are_those_of_the_stored_measurements(stored: dict[str, Results], name: str) -> None:
    text, record = page(name), StudyFolder(ROOT / "benchmarks" / STORED[name]).read()
    for costs in _cost_lines(stored[name], record):
        assert f"| {' | '.join(costs)} |" in text


@pytest.mark.parametrize("name", STORED)
def test_the_rates_of_the_results_are_those_of_the_stored_measurements(stored: dict[str, Results], name: str) -> None:
    rates = next(table for table in effectiveness(stored[name]) if table.name == "rq1_rates")
    tables = (rates, _an_hour(stored[name], Clock.SIMULATED), moments(stored[name]), *generality(stored[name]))
    for table in (table for table in tables if table.rows):
        assert (ROOT / "docs" / "background" / name / f"{table.name}.csv").read_text(encoding="utf-8") == table.as_csv()
        assert f"({name}/{table.name}.csv)" in page(name)


def test_the_method_says_what_the_exhaustive_search_has_and_what_one_search_finds_of_it(
    stored: dict[str, Results], again: Results
) -> None:
    results = stored["results"]
    (everything,) = results.of_campaign("pdm", EXHAUSTIVE)
    failures, findings, avoidable = (everything.count(what) for what in Counted)
    driver, braking, anticipating = (avoided(everything, who) for who in "dba")
    searches = {ranker: results.of_campaign("pdm", ranker) for ranker in ("foresee", "careful")}
    counts = {ranker: [m.count(Counted.AVOIDABLE) for m in found] for ranker, found in searches.items()}
    hours = {ranker: [m.simulated_s / 3600 for m in found] for ranker, found in searches.items()}
    found = mean(counts["foresee"])
    present = {r: [m.count(Counted.AVOIDABLE) for m in again.of_campaign("pdm", r, preset="paper")] for r in searches}
    now = mean(present["foresee"])
    assert (
        f"simulated {everything.simulated_s / 3600:.1f} hours, and its {failures} failures are {findings} findings. "
        f"{avoidable} of these are avoidable by the older reading: another driver avoids {driver}, R157's driver would "
        f"have avoided {braking}, and the anticipating driver {anticipating}. One search by `foresee` has "
        f"{between(present['foresee'])} avoidable findings in {between(hours['foresee'], '.1f')} hours, one by "
        f"`careful` {between(present['careful'])} in {between(hours['careful'], '.1f')} hours (older reading: "
        f"{between(counts['foresee'])} and {between(counts['careful'])}). Three times the mean of `foresee`, "
        f"{now:.1f}, would be {3 * now:.0f}, in a fifteenth of the time of the exhaustive search. By the older reading "
        f"it would be {3 * found:.0f}: four of five of its {avoidable}."
    ) in page("rankers")
    assert 3 * found / avoidable == pytest.approx(4 / 5, abs=0.02)
    assert everything.simulated_s / 3600 / mean(hours["foresee"]) == pytest.approx(15, abs=0.5)


def in_each_case(found: Iterable[MeasuredCampaign]) -> int:
    return sum(case.count(Counted.AVOIDABLE) for m in found for case in m.usable)


def test_the_method_counts_avoidable_findings_of_each_ranker_in_each_test_case(
    stored: dict[str, Results], again: Results
) -> None:
    text = page("rankers")
    for name, driver in (("results", "pdm"), ("results-idm", "idm"), ("results", "frenetix")):
        campaigns = [stored[name].of_campaign(driver, ranker)
                     for ranker in ("careful", "foresee", "proximity", "selforacle", "random")]  # fmt: skip
        cells = []
        for found in campaigns:
            older = in_each_case(found)
            present = again.of_campaign(driver, found[0].ranker, preset="paper") if found else ()
            before = f"({older})" if driver != "frenetix" else f"{older}"
            cells.append(f"{in_each_case(present)} {before}" if present else before if found else "no weights")
        assert f"| `{driver}` | {len(campaigns[0])} | {' | '.join(cells)} |" in text


def test_the_study_page_says_where_forecasting_pays(stored: dict[str, Results]) -> None:
    results, text = stored["results"], page("study")
    for driver in ("pdm", "fusion_safe", "fusion", "frenetix"):
        own, other, chance = (
            colliding(results.of_campaign(driver, ranker), first)
            for ranker, first in (("foresee", True), ("selforacle", True), ("random", False))
        )
        shares = " | ".join(f"{hits:,} of {runs:,} ({100 * hits / runs:.1f} %)" for hits, runs in (own, other, chance))
        gains = " | ".join(f"{hits / runs / (chance[0] / chance[1]):.1f}" for hits, runs in (own, other))
        assert f"| `{driver}` | {shares} | {gains} |" in text
    own, other = (colliding(results.of_campaign("fusion_safe", ranker), False) for ranker in ("foresee", "selforacle"))
    assert f"({other[0]} of {other[1]:,}; the forecast's {own[0]} of {own[1]:,})" in text


def test_the_study_page_compares_the_readings_of_the_paper(stored: dict[str, Results]) -> None:
    results = stored["results"]
    with (ROOT / "docs/background/results/rq2_readings.csv").open(encoding="utf-8") as file:
        table = list(csv.DictReader(file))
    for preset in results.readings:
        counts = [
            mean(m.count(Counted.COLLISIONS) for m in results.of_campaign("pdm", ranker, preset=preset))
            for ranker in ("foresee", "selforacle", "random")
        ]
        figures = [float(row[f"{preset}, ours"]) for row in table]
        assert figures[0] == pytest.approx(100 * (counts[0] / counts[2] - 1), abs=0.01)
        assert figures[1] == pytest.approx(100 * (counts[0] / counts[1] - 1), abs=0.01)
        over = f"{figures[0]:.0f} | {figures[1]:.0f} | {figures[2]:.2f} | {figures[3]:.2f}"
        assert f"| {', '.join(f'{count:.3g}' for count in counts)} | {over} |" in page("study")


def test_the_study_page_says_where_the_moments_of_selforacle_lie(stored: dict[str, Results]) -> None:
    table = moments(stored["results"])
    shares = {row.label: dict(zip((c.whole_title for c in table.columns), table.texts(row), strict=True))
              for row in table.rows if row.values}  # fmt: skip
    own, chance = shares["selforacle"], shares["random"]
    near, fails, others = table.columns[1].whole_title, table.columns[4].whole_title, table.columns[5].whole_title
    assert (
        f"{own[near]} % of SelfOracle's moments are at most 1 s before a close encounter, of all seconds "
        f"{own['all seconds, %']} %; where it has moments before an encounter, it has {own['per encounter']} on "
        f"average, and the forecaster one. But of the mutants of such moments {own[fails]} % fail, of its other ones "
        f"{own[others]} %, and of random ones {chance[fails]} % and {chance[others]} %"
    ) in page("study")


def colliding(campaigns: Iterable[MeasuredCampaign], first: bool) -> tuple[int, int]:
    """How many children collide, and of how many; of the moments of first rank, or of all."""
    children = [child for m in campaigns for case in m.usable for clip in case.clips
                if not first or clip.position == 0 for child in clip.children]  # fmt: skip
    return sum(child.verdict.is_collision for child in children), len(children)


@pytest.mark.parametrize("driver", ["pdm", "fusion"])
def test_the_selforacle_page_compares_the_rankers_as_they_were_measured(
    stored: dict[str, Results], again: Results, driver: str
) -> None:
    text = page("selforacle")
    for ranker in ("foresee", "selforacle", "proximity", "random"):
        found = stored["results"].of_campaign(driver, ranker)
        children = [child for m in found for child in m.children_run]
        counts = (sum(m.clips for m in found), len(children), failing(children), clips_with(failing, found),
                  sum(m.count(Counted.FINDINGS) for m in found))  # fmt: skip
        older = sum(m.count(Counted.AVOIDABLE) for m in found)
        present = again.of_campaign(driver, ranker, preset="paper")
        avoidable = f"({older})" if driver == "pdm" else f"{older}"
        if present:
            avoidable = f"{sum(m.count(Counted.AVOIDABLE) for m in present)} {avoidable}"
        assert f"| `{ranker}` | {' | '.join(f'{count:,}' for count in counts)} | {avoidable} |" in text


def failing(children: Iterable[Child]) -> int:
    return sum(child.verdict.is_failure for child in children)


def clips_with(count: Callable[[Iterable[Child]], int], campaigns: Iterable[MeasuredCampaign]) -> int:
    return sum(count(clip.children) > 0 for m in campaigns for case in m.usable for clip in case.clips)


def test_the_selforacle_page_says_what_fusion_safe_gave(stored: dict[str, Results]) -> None:
    counts = []
    for ranker in ("selforacle", "foresee", "random"):
        found = stored["results"].of_campaign("fusion_safe", ranker)
        hits, runs = colliding(found, False)
        counts.append((hits, runs, *(sum(m.count(what) for m in found)
                                     for what in (Counted.FINDINGS, Counted.AVOIDABLE))))  # fmt: skip
    one, own, chance = counts  # each: collisions, children, findings, avoidable findings
    assert (
        f"{one[0]} of {one[1]:,} mutants of `selforacle` collide ({one[2]} findings, counted for each seed, "
        f"{one[3]} of them avoidable), {own[0]} of {own[1]:,} of `foresee` ({own[2]} and {own[3]}), and "
        f"{chance[0]} of {chance[1]:,} of `random` ({chance[2]} and {chance[3]})."
    ) in page("selforacle")
