"""Measures how near a run came to a failure: smallest distance, TTC and post-encroachment time, hardest braking.

All measures are between the footprints of the ego and another actor. A *path* is the curve that a footprint followed in
the run, continued straight ahead after the run's end. The measures are those of Westhofen et al., "Criticality Metrics
for Automated Driving" (Archives of Computational Methods in Engineering, 2023); our formulas for DRAC and PET were not
compared with the text. Ours is that actors are predicted along their paths, not along the heading of each frame: with
straight lines an actor that turns at a junction would have a small time to collision with actors waiting there, and so
would two actors that meet in a bend.

- distance(t): between the footprints, m.
- TTC(t): the least tau after which the footprints touch if both keep their speeds of t along their paths.
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
from numpy.typing import NDArray

from foresee_dsl.documents import or_null, rounded
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.boxes import IntArray, box_overlap, pairwise_box_distance
from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.measuring import Part
from foresee_dsl.simulate.trace import HEADING, SPEED, STEP_S, Trace, X, Y

HORIZON_S = 5.0
"""Longest TTC and PET that count, s. Ours: conflict studies call 1.5 s to 3 s serious."""
LOOKS_AHEAD_S = 0.1
"""Time step of the search for TTC, which is then refined to a millisecond, s. Ours: only a touch of two corners is
shorter, and is missed."""
CROSSING_RAD = math.radians(20)
"""Difference of headings below which two paths have the same direction at a spot, rad. Ours: the forecast's threshold
for crossing paths (`crossing_angle_rad`)."""
_SKIPPED = 4
"""Every fourth frame is evaluated first, then all frames around the worst of these."""
_STEPS_AHEAD_S: FloatArray = np.arange(0.0, HORIZON_S + 1e-9, LOOKS_AHEAD_S)
_BIN_M = 2.0
"""Length of the pieces in which paths are first compared, m. Ours: it affects the computing time, not the result."""
_BEND_M = 0.4
"""Upper bound of a piece's distance from the straight line, m: 2^2 / (2 x 5) on an arc with a radius of 5 m."""
_HALVINGS = 7
"""Number of halvings of the step of 0.1 s after which it is shorter than a millisecond."""


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
    """How near a run came to a failure; a measure is None if no actor came near enough for a value.

    Attributes:
        distance_m: smallest distance between footprints. ttc_s: smallest time to collision.
        pet_s: smallest post-encroachment time. drac_mps2: hardest braking needed, infinity at a contact.
    """

    distance_m: NearMiss | None
    ttc_s: NearMiss | None
    pet_s: NearMiss | None
    drac_mps2: NearMiss | None


@Part.JUDGING.measured
def near_misses(trace: Trace) -> NearMisses:
    """Return how near the ego came to a failure in a run, obstacles and parked cars included."""
    run = _Footprints(trace)
    ttc, drac = _conflicts(run)
    return NearMisses(_closest(run), ttc, _encroachment(run), drac)


def times_to_collision(trace: Trace, actor: int) -> FloatArray:
    """Return the ego's time to collision with an actor at each frame, [T] s; infinite without a predicted contact.

    Args:
        trace: a run. actor: column of the other actor.
    """
    run, frames = _Footprints(trace), np.arange(trace.frames)
    times_s = np.full(trace.frames, np.inf)
    if trace.frames:
        ego = run.path(0)
        rows, ttc, _ = _with(run, ego, actor, frames, _ahead(run, ego, frames))
        times_s[rows] = ttc
    return times_s


def braking_needed(trace: Trace, actor: int) -> FloatArray:
    """Return the braking that the ego needs for an actor at each frame (DRAC), [T] m/s^2; 0 if none.

    Args:
        trace: a run. actor: column of the other actor.
    """
    run, frames = _Footprints(trace), np.arange(trace.frames)
    braking = np.zeros(trace.frames)
    if trace.frames:
        ego = run.path(0)
        rows, _, drac = _with(run, ego, actor, frames, _ahead(run, ego, frames))
        braking[rows] = drac
    return braking


class _Footprints:
    """A run as footprints."""

    def __init__(self, trace: Trace) -> None:
        self.trace = trace
        self.xy: FloatArray = trace.states[:, :, [X, Y]]
        self.heading: FloatArray = trace.states[:, :, HEADING]
        self.speed: FloatArray = trace.states[:, :, SPEED]
        self.size = np.array([(info.length_m, info.width_m) for info in trace.actors], dtype=np.float64)
        self.radius: FloatArray = np.hypot(self.size[:, 0], self.size[:, 1]) / 2
        delta = self.xy[:, 1:] - self.xy[:, :1]
        self.apart: FloatArray = np.hypot(delta[..., 0], delta[..., 1])
        """[T, A - 1] distance between the centres, m; NaN where the actor is absent."""
        self._paths: dict[int, _Path] = {}

    def boxes(self, frames: IntArray, actors: IntArray | int) -> FloatArray:
        """Return footprints, [N, 5]."""
        boxes = np.empty((len(frames), 5))
        boxes[:, :2], boxes[:, 2], boxes[:, 3:] = (
            self.xy[frames, actors],
            self.heading[frames, actors],
            self.size[actors],
        )
        return boxes

    def path(self, actor: int) -> _Path:
        """Return an actor's path, from the cache."""
        if actor not in self._paths:
            self._paths[actor] = _Path(self, actor)
        return self._paths[actor]

    def miss(self, value: float, frame: int, actor: int) -> NearMiss:
        """Return a value with its time and the other actor's id."""
        return NearMiss(float(value), float(self.trace.time_s[frame]), self.trace.actors[actor].id)


class _Path:
    """An actor's path, as a function of the length along it, m."""

    def __init__(self, run: _Footprints, actor: int) -> None:
        self.present: IntArray = np.flatnonzero(~np.isnan(run.xy[:, actor, 0]))
        self._xy, self._heading = run.xy[self.present, actor], np.unwrap(run.heading[self.present, actor])
        steps = self._xy[1:] - self._xy[:-1]
        self._along = np.zeros(len(self._xy) or 1)
        np.cumsum(np.hypot(steps[:, 0], steps[:, 1]), out=self._along[1:])
        self.along: FloatArray = np.full(len(run.xy), np.nan)
        self.along[self.present] = self._along

    def places(self, along: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return x and y (m) at lengths along the path, continued straight ahead beyond its end."""
        beyond = np.maximum(along - self._along[-1], 0.0)
        last = self._heading[-1]
        x = np.interp(along, self._along, self._xy[:, 0]) + beyond * math.cos(last)
        y = np.interp(along, self._along, self._xy[:, 1]) + beyond * math.sin(last)
        return x, y

    def headings(self, along: FloatArray) -> FloatArray:
        """Return the headings (rad) at lengths along the path."""
        headings: FloatArray = np.interp(along, self._along, self._heading)
        return headings


# --- smallest distance -----------------------------------------------------------------------------------------------


def _closest(run: _Footprints) -> NearMiss | None:
    if not np.isfinite(run.apart).any():
        return None
    # The distance of two footprints is at least that of the circles around them and at most that of circles inside.
    least = run.apart - run.radius[0] - run.radius[1:]
    most = np.maximum(run.apart - run.size[0].min() / 2 - run.size[1:].min(axis=1) / 2, 0.0)
    frames, others = np.nonzero(least <= np.nanmin(most))
    distances = pairwise_box_distance(run.boxes(frames, 0), run.boxes(frames, others + 1))
    k = int(distances.argmin())
    return run.miss(distances[k], int(frames[k]), int(others[k]) + 1)


# --- time to collision, and the braking it takes ---------------------------------------------------------------------


def _conflicts(run: _Footprints) -> tuple[NearMiss | None, NearMiss | None]:
    """Return the smallest TTC and the largest DRAC."""
    ego, frames = run.path(0), len(run.xy)
    # The last frame is always evaluated: a failure happens there.
    looked_at = np.unique(np.append(np.arange(0, frames, _SKIPPED), max(frames - 1, 0))) if frames else np.arange(0)
    soonest: NearMiss | None = None
    hardest: NearMiss | None = None
    near: list[tuple[int, IntArray]] = []
    places = _ahead(run, ego, looked_at)
    for actor in range(1, run.xy.shape[1]):
        rows, ttc, drac = _with(run, ego, actor, looked_at, places)
        if rows.size:
            near.append((actor, np.unique([rows[ttc.argmin()], rows[drac.argmax()]])))
    # Then evaluate all frames around each actor's worst frames so far.
    for actor, worst in near:
        about = np.unique(np.clip(worst[:, None] + np.arange(-_SKIPPED, _SKIPPED + 1), 0, frames - 1))
        rows, ttc, drac = _with(run, ego, actor, about, _ahead(run, ego, about))
        k, h = int(ttc.argmin()), int(drac.argmax())
        if soonest is None or ttc[k] < soonest.value:
            soonest = run.miss(ttc[k], int(rows[k]), actor)
        if drac[h] > 0 and (hardest is None or drac[h] > hardest.value):
            hardest = run.miss(drac[h], int(rows[h]), actor)
    return soonest, hardest


def _ahead(run: _Footprints, ego: _Path, frames: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return the ego's predicted positions after each frame, [N, steps ahead] x and y, m."""
    return ego.places(ego.along[frames, None] + run.speed[frames, 0, None] * _STEPS_AHEAD_S)


def _with(
    run: _Footprints,
    ego: _Path,
    actor: int,
    looked_at: IntArray,
    ego_places: tuple[FloatArray, FloatArray],
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return the frames with a predicted contact with an actor, and the TTC (s) and DRAC (m/s^2) there."""
    reach = run.radius[0] + run.radius[actor]
    closing = run.speed[looked_at, 0] + run.speed[looked_at, actor]
    can = np.flatnonzero(run.apart[looked_at, actor - 1] - reach <= closing * HORIZON_S)  # False where absent
    if not can.size:
        return can, np.empty(0), np.empty(0)
    frames, path = looked_at[can], run.path(actor)
    speeds = run.speed[frames, 0], run.speed[frames, actor]
    x, y = path.places(path.along[frames, None] + speeds[1][:, None] * _STEPS_AHEAD_S)
    near = (x - ego_places[0][can]) ** 2 + (y - ego_places[1][can]) ** 2 <= reach * reach
    row, column = np.nonzero(near)

    def touch(row: IntArray, tau: FloatArray) -> tuple[NDArray[np.bool_], FloatArray]:
        """Return per row whether the footprints overlap `tau` (s) after its frame, and their headings' difference."""
        mine, theirs = ego.along[frames[row]] + speeds[0][row] * tau, path.along[frames[row]] + speeds[1][row] * tau
        a, b = _swept(ego, mine, run.size[0]), _swept(path, theirs, run.size[actor])
        return box_overlap(a, b), b[:, 2] - a[:, 2]

    touching = touch(row, _STEPS_AHEAD_S[column])[0]
    if not touching.any():
        return can[:0], np.empty(0), np.empty(0)
    row, first = np.unique(row[touching], return_index=True)
    late = _STEPS_AHEAD_S[column[touching][first]]
    early = np.maximum(late - LOOKS_AHEAD_S, 0.0)
    for _ in range(_HALVINGS):
        middle = (early + late) / 2
        there = touch(row, middle)[0]
        early, late = np.where(there, early, middle), np.where(there, middle, late)
    ttc = np.where(touch(row, np.zeros(len(row)))[0], 0.0, late)
    closes = speeds[0][row] - speeds[1][row] * np.cos(touch(row, ttc)[1])
    closes = np.where(speeds[0][row] < STANDS_MPS, 0.0, np.maximum(closes, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        drac = np.where(closes > 0, closes / (2 * ttc), 0.0)
    return frames[row], ttc, drac


def _swept(path: _Path, along: FloatArray, size: FloatArray) -> FloatArray:
    boxes = np.empty((len(along), 5))
    boxes[:, 0], boxes[:, 1] = path.places(along)
    boxes[:, 2], boxes[:, 3:] = path.headings(along), size
    return boxes


# --- post-encroachment time ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Pieces:
    """Paths cut into pieces of `_BIN_M`, in the order of their frames.

    Attributes:
        actor: [P] column of the actor. first, last: [P] first and last frame of the piece; all frames of a standing
            actor are in one piece. middle: [P] a frame between them.
    """

    actor: IntArray
    first: IntArray
    last: IntArray
    middle: IntArray


def _encroachment(run: _Footprints) -> NearMiss | None:
    if run.xy.shape[1] < 2 or not len(run.xy):
        return None
    mine, theirs = _pieces(run, [0]), _pieces(run, list(range(1, run.xy.shape[1])))
    i, j = _candidates(run, mine, theirs)
    gap = np.maximum(np.maximum(mine.first[i] - theirs.last[j], theirs.first[j] - mine.last[i]), 0)
    best: tuple[int, int, int] | None = None  # steps between, frame, actor
    horizon = round(HORIZON_S / STEP_S)
    for k in np.argsort(gap, kind="stable").tolist():
        if gap[k] > horizon or (best is not None and gap[k] >= best[0]):
            break
        actor = int(theirs.actor[j[k]])
        passage = _between(run, mine, int(i[k]), theirs, int(j[k]))
        if passage is not None and passage[0] <= horizon and (best is None or passage[0] < best[0]):
            best = *passage, actor
    return None if best is None else run.miss(best[0] * STEP_S, best[1], best[2])


def _pieces(run: _Footprints, actors: list[int]) -> _Pieces:
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
    return _Pieces(np.concatenate(of or empty), a, b, (a + b) // 2)


def _candidates(run: _Footprints, mine: _Pieces, theirs: _Pieces) -> tuple[IntArray, IntArray]:
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


def _between(run: _Footprints, mine: _Pieces, i: int, theirs: _Pieces, j: int) -> tuple[int, int] | None:
    """Return the least number of steps between both actors at one spot of two pieces, and the later frame."""
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


def _moving(run: _Footprints, first: int, last: int, actor: int) -> IntArray:
    """Return the frames of a piece without the inner frames of a stand: only arriving and leaving count."""
    frames = np.arange(first, last + 1)
    stands = run.speed[frames, actor] == 0.0
    inner = stands[1:-1] & stands[:-2] & stands[2:]
    return frames[np.concatenate([[True], ~inner, [True]])] if len(frames) > 2 else frames
