"""The study's published figures, computed a second time from its raw files, without the study's own code."""

from __future__ import annotations

import csv
import json
import math
from collections import Counter
from collections.abc import Iterable, Iterator
from fractions import Fraction
from hashlib import sha256
from itertools import product
from pathlib import Path
from typing import Any

import pytest

ROOT = next(folder for folder in Path(__file__).parents if (folder / "benchmarks").is_dir())
COLLISIONS = ("F1", "F2", "F3", "F4", "F5")
KINDS = ("collisions", "findings", "avoidable findings")
PAGES = {"results": "study", "results-idm": "idm_study"}
Campaign = dict[str, Any]


@pytest.fixture(scope="module", params=PAGES)
def study(request: pytest.FixtureRequest) -> Study:
    return Study(request.param)


class Study:
    """The raw files behind one page, and the page's tables."""

    def __init__(self, page: str) -> None:
        self.page = page
        raw = ROOT / "benchmarks" / PAGES[page] / "measured"
        self.campaigns: list[Campaign] = [json.loads(file.read_text()) for file in sorted(raw.glob("*.json"))]
        for campaign in self.campaigns:
            if campaign["group"] == "bundled":
                campaign["cases"] = [case for case in campaign["cases"] if case["half"] == "odd"]

    def of(self, driver: str, ranker: str, seconds: float = 10) -> list[Campaign]:
        """The repetitions of rq1 to rq3, in order."""
        return sorted(
            (c for c in self.campaigns
             if (c["driver"], c["ranker"], c["preset"], c["group"]) == (driver, ranker, "paper", "bundled")
             and c["before_s"] + c["after_s"] == seconds and c["seed"] < 1000),
            key=lambda c: c["repetition"],
        )  # fmt: skip

    def table(self, name: str) -> list[Row]:
        file = ROOT / "docs" / "background" / self.page / f"{name}.csv"
        rows = [Row(row) for row in csv.DictReader(file.read_text(encoding="utf-8").splitlines())]
        decimals = {column: max(len(row[column].partition(".")[2]) for row in rows) for column in rows[0]}
        for row in rows:
            row.decimals = decimals
        return rows


def clips(campaign: Campaign, points: int = 10**6) -> Iterator[tuple[str, dict[str, Any]]]:
    for case in campaign["cases"]:
        if case["verdict"] == "pass":
            yield from ((case["name"], clip) for clip in case["clips"] if clip["position"] < points)


def children(campaign: Campaign, points: int = 10**6) -> list[tuple[str, list[Any]]]:
    return [(name, child) for name, clip in clips(campaign, points) for child in clip["children"]]


def count(some: Iterable[list[Any]], kind: str) -> int:
    hits = [child for child in some if child[0] in COLLISIONS]
    if kind == "collisions":
        return len(hits)
    return len({child[3] for child in hits if kind == "findings" or child[4]})


def number(campaign: Campaign, kind: str, points: int = 10**6) -> int:
    return count((child for _, child in children(campaign, points)), kind)


def mean(values: Iterable[float]) -> Fraction:
    numbers = [Fraction(value) for value in values]
    return sum(numbers, Fraction(0)) / len(numbers)


class Row(dict[str, str]):
    """A row of a table, whose cells are compared with values to the most decimals that their column has."""

    decimals: dict[str, int]

    def __missing__(self, column: str) -> str:
        raise AssertionError(f"no column {column}")

    def states(self, column: str, value: Fraction | float) -> None:
        cell = self[column]
        assert abs(float(value) - float(cell)) <= 0.5 * 10.0 ** -self.decimals[column] + 1e-9, (
            f"{column} of {self}: {cell}, computed again {float(value)}"
        )


def test_totals(study: Study) -> None:
    rows = study.table("rq2_totals")
    assert len(rows) >= 4
    for row in rows:
        own = study.of(row["part"], row["ranker"])
        row.states("clips", mean(len(list(clips(c, 4))) for c in own))
        row.states("children", mean(len(children(c, 4)) for c in own))
        for kind in KINDS:
            counted = mean(number(c, kind, 4) for c in own)
            row.states(kind, counted)
            row.states(f"a clip, {kind}", counted / mean(len(list(clips(c, 4))) for c in own))
        if float(row["findings"]):
            shares = [mean(number(c, kind, 4) for c in own) for kind in KINDS[1:]]
            row.states("avoidable, %", 100 * shares[1] / shares[0])
        for judge, letter in (("another driver", "d"), ("R157's driver", "b"), ("the anticipating driver", "a")):
            row.states(f"avoidable by, {judge}", mean(
                len({child[3] for _, child in children(c, 4) if child[0] in COLLISIONS and letter in child[4]})
                for c in own
            ))  # fmt: skip


def test_collisions_by_family_and_kind(study: Study) -> None:
    rankers = [name.split(",")[0] for name in study.table("rq2")[0] if name.endswith(", Σ")]
    for row, ranker in product(study.table("rq2"), rankers):
        if not row["row"].startswith("Scenario") or not row[f"{ranker}, Σ"].replace(".", "").isdigit():
            continue
        families = {case["name"]: case["family"] for c in study.of(row["part"], ranker) for case in c["cases"]}
        for kind in COLLISIONS:
            hits = mean(
                sum(child[0] == kind and families[name] == row["row"][8:] for name, child in children(c, 4))
                for c in study.of(row["part"], ranker)
            )
            row.states(f"{ranker}, {kind}", hits)


def test_rates_of_risky_points_and_shares_of_the_exhaustive_search(study: Study) -> None:
    for row in study.table("rq1_rates"):
        driver, _, length = row["part"].partition(", clips of ")
        seconds = float(length.removesuffix(" s"))
        ranker, _, points = row["ranking"].partition(", n_rp ")
        if not points:
            continue
        own = study.of(driver, ranker, seconds)
        everything = study.of(driver, "exhaustive", seconds)
        for kind in KINDS:
            row.states(f"{kind}, number", mean(number(c, kind, int(points)) for c in own))
            hits = sum(number(c, kind, int(points)) for c in own)
            there = sum(len(list(clips(c, int(points)))) for c in own)
            row.states(f"{kind}, a risky point", Fraction(hits, there))
            if row[f"{kind}, of exhaustive, %"]:
                whole = mean(number(c, kind) for c in everything)
                row.states(f"{kind}, of exhaustive, %", 100 * mean(number(c, kind, int(points)) for c in own) / whole)


def test_where_the_collisions_of_the_exhaustive_search_lie(study: Study) -> None:
    if study.page == "results-idm":
        pytest.skip("the files of this page are older than the moments' times")
    for row in study.table("rq1_where"):
        driver, _, rest = row["part"].partition(", clips of ")
        clip_s = float(rest.removesuffix(" s"))
        (searched,) = study.of(driver, "exhaustive", clip_s)
        places: Counter[str] = Counter()
        for own in study.of(driver, "foresee", clip_s):
            moments = {c["name"]: [clip["at_s"] for clip in c["clips"]] for c in own["cases"] if c["verdict"] == "pass"}
            for name, clip in clips(searched):
                at_s = clip["at_s"] if clip.get("at_s") is not None else math.ceil(clip_s / 2) + clip["position"]
                after_s = min((at_s - moment for moment in moments.get(name, ())), key=abs, default=math.inf)
                half = "later" if after_s > 0 else "earlier"
                away = "at a moment" if abs(after_s) <= 0.5 else half if abs(after_s) <= clip_s / 2 else "farther"
                places[away] += count(clip["children"], "collisions") if name in moments else 0
        (place,) = (place for place in places if place in row["seconds"])
        row.states("collisions, %", 100 * Fraction(places[place], places.total()))


def seconds_of(campaign: Campaign) -> float:
    return sum(clip["simulated_s"] + sum(child[1] for child in clip["children"]) for _, clip in clips(campaign, 4))


def test_collisions_an_hour(study: Study) -> None:
    for row in study.table("rq3"):
        driver, _, length = row["part"].partition(", clips of ")
        if row["ranker"] == "exhaustive":
            continue
        own = study.of(driver, row["ranker"], float(length.removesuffix(" s")))
        hours = sum(map(seconds_of, own)) / 3600
        row.states("hours", hours / len(own))
        for kind, column in zip(KINDS, ("collisions", "findings", "avoidable"), strict=True):
            row.states(f"{column} an hour", sum(number(c, kind, 4) for c in own) / hours)


def found_at(campaign: Campaign) -> tuple[list[float], float]:
    """The times at which collisions are found if all clips of rank 1 come first, and so on; and the end, s."""
    ordered = sorted(clips(campaign, 4), key=lambda pair: (pair[1]["position"], sha256(pair[0].encode()).digest()))
    at_s, times = 0.0, []
    for _, clip in ordered:
        at_s += clip["simulated_s"]
        for child in clip["children"]:
            at_s += child[1]
            if child[0] in COLLISIONS:
                times.append(at_s)
    return times, at_s


def test_areas_under_the_curves(study: Study) -> None:
    rows = [row for row in study.table("rq3_areas") if "exhaustive" not in row["row"] and "all" not in row["part"]]
    assert rows
    for row in rows:
        driver, _, first = row["part"].partition(": ")
        sides = [study.of(driver, first), study.of(driver, row["row"].removeprefix("against "))]
        areas, ends_s = [0.0, 0.0], []
        for one, other in zip(*sides, strict=False):
            curves = found_at(one), found_at(other)
            end_s = min(end for _, end in curves)
            ends_s.append(end_s)
            for k, (times, _) in enumerate(curves):
                areas[k] += sum(max(end_s - time, 0.0) for time in times)
        assert round(areas[0]) == pytest.approx(float(row["first, area"]), abs=1), row
        assert round(areas[1]) == pytest.approx(float(row["second, area"]), abs=1), row
        row.states("ratio", areas[0] / areas[1])
        row.states("common end, h", sum(ends_s) / len(ends_s) / 3600)


def two_sided(sizes: list[int], positive: list[bool]) -> Fraction:
    """Twice the smaller tail of the sum of the positive sizes, if every sign is equally likely: all 2^n, counted."""
    ways = Counter({0: 1})
    for size in sizes:
        more = Counter(ways)
        for total, times in ways.items():
            more[total + size] += times
        ways = more
    at = sum(size for size, plus in zip(sizes, positive, strict=True) if plus)
    below = sum(times for total, times in ways.items() if total <= at)
    above = sum(times for total, times in ways.items() if total >= at)
    return min(Fraction(1), Fraction(2 * min(below, above), 2 ** len(sizes)))


def first_four(case: dict[str, Any]) -> Iterator[list[Any]]:
    return (child for clip in case["clips"] if clip["position"] < 4 for child in clip["children"])


def units(study: Study, driver: str, ranker: str, kind: str) -> list[tuple[str, int, int]]:
    """Both counts of every test case in every repetition that both rankers have."""
    found = []
    for one, other in product(study.of(driver, "foresee"), study.of(driver, ranker)):
        if one["repetition"] != other["repetition"]:
            continue
        counts = [
            {case["name"]: count(first_four(case), kind) for case in side["cases"] if case["verdict"] == "pass"}
            for side in (one, other)
        ]
        found += [(name, counts[0][name], counts[1][name]) for name in sorted(counts[0].keys() & counts[1].keys())]
    return found


def test_sums_a12_and_exact_p_values(study: Study) -> None:
    rows = study.table("rq2_statistics")
    drivers = sorted({c["driver"] for c in study.campaigns})
    assert len(rows) >= 3
    for row in rows:
        driver, _, against = row["part"].partition(": foresee against ")
        pairs = [
            (name, a, b)
            for own in (drivers if driver == "all" else [driver])
            for name, a, b in units(study, own, against, row["row"])
        ]
        assert (len(pairs), len({name for name, _, _ in pairs})) == (int(row["units"]), int(row["test cases"])), row
        assert (sum(a for _, a, _ in pairs), sum(b for _, _, b in pairs)) == (int(row["first"]), int(row["second"])), (
            row
        )

        sums = [sum(pair[k] for pair in pairs) for k in (1, 2)]
        if sums[1]:
            row.states("ratio", Fraction(*sums))
            row.states("change, %", 100 * (Fraction(*sums) - 1))
        firsts, seconds = Counter(a for _, a, _ in pairs), Counter(b for _, _, b in pairs)
        wins = sum(
            Fraction(n * m) if a > b else Fraction(n * m, 2)
            for (a, n), (b, m) in product(firsts.items(), seconds.items()) if a >= b
        )  # fmt: skip
        row.states("A12", wins / len(pairs) ** 2)

        by_case: Counter[str] = Counter()
        for name, a, b in pairs:
            by_case[name] += a - b
        differences = [d for d in by_case.values() if d]
        p = two_sided([abs(d) for d in differences], [d > 0 for d in differences])
        assert float(p) == pytest.approx(float(row["p, permutation"]), abs=6e-5), row

        apart = [a - b for _, a, b in pairs if a != b]
        sizes = Counter(abs(d) for d in apart)
        ranks, below = {}, 0
        for size in sorted(sizes):  # twice the mean rank, so that it is a whole number
            ranks[size] = 2 * below + sizes[size] + 1
            below += sizes[size]
        p = two_sided([ranks[abs(d)] for d in apart], [d > 0 for d in apart])
        assert float(p) == pytest.approx(float(row["p, signed rank"]), abs=6e-5), row
