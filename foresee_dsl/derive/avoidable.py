"""The mutants of the preset `avoidable`: the best candidates for a clip, each as a change of the clip."""

from __future__ import annotations

import math

import numpy as np
from numpy.random import Generator

from foresee_dsl.avoidance.candidates.behaviours import Candidate, Kind
from foresee_dsl.avoidance.candidates.recorded import RecordedRun
from foresee_dsl.avoidance.candidates.scoring import ScoredCandidate, search
from foresee_dsl.compile.roads.polyline import Polyline
from foresee_dsl.derive.operators.paper import largest_share
from foresee_dsl.derive.operators.situation import Situation, is_free
from foresee_dsl.derive.presets import MutationPreset
from foresee_dsl.language.model import Change, IgnoresRule, Quantity
from foresee_dsl.language.model.derived import NOTHING

SAME_KIND = 0.5
"""Factor on a candidate's score for each child of the same actor and kind that is chosen already. Ours: a second
strength of one behaviour often ends the same way."""
SAME_ACTOR = 0.8
"""Factor on a candidate's score for each child of the same actor that is chosen already. Ours."""
LEAST = 0.15
"""Of the candidates of a clip whose score is lower than this, at most `UNSURE` are used. Ours: a candidate with this
score hits even a driver that reacts late. Of 116 children of 11 test cases, 6 of the 9 with a score of at least 0.4
failed, 1 of the 18 with a score between 0.2 and 0.4, and none of the 89 with a lower score.
"""
HARDLY = 0.08
"""A candidate with a lower score than this is not simulated. Ours: it misses even a driver that does not react."""
ALIKE = 2
"""Maximum number of mutants for each actor and kind of change. Ours: a third such mutant ends like the first two."""
UNSURE = 2
"""Maximum number of mutants with a score between `HARDLY` and `LEAST`. Ours: they test whether the driver reacts at
all; with cyclists beside `pdm`, one in four such mutants failed."""
_PROPERTY = {
    Kind.LATE: "delay",
    Kind.EARLY: "moving",
    Kind.PACE: "timing",
    Kind.HESITATES: "brakes",
    Kind.BRAKES: "brakes",
    Kind.HALTS: "brakes",
    Kind.DRIFTS: "line",
    Kind.CUTS_IN: "line",
    Kind.SWERVES: "steer",
    Kind.RUNS_LIGHT: "ignores",
    Kind.TAKES_WAY: "ignores",
}
"""For each behaviour, the property that it changes."""

Children = list[tuple[tuple[str, ...], tuple[Change, ...]]]


def avoidable(situation: Situation, preset: MutationPreset, count: int, rng: Generator) -> Children:
    """Return up to `count` mutants (names of operators, and changes): the best first, and of several kinds."""
    if preset.search is None:
        return []
    trace = situation.trace
    heights = {name: spec.height_m for name, spec in situation.models.items()}
    run = RecordedRun.of(trace, heights)
    candidates = search(run, list(situation.columns.values()), 0, trace.frames - 1, situation.frame, rng, preset.search)
    remaining = [
        (scored, change)
        for scored in candidates
        if scored.score >= HARDLY and (change := _change(situation, preset, scored.candidate))
    ]
    children: Children = []
    chosen: list[Candidate] = []
    unsure = 0
    while remaining and len(children) < count and unsure < UNSURE:
        sure = [pair for pair in remaining if pair[0].score >= LEAST]
        best, change = max(sure or remaining, key=lambda pair: _worth(pair[0], chosen))
        unsure += not sure
        remaining = [pair for pair in remaining if pair[1] != change]
        chosen.append(best.candidate)
        if sum(map(best.candidate.is_like, chosen)) == ALIKE:
            remaining = [pair for pair in remaining if not pair[0].candidate.is_like(best.candidate)]
        children.append(((best.candidate.kind.value,), (change,)))
    return children


def _worth(scored: ScoredCandidate, chosen: list[Candidate]) -> float:
    mine = scored.candidate
    actor = sum(c.actor == mine.actor for c in chosen)
    kind = sum(map(mine.is_like, chosen))
    return scored.score * SAME_ACTOR**actor * SAME_KIND**kind


def _change(situation: Situation, preset: MutationPreset, candidate: Candidate) -> Change | None:
    """Return the change that makes an actor behave like the candidate; None if the actor cannot behave so."""
    name, actor = _PROPERTY[candidate.kind], candidate.actor
    if name == "ignores":
        obeys = not any(isinstance(item, IgnoresRule) for item in situation.actors[actor].body)
        rule = "signals" if candidate.kind is Kind.RUNS_LIGHT else "priority"
        return Change(actor=actor, property=name, was=NOTHING, now=rule) if obeys else None
    was = situation.present_value(actor, name)
    if was is None:
        return None
    value = _value(situation, preset, candidate, was.si)
    if value is None:
        return None
    now = Quantity.of(value, was.dimension, 2)
    if now.si == was.si:
        return None
    change = Change(actor=actor, property=name, was=was, now=now)
    if candidate.at_s is None or candidate.for_s is None:
        return change
    at, long = Quantity.of(candidate.at_s, "time", 2), Quantity.of(candidate.for_s, "time", 2)
    return change.model_copy(update={"start": at, "duration": long})


def _value(situation: Situation, preset: MutationPreset, candidate: Candidate, was: float) -> float | None:
    """Return the new value of the property in SI units; None if the model or the place does not allow the behaviour."""
    spec = situation.spec(candidate.actor)
    match candidate.kind:
        case Kind.PACE:
            fastest = float(np.nanmax(situation.trace.states[:, situation.columns[candidate.actor], 3]))
            return candidate.strength if candidate.strength * fastest <= spec.max_speed_mps else None
        case Kind.EARLY:
            return was + candidate.strength if _free(situation, candidate.actor, was + candidate.strength) else None
        case Kind.SWERVES:
            frame = situation.trace.frame_at(candidate.at_s or 0.0)
            most = largest_share(spec, situation.speed_mps(candidate.actor, frame), preset.steer)
            share = math.atan(candidate.strength * spec.wheelbase_m) / spec.max_steer_rad if most > 0 else 0.0
            return min(max(share, -most), most) or None
        case _:
            return was + candidate.strength


def _free(situation: Situation, actor: str, along_m: float) -> bool:
    """Return whether an actor's footprint at a place on its path touches no other actor at the first frame."""
    info, column = situation.info(actor), situation.columns[actor]
    box = np.array([*Polyline.of(info.path).at(along_m), info.length_m, info.width_m])
    return is_free(situation.trace, column, 0, box)
