"""Scores candidates: how likely each hits the recorded ego, and how likely a careful driver could have avoided that."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from foresee_dsl.avoidance.candidates.behaviours import Behaviours, Candidate, CarefulSettings, Kind
from foresee_dsl.avoidance.candidates.recorded import RecordedRun
from foresee_dsl.kernels.arrays import BoolArray, FloatArray, Records
from foresee_dsl.kernels.records import dtype_of
from foresee_dsl.kernels.what_if import PathStyle, RollOutEnding, WhatIf, roll_out
from foresee_dsl.simulate.trace import STEP_S

BLIND = PathStyle(delay=99.0, horizon=2.0, braking=6.0, pace=1.0, aside=0.0, room=0.0)
"""The driver that does not react. Candidates that miss it by a wide margin are not rolled out further."""
DRIVES = (
    PathStyle(delay=0.3, horizon=4.0, braking=8.0, pace=1.0, aside=0.0, room=0.0),
    PathStyle(delay=0.3, horizon=2.5, braking=8.0, pace=1.0, aside=0.0, room=0.0),
    PathStyle(delay=0.5, horizon=2.0, braking=7.0, pace=1.0, aside=0.0, room=0.0),
    PathStyle(delay=0.8, horizon=2.0, braking=6.0, pace=1.0, aside=0.0, room=0.0),
)
"""The driver under test, whose reaction is not known in advance: four styles that span the bundled drivers. Ours."""
CAREFUL = (
    PathStyle(delay=0.3, horizon=4.0, braking=5.0, pace=1.0, aside=0.0, room=0.5),
    PathStyle(delay=0.4, horizon=3.0, braking=6.0, pace=0.85, aside=0.0, room=0.3),
    PathStyle(delay=0.4, horizon=3.0, braking=6.0, pace=0.7, aside=0.0, room=0.3),
    PathStyle(delay=0.4, horizon=3.0, braking=6.0, pace=1.0, aside=0.7, room=0.2),
    PathStyle(delay=0.4, horizon=3.0, braking=6.0, pace=1.0, aside=-0.7, room=0.2),
)
"""Careful drivers: one brakes early, two approach more slowly, one keeps to the left and one to the right. Ours: less
than half a lane's free width aside, and the speed of a driver who expects a hazard."""
NEAR_M = 0.25
"""If the roll-out misses the ego by this distance, the probability of a hit is about a third of that for a distance of
zero, m. Ours: the error of a roll-out after some seconds.
"""
EGO_STANDS_MPS = 0.5
"""Speed below which the ego stands at the contact, m/s; such a contact counts as unavoidable."""
SUDDEN, SUDDEN_S = 0.5, 0.7
"""Probability of a hit by an actor that gets in the way of a driver that stops just in time: the first number if the
driver has no time left, and about a third of it if the driver has the second number of seconds left. Ours: `pdm` hits
with its side a walker who steps into its way within a second.
"""
_HITS = 0.3
"""Probability of a hit if the roll-out misses the ego by zero distance; if it shows a contact, the probability is 1.
Ours.
"""
LEAST_SHARE = 0.2
"""Factor on the score if none of the careful drivers avoids the contact. Ours: in a trial, other drivers avoided some
of these contacts, but fewer than of the others.
"""
NOTICE_S = 1.15
"""Shortest time from the window's beginning to a hit that counts, s: the reaction time of R157's careful and competent
driver (`avoidance.r157.risk.REACTION_S`). A change that hits sooner says nothing about the driver.
"""
IN_LINE_RAD, IN_LINE_M = math.radians(25), 1.2
"""Largest differences in heading and in lateral position for an actor to be in the ego's line. Ours: half a car's width
and a little. Of 30 actors that braked in the line of `pdm` and that a reacting driver did not hit, none was hit."""
SHARES = (0.1, 0.3, 0.3, 0.2, 0.1)
"""Weights of `BLIND` and of each of `DRIVES`. Ours: a candidate that hits a prompt driver fails in the simulation; of
those that hit only a driver that is late or does not react, one in twenty fails.
"""
PROMISING = 0.1
"""A moment is not promising if its best candidate has a lower score than this. Ours, chosen on the even half of the
test cases: in the 260 clips whose best candidate had a score below 0.12, 1 of 268 children failed; in the other 161
clips, 62 of 373 failed. In a trial with the ranker `reach`, 0.2 gave `pdm` 21 avoidable findings in a simulated hour
instead of 14, but `idm` 7 instead of 18: a driver that reacts late fails where the scores are low.
"""

_STYLES = np.array([BLIND, *DRIVES, *CAREFUL], dtype=dtype_of(PathStyle))
_CAREFULLY = np.array([BLIND, *CAREFUL], dtype=dtype_of(PathStyle))


@dataclass(frozen=True, slots=True)
class ScoredCandidate:
    """A candidate with the results of its roll-outs.

    Attributes:
        score: 0 to 1, the likelihood of hitting the ego as it drove, times the weight of `avoidable`. avoidable:
          likelihood that a careful driver avoids the contact. contact_s: time of the smallest distance since the
          window's beginning. braking_s: time from which a careful driver brakes, if braking avoids the contact. gap_m:
          smallest distance to the ego as it drove. reacts: whether it hits a driver that reacts.
    """

    candidate: Candidate
    score: float
    avoidable: float
    contact_s: float
    braking_s: float | None
    gap_m: float
    reacts: bool

    def sentence(self, begins_s: float) -> str:
        """Return the outcome in words, with times of the run; `begins_s`: the window's beginning in the run."""
        if self.gap_m > 0:
            return f"{self.candidate.sentence}: {self.gap_m:.1f} m are left at {begins_s + self.contact_s:.1f} s"
        ends = f"contact at {begins_s + self.contact_s:.1f} s"
        if not self.reacts:
            return f"{self.candidate.sentence}: {ends} unless the driver reacts"
        if self.braking_s is not None:
            return f"{self.candidate.sentence}: {ends}, avoidable by braking from {begins_s + self.braking_s:.1f} s"
        return f"{self.candidate.sentence}: {ends}, {_ways(self.avoidable)}"


def _ways(avoidable: float) -> str:
    return "avoidable by a slower approach or by keeping aside" if avoidable > 0 else "hardly avoidable"


def endings(run: RecordedRun, candidates: Sequence[Candidate]) -> Records:
    """Return how candidates end, [C, S].

    The S drivers are `BLIND`, then those of `DRIVES`, then those of `CAREFUL`.
    """
    rolled = np.zeros((len(candidates), len(_STYLES)), dtype=dtype_of(RollOutEnding))
    if candidates:
        whats = np.array([c.what for c in candidates], dtype=dtype_of(WhatIf))
        roll_out(whats, _STYLES, run.tracks, run.sizes, rolled)
    return rolled


def avoided_by_some(run: RecordedRun, what: WhatIf, rows: FloatArray) -> BoolArray:
    """Return whether some careful driver avoids the contact with a changed actor, [C].

    `what`: the actor and the window, without a change. `rows`: [C, T, 4] tracks that replace the actor's recorded one,
    laid out as `RecordedRun.tracks`.
    """
    rolled = np.zeros((len(rows), len(_CAREFULLY)), dtype=dtype_of(RollOutEnding))
    whats, tracks = np.array([what], dtype=dtype_of(WhatIf)), run.tracks.copy()
    for k, row in enumerate(rows):
        tracks[what.actor] = row
        roll_out(whats, _CAREFULLY, tracks, run.sizes, rolled[k : k + 1])
    avoided: BoolArray = ~np.isfinite(rolled[:, 1:]["contact"]).all(axis=1)
    return avoided


def _avoidable(careful: Records) -> FloatArray:
    """Return a score from 0 to 1: half if any careful driver avoids the contact, plus half of the share that does."""
    avoided = ~np.isfinite(careful["contact"])
    shares: FloatArray = 0.5 * avoided.any(axis=1) + 0.5 * avoided.mean(axis=1)
    return shares


def scored(run: RecordedRun, candidates: Sequence[Candidate]) -> list[ScoredCandidate]:
    """Score candidates; a candidate that hits a standing ego has a score of 0."""
    rolled = endings(run, candidates)
    count = 1 + len(DRIVES)
    drives, careful = rolled[:, :count], rolled[:, count:]
    touches = np.isfinite(drives["contact"])
    fair = drives["struck"] & (drives["ego"] >= EGO_STANDS_MPS)
    hits = np.where(touches, 1.0, _HITS * np.exp(-drives["gap"] / NEAR_M)) * fair
    # An actor that comes into the ego's way at the last moment leaves little time, although a roll-out may show that
    # the ego just stops.
    threatened_s = drives["brakes"] - np.array([style.delay for style in (BLIND, *DRIVES)])
    met_s = np.where(touches[:, :1], drives[:, :1]["contact"], -1.0)
    threatened = touches[:, :1] & np.isfinite(threatened_s)
    left_s = np.maximum(met_s - np.where(threatened, threatened_s, 0.0), 0.0)
    sudden = np.where(threatened, SUDDEN * np.exp(-left_s / SUDDEN_S), 0.0)
    hits = np.maximum(hits, sudden * fair[:, :1])
    hits[(touches & (drives["ego"] < EGO_STANDS_MPS))[:, 1:].any(axis=1)] = 0.0
    hits[drives["at"] < NOTICE_S] = 0.0  # the time of the contact, or of the smallest gap
    in_line = _ahead_in_line(run, candidates, drives[:, 0])
    hits[in_line] *= touches[in_line]
    hits[in_line, 0] = 0.0
    avoided = ~np.isfinite(careful["contact"])
    hit = hits @ np.array(SHARES)
    avoidable = _avoidable(careful)
    score = hit * (LEAST_SHARE + (1 - LEAST_SHARE) * avoidable)
    return [
        _scored(candidates[k], float(score[k]), float(avoidable[k]), drives[k], bool(avoided[k, 0]),
             careful[k, 0])
        for k in range(len(candidates))
    ]  # fmt: skip


def _ahead_in_line(run: RecordedRun, candidates: Sequence[Candidate], blind: Records) -> BoolArray:
    """Return for which candidates the recorded actor is in the ego's own lane at the nearest approach.

    There every driver keeps a distance; the approach is that of the driver that does not react.
    """
    in_line = np.zeros(len(candidates), dtype=np.bool_)
    for k, candidate in enumerate(candidates):
        what = candidate.what
        frame = min(what.first + round(float(blind[k]["at"]) / STEP_S), run.tracks.shape[1] - 1)
        x, y, heading, _ = run.tracks[0, frame]
        dx, dy, turned = (run.tracks[what.actor, frame, :3] - (x, y, heading)).tolist()
        beside = dy * math.cos(heading) - dx * math.sin(heading)
        in_line[k] = math.cos(turned) > math.cos(IN_LINE_RAD) and abs(beside) < IN_LINE_M
    return in_line


def _scored(
    candidate: Candidate, score: float, avoidable: float, drives: Records, brakes: bool, early: Records
) -> ScoredCandidate:
    nearest = drives[int(np.argmin(drives["gap"]))]
    braking_s = float(early["brakes"]) if brakes and math.isfinite(early["brakes"]) else None
    return ScoredCandidate(candidate, score, avoidable, float(nearest["at"]), braking_s, float(nearest["gap"]),
                  bool(np.isfinite(drives[1:]["contact"]).any()))  # fmt: skip


def search(
    run: RecordedRun, actors: Sequence[int], first: int, last: int, frame: int, rng: Generator,
    settings: CarefulSettings,
) -> list[ScoredCandidate]:  # fmt: skip
    """Return the scored candidates of some actors in a window of a run, best first, without those of score 0."""
    behaviours = Behaviours(run, first, last, frame, settings, rng)
    candidates = [
        c for actor in actors if _near(run, actor, first, last, settings.reach_m) for c in behaviours.of(actor)
    ]
    candidates = [c for c in candidates if c.kind is not Kind.SWERVES or not _ego_stands(run, c)]
    return sorted((s for s in scored(run, candidates) if s.score > 0), key=lambda s: -s.score)


@dataclass(frozen=True, eq=False)
class Promise:
    """Tests whether a moment of a run is promising: some actor that behaves differently there would cause a failure."""

    run: RecordedRun
    settings: CarefulSettings
    seed: int = 0

    def of(self, frame: int, first: int, last: int) -> bool:
        """Return whether the best candidate of a clip about a frame is `PROMISING`; `first`, `last`: its frames."""
        rng = np.random.default_rng(np.random.SeedSequence([self.seed, frame]))
        best = search(self.run, range(1, len(self.run.sizes)), first, last, frame, rng, self.settings)[:1]
        return any(candidate.score >= PROMISING for candidate in best)


def _near(run: RecordedRun, actor: int, first: int, last: int, reach_m: float) -> bool:
    if not run.there[actor, first]:
        return False
    apart: FloatArray = run.tracks[actor, first : last + 1, :2] - run.tracks[0, first : last + 1, :2]
    return bool(np.hypot(*apart.T).min() <= reach_m)


def _ego_stands(run: RecordedRun, candidate: Candidate) -> bool:
    """Return whether the ego stands at any time at which a swerving actor may reach it."""
    at = candidate.what.first + round((candidate.at_s or 0.0) / STEP_S)
    until = at + round(3.0 / STEP_S)
    return bool((run.trace.states[at : until + 1, 0, 3] < EGO_STANDS_MPS).any())
