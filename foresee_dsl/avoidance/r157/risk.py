"""Computes when a careful driver sees a risk: the predicted path of another actor soon enters the ego's corridor.

The driver is that of UN Regulation 157, Annex 4, appendix 3. We could not look up the regulation's own text: all
figures but one are those of the European Commission's open implementation (repository ec-jrc/JRC-FSM,
`CC_human_driver`). The appendix describes cut-in, cut-out and deceleration on a motorway. For a town, where others
cross, are oncoming or walk, the perception is generalised; our additions are marked `ours`.

The prediction uses only the information of a driver at that frame: the ego's own intended path, and the place, speed,
turn rate and braking of the other.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from foresee_dsl.avoidance.replay import RecordedPath
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.boxes import box_overlap
from foresee_dsl.simulate.sensing.sight import Sight, in_view
from foresee_dsl.simulate.trace import ACCELERATION, HEADING, SPEED, STEP_S, YAW_RATE, Trace, X, Y

EVALUATION_S = 0.4
"""Time for which a risk must last to be perceived, s. Ours, after R157, Annex 4, appendix 3: instead of a time, JRC-FSM
(`CC_calc_dist_to_react`) has a lateral way of 0.72 m, which takes 0.4 s at 1.8 m/s.
"""
DELAY_S = 0.75
"""Time from the perception to the beginning of braking, s: R157, Annex 4, appendix 3; `CC_rt` in JRC-FSM."""
REACTION_S = EVALUATION_S + DELAY_S
"""Time that a driver needs from the first sign of a conflict until it brakes, 1.15 s."""
CRITICAL_TTC_S = 2.0
"""Time to collision below which a cutting-in vehicle is a risk, s: `CC_critical_ttc` in JRC-FSM. We apply it to all
kinds of encounters."""
WANDER_M = 0.375
"""Lateral distance by which a vehicle sways within its lane, m: R157, Annex 4, appendix 3, as summarised in JRC-FSM
(`CC_calc_dist_to_react`). The corridor is this much wider than the ego on either side: ours."""
HARD_BRAKING_MPS2 = 5.0
"""Braking that is assumed for the latest moment at which a risk is seen, m/s^2: then evaluation, delay and this braking
just reduce the ego's speed to the other's. Ours, after R157's emergency manoeuvre (over 5 m/s^2; we could not look up
its clause). If only `CRITICAL_TTC_S` counted, an ego that drives at 8.5 m/s or faster would hit an object that stands
on a clear road, because only 0.85 s (7.2 m) remain for braking.
"""
MERGES_RAD = math.pi / 4
"""A vehicle that crosses the ego's line at a smaller angle than this to the ego's heading is expected to stay on the
line (a cut-in, for which R157 takes the time to collision along the lane). Ours: up to the same angle,
`simulate.results.outcome` treats two directions as the same.
"""
MOVED_M = 0.001
"""If an actor moves by less than this between two frames, the movement has no direction, m. Ours: this is a speed of 2
cm/s.
"""
PREDICTED_EVERY_S = 0.05
"""Time between predicted positions, s. Ours: a step of the simulation, in which an actor with 20 m/s moves by a metre.
"""


@dataclass(frozen=True)
class Perception:
    """The time at which a risk is seen.

    Attributes:
        onset_s: the first moment of the risk. at_once: whether the risk exists at the first frame.
    """

    onset_s: float
    at_once: bool

    @property
    def perceived_s(self) -> float:
        """The time at which the driver has evaluated the risk, s."""
        return round(self.onset_s + EVALUATION_S, 6)

    @property
    def brakes_s(self) -> float:
        """The time at which braking begins, s: after the evaluation and the driver's delay."""
        return round(self.onset_s + EVALUATION_S + DELAY_S, 6)


@dataclass(frozen=True)
class Other:
    """Another road user at one moment; `course_rad` is its direction of motion."""

    kind: str
    x: float
    y: float
    heading_rad: float
    course_rad: float
    speed_mps: float
    acceleration_mps2: float
    yaw_rate_rad_s: float
    length_m: float
    width_m: float


def perceive(trace: Trace, other: int, sight: Sight) -> Perception | None:
    """Return when the ego's driver perceives the risk that led to the contact at the run's end.

    None if there is no risk.

    A risk that is interrupted for less than the evaluation time is one risk. An earlier risk that passed without a
    contact is ignored, as braking for it, seconds earlier, would avoid the contact by chance (ours). None if there is
    no risk shortly before the frame of the contact.
    """
    path = RecordedPath(trace)
    onset = beginning(trace, lambda frame: is_risk(trace, path, other, frame, sight), forgets_s=EVALUATION_S)
    return None if onset is None else Perception(round(onset * STEP_S, 6), at_once=onset == 0)


def beginning(trace: Trace, holds: Callable[[int], bool], *, forgets_s: float, every: int = 1) -> int | None:
    """Return the frame from which something holds until the contact at the run's end, without a break of `forgets_s`.

    None if it does not hold shortly before the contact.

    Args:
        holds: returns whether it holds at a frame. every: number of frames between two that are examined.
    """
    forgets = round(forgets_s / STEP_S)
    first: int | None = None
    # Search backwards from the contact, until it did not hold for long enough.
    for frame in range(trace.frames - 2, -1, -every):
        if holds(frame):
            first = frame
        elif (trace.frames - 1 if first is None else first) - frame >= forgets:
            break
    return first


def is_risk(trace: Trace, path: RecordedPath, other: int, frame: int, sight: Sight) -> bool:
    """Return whether the other's predicted path enters the ego's corridor soon enough to be a risk."""
    me, them, info = trace.states[frame, 0], other_at(trace, other, frame), trace.actors[0]
    if them is None:
        return False
    ahead = (them.x - me[X]) * math.cos(me[HEADING]) + (them.y - me[Y]) * math.sin(me[HEADING])
    if not ahead > -info.length_m / 2:  # braking does not avoid a contact from behind
        return False
    turned = math.cos(them.heading_rad - me[HEADING])
    limit = critical_time_s(float(me[SPEED]), them.speed_mps * turned)
    time_s = np.arange(0.0, limit + 1e-9, PREDICTED_EVERY_S)
    ego = np.empty((len(time_s), 5))
    ego[:, :3] = path.at(path.along[frame] + float(me[SPEED]) * time_s)
    ego[:, 3:] = (info.length_m, info.width_m + 2 * WANDER_M)
    boxes = predicted(them, time_s)
    if them.kind != "pedestrian" and turned >= math.cos(MERGES_RAD):
        boxes = merged(boxes, me[[X, Y, HEADING]])
    return bool(box_overlap(ego, boxes).any()) and in_view(trace, other, frame, sight)


def critical_time_s(speed_mps: float, along_mps: float) -> float:
    """Return the time to collision below which an encounter is a risk, s.

    `along_mps`: the other's speed along the ego's heading; an oncoming one counts as standing, since the ego cannot
    lose more than its own speed."""
    shed = max(speed_mps - max(along_mps, 0.0), 0.0)
    return max(CRITICAL_TTC_S, REACTION_S + shed / (2 * HARD_BRAKING_MPS2))


def other_at(trace: Trace, actor: int, frame: int) -> Other | None:
    """Return an actor of a trace (its column) at a frame; None where it is absent."""
    row, info = trace.states[frame, actor], trace.actors[actor]
    if math.isnan(row[X]):
        return None
    x, y, heading, speed, acceleration, rate = (
        float(np.nan_to_num(row[k])) for k in (X, Y, HEADING, SPEED, ACCELERATION, YAW_RATE)
    )
    course = course_of(trace, actor, frame)
    return Other(info.kind, x, y, heading, course, speed, acceleration, rate, info.length_m, info.width_m)


def predicted(other: Other, time_s: FloatArray) -> FloatArray:
    """Return the predicted boxes of another road user after some times, [N, 5], from its motion now.

    It continues in the direction of its last step with its turn rate and its braking, and does not accelerate. A
    pedestrian, who can turn on the spot, continues straight on."""
    turns = other.speed_mps > 0 and other.kind != "pedestrian"
    per_m = other.yaw_rate_rad_s / other.speed_mps if turns else 0.0
    return moved_on(other, time_s, other.speed_mps, max(-other.acceleration_mps2, 0.0), per_m)


def moved_on(other: Other, time_s: FloatArray, speed: float, brakes: float, turns_per_m: float) -> FloatArray:
    """Return the boxes [N, 5] at some times of a road user that brakes evenly along an arc.

    `speed`: its speed at first, m/s. `brakes`: m/s^2. `turns_per_m`: change of direction, rad per metre.
    """
    rolls = np.minimum(time_s, speed / brakes) if brakes > 0 else time_s
    moved = speed * rolls - brakes * rolls**2 / 2
    turned = turns_per_m * moved
    # The chord of an arc lies at the mean direction.
    chord, towards = moved * np.sinc(turned / (2 * np.pi)), other.course_rad + turned / 2
    boxes = np.empty((len(time_s), 5))
    boxes[:, 0], boxes[:, 1] = other.x + chord * np.cos(towards), other.y + chord * np.sin(towards)
    boxes[:, 2], boxes[:, 3:] = other.heading_rad + turned, (other.length_m, other.width_m)
    return boxes


def course_of(trace: Trace, actor: int, frame: int) -> float:
    """Return the direction of an actor's last step, rad; its heading if it stood."""
    heading = float(trace.states[frame, actor, HEADING])
    if frame == 0:
        return heading
    dx, dy = (trace.states[frame, actor, [X, Y]] - trace.states[frame - 1, actor, [X, Y]]).tolist()
    return math.atan2(dy, dx) if math.hypot(dx, dy) > MOVED_M else heading


def merged(boxes: FloatArray, ego: FloatArray) -> FloatArray:
    """Return the path of a vehicle that cuts in: after reaching the ego's line it continues along it.

    `ego`: x, y, heading of the ego's line.
    """
    cos, sin = math.cos(ego[2]), math.sin(ego[2])
    lateral = (boxes[:, 1] - ego[1]) * cos - (boxes[:, 0] - ego[0]) * sin
    over = lateral * lateral[0] < 0.0
    boxes[over, 0] += lateral[over] * sin
    boxes[over, 1] -= lateral[over] * cos
    boxes[over, 2] = ego[2]
    return boxes
