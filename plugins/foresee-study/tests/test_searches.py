"""The searches from the literature: what they propose, what they run on a small crossing, and their table."""

from __future__ import annotations

import csv
import io
import json
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from foresee_study.folder import StudyFolder
from foresee_study.halves import Half
from foresee_study.measured import Child, Counted, MeasuredCampaign, MeasuredCase, MeasuredClip
from foresee_study.measuring import measure
from foresee_study.results import Results
from foresee_study.running import stages_of
from foresee_study.search.av_fuzzer import AvFuzzer
from foresee_study.search.protocol import FAR, OBJECTIVES, Evaluation, Point, Search
from foresee_study.search.samota import Samota
from foresee_study.search.searches import SEARCHES
from foresee_study.search.space import changes_at, dimensions_of, run_margins, values_of
from foresee_study.settings import RANKERS, StudyCampaign
from foresee_study.tables.searches import DEFAULT, beside_default, default_search, rates, searches, techniques, within

from foresee_dsl.campaign.execution.engine import run_missing
from foresee_dsl.campaign.records import ChildOutcome, decode
from foresee_dsl.campaign.storage.store import Store
from foresee_dsl.campaign.workers.pool import RunOptions
from foresee_dsl.derive.clipping.clip import clip
from foresee_dsl.derive.mutate import Mutator
from foresee_dsl.derive.operators import Situation, operators
from foresee_dsl.derive.presets import PRESETS
from foresee_dsl.language.project.expand import expand_clip
from foresee_dsl.language.project.loading import load_test_cases
from foresee_dsl.simulate.results.verdict import Verdict
from tests.support.command import program
from tests.support.situations import case_with, crossing, make_trace, risky
from tests.support.small_campaign import Heard, InThisProcess, write_project

WANTED = StudyCampaign("bundled", "idm", "av_fuzzer", 6.0, 0, 3, "focused", risky_points=1000, children=0, against=(),
                       budget_s=45.0)  # fmt: skip
"""A search on the small crossing."""


def run(wanted: StudyCampaign, file: Path, store: Path, options: RunOptions) -> tuple[MeasuredCampaign, Heard]:
    heard, work = Heard(), store.parent / "work"
    work.mkdir(exist_ok=True)
    with Store(store) as opened:
        cases = load_test_cases([f"{file}::after", f"{file}::last"])
        stages = stages_of(wanted, cases, opened, work)
        run_missing(stages, work=work, store=opened, listeners=[heard], options=options, minimise=False)
        return measure(stages, opened, wanted), heard


def without_wall(measured: MeasuredCampaign) -> MeasuredCampaign:
    return replace(measured, cases=tuple(
        replace(case, wall_s=0, clips=tuple(
            replace(clip, wall_s=0, children=tuple(child._replace(wall_s=0) for child in clip.children))
            for clip in case.clips
        )) for case in measured.cases
    ))  # fmt: skip


def spent_s(case: MeasuredCase) -> float:
    return sum(clip.simulated_s + sum(child.simulated_s for child in clip.children) for clip in case.clips)


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_project(tmp_path_factory.mktemp("searches"))


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("store") / "store"


@pytest.fixture(scope="module")
def done(file: Path, store: Path) -> MeasuredCampaign:
    """AV-Fuzzer on two test cases, by two workers."""
    return run(WANTED, file, store, RunOptions(jobs=2))[0]


def test_a_search_that_is_stopped_goes_on_to_the_same_result_without_workers(
    file: Path, done: MeasuredCampaign, tmp_path: Path
) -> None:
    heard = Heard()

    def enough() -> bool:
        return heard.count("child") >= 3

    work, other = tmp_path / "work", tmp_path / "store"
    work.mkdir()
    with Store(other) as opened:
        stages = stages_of(WANTED, load_test_cases([f"{file}::after", f"{file}::last"]), opened, work)
        ended = run_missing(stages, work=work, store=opened, listeners=[heard], minimise=False,
                            options=RunOptions(stop=enough, executor=InThisProcess))  # fmt: skip
    assert ended.stopped
    measured, then = run(WANTED, file, other, RunOptions(executor=InThisProcess))
    assert without_wall(measured) == without_wall(done)
    assert then.old.count("child") >= 3 and then.count("child") > 0


@pytest.mark.parametrize("name", sorted(SEARCHES))
def test_no_search_exceeds_its_simulated_time_and_none_leaves_room_for_two_runs(
    name: str, file: Path, store: Path, done: MeasuredCampaign
) -> None:
    measured, _ = run(replace(WANTED, ranker=name), file, store, RunOptions(executor=InThisProcess))
    assert measured.ranker == name and len(measured.usable) == len(done.usable) == 2
    for case in measured.usable:
        assert case.clips and any(clip.children for clip in case.clips)
        assert 45.0 - 2 * WANTED.clip_s < spent_s(case) <= 45.0


def test_mutants_are_run_once_and_change_what_the_operators_allow(store: Path, done: MeasuredCampaign) -> None:
    with Store(store, write=False) as opened:
        rows = [row for row in opened.rows() if row.kind == "child"]
        children = [decode(row.record, ChildOutcome) for row in rows]
    meanings = [child.meaning for child in children if isinstance(child, ChildOutcome)]
    assert meanings and len(meanings) == len(set(meanings))
    for child in children:
        assert isinstance(child, ChildOutcome) and set(child.operators) <= set(operators())
        margins = run_margins(child)
        assert len(margins) == len(OBJECTIVES) and all(0 <= margin <= FAR for margin in margins)
        assert child.verdict.is_failure == (margins == (0.0, 0.0, 0.0))


def situation() -> Situation:
    """A clip in which an actor crosses the ego's way."""
    trace, case = make_trace(crossing()), case_with()
    cut = clip(case, trace, risky(trace, "runner", 5.0), before_s=5, after_s=5, name="runs_p1", parent="runs.foresee")
    return Mutator(expand_clip(cut, case, source=case.source), cut, trace).situation


@pytest.mark.parametrize("name", sorted(set(PRESETS) - {"heavy_weather"}))
def test_each_point_is_a_change_that_an_operator_of_the_preset_can_make(name: str) -> None:
    here, preset = situation(), PRESETS[name]
    rng = np.random.default_rng(0)
    points = [tuple(map(float, row)) for row in rng.random((20, dimensions_of(preset)))]
    drawn = [changes_at(here, preset, point) for point in (*points, (0.0,) * len(points[0]), (1.0,) * len(points[0]))]
    assert all(drawn) and len(set(drawn)) > 5
    for names, changes in filter(None, drawn):
        assert any(set(names) <= set(recipe) for recipe in preset.recipes)
        by_name = operators()
        for operator, change in zip(names, changes, strict=True):
            assert (change,) in values_of(by_name[operator], here, change.actor, preset)


# ---- the searches alone, on a function that is known -----------------------------------------------------------------


def bowl(point: Point) -> float:
    """A margin that is small near one place."""
    return FAR * float(np.linalg.norm(np.array(point) - 0.3) / np.sqrt(len(point)))


def searched(search: Search, count: int, margin: Callable[[Point], float] = bowl, seed: int = 0) -> list[list[Point]]:
    """The first `count` points that a search proposes, batch by batch."""
    proposals = search.proposals(4, np.random.default_rng(seed))
    batches = [next(proposals)]
    while sum(map(len, batches)) < count:
        batches.append(proposals.send([Evaluation(p, (margin(p),) * len(OBJECTIVES)) for p in batches[-1]]))
    return batches


@pytest.mark.parametrize("name", sorted(SEARCHES))
def test_a_search_comes_nearer_with_what_it_has_learnt_and_is_the_same_for_a_seed(name: str) -> None:
    search = SEARCHES[name]
    if name in ("bandit", "cross_entropy"):
        search = replace(search, thres=3.0)  # type: ignore[type-var]
    count = 60 if name == "samota" else 300
    each = [[bowl(point) for batch in searched(search, count, seed=seed) for point in batch] for seed in range(2)]
    first, last = (np.mean([m[part] for m in each]) for part in (slice(6), slice(count - 20, count)))
    assert last < 0.9 * first
    assert searched(search, 20, seed=1) == searched(search, 20, seed=1) != searched(search, 20, seed=2)
    assert all(len(p) == 4 and all(0 <= v <= 1 for v in p) for batch in searched(search, 20) for p in batch)


def test_av_fuzzer_searches_locally_after_progress_and_restarts_far_away_without_it() -> None:
    flat = searched(AvFuzzer(), 120, lambda _: 1.0)
    apart = [
        min(np.linalg.norm(np.subtract(p, q)) for earlier in flat[:k] for q in earlier)
        for k, batch in enumerate(flat) if k and len(batch) == 4 for p in batch
    ]  # fmt: skip
    assert sum(distance > 0.4 for distance in apart) >= 4, "no restart"
    improving = iter(np.linspace(9, 0, 500))
    batches = searched(AvFuzzer(mutation=1.0, crossover=0.0), 200, lambda _: float(next(improving)))
    # the local fuzzer begins with copies of the best individual, each with one new gene
    local = [batch for batch in batches[1:] if len(batch) == 4 and len(set.intersection(*map(set, batch))) >= 1]
    assert local


def test_samota_proposes_the_best_and_the_most_uncertain_point_of_each_objective_and_opens_all_again() -> None:
    batches = searched(Samota(), 12)
    assert [len(batch) for batch in batches[:2]] == [6, 6]  # three objectives
    reached = searched(Samota(), 20, lambda point: 0.0 if point[0] < 0.5 else 1.0)
    assert sum(map(len, reached)) >= 20, "it ends when all objectives are reached"


# ---- the table -------------------------------------------------------------------------------------------------------


def made(ranker: str, children: tuple[Child, ...], budget_s: float | None = None) -> MeasuredCampaign:
    """Eight test cases, each with one clip of 10 s and these mutants."""
    cases = tuple(
        MeasuredCase(f"case{k}", "3", Half.ODD, Verdict.PASS, 20.0, 0.5,
                     clips=(MeasuredClip(0, Verdict.PASS, 10.0, 0.2, children),))
        for k in range(8)
    )  # fmt: skip
    return MeasuredCampaign("bundled", "pdm", ranker, "paper", 5, 5, 4, 2, 0, 0, "test", cases, budget_s=budget_s)


HIT, STEERED = Child(Verdict.F4, 5.0, 0.1, "a", "d", False), Child(Verdict.F4, 5.0, 0.1, "b", "", True)
MISS = Child(Verdict.PASS, 10.0, 0.1)


def test_the_table_counts_at_equal_time_and_says_how_many_were_steered_into_the_ego() -> None:
    rankers = made("reach", (HIT, STEERED, MISS)), made("random", (MISS, MISS, HIT))
    exhaustive = made("exhaustive", (HIT, HIT._replace(story="c")))
    results = Results((*rankers, made("bandit", (HIT, STEERED), 20.0), exhaustive), "paper")
    counted, statistics = (list(csv.DictReader(io.StringIO(table.as_csv()))) for table in searches(results))
    by_name = {row["technique"]: row for row in counted}
    assert set(by_name) == {"reach", "random", "bandit"}
    assert by_name["reach"]["findings"] == "2" and by_name["reach"]["avoidable findings"] == "1"
    assert by_name["reach"]["steered into the ego, % of findings"] == "50"
    assert (by_name["bandit"]["stories of the exhaustive search"], by_name["bandit"]["of"]) == ("1", "2")
    assert by_name["random"]["collisions"] == "4", "the other runs lie beyond the time of the searches"
    row = next(row for row in statistics if row["row"] == "reach over random: collisions")
    assert float(row["p, permutation"]) == pytest.approx(2 / 2**5, abs=1e-4)
    hours = float(by_name["bandit"]["hours"])
    rate = float(by_name["bandit"]["collisions an hour, mean"])
    assert hours == pytest.approx(8 * 20 / 3600, abs=0.01) and rate == pytest.approx(16 / (8 * 20 / 3600), rel=0.01)


def test_the_default_search_is_compared_with_the_others_in_the_time_that_it_takes() -> None:
    """Its fourth risky point counts only in the comparison with four points."""
    ours = made("reach", (HIT, HIT._replace(story="b", avoided_by="")))
    cases = (replace(case, clips=(*case.clips, replace(case.clips[0], position=3))) for case in ours.cases)
    ours = replace(ours, preset="avoidable", cases=tuple(cases))
    campaigns = (ours, made("random", (MISS, HIT)), made("bandit", (HIT, STEERED), 20.0))
    results = Results(campaigns, "paper")
    for points, hours in ((3, 160 / 3600), (4, 320 / 3600)):
        by_name = beside_default(results, "pdm", points)
        assert set(by_name) == {DEFAULT, "random", "bandit"}
        assert sum(m.simulated_s for m in by_name[DEFAULT]) / 3600 == pytest.approx(hours)
        assert all(m.simulated_s / 3600 <= hours for each in by_name.values() for m in each)
    counted, statistics = (list(csv.DictReader(io.StringIO(table.as_csv()))) for table in default_search(results))
    assert [(row["part"], row["technique"]) for row in counted] == [
        (f"pdm, {points} points", name) for points in (3, 4) for name in (DEFAULT, "random", "bandit")
    ]
    assert (counted[0]["collisions"], counted[3]["collisions"], counted[0]["findings"]) == ("16", "32", "2")
    assert any(row["row"] == f"{DEFAULT} over random: avoidable findings" for row in statistics)
    assert not any(table.rows for table in default_search(Results(campaigns[1:], "paper"))), "no default search was run"


def test_the_time_of_mutants_that_do_not_count_is_that_of_their_clip(tmp_path: Path) -> None:
    """The clip of two mutants that fail is run, and fails as well."""
    file = Path(__file__).parents[3] / "scenarios" / "scenario7.foresee"
    wanted = StudyCampaign("bundled", "pdm", "reach", 10.0, 0, 0, "avoidable", risky_points=1, against=())
    with Store(tmp_path / "store") as store:
        stages = stages_of(wanted, load_test_cases([f"{file}::r03"]), store, tmp_path)
        run_missing(stages, work=tmp_path, store=store, options=RunOptions(executor=InThisProcess), minimise=False)
        measured = measure(stages, store, wanted)
        times = {row.kind: row.simulated_s for row in store.rows()}
        every_s = sum(row.simulated_s for row in store.rows() if row.kind in ("clip", "check", "child"))
    ((clip,),) = [case.clips for case in measured.cases]
    assert clip.verdict.is_failure and not clip.children
    assert clip.simulated_s == measured.simulated_s == pytest.approx(every_s)
    assert clip.simulated_s > times["check"] > 0 and clip.wall_s > 0


def test_the_figures_in_the_documentation_are_those_of_the_stored_measurements(root: Path) -> None:
    stored, pages = root / "benchmarks", root / "docs" / "background" / "results"
    beside = [StudyFolder(stored / name) for name in ("default_study", "study", "idm_study")]
    study = Results.of(StudyFolder(stored / "search_study"), None, beside)
    large = Results.of(StudyFolder(stored / "search_study" / "large"))
    for name, results in (("search", study), ("search_large", large)):
        table = rates(results)
        assert (pages / f"{name}.csv").read_text() == table.as_csv(), name
    beside = [*beside[1:], StudyFolder(stored / "search_study")]
    for table in default_search(Results.of(StudyFolder(stored / "default_study"), None, beside)):
        assert (pages / f"{table.name}.csv").read_text() == table.as_csv(), table.name


def test_the_table_of_the_default_search_has_the_figures_of_its_study(root: Path) -> None:
    """Each row states the rates of the default, and of the other ranker with the highest rate, with the test's p."""
    pages = root / "docs" / "background"
    rates_of, tests = (
        list(csv.DictReader(io.StringIO((pages / "results" / f"{name}.csv").read_text(encoding="utf-8"))))
        for name in ("default", "default_statistics")
    )
    p_of = {(row["part"], row["row"]): row["p, permutation"] for row in tests}
    expected = []
    for part in dict.fromkeys(row["part"] for row in rates_of):
        first, *others = (row for row in rates_of if row["part"] == part)
        rankers = [row for row in others if row["technique"] in RANKERS]
        cells = [first["repetitions"], first["hours"]]
        for what in (Counted.FINDINGS, Counted.AVOIDABLE):
            mean, low, high = (first[f"{what} an hour, {column}"] for column in ("mean", "low", "high"))
            cells.append(f"{mean} ({low} to {high})")
        cells.append(first["steered into the ego, % of findings"])
        for what in (Counted.FINDINGS, Counted.AVOIDABLE):
            best = max(rankers, key=lambda row: float(row[f"{what} an hour, mean"] or 0))
            p = p_of[part, f"{DEFAULT} over {best['technique']}: {what}"]
            cells.append(f"`{best['technique']}` {best[f'{what} an hour, mean']} (p = {p})")
        driver, points = part.removesuffix(" points").split(", ")
        expected.append([f"`{driver}`", points, *cells])
    table = (pages / "study.md").read_text(encoding="utf-8").partition("### The default search")[2]
    table = table.partition("best other ranker: findings an hour")[2].partition("\n\n")[0]
    assert [[cell.strip() for cell in line.split("|")[1:-1]] for line in table.splitlines()[2:]] == expected


def test_a_ranker_is_cut_in_the_order_of_its_runs() -> None:
    cut = within(made("reach", (HIT, STEERED, MISS)), 35.0)
    assert [[len(clip.children) for clip in case.clips] for case in cut.cases[:3]] == [[3], [], []]
    assert cut.simulated_s == 30.0
    assert techniques(Results((made("reach", (HIT,)),), "paper"), "pdm") == {}, "without a search there is no time"


def test_the_command_runs_rankers_and_searches_and_writes_their_table(tmp_path: Path) -> None:
    beside = Path(__file__).parent / "cases" / "beside.foresee"
    out = tmp_path / "out"
    words = ["study", "search,default", f"{beside}::ahead", "--half", "all", "--repetitions", "1", "--drivers", "idm",
             "--rankers", "random", "--searches", "bandit", "--budget-hours", "0.015", "--children", "1",
             "--against", "none", "--jobs", "1", "--out", str(out), "--quiet", "--json"]  # fmt: skip
    command = [program(), *words]
    printed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    assert [table["name"] for table in json.loads(printed)["tables"]] == [
        "search", "search_statistics", "default", "default_statistics"
    ]  # fmt: skip
    rows = list(csv.DictReader(io.StringIO((out / "tables" / "search.csv").read_text())))
    assert {row["technique"] for row in rows} == {"random", "reach", "bandit"}
    assert all(float(row["hours"]) <= 0.015 for row in rows)
    rows = list(csv.DictReader(io.StringIO((out / "tables" / "default.csv").read_text())))
    assert {row["technique"] for row in rows} == {DEFAULT, "random", "reach", "bandit"}
