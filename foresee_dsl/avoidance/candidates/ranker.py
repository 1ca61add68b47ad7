"""The ranker `careful`: it orders a run's moments by the failures near them that a careful driver could avoid."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from foresee_dsl.avoidance.candidates.behaviours import CarefulSettings
from foresee_dsl.avoidance.candidates.recorded import RecordedRun
from foresee_dsl.avoidance.candidates.scoring import ScoredCandidate, search
from foresee_dsl.forecast.foresee import CloseEncounter, ForeseeRanker, close_encounters
from foresee_dsl.forecast.protocol import RiskyPoint
from foresee_dsl.forecast.settings import ForeseeSettings
from foresee_dsl.simulate.trace import STEP_S, Trace

BEST = 4
"""Number of the best candidates whose mean score is the score of a moment (the children of a clip in a campaign)."""
APART_S = 2.0
"""Of two moments that are less than this apart, only the better one counts, s. Ours: clips of 10 s that begin closer
together show the same events.
"""


_Moment = tuple[float, CloseEncounter, ScoredCandidate]
"""The score of a moment, its encounter, and its best candidate."""


@dataclass(frozen=True)
class CarefulRanker:
    """Ranks encounters by the best candidates around them: behaviours of an actor that hit the recorded ego and that a
    careful driver could have avoided. Moments without candidates follow in the order of `foresee`."""

    settings: CarefulSettings = field(default_factory=CarefulSettings)
    encounters: ForeseeSettings = field(
        default_factory=lambda: ForeseeSettings(vehicle_radius_m=15.0, pedestrian_radius_m=25.0)
    )
    name: str = "careful"

    def rank(
        self, trace: Trace, *, seed: int = 0, before_s: float = 5.0, after_s: float = 5.0
    ) -> tuple[RiskyPoint, ...]:
        """Rank the moments of a run; see `Ranker.rank`."""
        run = RecordedRun.of(trace)
        ranked: list[_Moment] = []
        for number, encounter in enumerate(close_encounters(trace, self.encounters, before_s=before_s)):
            first = max(0, encounter.frame - round(before_s / STEP_S))
            last = min(trace.frames - 1, encounter.frame + round(after_s / STEP_S))
            rng = np.random.default_rng(np.random.SeedSequence([seed, number]))
            best = search(run, [encounter.actor], first, last, encounter.frame, rng, self.settings)[:BEST]
            if best:
                ranked.append((sum(s.score for s in best) / BEST, encounter, best[0]))
        ranked.sort(key=lambda f: (-f[0], f[1].frame, f[1].actor))
        points = [_point(trace, *f, before_s) for f in _apart(ranked)]
        for other in ForeseeRanker().rank(trace, seed=seed, before_s=before_s, after_s=after_s):
            if all(abs(other.time_s - p.time_s) >= APART_S for p in points):
                points.append(replace(other, score=0.0))
        return tuple(replace(p, rank=k) for k, p in enumerate(points, start=1))


def _apart(ranked: list[_Moment]) -> list[_Moment]:
    moments: list[_Moment] = []
    for moment in ranked:
        if all(abs(moment[1].frame - k[1].frame) * STEP_S >= APART_S for k in moments):
            moments.append(moment)
    return moments


def _point(trace: Trace, score: float, encounter: CloseEncounter, best: ScoredCandidate, before_s: float) -> RiskyPoint:
    begins_s = max(0.0, float(trace.time_s[encounter.frame]) - before_s)
    return RiskyPoint(
        rank=0,
        frame=encounter.frame,
        time_s=float(trace.time_s[encounter.frame]),
        actor=trace.actors[encounter.actor].id,
        group="close",
        distance_m=encounter.distance_m,
        trajectory_distance_m=float("nan"),
        score=score,
        why=best.sentence(begins_s),
    )
