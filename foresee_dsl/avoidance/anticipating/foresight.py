"""Computes the time from which a driver can foresee that another road user comes into the ego's path.

For each other actor in sight, the motions are predicted that IEEE 2846 calls reasonably foreseeable, within the bounds
of `settings`. A walker keeps its direction, a little faster or slower. A vehicle keeps its present motion; one that
cuts in stays on the ego's line. One that crosses or is oncoming, without right of way, is expected to wait while it
still can with comfortable braking and is farther away than R157's 2 s. There is a conflict if a motion reaches a place
of the ego's way at the same time as the ego.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from foresee_dsl.avoidance.anticipating.extended_path import ExtendedPath
from foresee_dsl.avoidance.anticipating.settings import (
    CROSSES_RAD,
    FORESEES_S,
    FORGETS_S,
    GAP_ACCEPTED_S,
    GAP_S,
    NEARLY_STANDS_MPS,
    TURNING_RAD,
    WALKER_HASTENS_MPS,
)
from foresee_dsl.avoidance.r157.risk import (
    CRITICAL_TTC_S,
    MERGES_RAD,
    MOVED_M,
    WANDER_M,
    Other,
    beginning,
    merged,
    moved_on,
    other_at,
)
from foresee_dsl.drivers.protocol import Mission
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.boxes import box_overlap
from foresee_dsl.kernels.constants import COMFORTABLE_MPS2
from foresee_dsl.simulate.sensing.sight import Sight, in_view
from foresee_dsl.simulate.trace import SPEED, STEP_S, Trace

_EVERY_S = 0.1
_PREDICTED_LEAST_MPS = 2.0
"""Lowest speed with which the ego is predicted, m/s, to see whether a standing ego could set off. Ours."""
LOOKS_EVERY_FRAMES = 2
"""Frames between two looks for what the ego sees first: 0.1 s, the scans of the standard sensors."""
_ON_WAY_M, _SAME_WAY = 2.0, 0.7
"""An actor is on a way if it is nearer to the way than the first number, m, and the cosine of the angle between their
headings is larger than the second number (45 degrees). Ours: within its lane.
"""


@dataclass(frozen=True)
class PredictedEgo:
    """The ego at one place of its path, with the data that predictions need.

    Attributes:
        first: paths of the traffic with priority at the ego's junctions, [N, 2] each. crossings: crossings where
          pedestrians have priority.
    """

    way: ExtendedPath
    along_m: float
    speed_mps: float
    length_m: float
    width_m: float
    first: tuple[FloatArray, ...] = ()
    crossings: tuple[FloatArray, ...] = ()


def priority_ways(mission: Mission) -> tuple[FloatArray, ...]:
    """Return the paths (with their approaches) of the traffic that has priority over the ego at its junctions."""
    foes = (foe for junction in mission.junctions for foe in junction.foes)
    return tuple(foe.path for foe in foes if foe.has_priority and not foe.pedestrian)


def crossings_of(mission: Mission) -> tuple[FloatArray, ...]:
    """Return the crossings on the ego's path where pedestrians have priority."""
    foes = (foe for junction in mission.junctions for foe in junction.foes)
    return tuple(foe.path for foe in foes if foe.has_priority and foe.pedestrian)


def _goes_first(ego: PredictedEgo, other: Other) -> bool:
    """Return whether another road user is on a path with priority, and moves along it."""
    cos, sin = math.cos(other.heading_rad), math.sin(other.heading_rad)
    for path in ego.first:
        apart = np.hypot(path[:, 0] - other.x, path[:, 1] - other.y)
        k = min(int(apart.argmin()), len(path) - 2)
        dx, dy = path[k + 1] - path[k]
        if apart[k] < _ON_WAY_M and dx * cos + dy * sin > _SAME_WAY * math.hypot(dx, dy):
            return True
    return False


@dataclass(frozen=True)
class ForeseenConflict:
    """A predicted conflict: another actor comes into the ego's path.

    `certain`: the other can no longer be expected to wait.
    """

    within_s: float
    certain: bool


def horizon_s(speed_mps: float) -> float:
    """Return the time for which other actors are predicted, s.

    The time lasts until the ego would stand or would have crossed the junction.
    """
    return max(FORESEES_S + speed_mps / COMFORTABLE_MPS2, GAP_ACCEPTED_S)


def ego_boxes(ego: PredictedEgo, time_s: FloatArray) -> FloatArray:
    """Return the ego's boxes [N, 5] at some times at constant speed, lengthened at both ends by the time gap."""
    speed = max(ego.speed_mps, _PREDICTED_LEAST_MPS)
    boxes = np.empty((len(time_s), 5))
    boxes[:, :3] = ego.way.at(ego.along_m + speed * time_s)
    boxes[:, 3:] = (ego.length_m + 2 * GAP_S * speed, ego.width_m + 2 * WANDER_M)
    return boxes


def conflicts(ego: PredictedEgo, others: list[Other]) -> list[ForeseenConflict | None]:
    """Return the conflict of each other actor with the ego; None if it does not come into the ego's way."""
    time_s = np.arange(0.0, horizon_s(ego.speed_mps) + 1e-9, _EVERY_S)
    mine = ego_boxes(ego, time_s)
    reach = mine[:, 3].max() / 2 + ego.speed_mps * float(time_s[-1])
    at = mine[0]
    turns = abs(math.remainder(float(mine[-1, 2] - at[2]), math.tau)) > TURNING_RAD
    meetings: list[ForeseenConflict | None] = []
    for other in others:
        far = reach + (other.speed_mps + WALKER_HASTENS_MPS) * float(time_s[-1]) + other.length_m
        near = math.hypot(other.x - at[0], other.y - at[1]) < far
        meetings.append(_conflict(ego, mine, other, time_s) if near and _counts(ego, at, other, turns) else None)
    return meetings


def _counts(ego: PredictedEgo, at: FloatArray, other: Other, turns: bool) -> bool:
    """Return whether another road user matters.

    It matters if it is ahead of the ego's rear, or if it is behind and beside an ego that turns.
    """
    cos, sin, dx, dy = math.cos(at[2]), math.sin(at[2]), other.x - at[0], other.y - at[1]
    beside = abs(dy * cos - dx * sin) > (ego.width_m + other.width_m) / 2
    return bool(dx * cos + dy * sin > -ego.length_m / 2 or (turns and beside))


def _conflict(ego: PredictedEgo, mine: FloatArray, other: Other, time_s: FloatArray) -> ForeseenConflict | None:
    turned = math.cos(other.heading_rad - mine[0, 2])
    hits = [box_overlap(mine, boxes) for boxes in _motions(mine[0], other, time_s, turned)]
    first = [float(time_s[int(hit.argmax())]) for hit in hits if hit.any()]
    if not first:
        return None
    crosses = other.kind != "pedestrian" and turned < math.cos(CROSSES_RAD)
    may_wait = crosses and len(first) < len(hits) and not _goes_first(ego, other)
    return ForeseenConflict(min(first), not may_wait or min(first) <= CRITICAL_TTC_S)


def _motions(me: FloatArray, other: Other, time_s: FloatArray, turned: float) -> list[FloatArray]:
    """Return the foreseeable motions of another road user, each as boxes over time, [N, 5]."""
    if other.kind == "pedestrian":
        if other.speed_mps < MOVED_M / STEP_S:
            return [_moved(other, time_s, 0.0, other.speed_mps)]
        slower = max(other.speed_mps - WALKER_HASTENS_MPS, 0.0)
        speeds = (slower, other.speed_mps, other.speed_mps + WALKER_HASTENS_MPS)
        return [_moved(other, time_s, 0.0, speed) for speed in speeds]
    brakes = max(-other.acceleration_mps2, 0.0)
    if turned >= math.cos(MERGES_RAD):
        return [merged(_moved(other, time_s, brakes, other.speed_mps), me)]
    # The vehicle continues, or begins to wait.
    return [_moved(other, time_s, a, other.speed_mps) for a in (brakes, max(brakes, COMFORTABLE_MPS2))]


def _moved(other: Other, time_s: FloatArray, brakes_mps2: float, speed_mps: float) -> FloatArray:
    steers = other.kind != "pedestrian" and speed_mps > MOVED_M / STEP_S
    per_m = other.yaw_rate_rad_s / speed_mps if steers else 0.0
    boxes = moved_on(other, time_s, speed_mps, brakes_mps2, per_m)
    # A standing vehicle does not sway, so the ego may pass it more closely.
    sways = 0.0 if other.kind == "pedestrian" or other.speed_mps > NEARLY_STANDS_MPS else 1.5 * WANDER_M
    boxes[:, 3:] = (max(other.length_m - sways, 0.1), max(other.width_m - sways, 0.1))
    return boxes


def onset(
    trace: Trace, way: ExtendedPath, other: int, sight: Sight, first: tuple[FloatArray, ...] = ()
) -> float | None:
    """Return the time, s, from which the driver foresees the conflict without interruption until the contact; None if
    it does not.
    """
    info = trace.actors[0]

    def foresees(frame: int) -> bool:
        them = other_at(trace, other, frame)
        if them is None:
            return False
        along_m, speed_mps = float(way.along[frame]), float(trace.states[frame, 0, SPEED])
        meets = conflicts(PredictedEgo(way, along_m, speed_mps, info.length_m, info.width_m, first), [them])[0]
        return meets is not None and meets.certain and in_view(trace, other, frame, sight)

    first_frame = beginning(trace, foresees, forgets_s=FORGETS_S, every=LOOKS_EVERY_FRAMES)
    if first_frame is None:
        return None
    return 0.0 if first_frame < LOOKS_EVERY_FRAMES else round(first_frame * STEP_S, 6)
