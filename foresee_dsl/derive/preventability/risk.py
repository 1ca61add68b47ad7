"""When a careful and competent driver sees a risk: the other's predicted way leads into the ego's corridor, soon.

The driver is that of UN Regulation 157, Annex 4, appendix 3. The regulation's own text was not at hand: the figures are
those of the European Commission's open implementation (repository ec-jrc/JRC-FSM, `CC_human_driver`) but for one. The
appendix describes cut-in, cut-out and deceleration on a motorway. For a town, where others cross, oncome and walk, the
perception is generalised; what is ours is marked so.

Only what a driver could know at a frame goes into it: the ego's own intended way, and where the other is, how fast, and
how it turns and brakes at that frame.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from foresee_dsl.derive.preventability.path import RecordedPath
from foresee_dsl.derive.preventability.sight import in_view, sight_of
from foresee_dsl.kernels.boxes import box_overlap
from foresee_dsl.kernels.lines import FloatArray
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
"""What a vehicle sways within its lane without meaning anything: R157, Annex 4, appendix 3, as summarised in JRC-FSM
(`CC_calc_dist_to_react`). The corridor is this much wider than the ego on either side: ours."""
HARD_BRAKING_MPS2 = 5.0
"""Ours, after what R157 calls an emergency manoeuvre (over 5 m/s^2; its clause was not at hand): a risk is seen
no later than when evaluation, delay and this braking just suffice to take the ego's speed down to the other's. With 2 s
alone, something that stands on a clear road would be run into from 8.5 m/s upwards (0.85 s are then 7.2 m)."""
MERGES_RAD = math.pi / 4
"""A vehicle whose heading is this near to the ego's and that comes onto the ego's line is expected to stay there: a
cut-in, of which R157 looks at the time to collision along the lane. Ours: as near as counts as the same direction in
`simulate.outcome`."""
MOVED_M = 0.001
"""A shorter step has no direction. Ours: 2 cm/s."""
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
    """Say when the driver of the ego would perceive the risk that became the contact with an actor.

    A risk that is gone for less than the evaluation time is the same risk. One that passes without a contact is
    another: who brakes for it, seconds before, avoids the contact by chance (ours).

    Args:
        trace: a run that ends in the contact. other: the actor's column.
        sight: what hides what in that run; None: what the trace alone says of it.

    Returns:
        None when there is no risk shortly before the contact. The contact's own frame does not count.
    """
    path, sight = RecordedPath(trace), sight or sight_of(trace)
    forgets = round(EVALUATION_S / STEP_S)
    onset, since = None, 0
    # From the contact back to where there was no risk for long enough.
    for frame in range(trace.frames - 2, -1, -1):
        if is_risk(trace, path, other, frame, sight):
            onset, since = frame, 0
            continue
        since += 1
        if since >= forgets:
            break
    return None if onset is None else Perception(round(onset * STEP_S, 6), at_once=onset == 0)


def is_risk(trace: Trace, path: RecordedPath, other: int, frame: int, sight: Sight) -> bool:
    """Say whether the other's predicted way leads into the ego's corridor soon enough to be a risk."""
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
        boxes = _merged(boxes, me)
    return bool(box_overlap(ego, boxes).any()) and in_view(trace, other, frame, sight)


def critical_time_s(speed_mps: float, along_mps: float) -> float:
    """Return the time to collision under which an encounter is a risk.

    Args:
        speed_mps: the ego's. along_mps: the other's, along the ego's heading; one that oncomes counts as standing,
            since the ego cannot shed more than its own speed.
    """
    shed = max(speed_mps - max(along_mps, 0.0), 0.0)
    return max(CRITICAL_TTC_S, EVALUATION_S + DELAY_S + shed / (2 * HARD_BRAKING_MPS2))


def predicted(trace: Trace, actor: int, frame: int, time_s: FloatArray) -> FloatArray:
    """Return where an actor will be, [N, 5] boxes, from how it moves at a frame.

    It goes on in the direction of its last step, turning as it does (a pedestrian, who can turn on the spot, goes
    straight on), and braking as it does; it does not speed up.

    Args:
        trace: a run. actor: column. frame: now. time_s: [N] s from now.
    """
    x, y, heading, speed, acceleration, rate = (
        float(np.nan_to_num(trace.states[frame, actor, k])) for k in (X, Y, HEADING, SPEED, ACCELERATION, YAW_RATE)
    )
    info = trace.actors[actor]
    brakes = max(-acceleration, 0.0)
    rolls = np.minimum(time_s, speed / brakes) if brakes > 0 else time_s
    way = speed * rolls - brakes * rolls**2 / 2
    turned = rate / speed * way if speed > 0 and info.kind != "pedestrian" else np.zeros_like(way)
    # The chord of an arc lies at the mean direction.
    chord, course = way * np.sinc(turned / (2 * np.pi)), _course(trace, actor, frame) + turned / 2
    boxes = np.empty((len(time_s), 5))
    boxes[:, 0], boxes[:, 1] = x + chord * np.cos(course), y + chord * np.sin(course)
    boxes[:, 2] = heading + turned
    boxes[:, 3:] = (info.length_m, info.width_m)
    return boxes


def _course(trace: Trace, actor: int, frame: int) -> float:
    """The direction (rad) of an actor's last step; where it points when it has made none."""
    heading = float(trace.states[frame, actor, HEADING])
    if frame == 0:
        return heading
    dx, dy = (trace.states[frame, actor, [X, Y]] - trace.states[frame - 1, actor, [X, Y]]).tolist()
    return math.atan2(dy, dx) if math.hypot(dx, dy) > MOVED_M else heading


def _merged(boxes: FloatArray, ego: FloatArray) -> FloatArray:
    """Let a way that crosses the ego's line from the side go on along it."""
    cos, sin = math.cos(ego[HEADING]), math.sin(ego[HEADING])
    dx, dy = boxes[:, 0] - ego[X], boxes[:, 1] - ego[Y]
    aside = dy * cos - dx * sin
    over = aside * aside[0] < 0.0
    merged = boxes.copy()
    merged[over, 0] += aside[over] * sin
    merged[over, 1] -= aside[over] * cos
    merged[over, 2] = ego[HEADING]
    return merged


def _in_front(trace: Trace, other: int, frame: int) -> bool:
    """Whether the other's middle is ahead of the ego's rear: braking helps against nobody who comes from behind."""
    ego, them = trace.states[frame, 0], trace.states[frame, other]
    ahead = (them[X] - ego[X]) * math.cos(ego[HEADING]) + (them[Y] - ego[Y]) * math.sin(ego[HEADING])
    return bool(ahead > -trace.actors[0].length_m / 2)
