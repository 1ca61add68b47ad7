"""What a worker does: run one test case and forecast it, or run one clip and its mutated children."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path, PurePosixPath

from foresee_dsl.campaign.results import ChildOutcome, ClipDraft, ClipOutcome, SeedOutcome
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.steps import children_of, clip_around, measure_clip, run_child, run_test_case
from foresee_dsl.forecast.registry import load_ranker
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.model import Clip
from foresee_dsl.language.parser import parse
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project import load_test_case
from foresee_dsl.simulate.trace import Trace
from foresee_dsl.simulate.verdict import Verdict


@dataclass(frozen=True)
class SeedTask:
    """One test case to run.

    `folder`: where its children's files will be, relative to the campaign's folder `out`. `work`: where files gather
    until then.
    """

    address: str
    name: str
    folder: str
    out: Path
    work: Path
    settings: CampaignSettings


@dataclass(frozen=True)
class ClipTask:
    """One clip to run and mutate; `trace` (its parent's) is relative to the folder where files gather."""

    seed: SeedTask
    family: str
    trace: str
    draft: ClipDraft


def run_seed(task: SeedTask) -> SeedOutcome:
    """Run a test case; when it passes, forecast it and clip it around its risky points."""
    started = time.perf_counter()
    settings = task.settings
    case = _parent(task.address)
    result = run_test_case(case, settings.driver, settings.seed)
    trace = f"traces/{task.name}.npz"
    result.trace.save(task.work / trace)
    outcome = SeedOutcome(
        id=task.address,
        family=case.family,
        scenario=case.scenario.name,
        verdict=result.verdict,
        reason=result.reason,
        duration_s=result.duration_s,
        wall_s=0.0,
        trace=trace,
        impact=result.impact,
        near=result.near_misses,
    )
    if result.verdict is Verdict.PASS:
        outcome = _forecast(task, case, result.trace, outcome)
    return replace(outcome, wall_s=time.perf_counter() - started)


def run_clip(task: ClipTask) -> ClipOutcome:
    """Run a clip unmutated, measure how true it is to its parent, then mutate it and run the children."""
    started = time.perf_counter()
    settings, draft = task.seed.settings, task.draft
    parent_trace = Trace.load(task.seed.work / task.trace)
    model, clip_case, result, found = measure_clip(
        _clip_of(draft),
        _parent(task.seed.address),
        parent_trace,
        task.seed.out / draft.file,
        driver=settings.driver,
        seed=settings.seed,
    )
    outcome = ClipOutcome(
        seed=task.seed.address,
        family=task.family,
        name=draft.name,
        file=draft.file,
        text=print_model(model),
        rank=draft.rank,
        verdict=result.verdict,
        reason=result.reason,
        duration_s=result.duration_s,
        wall_s=0.0,
        largest_m=found.largest_m,
        median_m=found.median_others_m,
        within=found.share_others_within,
        others_m=found.others_m,
        ego_m=found.ego_m,
    )
    if found.largest_m <= settings.fidelity_limit_m and result.verdict is Verdict.PASS:
        outcome = replace(outcome, children=_children(task, clip_case, model, result.trace))
    return replace(outcome, wall_s=time.perf_counter() - started)


def _forecast(task: SeedTask, case: TestCase, trace: Trace, outcome: SeedOutcome) -> SeedOutcome:
    settings = task.settings
    window = {"before_s": settings.before_s, "after_s": settings.after_s}
    points = load_ranker(settings.ranker).rank(trace, seed=settings.seed, **window)
    drafts = []
    for point in points[: settings.risky_points]:
        name = f"{task.name}_p{point.rank}"
        file = f"{task.folder}/{name}.foresee"
        clip = clip_around(case, trace, point, task.out / file, **window, handover_s=settings.handover_s)
        text = print_model(clip)
        drafts.append(ClipDraft(name=name, text=text, file=file, rank=point.rank))
    return replace(outcome, risky_points=len(points), clips=tuple(drafts))


def _children(task: ClipTask, clip_case: TestCase, model: Clip, clip_trace: Trace) -> tuple[ChildOutcome, ...]:
    settings = task.seed.settings
    folder = PurePosixPath(task.draft.file).parent
    outcomes = []
    for mutant in children_of(
        clip_case,
        model,
        clip_trace,
        preset=settings.preset,
        count=settings.children,
        driver=settings.driver,
        seed=settings.seed,
    ):
        file = str(folder / f"{mutant.name}.foresee")
        outcome, result = run_child(
            mutant, clip_case, task.seed.out / file, file, driver=settings.driver, seed=settings.seed
        )
        if result.verdict.is_failure:
            result.trace.save(task.seed.work / "traces" / f"{mutant.name}.npz")
        outcomes.append(outcome)
    return tuple(outcomes)


def _clip_of(draft: ClipDraft) -> Clip:
    model = parse(draft.text, draft.file).model
    if not isinstance(model, Clip):
        raise TypeError(f"{draft.file} was printed from a clip and is now a {model.kind}")
    return model


@lru_cache(maxsize=4)
def _parent(address: str) -> TestCase:
    return load_test_case(address)
