"""Tables, curves, sentences and halves on made-up results: what runs cannot show in seconds."""

from __future__ import annotations

import csv
import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from foresee_study.beside import beside, in_words, readings
from foresee_study.complementing import complement, split
from foresee_study.curves import Curve, compared_areas, curve
from foresee_study.folder import StudyFolder
from foresee_study.fuzz.settings import FuzzSettings
from foresee_study.fuzzed import CaseSummary, Fuzzed
from foresee_study.halves import Half, half_of, of_half, sample
from foresee_study.measured import Child, Counted, MeasuredCampaign, MeasuredCase, MeasuredClip
from foresee_study.paper import children_colliding, children_of_drivefuzz, more_an_hour, of_exhaustive
from foresee_study.planning import plan_study
from foresee_study.questions import HEAVY_WEATHER, QUESTIONS, wanted_by
from foresee_study.results import TOGETHER, Results
from foresee_study.settings import BUNDLED, SECOND_ITERATION, StudyCampaign, StudySettings
from foresee_study.tables.complementarity import complementarity
from foresee_study.tables.effectiveness import effectiveness
from foresee_study.tables.efficiency import efficiency
from foresee_study.tables.generality import generality
from foresee_study.tables.rankers import comparison, moments
from foresee_study.tables.table import Column, Row, RowKind, Table
from hypothesis import given, settings
from hypothesis import strategies as st

from foresee_dsl.errors import ForeseeError
from foresee_dsl.language.project.loading import load_test_cases
from foresee_dsl.simulate.results.verdict import Verdict

HIT, MISS = Child(Verdict.F4, 5.0, 0.1, "story", "d"), Child(Verdict.PASS, 10.0, 0.1)
NAMES = [f"case{k}" for k in range(8)]


def made(ranker: str, hits: int, *, driver: str = "pdm", seed: int = 0, repetition: int = 0, preset: str = "paper",
         names: list[str] = NAMES) -> MeasuredCampaign:  # fmt: skip
    """A campaign whose first `hits` test cases have one child that collides; each has two clips of two children."""
    cases = tuple(
        MeasuredCase(
            name, "3" if k % 2 else "7", Half.ODD, Verdict.PASS, 20.0, 0.5,
            clips=tuple(
                MeasuredClip(p, Verdict.PASS, 10.0, 0.2, (HIT if p == 0 and name in NAMES[:hits] else MISS, MISS))
                for p in (0, 1)
            ),
        )
        for k, name in enumerate(names)
    )  # fmt: skip
    return MeasuredCampaign("bundled", driver, ranker, preset, 5, 5, 4, 2, repetition, seed, "test", cases)


def fuzzed(failing: set[str], iteration: int, names: list[str] = NAMES) -> Fuzzed:
    seeds = tuple(
        CaseSummary(n, "3" if int(n[-1]) % 2 else "7", Half.ODD, Verdict.PASS, Verdict.F4 if n in failing else None,
                   10, 200.0, 5.0)
        for n in names
    )  # fmt: skip
    return Fuzzed("pdm", 0, iteration, 10, 8, "test", seeds)


def rows_of(table: Table) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(table.as_csv())))


def test_six_test_cases_that_all_differ_are_more_than_chance_and_two_are_not() -> None:
    table = comparison(Results((made("foresee", 6), made("random", 0)), "paper"))[-1]
    found = next(row for row in rows_of(table) if row["row"] == "collisions")
    assert (found["first"], found["second"], found["ratio"]) == ("6", "0", "inf")
    assert float(found["p, permutation"]) == pytest.approx(2 / 2**6, abs=1e-4)
    assert float(found["permutation, Holm"]) >= float(found["p, permutation"])
    table = comparison(Results((made("foresee", 2), made("random", 0)), "paper"))[-1]
    assert float(rows_of(table)[0]["p, permutation"]) == 0.5


def test_moments_are_counted_by_the_encounters_that_follow_within_a_second() -> None:
    clips = tuple(
        MeasuredClip(k, Verdict.PASS, 10.0, 0.2, (HIT if k < 2 else MISS,), at_s)
        for k, at_s in enumerate((7.0, 7.6, 8.1, 5.0))
    )
    case = MeasuredCase("a", "7", Half.ODD, Verdict.PASS, 14.0, 0.5, clips=clips, encounters_s=(8.0, 12.0))
    campaign = MeasuredCampaign("bundled", "pdm", "foresee", "paper", 5, 5, 4, 1, 0, 0, "test", (case,))
    table = moments(Results((campaign,), "paper"))
    assert rows_of(table)[0] == {
        "part": "pdm", "ranker": "foresee", "moments": "4", "just before an encounter, %": "50",
        "all seconds, %": "40",  # 7, 8, 11 and 12 of 5 to 14
        "per encounter": "2", "children that fail, %, of these": "100", "children that fail, %, of the others": "0",
    }  # fmt: skip
    older = replace(campaign, cases=(replace(case, encounters_s=None),))
    assert not moments(Results((older,), "paper")).rows, "files without encounters have no such table"


def test_each_reading_of_the_paper_has_its_figures_beside_the_papers() -> None:
    late = [made("foresee", 4, preset="paper_late"), made("random", 1, preset="paper_late")]
    results = Results((made("foresee", 6), made("random", 4), *late), "paper")
    assert results.readings == ("paper", "paper_late")
    row = next(row for row in rows_of(readings(results)) if "random" in row["figure"] and "%" in row["figure"])
    assert (row["paper, ours"], row["paper_late, ours"]) == ("50", "300")
    assert not readings(Results((made("foresee", 6), made("random", 4)), "paper")).rows
    wanted = wanted_by(["rq2"], StudySettings(drivers=("pdm",), rankers=("foresee",), readings=("paper_late",)))
    assert {campaign.preset for campaign in wanted} == {"paper", "paper_late"}


def test_sentences_say_direction_and_whose_rate_makes_the_difference() -> None:
    results = Results((made("foresee", 8), made("random", 2)), "paper")
    (sentence,) = (line for line in in_words(results, "rq2") if "random" in line)
    assert ": 300 % (" in sentence and "), the paper's two drivers together 129 %" in sentence
    assert "the direction is the same" in sentence
    worse = Results((made("foresee", 1), made("random", 6)), "paper")
    (sentence,) = (line for line in in_words(worse, "rq2") if "random" in line)
    assert "Ours is smaller; the direction is the opposite" in sentence
    equal = Results((made("foresee", 2), made("random", 2)), "paper")
    (sentence,) = (line for line in in_words(equal, "rq2") if "random" in line)
    assert "here there is no difference." in sentence and "direction" not in sentence
    own = Results((made("foresee", 8, driver="fusion_safe"), made("random", 2, driver="fusion_safe")), "paper")
    assert rows_of(beside(own, "rq2"))[0]["fusion_safe, paper"] == "186.69"


def test_the_interval_of_an_area_is_over_seeds_too() -> None:
    own, other = made("foresee", 6), made("random", 3)
    (once, _), (twice, _) = (
        compared_areas(*([replace(m, repetition=k, seed=k) for k in range(count)] for m in (own, other)))
        for count in (1, 2)
    )
    assert twice.interval == pytest.approx(once.interval, nan_ok=True), "copies are no evidence"
    unlucky = replace(made("foresee", 0), repetition=1, seed=1)
    earlier, _ = compared_areas([own, unlucky], [other, replace(other, repetition=1, seed=1)])
    assert earlier.ratio > 0 and earlier.interval.low == 0, "one draw in four has the unlucky seed alone"


def test_a_share_of_drivefuzzs_is_put_beside_the_papers_only_with_its_budget() -> None:
    campaigns = (made("foresee", 4), replace(made("foresee", 4), seed=SECOND_ITERATION))
    for cycles, said in (
        (10, "with another budget than the paper's (10 cycles of 1 mutation)"),
        (1, "lies within our interval"),
    ):
        fuzzings = tuple(replace(fuzzed({NAMES[0]}, k), cycles=cycles, mutations=1) for k in (1, 2))
        results = Results(campaigns, "paper", fuzzings=fuzzings)
        sentence = in_words(results, "rq4")[0]
        assert said in sentence and ("interval" in sentence) == (cycles == 1)
        assert bool(beside(results, "rq4").notes[1:]) == (cycles > 1)


def test_foresee_is_compared_in_the_drivers_and_repetitions_that_both_have() -> None:
    searched = [
        replace(made(ranker, hits), before_s=3, after_s=3) for ranker, hits in (("foresee", 2), ("exhaustive", 4))
    ]
    others = [replace(made("foresee", 8, driver="idm", repetition=k, seed=k), before_s=3, after_s=3) for k in range(3)]
    results = Results((*searched, *others, replace(searched[0], repetition=1, seed=1)), "paper")
    share, rate = of_exhaustive(6)(results, TOGETHER), more_an_hour(6)(results, TOGETHER)
    assert share is not None and share.value == pytest.approx(50)
    own, everything = (measured.simulated_s for measured in searched)
    assert rate is not None and rate.value == pytest.approx(100 * ((2 / own) / (4 / everything) - 1))
    results = Results((made("foresee", 2), made("selforacle", 4), made("foresee", 8, driver="idm")), "paper")
    assert children_colliding(results, TOGETHER, "selforacle") == (2 / 32, 4 / 32)


def test_shares_and_areas_of_an_exhaustive_search_take_all_repetitions_not_the_first() -> None:
    own = [made("foresee", hits, seed=k, repetition=k) for k, hits in enumerate((6, 2, 1))]
    everything = made("exhaustive", 8)
    results = Results((*own, everything), "paper")
    share = of_exhaustive(10)(results, "pdm")
    assert share is not None and share.value == pytest.approx(100 * 3 / 8)
    rates = effectiveness(results)[-2]
    row = next(r for r in rows_of(rates) if r["ranking"] == "foresee, n_rp 4")
    assert float(row["collisions, of exhaustive, %"]) == pytest.approx(share.value)
    areas = efficiency(results)[2]
    assert areas.name == "rq3_areas"
    row = next(r for r in rows_of(areas) if r["row"] == "against exhaustive")
    expected, _ = compared_areas(own, [everything] * 3)
    assert float(row["ratio"]) == pytest.approx(expected.ratio, abs=0.01)
    assert float(row["collisions, first, at 100 %"]) == pytest.approx(3)


def test_curves_are_read_off_the_repetitions_that_are_compared() -> None:
    own = [made("foresee", hits, seed=k, repetition=k) for k, hits in enumerate((6, 2))]
    row = next(r for r in rows_of(efficiency(Results((*own, made("random", 1, repetition=1, seed=1)), "paper"))[2])
               if r["row"] == "against random")  # fmt: skip
    assert float(row["collisions, first, at 100 %"]) == 2 and float(row["collisions, second, at 100 %"]) == 1


def test_avoidable_findings_of_an_exhaustive_search_count_where_reference_drivers_drove_its_failures() -> None:
    def avoidable(everything: MeasuredCampaign) -> str:
        table = effectiveness(Results((made("foresee", 4), everything), "paper"))[-2]
        return next(r for r in rows_of(table) if r["ranking"] == "exhaustive")["avoidable findings, number"]

    driven = made("exhaustive", 4)  # its failures are avoided by another driver
    assert avoidable(driven) == "1"
    by_braking = HIT._replace(avoided_by="b")
    clips = (MeasuredClip(0, Verdict.PASS, 10.0, 0.2, (by_braking, MISS)),)
    alone = replace(driven, cases=tuple(replace(case, clips=clips) for case in driven.cases))
    assert avoidable(alone) == ""
    assert avoidable(replace(alone, against=("idm",))) == "1"
    assert avoidable(replace(driven, against=())) == ""


def test_a_child_that_is_stuck_fails_and_is_no_collision() -> None:
    children = (HIT, HIT._replace(verdict=Verdict.STUCK, story="another"), MISS)
    case = replace(made("foresee", 0).cases[0], clips=(MeasuredClip(0, Verdict.PASS, 10.0, 0.2, children),))
    assert [case.count(what) for what in Counted] == [1, 1, 1]
    assert replace(case, clips=(replace(case.clips[0], children=children[1:]),)).fails


def test_a_test_case_that_drivefuzz_brings_to_fail_is_not_asked_again() -> None:
    first, second = made("foresee", 3), made("foresee", 5, seed=SECOND_ITERATION, names=NAMES[3:])
    one = split(NAMES, fuzzed({"case0", "case7"}, 1), first)
    assert one.fuzzed == {"case0", "case7"} and one.forecast == {"case1", "case2"}
    assert one.left == {"case3", "case4", "case5", "case6"}
    fuzzings = (fuzzed({"case0", "case7"}, 1), fuzzed({"case3"}, 2, NAMES[3:7]))
    results = Results((first, second), "paper", fuzzings=fuzzings)
    table, costs = complementarity(results)
    total = rows_of(table)[-1]
    assert [total[f"Iteration {k}, {who}, +#F"] for k in (1, 2) for who in ("DriveFuzz", "foresee")] == list("2211")
    assert total["Iteration 2, Σ, #F"] == "6" and total["foresee, of DriveFuzz's, %"] == "100"
    failing = [sum(c.verdict.is_failure for c in m.only(names).children_run) for m, names in (
        (first, NAMES[1:7]), (second, NAMES[4:7]))]  # fmt: skip
    assert [row["foresee, failing children"] for row in rows_of(costs)] == [str(count) for count in failing]
    theirs = children_of_drivefuzz(results, first.driver)
    assert theirs is not None and theirs.value == pytest.approx(100 * sum(failing) / 3)


def test_the_second_iteration_gets_what_neither_brought_to_fail(scenarios: Path) -> None:
    cases = load_test_cases([scenarios / "scenario7.foresee"])[:4]
    names = [f"red_light_runner_{case.id.partition('::')[2]}" for case in cases]
    asked: list[tuple[str, int, int]] = []

    def fuzzes(drive: FuzzSettings, given: object, repetition: int, iteration: int) -> Fuzzed:
        asked.append(("fuzz", drive.seed, len(given)))  # type: ignore[arg-type]
        return replace(fuzzed(set(), iteration, []), seeds=tuple(
            replace(fuzzed({"case0"}, 1).seeds[0], name=name) for name in names[:1]))  # fmt: skip

    def forecasts(wanted: StudyCampaign, given: object) -> MeasuredCampaign:
        asked.append((wanted.ranker, wanted.seed, len(given)))  # type: ignore[arg-type]
        found = made("foresee", 0)
        return replace(found, cases=tuple(replace(found.cases[0], name=name) for name in names))

    assert complement(StudySettings(drivers=("idm",)), cases, fuzzes=fuzzes, forecasts=forecasts)
    later = SECOND_ITERATION
    assert asked == [("fuzz", 0, 4), ("foresee", 0, 4), ("fuzz", later, 3), ("foresee", later, 3)]


def test_heavy_weather_is_a_table_of_its_own() -> None:
    weather = replace(made("foresee", 4, preset=HEAVY_WEATHER), children=1)
    towns, heavy = generality(Results((made("foresee", 8), weather), "paper"))
    assert rows_of(towns)[0]["F4"] == "8" and rows_of(heavy)[0]["F4"] == "4"


def test_the_area_of_drawn_test_cases_is_that_of_the_curve_they_make() -> None:
    rng = np.random.default_rng(0)
    cases = []
    for name in NAMES:
        children = tuple(HIT if rng.random() < 0.4 else MISS for _ in range(4))
        clip = MeasuredClip(0, Verdict.PASS, float(rng.integers(1, 9)), 0.1, children)
        cases.append(MeasuredCase(name, "3", Half.ODD, Verdict.PASS, 1.0, 1.0, clips=(clip,)))
    campaign = replace(made("foresee", 0), cases=tuple(cases))
    found = curve(campaign)
    for end_s in (0.0, 17.5, found.end_s / 2, found.end_s):
        steps = np.linspace(0, end_s, 200_001)
        counts = np.searchsorted(found.times_s, steps, side="right")
        assert found.area(end_s) == pytest.approx(float(np.trapezoid(counts, steps)), abs=0.01 * max(end_s, 1))
    earlier, later = compared_areas([campaign], [campaign])
    assert earlier.ratio == later.ratio == 1 and earlier.interval == (1, 1)
    assert earlier.first == pytest.approx(found.area(found.end_s))


def test_an_earlier_end_is_common_to_both() -> None:
    slow = replace(made("random", 8), cases=tuple(
        replace(case, clips=tuple(replace(clip, simulated_s=100.0) for clip in case.clips))
        for case in made("random", 8).cases))  # fmt: skip
    earlier, later = compared_areas([made("foresee", 8)], [slow])
    assert earlier.end_s == curve(made("foresee", 8)).end_s < later.end_s == curve(slow).end_s
    assert earlier.ratio > 2 and earlier.interval.low > 1
    assert Curve(np.array([1.0, 3.0]), 4.0).area(2.0) == 1.0


def test_stories_count_once_and_only_avoided_ones_are_avoidable() -> None:
    found = made("foresee", 5)
    assert [found.count(what) for what in Counted] == [5, 1, 1]
    nobody = replace(found, cases=tuple(replace(case, clips=tuple(
        replace(clip, children=tuple(child._replace(avoided_by="") for child in clip.children)) for clip in case.clips
    )) for case in found.cases))  # fmt: skip
    assert [nobody.count(what) for what in Counted] == [5, 1, 0]


def test_questions_share_campaigns_and_only_the_first_driver_is_searched_exhaustively() -> None:
    settings = StudySettings(drivers=("pdm", "idm"), rankers=("foresee", "random", "proximity"))
    every = wanted_by(QUESTIONS, settings)
    assert len(every) == len({one.name for one in every})
    alone = sum(len(wanted_by([name], settings)) for name in QUESTIONS)
    assert len(every) < alone
    searched = [one for one in every if one.ranker == "exhaustive"]
    assert {one.driver for one in searched} == {"pdm"} and {one.against for one in searched} == {()}
    named = wanted_by(QUESTIONS, replace(settings, against=("idm",)))
    assert {one.against for one in named if one.ranker == "exhaustive"} == {("idm",)}
    second = wanted_by(["rq2", "rq3"], replace(settings, exhaustive_repetitions=0))
    assert len(second) == len(wanted_by(["rq2"], settings)) + 3  # foresee with clips of 6 s


def test_halves_are_by_the_name_whatever_its_folder(scenarios: Path) -> None:
    cases = load_test_cases([scenarios / "scenario7.foresee"])
    even, odd = (of_half(cases, half) for half in (Half.EVEN, Half.ODD))
    assert len(even) + len(odd) == len(cases) and even and odd
    assert half_of("/elsewhere/scenario7.foresee::r01") is half_of("scenario7.foresee::r01")
    names = [case.id for case in cases]
    three, five = ([case.id for case in sample(cases, count)] for count in (3, 5))
    assert len(three) == 3 and three == [name for name in names if name in three]
    assert set(three) < set(five) and sample(cases, None) == tuple(cases)


def test_what_is_kept_is_read_again(tmp_path: Path) -> None:
    folder = StudyFolder(tmp_path)
    folder.keep(StudyCampaign("bundled", "pdm", "foresee", 10, 0, 0, "paper"), made("foresee", 3))
    folder.keep_fuzzed(fuzzed({"case1"}, 1))
    assert folder.campaigns() == (made("foresee", 3),)
    assert folder.fuzzings() == (fuzzed({"case1"}, 1),)
    next((tmp_path / "measured").iterdir()).write_text('{"schema": 1}')
    with pytest.raises(ForeseeError, match="run the study again"):
        folder.campaigns()


def test_a_table_is_shown_alike_in_all_forms() -> None:
    columns = (Column("a", ("one", "x"), 1), Column("b", ("one", "x")), Column("c"))
    rows = (
        Row("p|d_m", kind=RowKind.HEADING),
        Row("first", (1.25, 3, None)),
        Row("Σ", (float("nan"), 7.0, "5 %"), RowKind.SUM),
    )
    table = Table("t", "A & B", columns, rows, "n_rp", ("Note.",))
    assert table.spans == ((("one", 2), ("", 1)), (("x", 2), ("", 1)))
    assert table.stacked == ("one\nx\na", "\n\nb", "c")
    assert r"| **p\|d_m** |" in table.as_markdown() and "| **Σ** | **-** | **7** | **5 %** |" in table.as_markdown()
    assert table.as_csv().splitlines()[-1] == "p|d_m,Σ,,7,5 %"
    latex = table.as_latex()
    assert r"\caption{A \& B}" in latex and r"\multicolumn{2}{c}{one}" in latex and r"\cmidrule(r){2-3}" in latex
    assert r"\textsc{p|d\_m}" in latex and r"$\Sigma$ & - & 7 & 5 \%" in latex


def test_a_table_wider_than_the_page_is_divided_between_groups_of_columns() -> None:
    columns = (Column("alone"), *(Column(title, (group,)) for group in ("one", "two", "three") for title in "abc"))
    row = Row("first", tuple(range(100, 110)))
    table = Table("t", "Title", columns, (Row("part", kind=RowKind.HEADING), row), "n", ("Note.",))
    assert table.parts(80) == (table,)
    assert [part.title for part in table.parts(31)] == ["Title", "Title, continued"]
    parts = table.parts(24)
    assert [part.title for part in parts] == ["Title", "Title: two", "Title: three"]
    assert [[column.whole_title for column in part.columns] for part in parts] == [
        ["alone", "one, a", "one, b", "one, c"], ["a", "b", "c"], ["a", "b", "c"],
    ]  # fmt: skip
    assert [part.rows[1].values for part in parts] == [(100, 101, 102, 103), (104, 105, 106), (107, 108, 109)]
    assert [part.notes for part in parts] == [(), (), ("Note.",)]
    unknown = Row("first", (100, 101, 102, 103, *(None,) * 6))
    two = replace(table, rows=(*table.rows, Row("other", kind=RowKind.HEADING), unknown)).parts(24)
    assert [len(part.rows) for part in two] == [4, 2, 2]
    assert len(table.parts(1)) == 4 and table.as_csv().count("first") == 1


@settings(max_examples=50, deadline=None)
@given(st.lists(st.one_of(st.none(), st.integers(-9, 9), st.floats(-1e6, 1e6)), min_size=1, max_size=4))
def test_csv_has_what_markdown_has(values: list[float | None]) -> None:
    table = Table("t", "T", tuple(Column(f"c{k}") for k in range(len(values))), (Row("r", tuple(values)),))
    cells = [cell.strip() for cell in table.as_markdown().splitlines()[4].strip("|").split("|")][1:]
    assert [cell.replace("-", "") if cell == "-" else cell for cell in cells] == next(
        csv.reader([table.as_csv().splitlines()[1]]))[2:]  # fmt: skip


def test_a_plan_takes_into_account_that_other_drivers_are_slower() -> None:
    pytest.importorskip("frenetix", reason="the driver frenetix is not installed")
    cases = {BUNDLED: load_test_cases([Path(__file__).parent / "cases" / "beside.foresee"])}

    def longest_s(driver: str) -> float:
        asked = StudySettings(drivers=(driver,), rankers=("foresee",), repetitions=1)
        return plan_study(["rq2"], asked, cases, None)[0].one_core_s

    assert longest_s("frenetix") == pytest.approx(2.5 * longest_s("pdm"))
