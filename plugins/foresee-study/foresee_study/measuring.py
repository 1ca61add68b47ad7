"""Measures a campaign from its store; a study keeps the result."""

from __future__ import annotations

import hashlib

from foresee_dsl import __version__
from foresee_dsl.campaign.assembly import assemble
from foresee_dsl.campaign.records import CaseRunOutcome, ChildOutcome, ClipOutcome
from foresee_dsl.campaign.stages import Stages
from foresee_dsl.story import Story
from foresee_study.halves import half_of
from foresee_study.measured import AVOIDERS, Child, MeasuredCampaign, MeasuredCase, MeasuredClip


def measure(stages: Stages, *, group: str, repetition: int) -> MeasuredCampaign:
    """Return the stored results of a campaign; missing steps are left out."""
    settings = stages.settings
    result = assemble(stages, stages.out)
    wall_s = {(node.step.kind, node.step.name): row.wall_s for node, row in stages.walk() if row is not None}
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
            wall_s=round(wall_s["seed", names[seed.id]], 4),
            story=_story(seed.story, seed.family),
            clips=tuple(_clip(k, clip, wall_s) for k, clip in enumerate(clips.get(seed.id, ()))),
        )
        for seed in result.seeds
    )
    return MeasuredCampaign(
        group=group,
        driver=settings.driver,
        ranker=settings.ranker,
        preset=settings.preset,
        before_s=settings.before_s,
        after_s=settings.after_s,
        risky_points=settings.risky_points,
        children=settings.children,
        repetition=repetition,
        seed=settings.seed,
        tool=__version__,
        cases=tuple(sorted(cases, key=lambda case: case.name)),
        against=settings.against,
    )


def _clip(position: int, clip: ClipOutcome, wall_s: dict[tuple[str, str], float]) -> MeasuredClip:
    children = (
        Child(
            verdict=child.verdict,
            simulated_s=round(child.duration_s, 2),
            wall_s=round(wall_s["child", child.name], 4),
            story=_story(child.story, clip.family),
            avoided_by=avoided_by(child),
        )
        for child in clip.children
    )
    simulated_s, wall = round(clip.duration_s, 2), round(wall_s["clip", clip.name], 4)
    return MeasuredClip(position, clip.verdict, simulated_s, wall, tuple(children))


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
