"""Compares SelfOracle with the other rankers: campaigns of the bundled library, and events that its alarms warn of.

    python -m training.selforacle.evaluate --driver pdm --half even --out FOLDER

The same test cases, settings and seeds for every ranker, one risky point per run by default; without rankers, only the
alarms before near misses are counted. The same command gives the same figures. Finished runs are kept in the folder, so
that a repetition is fast.
"""

from __future__ import annotations

import argparse
import hashlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from foresee_study.halves import Half, of_half
from foresee_study.selforacle.ranker import ConvolutionalRanker, Segment, SelfOracleRanker
from foresee_study.selforacle.watcher import watcher_of
from scipy.stats import spearmanr

from foresee_dsl.avoidance.r157.assessing import Preventable
from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.campaign.execution.engine import run_campaign
from foresee_dsl.campaign.keys import driver_identity
from foresee_dsl.campaign.results import CampaignResult
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.storage.store import Store
from foresee_dsl.campaign.workers.pool import RunOptions
from foresee_dsl.compile import compile_test_case
from foresee_dsl.files import data_folder
from foresee_dsl.forecast.protocol import Surroundings
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.model import Clip
from foresee_dsl.language.parser import parse
from foresee_dsl.language.project.loading import load_test_cases
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.trace import Trace
from training.selforacle.alarms import Event, Tally, near_misses_of

RANKERS = ("foresee", "proximity", "random", "selforacle", "selforacle_conv")
FIRST = 4
"""Number of segments of a run that are compared: as many as a campaign has risky points by default."""
HALVES = (Half.EVEN.value, Half.ODD.value)


def main() -> None:
    """Run the campaigns and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--driver", default="pdm")
    parser.add_argument("--half", choices=list(HALVES), help="only test cases whose name's hash is even, or odd")
    parser.add_argument("--every", type=int, default=1, help="use only one in this number")
    parser.add_argument("--risky-points", type=int, default=1)
    parser.add_argument("--children", type=int, default=4)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--rankers", nargs="*", default=list(RANKERS))
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    cases = chosen_cases(options.half)[:: options.every]
    results = {
        name: _campaign(cases, CampaignSettings(
            driver=options.driver, ranker=name, preset="focused", risky_points=options.risky_points,
            children=options.children,
        ), options.out, options.jobs)
        for name in options.rankers
    }  # fmt: skip
    _say(f"{len(cases)} test cases, driver {options.driver}, at most {options.risky_points} risky point(s) a run")
    for name, result in results.items():
        _say(row(name, result))
    passed = [(case, trace) for case in cases if (trace := _passed(case, options.driver, options.out)) is not None]
    seen: dict[str, list[list[Segment]]] = {}
    near = [near_misses_of(trace) for _, trace in passed]
    _say(f"{len(passed)} runs passed; {sum(map(bool, near))} of them have near misses, {sum(map(len, near))} in all")
    studied = [_studied(case, trace, list(results.values())) for case, trace in passed]
    for ranker in (SelfOracleRanker(), ConvolutionalRanker()):
        threshold = watcher_of(ranker.name, options.driver).threshold
        segments = seen[ranker.name] = [ranker.within(_around(case)).segments(trace) for case, trace in passed]
        misses, children = Tally(), Tally()
        for run_segments, events, (moments, failing) in zip(segments, near, studied, strict=True):
            misses.add(run_segments, threshold, events)
            children.add([s for s in run_segments if _at_one_of(s, moments)], threshold, failing)
        calm = [
            s.error > threshold
            for run_segments, events in zip(segments, near, strict=True)
            if not events
            for s in run_segments
        ]
        _say(f"{ranker.name}, near misses: {misses.score()}")
        if results:
            _say(f"{ranker.name}, failures of children: {children.score()}")
        _say(f"{ranker.name}, runs without a near miss: alarms in {np.mean(calm):.1%} of {len(calm)} segments")
    _say(agreement(*seen.values()))


def chosen_cases(half: str | None) -> list[TestCase]:
    """Return the library's test cases, or one half of them by the hash of their names."""
    folder = data_folder("scenarios")
    cases = load_test_cases(sorted(str(file) for file in folder.glob("scenario*")))
    return list(of_half(cases, Half.ALL if half is None else Half(half)))


def row(name: str, result: CampaignResult) -> str:
    """Return a ranker's line of the table."""
    total = result.row()
    failing = [clip for clip in result.clips if clip.failing]
    avoidable = sum(child.preventable is Preventable.YES for clip in result.clips for child in clip.failing)
    kinds = " ".join(f"{kind} {count}" for kind, count in total.failures.items() if count)
    return (
        f"{name:16} points {total.risky_points:4}, clips {total.clips:4}, children {total.children:4}, "
        f"failing {sum(total.failures.values()):3} ({kinds}), clips with one {len(failing):3}, avoidable "
        f"{avoidable:3}, {total.simulated_s:.0f} s simulated"
    )


def agreement(dense: Sequence[Sequence[Segment]], conv: Sequence[Sequence[Segment]]) -> str:
    """Return in words how similarly the two networks rank the segments of each run."""
    alike, common, first = [], [], 0
    for mine, other in zip(dense, conv, strict=True):
        if len(mine) > FIRST:
            alike.append(float(spearmanr([s.error for s in mine], [s.error for s in other]).statistic))
            best = [sorted(run_segments, key=lambda s: -s.error)[:FIRST] for run_segments in (mine, other)]
            common.append(len({s.first for s in best[0]} & {s.first for s in best[1]}) / FIRST)
            first += best[0][0].first == best[1][0].first
    return (
        f"both networks, {len(alike)} runs: rank correlation of a run's segments {np.mean(alike):.2f} in the mean; "
        f"of the {FIRST} worst segments {np.mean(common):.0%} are common; the worst one is the same in {first} runs"
    )


def _campaign(cases: Sequence[TestCase], settings: CampaignSettings, out: Path, jobs: int) -> CampaignResult:
    with Store(out / "store") as store:
        where = out / f"{settings.driver}_{settings.ranker}"
        return run_campaign(cases, settings, out=where, store=store, options=RunOptions(jobs=jobs))


def _passed(case: TestCase, driver: str, out: Path) -> Trace | None:
    """Return the trace of a run that passed. Runs are cached, under a key of all their inputs except the code."""
    identity = f"{driver_identity(driver)} {case.meaning}"
    file = out / "runs" / f"{hashlib.sha256(identity.encode()).hexdigest()[:20]}.npz"
    trace = Trace.load(file) if file.exists() else run_test_case(case, driver, 0).trace
    if not file.exists():
        file.parent.mkdir(parents=True, exist_ok=True)
        trace.save(file)
    return trace if trace.meta["verdict"] == Verdict.PASS.value else None


def _around(case: TestCase) -> Surroundings:
    return Surroundings.of(compile_test_case(case))


def _studied(case: TestCase, trace: Trace, results: Sequence[CampaignResult]) -> tuple[list[int], list[Event]]:
    """Return the moments of a run that the clips of any ranker contain, and those at which a mutant failed."""
    studied, failing = [], []
    for clip in (clip for result in results for clip in result.clips if clip.seed == case.id):
        model = parse(clip.text, clip.file).model
        if isinstance(model, Clip) and model.risk is not None and model.risk.at is not None and clip.children:
            frame = trace.frame_at(float(model.risk.at.si))
            studied.append(frame)
            if clip.failing:
                failing.append(Event(frame, frame))
    return studied, failing


def _at_one_of(segment: Segment, frames: Sequence[int]) -> bool:
    return any(segment.first - 20 <= frame <= segment.last + 20 for frame in frames)


def _say(text: str) -> None:
    print(text, flush=True)  # noqa: T201  a command's answer


if __name__ == "__main__":
    main()
