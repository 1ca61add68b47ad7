"""Decides whether an actor could still stop before a line, and records at which colour and how slowly it passed the
line.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from foresee_dsl.compile.roads.route_line import Passage
from foresee_dsl.kernels.constants import COMFORTABLE_MPS2
from foresee_dsl.simulate.mission import STOP_BEFORE_M

BRAKING_DELAY_S = 0.75
"""Time before braking begins, s: UN Regulation 157, annex 4, appendix 3, the delay of the careful driver."""
STOPS_WITHIN_M = 4.0
"""Distance before the stop line within which an actor has to stop, m: `PROXIMITY_THRESHOLD` of `RunningStopTest`, the
criterion of CARLA's leaderboard 2."""
STOPPED_MPS = 0.1
"""Speed below which an actor has stopped, m/s: `SPEED_THRESHOLD` of the same criterion."""
ALL_WAY_STOP = "allway_stop"
"""SUMO's type of a junction at which all have to stop."""


def can_stop(room_m: float, speed_mps: float) -> bool:
    """Return whether an actor that reacts now can stop comfortably before a line.

    An actor that has to brake harder is made to brake abruptly (the words of VCRT article 1(aa)).
    """
    return room_m >= speed_mps * BRAKING_DELAY_S + speed_mps * speed_mps / (2 * COMFORTABLE_MPS2)


@dataclass(slots=True)
class LineAhead:
    """The line before a junction that an actor approaches.

    An actor has passed it only when its front has reached the lanes inside the junction, which begin `STOP_BEFORE_M`
    beyond the line; so that length is also a tolerance.

    Attributes:
        passage: the actor's way over the junction.
        must_stop: whether there is a stop sign.
        warned: whether its light was not green at the last frame. could_stop: whether the actor could stop in time when
            the light ceased to be green (or at the run's first frame).
        red: whether the light was red at the last frame.
        slowest_mps: smallest speed so far near the line.
    """

    passage: Passage
    must_stop: bool
    could_stop: bool = True
    warned: bool = False
    red: bool = False
    slowest_mps: float = field(default=math.inf)

    @property
    def entry_s(self) -> float:
        """Return the length along the actor's line at which the line is, m."""
        return self.passage.entry_s

    def see(self, colour: str, room_m: float, speed_mps: float) -> bool:
        """Record the light's colour at a frame; return whether the light was red at this frame and at the last one."""
        warned, still_red = colour in ("amber", "red"), self.red and colour == "red"
        if warned and not self.warned:
            self.could_stop = self.could_stop and can_stop(room_m, speed_mps)
        elif self.warned and not warned:
            self.could_stop = True
        self.warned, self.red = warned, colour == "red"
        return still_red

    def slow(self, room_m: float, speed_mps: float) -> None:
        """Record the actor's speed at a frame."""
        if room_m <= STOPS_WITHIN_M + STOP_BEFORE_M:
            self.slowest_mps = min(self.slowest_mps, speed_mps)
