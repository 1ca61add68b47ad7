"""Measures how near a run came to a failure: the worst values of its criticality, its smallest distance, and PET.

All measures are between the footprints of the ego and another actor; `criticality` computes those at one moment. Their
definitions are those of Westhofen et al., "Criticality Metrics for Automated Driving" (Archives of Computational
Methods in Engineering, 2023); our formulas for DRAC and PET were not compared with the text.

- distance(t): between the footprints, m.
- TTC(t): the least tau after which the footprints touch if both actors keep the speeds that they have at t along their
  paths.
- DRAC(t) = c / (2 TTC(t)), with c the speed at which the ego comes nearer along its own heading at that touch,
  v_ego - v_other cos(turn). For actors in line this is the usual c^2 / (2 gap), as the gap is c TTC; for crossing
  actors it is the braking with which the ego stops where they would touch. A standing ego need not brake.
- PET: the least time between one actor leaving a spot and the other reaching it in a different direction. Actors that
  follow each other in one direction have a time gap and no PET.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import shapely

from foresee_dsl.documents import or_null, rounded
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.boxes import IntArray, box_distance, box_overlap
from foresee_dsl.measuring import Part
from foresee_dsl.simulate.results.criticality import CriticalityMeasure, of_contacts, of_place
from foresee_dsl.simulate.results.footprints import HORIZON_S, Footprints, contacts_with, predicted
from foresee_dsl.simulate.trace import STEP_S, Trace

CROSSING_RAD = math.radians(20)
"""Difference of headings below which two paths have the same direction at a spot, rad. Ours: the forecast's threshold
for crossing paths (`crossing_angle_rad`)."""
_SKIPPED = 4
"""Every fourth frame is evaluated first, then all frames around the worst of those."""
_BIN_M = 2.0
"""Length of the pieces in which paths are first compared, m. Ours: it changes the computing time, not the result."""
_BEND_M = 0.4
"""Upper bound of how far a piece of a path is from the straight line, m: 2^2 / (2 x 5) on an arc with a radius of 5
m."""


@dataclass(frozen=True)
class NearMiss:
    """The worst value of a measure, with its time and the other actor.

    Attributes:
        value: m, s or m/s^2. time_s: time in the run; for a PET the time at which the second actor reached the spot.
        actor: id of the other actor.
    """

    value: float
    time_s: float
    actor: str

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {"value": rounded(or_null(self.value), 3), "time_s": rounded(self.time_s, 2), "with": self.actor}


@dataclass(frozen=True)
class NearMisses:
    """How near a run came to a failure; a measure is None if no actor came near enough to have a value.

    Attributes:
        distance_m: smallest distance between footprints. ttc_s: smallest time to collision.
        pet_s: smallest post-encroachment time. drac_mps2: hardest braking needed, infinity at a contact.
        btn, ttb_s, tts_s, ttr_s, thw_s, rss_m, delta_v_mps, injury_risk: worst value of each `CriticalityMeasure`.
    """

    distance_m: NearMiss | None
    ttc_s: NearMiss | None
    pet_s: NearMiss | None
    drac_mps2: NearMiss | None
    btn: NearMiss | None = None
    ttb_s: NearMiss | None = None
    tts_s: NearMiss | None = None
    ttr_s: NearMiss | None = None
    thw_s: NearMiss | None = None
    rss_m: NearMiss | None = None
    delta_v_mps: NearMiss | None = None
    injury_risk: NearMiss | None = None


@Part.JUDGING.measured
def near_misses(trace: Trace) -> NearMisses:
    """Return how near the ego came to a failure in a run, obstacles and parked cars included."""
    run = Footprints(trace)
    worst = {measure.value: near_miss for measure, near_miss in _worst(run).items()}
    return NearMisses(distance_m=_closest(run), pet_s=_encroachment(run), **dict.fromkeys(_AT_A_MOMENT) | worst)


_AT_A_MOMENT = tuple(measure.value for measure in CriticalityMeasure)


def times_between(trace: Trace, actor: int) -> FloatArray:
    """Return the time between the ego and an actor at the spot where the ego is at each frame, [T] s.

    The least of these times is the run's post-encroachment time. A time is NaN where the other actor is not at the spot
    within `HORIZON_S` before or after the ego, or drives there in the ego's direction.

    Args:
        trace: a run. actor: column of the other actor.
    """
    run, frames = Footprints(trace), np.arange(trace.frames)
    reach, horizon = run.radius[0] + run.radius[actor], round(HORIZON_S / STEP_S)
    between = np.full(trace.frames, np.nan)
    for frame in frames.tolist():
        near = frames[max(frame - horizon, 0) : frame + horizon + 1]
        away = run.xy[near, actor] - run.xy[frame, 0]
        turned = run.heading[frame, 0] - run.heading[near, actor]
        near = near[(np.hypot(away[:, 0], away[:, 1]) <= reach) & (np.cos(turned) <= math.cos(CROSSING_RAD))]
        hit = near[box_overlap(run.boxes(np.full(len(near), frame), 0), run.boxes(near, actor))]
        if hit.size:
            between[frame] = np.abs(hit - frame).min() * STEP_S
    return between


def _miss(run: Footprints, value: float, frame: int, actor: int) -> NearMiss:
    """Return a value together with its time and the other actor's id."""
    return NearMiss(float(value), float(run.trace.time_s[frame]), run.trace.actors[actor].id)


# --- smallest distance -----------------------------------------------------------------------------------------------


def _closest(run: Footprints) -> NearMiss | None:
    if not np.isfinite(run.apart).any():
        return None
    # Circles around two footprints bound their distance from below, circles inside them bound it from above; most
    # frames are excluded by these bounds.
    least = run.apart - run.radius[0] - run.radius[1:]
    most = np.maximum(run.apart - run.size[0].min() / 2 - run.size[1:].min(axis=1) / 2, 0.0)
    frames, others = np.nonzero(least <= np.nanmin(most))
    distances = box_distance(run.boxes(frames, 0), run.boxes(frames, others + 1))
    k = int(distances.argmin())
    return _miss(run, distances[k], int(frames[k]), int(others[k]) + 1)


# --- measures at a moment --------------------------------------------------------------------------------------------


def _worst(run: Footprints) -> dict[CriticalityMeasure, NearMiss]:
    """Return the worst value of each measure. A needed braking of 0 counts as no value."""
    frames = len(run.xy)
    # The last frame is always evaluated: a failure happens there.
    looked_at = np.unique(np.append(np.arange(0, frames, _SKIPPED), max(frames - 1, 0))) if frames else np.arange(0)
    worst: dict[CriticalityMeasure, NearMiss] = {}
    places = predicted(run, looked_at)
    for actor in range(1, run.xy.shape[1]):
        evaluated = [of_place(run, actor, looked_at)]
        contacts = contacts_with(run, actor, looked_at, places)
        if contacts.frames.size:
            at_first = of_contacts(run, actor, contacts)
            # Then evaluate all frames around the worst so far.
            hardest = at_first.values[CriticalityMeasure.DRAC].argmax()
            about = np.unique([contacts.frames[contacts.ttc_s.argmin()], contacts.frames[hardest]])
            about = np.unique(np.clip(about[:, None] + np.arange(-_SKIPPED, _SKIPPED + 1), 0, frames - 1))
            again = contacts_with(run, actor, about, predicted(run, about))
            evaluated += [of_contacts(run, actor, again), at_first]
        for part in evaluated:
            for measure, values in part.values.items():
                signed = np.where(np.isnan(values), -np.inf, measure.sign * values)
                k = int(signed.argmax())
                before = worst.get(measure)
                if signed[k] == -np.inf or (measure is CriticalityMeasure.DRAC and not values[k] > 0):
                    continue
                if before is None or signed[k] > measure.sign * before.value:
                    worst[measure] = _miss(run, values[k], int(part.frames[k]), actor)
    return worst


# --- post-encroachment time ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _PathPieces:
    """Paths cut into pieces of `_BIN_M`, in the order of their frames.

    Attributes:
        actor: [P] column of the actor.
        first, last: [P] first and last frame of the piece; all frames of a standing actor are in one piece.
        middle: [P] a frame between the first and the last.
    """

    actor: IntArray
    first: IntArray
    last: IntArray
    middle: IntArray


def _encroachment(run: Footprints) -> NearMiss | None:
    if run.xy.shape[1] < 2 or not len(run.xy):
        return None
    mine, theirs = _pieces(run, [0]), _pieces(run, list(range(1, run.xy.shape[1])))
    i, j = _candidates(run, mine, theirs)
    gap = np.maximum(np.maximum(mine.first[i] - theirs.last[j], theirs.first[j] - mine.last[i]), 0)
    best: tuple[int, int, int] | None = None  # the best so far: steps between both actors, later frame, other actor
    horizon = round(HORIZON_S / STEP_S)
    for k in np.argsort(gap, kind="stable").tolist():
        if gap[k] > horizon or (best is not None and gap[k] >= best[0]):
            break
        actor = int(theirs.actor[j[k]])
        passage = _between(run, mine, int(i[k]), theirs, int(j[k]))
        if passage is not None and passage[0] <= horizon and (best is None or passage[0] < best[0]):
            best = *passage, actor
    return None if best is None else _miss(run, best[0] * STEP_S, best[1], best[2])


def _pieces(run: Footprints, actors: list[int]) -> _PathPieces:
    first, last, of = [], [], []
    for actor in actors:
        path = run.path(actor)
        if not path.present.size:
            continue
        number = np.floor(path.along[path.present] / _BIN_M)
        begins = np.flatnonzero(np.diff(number, prepend=-1.0))
        first.append(path.present[begins])
        last.append(path.present[np.append(begins[1:], len(number)) - 1])
        of.append(np.full(len(begins), actor))
    empty = [np.empty(0, dtype=np.intp)]
    a, b = np.concatenate(first or empty), np.concatenate(last or empty)
    return _PathPieces(np.concatenate(of or empty), a, b, (a + b) // 2)


def _candidates(run: Footprints, mine: _PathPieces, theirs: _PathPieces) -> tuple[IntArray, IntArray]:
    """Return the indices of pairs of pieces (of the ego, of another actor) that may have a spot in common."""
    if not theirs.actor.size:
        return np.empty(0, dtype=np.intp), np.empty(0, dtype=np.intp)
    within = run.radius[0] + run.radius[theirs.actor].max() + 2 * _BIN_M
    tree = shapely.STRtree(np.asarray(shapely.points(run.xy[theirs.middle, theirs.actor]), dtype=np.object_))
    i, j = tree.query(shapely.points(run.xy[mine.middle, 0]), predicate="dwithin", distance=within)
    horizon = round(HORIZON_S / STEP_S)
    soon = (mine.first[i] - theirs.last[j] <= horizon) & (theirs.first[j] - mine.last[i] <= horizon)
    i, j = i[soon], j[soon]
    a, b = run.boxes(mine.middle[i], 0), run.boxes(theirs.middle[j], theirs.actor[j])
    for boxes in (a, b):
        boxes[:, 3] += 2 * _BIN_M
        boxes[:, 4] += 2 * _BEND_M
    meet = box_overlap(a, b)
    return i[meet], j[meet]


def _between(run: Footprints, mine: _PathPieces, i: int, theirs: _PathPieces, j: int) -> tuple[int, int] | None:
    """Return the smallest number of steps between the moments at which each actor is at a spot that both pieces share,
    and the later frame; None if they share no spot or have one direction there.
    """
    actor = int(theirs.actor[j])
    e = _moving(run, int(mine.first[i]), int(mine.last[i]), 0)
    o = _moving(run, int(theirs.first[j]), int(theirs.last[j]), actor)
    ego, other = np.repeat(e, len(o)), np.tile(o, len(e))
    crossing = np.cos(run.heading[ego, 0] - run.heading[other, actor]) <= math.cos(CROSSING_RAD)
    ego, other = ego[crossing], other[crossing]
    hit = box_overlap(run.boxes(ego, 0), run.boxes(other, actor))
    if not hit.any():
        return None
    ego, other = ego[hit], other[hit]
    steps = np.abs(ego - other)
    k = int(steps.argmin())
    return int(steps[k]), int(max(ego[k], other[k]))


def _moving(run: Footprints, first: int, last: int, actor: int) -> IntArray:
    """Return the frames of a piece; while the actor stands, only the frames at which it arrives and leaves, because the
    frames between do not matter.
    """
    frames = np.arange(first, last + 1)
    stands = run.speed[frames, actor] == 0.0
    inner = stands[1:-1] & stands[:-2] & stands[2:]
    return frames[np.concatenate([[True], ~inner, [True]])] if len(frames) > 2 else frames
