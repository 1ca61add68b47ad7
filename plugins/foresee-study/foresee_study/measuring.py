"""Measures a campaign from its store; a study keeps the result."""

from __future__ import annotations

import hashlib
import io
from collections import defaultdict
from collections.abc import Mapping, Sequence

from foresee_dsl import __version__
from foresee_dsl.campaign.assembly import assemble
from foresee_dsl.campaign.records import CaseRunOutcome, ChildOutcome, ClipOutcome
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.stages import Stages
from foresee_dsl.campaign.steps.child import ChildStep
from foresee_dsl.campaign.steps.clip import ClipStep
from foresee_dsl.campaign.steps.clip_check import ClipCheckStep
from foresee_dsl.campaign.storage.store import Store, StoredResult
from foresee_dsl.forecast.foresee import close_encounters
from foresee_dsl.forecast.settings import ForeseeSettings
from foresee_dsl.language.model import Clip, Quantity
from foresee_dsl.language.parser import parse
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.trace import Trace
from foresee_dsl.story import Story
from foresee_study.halves import half_of
from foresee_study.measured import AVOIDERS, Child, MeasuredCampaign, MeasuredCase, MeasuredClip
from foresee_study.settings import StudyCampaign


def measure(stages: Stages, store: Store, wanted: StudyCampaign) -> MeasuredCampaign:
    """Return the results of a campaign in its store; missing steps are left out."""
    settings = stages.settings
    result, _ = assemble(stages, stages.out)
    ran = [(node, row) for node, row in stages.walk() if row is not None]
    rows = {(node.step.kind, node.step.name): row for node, row in ran}
    children: defaultdict[str, list[StoredResult]] = defaultdict(list)
    for node, row in ran:
        if node.step.kind == ChildStep.kind:
            children[node.over(ClipStep.kind).step.name].append(row)
    names = {node.case.id: node.step.name for node in stages.seeds}
    clips: dict[str, list[ClipOutcome]] = {}
    for clip in result.clips:  # sorted by test case and rank
        clips.setdefault(clip.seed, []).append(clip)
    cases = (
        MeasuredCase(
            name=names[seed.id],
            family=seed.family,
            half=half_of(seed.id),
            verdict=seed.verdict,
            simulated_s=round(seed.duration_s, 2),
            wall_s=round(rows["seed", names[seed.id]].wall_s, 4),
            story=_story(seed.story, seed.family),
            clips=tuple(_clip(k, clip, rows, children[clip.name]) for k, clip in enumerate(clips.get(seed.id, ()))),
            encounters_s=_encounters_s(store, rows["seed", names[seed.id]], settings)
            if seed.verdict is Verdict.PASS
            else None,
        )
        for seed in result.seeds
    )
    return MeasuredCampaign(
        group=wanted.group,
        driver=settings.driver,
        ranker=wanted.ranker,
        preset=settings.preset,
        before_s=settings.before_s,
        after_s=settings.after_s,
        risky_points=settings.risky_points,
        children=settings.children,
        repetition=wanted.repetition,
        seed=settings.seed,
        tool=__version__,
        cases=tuple(sorted(cases, key=lambda case: case.name)),
        against=settings.against,
        budget_s=wanted.budget_s,
        allocation=settings.allocation,
    )


def _clip(
    position: int, clip: ClipOutcome, rows: Mapping[tuple[str, str], StoredResult], children: Sequence[StoredResult]
) -> MeasuredClip:
    """Return a clip; `children`: the rows of all its mutants. The time of those that do not count is the clip's."""
    counted = tuple(
        Child(
            verdict=child.verdict,
            simulated_s=round(child.duration_s, 2),
            wall_s=round(rows["child", child.name].wall_s, 4),
            story=_story(child.story, clip.family),
            avoided_by=avoided_by(child),
            steered=child.story.grounds.steered if child.story is not None else None,
        )
        for child in clip.children
    )
    own = [row for kind in (ClipStep.kind, ClipCheckStep.kind) if (row := rows.get((kind, clip.name))) is not None]
    without = children if clip.dropped else ()
    return MeasuredClip(
        position,
        clip.verdict,
        round(clip.duration_s + sum(row.simulated_s for row in without), 2),
        round(sum(row.wall_s for row in (*own, *without)), 4),
        counted,
        _risky_point_s(clip),
    )


def _risky_point_s(clip: ClipOutcome) -> float | None:
    """Return the time of a clip's risky point in its test case, s."""
    definition = parse(clip.text, clip.file).model
    at = definition.risk.at if isinstance(definition, Clip) and definition.risk is not None else None
    return at.si if isinstance(at, Quantity) else None


def _encounters_s(store: Store, row: StoredResult, settings: CampaignSettings) -> tuple[float, ...] | None:
    """Return the times of all close encounters of a stored run (step 1a of the forecaster), s; None if its trace is not
    stored."""
    data = store.blobs.get(row.trace) if row.trace else None
    if data is None:
        return None
    trace = Trace.load(io.BytesIO(data))
    encounters = close_encounters(trace, ForeseeSettings(), before_s=settings.before_s)
    return tuple(round(float(trace.time_s[encounter.frame]), 2) for encounter in encounters)


def avoided_by(failure: ChildOutcome | CaseRunOutcome) -> str:
    """Return the judges that avoid a failure, letters of `AVOIDERS`."""
    careful, anticipating = failure.preventability, failure.anticipation
    who = {
        "d": bool(failure.avoided),
        "b": careful is not None and careful.avoids,
        "a": anticipating is not None and anticipating.avoids,
    }
    return "".join(letter for letter in AVOIDERS if who[letter])


def _story(story: Story | None, family: str) -> str:
    """Return a short hash of a story's signature and its family: equal for stories of the same finding; "" without a
    story."""
    if story is None:
        return ""
    return hashlib.sha256("\n".join((family, *story.signature)).encode()).hexdigest()[:12]
