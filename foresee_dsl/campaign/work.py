"""What workers do: run a test case and forecast it, run a clip and mutate it, run a child.

Each function yields what it has as soon as it has it, so that what was finished is kept when the next part breaks.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from foresee_dsl.campaign.results import ClipOutcome, SeedOutcome
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.steps import clip_around, driver_of, measure_clip, run_child, run_test_case
from foresee_dsl.campaign.storage.attachments import CaseRef, Ref, load_case, load_trace
from foresee_dsl.campaign.storage.records import Draft, Forecast, Made, MutantDraft, Mutants
from foresee_dsl.derive.mutate import Mutator
from foresee_dsl.derive.preventability import assess
from foresee_dsl.forecast.registry import load_ranker
from foresee_dsl.language.meaning import clip_pin
from foresee_dsl.language.model import Clip, Mutant
from foresee_dsl.language.parser import parse
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.language.project.expand import expand_clip, expand_mutant
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.trace import Trace


@dataclass(frozen=True)
class SeedWork:
    """A test case to run, unless there is its `trace` already, and to forecast, unless `forecast` is "".

    Attributes:
        key, forecast: the keys of the two results. name: of the test case's files. seed: of this run.
        folder: where the clips' files will be, absolute.
    """

    key: str
    forecast: str
    case: CaseRef
    name: str
    seed: int
    settings: CampaignSettings
    folder: Path
    trace: Ref | None = None


@dataclass(frozen=True)
class ClipWork:
    """A clip to run, unless there is its own `trace` already, and to mutate.

    `mutants`: the keys of the mutations to make, each with its seed. `seed`: of the clip's own run.
    """

    key: str
    mutants: tuple[tuple[str, int], ...]
    case: CaseRef
    draft: Draft
    seed: int
    settings: CampaignSettings
    folder: Path
    parent_trace: Ref | None
    trace: Ref | None = None


@dataclass(frozen=True)
class ChildWork:
    """A mutant to run, under a name."""

    key: str
    name: str
    case: CaseRef
    draft: Draft
    mutant: MutantDraft
    seed: int
    settings: CampaignSettings
    folder: Path


def run_seed(work: SeedWork) -> Iterator[Made]:
    """Run a test case; when it passes, forecast it and cut the clips around its risky points."""
    started = time.perf_counter()
    case, settings = load_case(work.case), work.settings
    if work.trace is None:
        result = run_test_case(case, settings.driver, work.seed)
        trace = result.trace
        avoided = assess(case, result) if result.verdict.is_failure else None
        outcome = SeedOutcome(
            id=case.id,
            family=case.family,
            scenario=case.scenario.name,
            verdict=result.verdict,
            reason=result.reason,
            duration_s=result.duration_s,
            wall_s=time.perf_counter() - started,
            impact=result.impact,
            near=result.near_misses,
            preventability=avoided,
        )
        yield Made(work.key, "seed", work.name, outcome, trace.packed(), settings.driver, outcome.wall_s)
        if result.verdict is not Verdict.PASS:
            return
    else:
        trace = load_trace(work.trace)
    if work.forecast:
        started = time.perf_counter()
        forecast = _forecast(work, case, trace)
        yield Made(work.forecast, "forecast", work.name, forecast, wall_s=time.perf_counter() - started)


def run_clip(work: ClipWork) -> Iterator[Made]:
    """Run a clip unmutated and measure how true it is to its parent; when it is true enough, mutate it."""
    started = time.perf_counter()
    parent, settings, draft = load_case(work.case), work.settings, work.draft
    file = work.folder / f"{draft.name}.foresee"
    if work.trace is None:
        if work.parent_trace is None:
            raise ValueError(f"clip {draft.name} has no parent's trace to be compared with")
        model, clip_case, result, found = measure_clip(
            _clip_of(draft.text),
            parent,
            load_trace(work.parent_trace),
            file,
            driver=settings.driver,
            seed=work.seed,
        )
        trace = result.trace
        outcome = ClipOutcome(
            seed=parent.id,
            family=parent.family,
            name=draft.name,
            file=file.name,
            text=print_model(model),
            rank=draft.rank,
            verdict=result.verdict,
            reason=result.reason,
            duration_s=result.duration_s,
            wall_s=time.perf_counter() - started,
            largest_m=found.largest_m,
            median_m=found.median_others_m,
            within=found.share_others_within,
            others_m=found.others_m,
            ego_m=found.ego_m,
        )
        yield Made(work.key, "clip", draft.name, outcome, trace.packed(), settings.driver, outcome.wall_s)
        if not worth_mutating(outcome, settings):
            return
    else:
        model, trace = _clip_of(draft.text), load_trace(work.trace)
        clip_case = expand_clip(model, parent, source=file)
    if not work.mutants:
        return
    mutator, drove = Mutator(clip_case, model, trace, preset=settings.preset), driver_of(trace, settings.driver)
    for key, seed in work.mutants:
        started = time.perf_counter()
        mutants = _drafts(mutator.children(settings.children, seed=seed, driver=drove), clip_case, work.folder)
        yield Made(key, "mutants", draft.name, mutants, wall_s=time.perf_counter() - started)


def run_mutant(work: ChildWork) -> Iterator[Made]:
    """Run one mutated child."""
    started = time.perf_counter()
    settings, draft = work.settings, work.draft
    clip_case = _clip_case(draft.text, work.case, work.folder / f"{draft.name}.foresee")
    mutant = _mutant_of(work.mutant.text, work.name)
    file = work.folder / f"{mutant.name}.foresee"
    outcome, result = run_child(mutant, clip_case, file, file.as_posix(), driver=settings.driver, seed=work.seed)
    trace = result.trace.packed() if result.verdict.is_failure else None
    wall_s = time.perf_counter() - started
    yield Made(work.key, "child", mutant.name, outcome, trace, settings.driver, wall_s)


def worth_mutating(clip: ClipOutcome, settings: CampaignSettings) -> bool:
    """Whether a clip is mutated: its unmutated run passed, and is true to its parent's."""
    return clip.largest_m <= settings.fidelity_limit_m and clip.verdict is Verdict.PASS


def _forecast(work: SeedWork, case: TestCase, trace: Trace) -> Forecast:
    settings = work.settings
    window = {"before_s": settings.before_s, "after_s": settings.after_s}
    points = load_ranker(settings.ranker).rank(trace, seed=work.seed, **window)
    drafts = []
    for point in points[: settings.risky_points]:
        file = work.folder / f"{work.name}_p{point.rank}.foresee"
        clip = clip_around(case, trace, point, file, **window, handover_s=settings.handover_s)
        drafts.append(_draft(clip, point.rank))
    return Forecast(len(points), tuple(drafts))


def _draft(clip: Clip, rank: int) -> Draft:
    risk = clip.risk.model_dump_json() if clip.risk is not None else ""
    return Draft(
        rank=rank,
        text=print_model(clip),
        name=clip.name,
        parent=clip.parent,
        case=clip.case or "",
        pin=clip_pin(clip, clip.pin),
        risk=hashlib.sha256(risk.encode()).hexdigest()[:12],
    )


def _drafts(made: Iterable[Mutant], clip_case: TestCase, folder: Path) -> Mutants:
    drafts = []
    for mutant in made:
        meaning = expand_mutant(mutant, clip_case, source=folder / f"{mutant.name}.foresee").meaning
        number = int(mutant.name.rpartition("_m")[2])
        drafts.append(MutantDraft(number, print_model(mutant), meaning))
    return Mutants(tuple(drafts))


@lru_cache(maxsize=16)
def _clip_case(text: str, parent: CaseRef, file: Path) -> TestCase:
    return expand_clip(_clip_of(text), load_case(parent), source=file)


def _clip_of(text: str) -> Clip:
    model = parse(text, "a clip of this campaign").model
    if not isinstance(model, Clip):
        raise TypeError(f"{model.name} was printed from a clip and is now a {model.kind}")
    return model


def _mutant_of(text: str, name: str) -> Mutant:
    model = parse(text, "a mutant of this campaign").model
    if not isinstance(model, Mutant):
        raise TypeError(f"{model.name} was printed from a mutant and is now a {model.kind}")
    return model.model_copy(update={"name": name})
