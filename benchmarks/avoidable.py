"""How many failures that somebody avoids does each way of searching find? Campaigns side by side, with intervals.

    python -m benchmarks.avoidable --rankers foresee careful --presets focused avoidable --drivers pdm --seeds 0 1 2 \
        --half even --jobs 16 --out FOLDER

Every combination of driver, ranker, preset and seed is a campaign of its own over the same test cases, in a process of
its own, with its own store; what a store holds already is not run again, so a command that was stopped goes on.
With `--pairs careful:avoidable foresee:focused foresee:focused:adaptive` only those combinations; the third word is how
children are allocated. The test case is the unit of the intervals (bootstrap of the ratio of sums). The table is
printed at the end, and written to FOLDER/avoidable.md and FOLDER/avoidable.json after each campaign.
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
from collections import defaultdict
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, fields
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.avoidance.r157.assessing import Preventable
from foresee_dsl.campaign.execution.engine import run_campaign
from foresee_dsl.campaign.execution.pool import RunOptions
from foresee_dsl.campaign.records import ChildOutcome
from foresee_dsl.campaign.results import CampaignResult
from foresee_dsl.campaign.settings import Allocation, CampaignSettings
from foresee_dsl.campaign.storage.store import Store
from training.selforacle.evaluate import HALVES, chosen_cases

RESAMPLES = 4000
"""Resamples of the bootstrap. Ours: the bounds of a 95 % interval then vary by about one part in fifty."""
_SEED = 0
REFERENCES = ("idm", "frenetix", "pdm", "pdm+ideal")
"""Who drives every failure as well, but the driver under test."""


@dataclass(frozen=True)
class Search:
    """One way of searching: the driver under test, the ranker, the preset, how children are allocated."""

    driver: str
    ranker: str
    preset: str
    allocation: Allocation = "even"

    @property
    def name(self) -> str:
        """What its folders are called."""
        return "_".join(
            (self.driver, self.ranker, self.preset, *((self.allocation,) if self.allocation != "even" else ()))
        )


@dataclass
class Counts:
    """What campaigns found in one test case, all seeds together.

    Attributes:
        clips: that were mutated. failures: failing children. avoided: of them, those that a reference driver avoids.
        findings: failures after grouping, counted where their representative is. avoided_findings: those of which
            somebody avoids a member. preventable: children, after R157; anticipated: after the anticipating driver.
        simulated_s: by test cases, clips and children. derived_s: by clips and children, as in rq3: the test cases'
            own runs are the same for every way of searching.
    """

    clips: float = 0
    children: float = 0
    failures: float = 0
    findings: float = 0
    avoided: float = 0
    avoided_findings: float = 0
    preventable: float = 0
    anticipated: float = 0
    anticipated_findings: float = 0
    avoidable_findings: float = 0
    simulated_s: float = 0
    derived_s: float = 0

    def add(self, other: Counts) -> None:
        """Add those of another seed."""
        for field in fields(self):
            setattr(self, field.name, getattr(self, field.name) + getattr(other, field.name))


@dataclass(frozen=True)
class Task:
    """One campaign: over which test cases, against whom, with how many processes, and where."""

    search: Search
    seed: int
    half: str | None
    every: int
    against: tuple[str, ...]
    jobs: int
    out: Path
    more: dict[str, int]


COLUMNS = tuple(field.name for field in fields(Counts))


def main() -> None:
    """Run the campaigns, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rankers", nargs="+", default=["foresee", "careful"])
    parser.add_argument("--presets", nargs="+", default=["focused", "avoidable"])
    parser.add_argument("--pairs", nargs="+", help="RANKER:PRESET[:ALLOCATION], instead of all combinations")
    parser.add_argument("--drivers", nargs="+", default=["pdm"])
    parser.add_argument("--seeds", nargs="+", type=int, default=[0])
    parser.add_argument("--half", choices=list(HALVES), help="only test cases whose name's hash is even, or odd")
    parser.add_argument("--every", type=int, default=1, help="only every so many of them")
    parser.add_argument("--against", default="", help="reference drivers, with commas")
    parser.add_argument("--jobs", type=int, default=1, help="processes, over all campaigns")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--risky-points", type=int, default=4)
    parser.add_argument("--children", type=int, default=4)
    options = parser.parse_args()
    pairs = [tuple(p.split(":")) for p in options.pairs or ()] or list(
        itertools.product(options.rankers, options.presets)
    )
    searches = [Search(driver, *pair) for driver in options.drivers for pair in pairs]
    references = tuple(options.against.split(",")) if options.against else REFERENCES
    more = {"risky_points": options.risky_points, "children": options.children}
    pairs_of_seeds = [(search, seed) for seed in options.seeds for search in searches]
    at_once = max(1, min(options.jobs, len(pairs_of_seeds)))
    tasks = [
        Task(search, seed, options.half, options.every, tuple(r for r in references if r != search.driver),
             max(1, options.jobs // at_once), options.out, more)
        for search, seed in pairs_of_seeds
    ]  # fmt: skip
    found: dict[Search, dict[str, Counts]] = {search: defaultdict(Counts) for search in searches}
    with ProcessPoolExecutor(at_once, mp_context=get_context("spawn")) as pool:
        running = {pool.submit(_campaign, task): task for task in tasks}
        for done in as_completed(running):
            for case, more_of_it in done.result().items():
                found[running[done].search][case].add(more_of_it)
            _write({search: counts for search, counts in found.items() if counts}, options.seeds, options.out)
    sys.stdout.write((options.out / "avoidable.md").read_text(encoding="utf-8"))


def _write(found: Mapping[Search, Mapping[str, Counts]], seeds: Sequence[int], out: Path) -> None:
    """Write the table of what there is so far."""
    cases = max(map(len, found.values()))
    tables = {search: _summary(counts) for search, counts in found.items()}
    (out / "avoidable.md").write_text(_markdown(tables, found, cases, seeds), encoding="utf-8")
    rows = [asdict(search) | {"figures": table} for search, table in tables.items()]
    (out / "avoidable.json").write_text(json.dumps({"cases": cases, "rows": rows}, indent=1) + "\n")


def _campaign(task: Task) -> dict[str, Counts]:
    """Run a campaign over the test cases of a task, and return what it found in each."""
    search, folder = task.search, task.out / f"{task.search.name}_{task.seed}"
    settings = CampaignSettings(driver=search.driver, ranker=search.ranker, preset=search.preset, seed=task.seed,
                                allocation=search.allocation, against=task.against, **task.more)  # fmt: skip
    cases = chosen_cases(task.half)[:: task.every]
    folder.mkdir(parents=True, exist_ok=True)
    with Store(folder / "store") as store:
        result = run_campaign(cases, settings, out=folder, store=store, options=RunOptions(jobs=task.jobs))
    sys.stderr.write(f"{search.name}, seed {task.seed}: {result.total.failed} failures, {len(result.findings)} findings"
                     f"{', interrupted' if result.interrupted else ''}, {len(result.broken)} broken\n")  # fmt: skip
    return counted(result)


def counted(result: CampaignResult) -> dict[str, Counts]:
    """Return what a campaign found in each of its test cases."""
    counts: dict[str, Counts] = {seed.id: Counts(simulated_s=seed.duration_s) for seed in result.seeds}
    failing: dict[str, ChildOutcome] = {}
    for clip in result.clips:
        here = counts[clip.seed]
        here.clips += bool(clip.children)
        derived_s = clip.duration_s + sum(child.duration_s for child in clip.children)
        here.simulated_s += derived_s
        here.derived_s += derived_s
        here.children += len(clip.children)
        for child in clip.failing:
            failing[child.name] = child
            here.failures += 1
            here.avoided += bool(child.avoided)
            here.preventable += child.preventable is Preventable.YES
            here.anticipated += _anticipated(child)
    for finding in result.findings:
        if not finding.clip:  # a test case that fails unmutated
            continue
        here = counts[finding.test_case]
        known = [failing[name] for name in (finding.name, *finding.siblings) if name in failing]
        avoided, anticipated = any(c.avoided for c in known), any(map(_anticipated, known))
        here.findings += 1
        here.avoided_findings += avoided
        here.anticipated_findings += anticipated
        here.avoidable_findings += avoided or anticipated or any(c.preventable is Preventable.YES for c in known)
    return counts


def _anticipated(child: ChildOutcome) -> bool:
    return child.anticipation is not None and child.anticipation.answer.preventable


def _summary(counts: Mapping[str, Counts]) -> dict[str, Any]:
    """Return sums over test cases and ratios with intervals."""
    table = np.array([[getattr(counts[case], name) for name in COLUMNS] for case in sorted(counts)])
    totals = dict(zip(COLUMNS, table.sum(axis=0).tolist(), strict=True))
    ratios = {
        "failures_per_clip": _ratio(table, "failures", "clips"),
        "findings_avoided": _ratio(table, "avoided_findings", "findings"),
        "findings_avoidable": _ratio(table, "avoidable_findings", "findings"),
        "avoided_findings_per_hour": _ratio(table, "avoided_findings", "simulated_s", 3600.0),
        "avoidable_findings_per_hour": _ratio(table, "avoidable_findings", "simulated_s", 3600.0),
        "avoidable_findings_per_derived_hour": _ratio(table, "avoidable_findings", "derived_s", 3600.0),
    }
    intervals = {name: _interval(table[:, k]) for k, name in enumerate(COLUMNS)}
    return {"totals": totals, "intervals": intervals, "ratios": ratios}


def _resampled(count: int) -> NDArray[np.intp]:
    return np.random.default_rng(_SEED).integers(0, count, (RESAMPLES, count))


def _interval(values: NDArray[np.float64]) -> list[float]:
    sums = values[_resampled(len(values))].sum(axis=1)
    return [float(v) for v in np.percentile(sums, [2.5, 97.5])]


def _ratio(table: NDArray[np.float64], over: str, under: str, scale: float = 1.0) -> list[float]:
    """Return a ratio of sums and its 95 % interval, by resampling test cases."""
    a, b = table[:, COLUMNS.index(over)], table[:, COLUMNS.index(under)]
    drawn = _resampled(len(table))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = scale * a[drawn].sum(axis=1) / b[drawn].sum(axis=1)
    value = scale * a.sum() / b.sum() if b.sum() else float("nan")
    known = ratios[np.isfinite(ratios)]
    low, high = np.percentile(known, [2.5, 97.5]) if len(known) else (float("nan"), float("nan"))
    return [float(value), float(low), float(high)]


def _against(
    mine: Mapping[str, Counts], other: Mapping[str, Counts], what: str, clock: str = "simulated_s"
) -> list[float]:
    """Return how many times as many of something one search finds per simulated second, resampling test cases."""
    cases = sorted(mine)

    def column(of: Mapping[str, Counts], name: str) -> NDArray[np.float64]:
        return np.array([getattr(of[case], name) for case in cases])

    drawn = _resampled(len(cases))
    a, ta, b, tb = column(mine, what), column(mine, clock), column(other, what), column(other, clock)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = (a[drawn].sum(1) / ta[drawn].sum(1)) / (b[drawn].sum(1) / tb[drawn].sum(1))
        value = (a.sum() / ta.sum()) / (b.sum() / tb.sum())
    known = ratios[np.isfinite(ratios)]
    low, high = np.percentile(known, [2.5, 97.5]) if len(known) else (float("nan"), float("nan"))
    return [float(value), float(low), float(high)]


def _markdown(
    tables: Mapping[Search, Mapping[str, Any]], found: Mapping[Search, Mapping[str, Counts]], cases: int,
    seeds: Sequence[int],
) -> str:  # fmt: skip
    heads = ("driver", "ranker", "preset", "clips", "failures", "a clip", "findings", "avoided children",
             "avoided findings", "R157", "anticipating", "avoidable findings", "simulated s",
             "avoidable findings an hour", "an hour of clips and children")  # fmt: skip
    lines = [f"{cases} test cases, seeds {', '.join(map(str, seeds))}; in brackets 95 % by bootstrap over test cases",
             "", "| " + " | ".join(heads) + " |", "| " + " | ".join("---" for _ in heads) + " |"]  # fmt: skip
    for search, table in tables.items():
        total, interval, ratio = table["totals"], table["intervals"], table["ratios"]

        def sum_of(name: str, total: Any = total, interval: Any = interval) -> str:  # noqa: ANN401  JSON
            return f"{total[name]:.0f} [{interval[name][0]:.0f}, {interval[name][1]:.0f}]"

        preset = search.preset if search.allocation == "even" else f"{search.preset}, {search.allocation}"
        cells = [search.driver, search.ranker, preset, f"{total['clips']:.0f}", sum_of("failures"),
                 _bracketed(ratio["failures_per_clip"], 3), sum_of("findings"), sum_of("avoided"),
                 sum_of("avoided_findings"), sum_of("preventable"), sum_of("anticipated"),
                 f"{sum_of('avoidable_findings')}, {_bracketed(ratio['findings_avoidable'], 2)} of all",
                 f"{total['simulated_s']:.0f}", _bracketed(ratio["avoidable_findings_per_hour"], 1),
                 _bracketed(ratio["avoidable_findings_per_derived_hour"], 1)]  # fmt: skip
        lines.append("| " + " | ".join(cells) + " |")
    lines += ["", "At equal simulated time, avoidable findings of the one over those of the other:", "",
              "| driver | one | other | ratio | of clips and children |", "| --- |" + " --- |" * 4]  # fmt: skip
    for one, other in itertools.permutations(tables, 2):
        if one.driver == other.driver:
            ratios = (
                _bracketed(_against(found[one], found[other], "avoidable_findings", clock), 2)
                for clock in ("simulated_s", "derived_s")
            )
            names = (f"{s.ranker}, {s.preset}" for s in (one, other))
            lines.append(f"| {' | '.join((one.driver, *names, *ratios))} |")
    return "\n".join(lines) + "\n"


def _bracketed(value: Sequence[float], digits: int) -> str:
    return f"{value[0]:.{digits}f} [{value[1]:.{digits}f}, {value[2]:.{digits}f}]"


if __name__ == "__main__":
    main()
