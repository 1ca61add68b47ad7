"""Compares a failing driver with a passing one in one test case.

It tells whether both met the same situation, and what they did differently.

A driver avoids a failure if it meets the same situation and reacts to it. The comparison is made at the moment from
which the failing driver could foresee the conflict (`avoidance.anticipating.foresight`). Both drivers are in the same
situation if the same actor is at the same place then, and if both egos, each at its speed of that moment, would come to
the place of the failure at about the same time. A passing driver that was ahead, behind or elsewhere before that
moment, for whatever reason, is not comparable.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from foresee_dsl.avoidance.anticipating.extended_path import ExtendedPath
from foresee_dsl.avoidance.anticipating.foresight import horizon_s, onset, priority_ways
from foresee_dsl.avoidance.replay import RecordedPath
from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.simulate.mission import mission_of
from foresee_dsl.simulate.results.outcome import contact_of
from foresee_dsl.simulate.sensing.settings import STANDARD, SensorSettings
from foresee_dsl.simulate.sensing.sight import sight_of
from foresee_dsl.simulate.trace import ACCELERATION, HEADING, SPEED, STEP_S, Trace, X, Y
from foresee_dsl.story.ego import BRAKES_FOR_S, EASES_S, EGO_BRAKES_MPS2
from foresee_dsl.story.facts import spans
from foresee_dsl.story.wording import metres

SAME_PLACE_M = 3.0
"""Two places that are at most this far apart are the same, m. Ours: a lane's width."""
SAME_TIME_S = 1.0
"""Two egos that would come to the place of the failure within this time of each other meet the same situation, s. Ours:
about R157's time for perceiving and beginning to brake, 1.15 s: a larger difference is not made up by reacting."""
LOOKS_ON_S = 3.0
"""A reaction is looked for up to this long after the failure, s. Ours: a car that drives at 50 km/h can stop in 2 s."""
EARLIER_S = 0.2
"""The smallest difference in time that is mentioned, s. Ours: two decisions of a driver that plans at 10 Hz."""
SLOWER_MPS = 0.5
"""The smallest difference in speed that is mentioned, m/s. Ours: 2 km/h."""
HARDER_MPS2 = 1.0
"""The smallest difference in braking that is mentioned, m/s^2. Ours: releasing the accelerator has as much effect."""
ASIDE_M = 0.3
"""The smallest lateral difference that counts as evading, m. Ours: twice the sensors' error in position."""


@dataclass(frozen=True)
class RunComparison:
    """The comparison of a passing run with a failing one.

    Attributes:
        how: the passing driver's reactions, in phrases: `brakes 0.8 s earlier`, `passes 0.7 m farther left`.
        apart: why the two runs cannot be compared, in words; "" if the passing driver avoids the failure.
        met: whether it met the same situation; also True if it reacts in nearly the same way as the failing driver.
        late_s: how much later than the failing driver it would come to the place of the failure, if it is not
            comparable for that reason, s; negative if it comes earlier.
    """

    how: tuple[str, ...] = ()
    apart: str = ""
    met: bool = False
    late_s: float = 0.0


NOT_COMPARED = RunComparison()
"""In place of a comparison if there is nothing to compare."""


def compared(failed: Trace, passed: Trace, bundle: SumoBundle, sensors: SensorSettings = STANDARD) -> RunComparison:
    """Return whether the driver of a passing run avoided the failure of another run, and by which reaction.

    Args:
        failed: a run that ended with a failure, its last frame. passed: another driver's run of the same test case.
        bundle: the compiled test case. sensors: the sensors of the passing driver; they decide when it could foresee
            the conflict.
    """
    impact = contact_of(failed)
    if impact is None:
        return RunComparison(("drives on",))  # without another actor every driver meets the same situation
    if impact.with_ not in {info.id for info in passed.actors}:
        return RunComparison(apart=f"{impact.with_} is not there")
    return _Compared(failed, passed, bundle, impact.with_, sensors).result()


class _Compared:
    """Compares two runs in which the failure is a contact with the actor `name`."""

    def __init__(self, failed: Trace, passed: Trace, bundle: SumoBundle, name: str, sensors: SensorSettings) -> None:
        self._failed, self._passed, self._bundle, self._name, self._sensors = failed, passed, bundle, name, sensors
        self._end = failed.frames - 1
        self._path = RecordedPath(failed)

    def result(self) -> RunComparison:
        other = self._failed.index(self._name)
        if self._stands(other):
            meets = self._comes_there() or self._brakes_for(other)
            return RunComparison(self._past(0)) if meets else RunComparison(apart="it takes another way")
        onset_frame = self._onset_frame(other)
        if onset_frame is None:
            return RunComparison(apart="the conflict could not be foreseen before the contact")
        if apart := self._apart(other, onset_frame):
            return RunComparison(apart=apart)
        late_s = self._late_s(onset_frame)
        if abs(late_s) > SAME_TIME_S:
            when = f"{abs(late_s):.1f} s {'later' if late_s > 0 else 'earlier'}"
            return RunComparison(apart=f"it would come there {when} in any case", late_s=late_s)
        earlier_s = self._passes_earlier_s()
        if earlier_s > EARLIER_S:
            return RunComparison(apart=f"it passes the place {earlier_s:.1f} s earlier", late_s=-earlier_s)
        how = self._past(onset_frame)
        return RunComparison(how) if how else RunComparison(apart="it drives nearly the same way", met=True)

    def _stands(self, other: int) -> bool:
        recent = self._failed.states[max(0, self._end - round(1 / STEP_S)) :, other, SPEED]
        return bool((np.nan_to_num(recent) < STANDS_MPS).all())

    def _comes_there(self) -> bool:
        return bool(np.nanmin(self._distances()) <= 2 * SAME_PLACE_M)

    def _brakes_for(self, other: int) -> bool:
        """Return whether the passing ego brakes on the failing ego's path because of an actor that stands.

        That is so if at its present speed it would reach the place of the failure within the time for which an
        anticipating driver predicts others, and if no other actor is in between.
        """
        last = min(self._passed.frames - 1, self._end + round(LOOKS_ON_S / STEP_S))
        ego = self._passed.states[: last + 1, 0]
        brakings = spans(ego[:, ACCELERATION] < -EGO_BRAKES_MPS2, BRAKES_FOR_S, EASES_S)
        if not brakings:
            return False
        first, speed_mps = brakings[-1][0], float(ego[brakings[-1][0], SPEED])
        along, aside = self._on_path(ego[first:])
        left_m = float(self._path.along[-1]) - along
        if bool((aside > SAME_PLACE_M).any()) or left_m[0] > speed_mps * horizon_s(speed_mps):
            return False
        others = np.delete(self._passed.states[last], [0, self._passed.index(self._failed.actors[other].id)], axis=0)
        their_along, their_aside = self._on_path(others)
        between = (their_aside <= SAME_PLACE_M) & (their_along > along[-1]) & (their_along < along[-1] + left_m[-1])
        return not bool(between.any())

    def _on_path(self, states: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return, for each state [N], the nearest place of the failing ego's path and the distance to it, m; for an
        actor that is not there the distance is infinite.
        """
        way = self._failed.states[:, 0]
        far = np.hypot(states[:, None, X] - way[:, X], states[:, None, Y] - way[:, Y])
        far[np.isnan(far)] = np.inf
        frame = far.argmin(axis=1)
        nearest: FloatArray = far[np.arange(len(states)), frame]
        along: FloatArray = self._path.along[frame]
        return along, nearest

    def _distances(self) -> FloatArray:
        """Return the passing ego's distance to the place of the failure at each frame, m."""
        x, y = self._failed.states[-1, 0, [X, Y]]
        apart: FloatArray = np.hypot(self._passed.states[:, 0, X] - x, self._passed.states[:, 0, Y] - y)
        return apart

    def _passes_earlier_s(self) -> float:
        """Return how much earlier the passing ego reaches the place of the failure, s; 0 if it comes later or never."""
        far = self._distances()
        frame = int(np.nanargmin(far))
        return max(self._end - frame, 0) * STEP_S if far[frame] <= SAME_PLACE_M else 0.0

    def _onset_frame(self, other: int) -> int | None:
        """Return the first frame of the failing run at which these sensors show the conflict; None if they never do."""
        failed, bundle = self._failed, self._bundle
        way = ExtendedPath(failed, bundle.scene.ego.line)
        seen_s = onset(failed, way, other, sight_of(bundle, self._sensors), priority_ways(mission_of(bundle)))
        return None if seen_s is None else round(seen_s / STEP_S)

    def _apart(self, other: int, onset_frame: int) -> str:
        """Return why the passing driver is not in the same situation at a frame, in words; "" if it is."""
        if onset_frame >= self._passed.frames:
            return "it has arrived by then"
        mine, its = self._failed.states[onset_frame], self._passed.states[onset_frame]
        there = self._passed.index(self._name)
        if not np.hypot(*(its[there, [X, Y]] - mine[other, [X, Y]])) <= SAME_PLACE_M:
            return f"{self._name} is elsewhere when the conflict can be foreseen"
        if abs(self._place(its[0])[1]) > SAME_PLACE_M:
            return "it is on another way when the conflict can be foreseen"
        return ""

    def _late_s(self, onset_frame: int) -> float:
        """Return how much later than the failing ego the passing ego would come to the place of the failure, each at
        its speed at a frame, s.
        """
        mine, its = self._failed.states[onset_frame, 0], self._passed.states[onset_frame, 0]
        left_s = (self._end - onset_frame) * STEP_S
        ahead_m = self._place(its)[0] - self._path.along[onset_frame] + (its[SPEED] - mine[SPEED]) * left_s
        return -float(ahead_m) / max(float(mine[SPEED]), float(its[SPEED]), 1.0)

    def _place(self, ego: FloatArray) -> tuple[float, float]:
        """Return the place of an ego relative to the failing ego's path: the length along the path, and the distance to
        its left, m.
        """
        way = self._failed.states[:, 0]
        far = np.hypot(way[:, X] - ego[X], way[:, Y] - ego[Y])
        frame = int(np.nanargmin(far))
        x, y, heading = (float(way[frame, column]) for column in (X, Y, HEADING))
        dx, dy = float(ego[X]) - x, float(ego[Y]) - y
        ahead, left = dx * math.cos(heading) + dy * math.sin(heading), dy * math.cos(heading) - dx * math.sin(heading)
        return float(self._path.along[frame]) + ahead, left

    def _past(self, onset_frame: int) -> tuple[str, ...]:
        """Return the passing driver's reactions after a frame in words (braking, waiting, speed, side); () for none."""
        braking = self._braking(onset_frame)
        where, evading = self._there(onset_frame)
        return tuple(text for text in (braking, where, evading) if text) if braking or evading else ()

    def _braking(self, onset_frame: int) -> str:
        """Return in words how the passing ego brakes or waits, if the failing ego brakes or waits later, less or not at
        all.
        """
        own, its = self._brakes(self._failed, onset_frame), self._brakes(self._passed, onset_frame)
        if its is None:
            waits = self._passed.states[onset_frame : self._end + 1, 0, SPEED]
            return "waits" if waits.size and bool((waits < STANDS_MPS).all()) else ""
        if own is None:
            return f"brakes {(self._end - its[0]) * STEP_S:.1f} s before it" if its[0] < self._end else "brakes"
        earlier_s, harder = (own[0] - its[0]) * STEP_S, its[1] - own[1]
        if earlier_s > EARLIER_S:
            return f"brakes {earlier_s:.1f} s earlier"
        slower = self._speed_lost(self._passed, onset_frame) - self._speed_lost(self._failed, onset_frame)
        if harder > HARDER_MPS2:
            return f"brakes with {its[1]:.1f} instead of {own[1]:.1f} m/s^2"
        return "brakes longer" if slower > SLOWER_MPS else ""

    def _brakes(self, trace: Trace, onset_frame: int) -> tuple[int, float] | None:
        """Return the first frame from `onset_frame` on at which an ego brakes, and its strongest braking, m/s^2; None
        if it does not brake.
        """
        last = min(trace.frames - 1, self._end + round(LOOKS_ON_S / STEP_S))
        part = trace.states[onset_frame : last + 1, 0, ACCELERATION]
        braking = [s for s in spans(part < -EGO_BRAKES_MPS2, BRAKES_FOR_S, EASES_S) if onset_frame + s[0] <= self._end]
        return (onset_frame + braking[0][0], -float(part[braking[0][0] :].min())) if braking else None

    def _speed_lost(self, trace: Trace, onset_frame: int) -> float:
        speed = trace.states[onset_frame : min(trace.frames, self._end + 1), 0, SPEED]
        return float(speed[0] - speed.min()) if speed.size else 0.0

    def _there(self, onset_frame: int) -> tuple[str, str]:
        """Return how much slower the ego of the run that passes is at the place of the failure, and how far it keeps
        to the side of it; each in words."""
        x, y, heading, speed = (float(self._failed.states[-1, 0, column]) for column in (X, Y, HEADING, SPEED))
        ego, far = self._passed.states[:, 0], self._distances()
        frame = int(np.nanargmin(far))
        if far[frame] > SAME_PLACE_M:
            return f"stays {metres(float(far[frame]))} away from the place", ""
        slower = speed - float(ego[frame, SPEED])
        left = (ego[frame, Y] - y) * math.cos(heading) - (ego[frame, X] - x) * math.sin(heading)
        evaded = abs(left - self._place(ego[onset_frame])[1]) > ASIDE_M and abs(left) > ASIDE_M
        return (
            f"is {slower * 3.6:.0f} km/h slower there" if slower > SLOWER_MPS else "",
            f"passes {abs(left):.1f} m farther {'left' if left > 0 else 'right'}" if evaded else "",
        )
