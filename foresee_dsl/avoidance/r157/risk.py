"""When a careful and competent driver sees a risk: the other's predicted path enters the ego's corridor soon.

The driver is that of UN Regulation 157, Annex 4, appendix 3. The regulation's own text was not at hand: the figures are
those of the European Commission's open implementation (repository ec-jrc/JRC-FSM, `CC_human_driver`) but for one. The
appendix describes cut-in, cut-out and deceleration on a motorway. For a town, where others cross, oncome and walk, the
perception is generalised; what is ours is marked so.

The prediction uses only what a driver could know at a frame: the ego's own intended path, and where the other is, how
fast it is, and how it turns and brakes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from foresee_dsl.avoidance.replay import RecordedPath
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.boxes import box_overlap
from foresee_dsl.simulate.sensing.line_of_sight import in_view, sight_of
from foresee_dsl.simulate.sensing.sight import Sight
from foresee_dsl.simulate.trace import ACCELERATION, HEADING, SPEED, STEP_S, YAW_RATE, Trace, X, Y

EVALUATION_S = 0.4
"""The risk has to last this long to be perceived: ours, after R157, Annex 4, appendix 3: JRC-FSM
(`CC_calc_dist_to_react`) has a lateral way of 0.72 m for it, 0.4 s at 1.8 m/s."""
DELAY_S = 0.75
"""From the perception until braking begins. R157, Annex 4, appendix 3; `CC_rt` in JRC-FSM."""
CRITICAL_TTC_S = 2.0
"""A cutting-in vehicle is a risk below this time to collision: `CC_critical_ttc` in JRC-FSM. Applied to all kinds of
encounters: ours."""
WANDER_M = 0.375
"""How far a vehicle sways within its lane: R157, Annex 4, appendix 3, as summarised in JRC-FSM
(`CC_calc_dist_to_react`). The corridor is this much wider than the ego on either side: ours."""
HARD_BRAKING_MPS2 = 5.0
"""Ours, after what R157 calls an emergency manoeuvre (over 5 m/s^2; its clause was not at hand): a risk is seen
no later than when evaluation, delay and this braking just suffice to take the ego's speed down to the other's. With 2 s
alone, something that stands on a clear road would be run into from 8.5 m/s upwards (0.85 s are then 7.2 m)."""
MERGES_RAD = math.pi / 4
"""A vehicle whose heading differs from the ego's by less than this and that crosses the ego's line is expected to stay
on it: a cut-in, for which R157 takes the time to collision along the lane. Ours: what counts as the same direction in
`simulate.results.outcome`."""
MOVED_M = 0.001
"""A shorter step between two frames has no direction. Ours: it is 2 cm/s."""
PREDICTED_EVERY_S = 0.05
"""Ours: a step of the simulation; at 20 m/s a metre."""


@dataclass(frozen=True)
class Perception:
    """When a risk is seen.

    Attributes:
        onset_s: the first moment of the risk that is then perceived. at_once: the risk is there at the first frame.
    """

    onset_s: float
    at_once: bool

    @property
    def perceived_s(self) -> float:
        """The risk has been evaluated."""
        return round(self.onset_s + EVALUATION_S, 6)

    @property
    def brakes_s(self) -> float:
        """Braking begins."""
        return round(self.onset_s + EVALUATION_S + DELAY_S, 6)


def perceive(trace: Trace, other: int, sight: Sight | None = None) -> Perception | None:
    """Say when the driver of the ego would perceive the risk that became the contact with an actor, at the run's end.

    A risk that is gone for less than the evaluation time is the same risk. One that passes without a contact is
    another: braking for it, seconds earlier, would avoid the contact by chance (ours). None when there is no risk
    shortly before the contact, whose own frame does not count. Without `sight` it is judged as far as the trace alone
    tells.
    """
    path, sight = RecordedPath(trace), sight or sight_of(trace)
    forgets = round(EVALUATION_S / STEP_S)
    onset: int | None = None
    # From the contact back to where there was no risk for long enough.
    for frame in range(trace.frames - 2, -1, -1):
        if is_risk(trace, path, other, frame, sight):
            onset = frame
        elif (trace.frames - 1 if onset is None else onset) - frame >= forgets:
            break
    return None if onset is None else Perception(round(onset * STEP_S, 6), at_once=onset == 0)


def is_risk(trace: Trace, path: RecordedPath, other: int, frame: int, sight: Sight) -> bool:
    """Say whether the other's predicted path enters the ego's corridor soon enough to be a risk."""
    me, them = trace.states[frame, 0], trace.states[frame, other]
    if math.isnan(them[X]) or not _in_front(trace, other, frame):
        return False
    limit = critical_time_s(float(me[SPEED]), float(them[SPEED] * math.cos(them[HEADING] - me[HEADING])))
    time_s = np.arange(0.0, limit + 1e-9, PREDICTED_EVERY_S)
    ego = np.empty((len(time_s), 5))
    ego[:, :3] = path.at(path.along[frame] + float(me[SPEED]) * time_s)
    info = trace.actors[0]
    ego[:, 3:] = (info.length_m, info.width_m + 2 * WANDER_M)
    boxes = predicted(trace, other, frame, time_s)
    if trace.actors[other].kind != "pedestrian" and math.cos(them[HEADING] - me[HEADING]) >= math.cos(MERGES_RAD):
        boxes = merged(boxes, me[[X, Y, HEADING]])
    return bool(box_overlap(ego, boxes).any()) and in_view(trace, other, frame, sight)


def critical_time_s(speed_mps: float, along_mps: float) -> float:
    """Return the time to collision under which an encounter is a risk.

    `along_mps`: the other's speed along the ego's heading; one that oncomes counts as standing, since the ego cannot
    shed more than its own speed.
    """
    shed = max(speed_mps - max(along_mps, 0.0), 0.0)
    return max(CRITICAL_TTC_S, EVALUATION_S + DELAY_S + shed / (2 * HARD_BRAKING_MPS2))


def predicted(trace: Trace, actor: int, frame: int, time_s: FloatArray) -> FloatArray:
    """Return where an actor (a column) will be some times after a frame, [N, 5] boxes, from how it moves there.

    It continues in the direction of its last step with its turn rate and its braking (a pedestrian, who can turn on the
    spot, straight on); it does not speed up.
    """
    x, y, heading, speed, acceleration, rate = (
        float(np.nan_to_num(trace.states[frame, actor, k])) for k in (X, Y, HEADING, SPEED, ACCELERATION, YAW_RATE)
    )
    info = trace.actors[actor]
    per_m = rate / speed if speed > 0 and info.kind != "pedestrian" else 0.0
    boxes = moved_on((x, y, heading), course_of(trace, actor, frame), speed, max(-acceleration, 0.0), per_m, time_s)
    boxes[:, 3:] = (info.length_m, info.width_m)
    return boxes


def moved_on(
    pose: tuple[float, float, float], course: float, speed: float, brakes: float, turns_per_m: float, time_s: FloatArray
) -> FloatArray:
    """Return where somebody is after some times who brakes evenly along an arc, [N, 5] boxes without their sizes.

    `pose`: x, y, heading. `course`: the direction of motion. `turns_per_m`: rad per metre.
    """
    rolls = np.minimum(time_s, speed / brakes) if brakes > 0 else time_s
    moved = speed * rolls - brakes * rolls**2 / 2
    turned = turns_per_m * moved
    # The chord of an arc lies at the mean direction.
    chord, towards = moved * np.sinc(turned / (2 * np.pi)), course + turned / 2
    boxes = np.empty((len(time_s), 5))
    boxes[:, 0], boxes[:, 1] = pose[0] + chord * np.cos(towards), pose[1] + chord * np.sin(towards)
    boxes[:, 2] = pose[2] + turned
    return boxes


def course_of(trace: Trace, actor: int, frame: int) -> float:
    """The direction (rad) of an actor's last step; where it points when it has made none."""
    heading = float(trace.states[frame, actor, HEADING])
    if frame == 0:
        return heading
    dx, dy = (trace.states[frame, actor, [X, Y]] - trace.states[frame - 1, actor, [X, Y]]).tolist()
    return math.atan2(dy, dx) if math.hypot(dx, dy) > MOVED_M else heading


def merged(boxes: FloatArray, ego: FloatArray) -> FloatArray:
    """Let a path that crosses the ego's line (`ego`: x, y, heading) from the side continue along it: a cut-in."""
    cos, sin = math.cos(ego[2]), math.sin(ego[2])
    lateral = (boxes[:, 1] - ego[1]) * cos - (boxes[:, 0] - ego[0]) * sin
    over = lateral * lateral[0] < 0.0
    boxes[over, 0] += lateral[over] * sin
    boxes[over, 1] -= lateral[over] * cos
    boxes[over, 2] = ego[2]
    return boxes


def _in_front(trace: Trace, other: int, frame: int) -> bool:
    """Whether the other's middle is ahead of the ego's rear: braking avoids nothing that comes from behind."""
    ego, them = trace.states[frame, 0], trace.states[frame, other]
    ahead = (them[X] - ego[X]) * math.cos(ego[HEADING]) + (them[Y] - ego[Y]) * math.sin(ego[HEADING])
    return bool(ahead > -trace.actors[0].length_m / 2)
