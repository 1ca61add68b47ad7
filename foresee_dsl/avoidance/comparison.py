"""Describes how a run avoids the failure of another: compares two drivers in one test case where the first failed."""

from __future__ import annotations

import math

import numpy as np

from foresee_dsl.simulate.trace import ACCELERATION, HEADING, SPEED, STEP_S, Trace, X, Y
from foresee_dsl.story.ego import BRAKES_FOR_S, EASES_S, EGO_BRAKES_MPS2
from foresee_dsl.story.facts import spans
from foresee_dsl.story.wording import metres

SAME_PLACE_M = 3.0
"""Distance of the other ego to the place of the failure up to which the two are compared there, m. Ours: a lane's
width."""
EARLIER_S = 0.2
"""The smallest difference in time that is mentioned, s. Ours: two decisions of a driver that plans at 10 Hz."""
SLOWER_MPS = 0.5
"""The smallest difference in speed that is mentioned. Ours: 2 km/h."""
ASIDE_M = 0.3
"""The smallest lateral difference that is mentioned, m. Ours: twice the sensors' error in position."""


def how_avoided(failed: Trace, passed: Trace) -> tuple[str, ...]:
    """Return the differences of a passing run's ego in phrases, in the order: braking, place and speed, side.

    Args:
        failed: a run that ended with a failure, its last frame. passed: another driver's run of the same test case.

    Returns:
        Phrases such as `brakes 0.8 s earlier`, `is 6 km/h slower there`, `passes 0.7 m farther left`; empty where
        no difference exceeds its threshold.
    """
    return tuple(text for text in (_braking(failed, passed), *_at_the_place(failed, passed)) if text)


def _braking(failed: Trace, passed: Trace) -> str:
    """Return in words when the two egos began their last braking before the failure; "" if that is about equal."""
    end = failed.frames - 1
    own, other = _braking_from(failed, end), _braking_from(passed, min(end, passed.frames - 1))
    if other is None:
        return ""
    if own is None:
        return f"brakes {(end - other) * STEP_S:.1f} s before it"
    earlier_s = (own - other) * STEP_S
    return f"brakes {earlier_s:.1f} s earlier" if earlier_s > EARLIER_S else ""


def _braking_from(trace: Trace, end: int) -> int | None:
    """Return the first frame of the ego's last braking up to a frame; None if it does not brake."""
    braking = spans(trace.states[: end + 1, 0, ACCELERATION] < -EGO_BRAKES_MPS2, BRAKES_FOR_S, EASES_S)
    return braking[-1][0] if braking else None


def _at_the_place(failed: Trace, passed: Trace) -> tuple[str, ...]:
    """Return in words the differences in speed, time and side at the place where the first ego ended."""
    x, y, heading, speed = (float(failed.states[-1, 0, column]) for column in (X, Y, HEADING, SPEED))
    ego = passed.states[:, 0]
    far = np.hypot(ego[:, X] - x, ego[:, Y] - y)
    frame = int(np.nanargmin(far))
    if far[frame] > SAME_PLACE_M:
        here = min(failed.frames, passed.frames) - 1
        slower = speed - float(ego[here, SPEED])
        at_once = f"is {slower * 3.6:.0f} km/h slower then" if slower > SLOWER_MPS else ""
        return f"stays {metres(float(far[frame]))} away from the place", at_once
    slower, later_s = speed - float(ego[frame, SPEED]), (frame - failed.frames + 1) * STEP_S
    left = (ego[frame, Y] - y) * math.cos(heading) - (ego[frame, X] - x) * math.sin(heading)
    return (
        f"is {abs(slower) * 3.6:.0f} km/h {'slower' if slower > 0 else 'faster'} there"
        if abs(slower) > SLOWER_MPS
        else "",
        f"comes there {abs(later_s):.1f} s {'later' if later_s > 0 else 'earlier'}" if abs(later_s) > EARLIER_S else "",
        f"passes {abs(left):.1f} m farther {'left' if left > 0 else 'right'}" if abs(left) > ASIDE_M else "",
    )
