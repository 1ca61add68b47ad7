"""The driver model that is cautious from the clip's beginning: it follows the recorded path, never ahead of the
recorded ego.

It is no faster than the recorded driver at any place, slows with easy braking for possible hazards (`_hazards`), keeps
two seconds behind others, and stops at signals that have changed meanwhile. For an actor that comes into its way
(`foresight`) it brakes after the reaction time, comfortably if that is enough. It sees with the standard sensors,
without their noise and delay. It does not know which actor will be hit.

Hazards are hidden places, pedestrians at the kerb, and buses at stops. A walker who steps out from a place beside the
way, a distance g from the ego's side, needs g / v_walk to be in the way. A driver with speed v who reacts after t and
brakes with b either stands before the place, or is past it in time, if v is at most 2 b (g / v_walk - t). This is the
careful speed at the place; in practice people do not drive slower than `settings.SLOWED_TO_MPS`, or past a bus at its
stop `SLOWEST_AT_BUS_MPS`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from foresee_dsl.avoidance.anticipating.extended_path import ExtendedPath
from foresee_dsl.avoidance.anticipating.foresight import PredictedEgo, conflicts, crossings_of, priority_ways
from foresee_dsl.avoidance.anticipating.settings import (
    AT_CROSSING_M,
    BESIDE_M,
    CLOSE_M,
    EASES_MPS2,
    EXPECTED_REACTION_S,
    HARDEST_MPS2,
    HEADWAY_S,
    HIDES_M,
    KERB_M,
    NEAR_VEHICLE_M,
    NEARLY_STANDS_MPS,
    RUNNING_MPS,
    SETS_OFF_MPS2,
    SLOWED_TO_MPS,
    SLOWEST_AT_BUS_MPS,
    WALKING_MPS,
)
from foresee_dsl.avoidance.r157.risk import EVALUATION_S, MOVED_M, REACTION_S, Other
from foresee_dsl.avoidance.replay import JERK_MPS3, Replay
from foresee_dsl.compile.bundle import Scene
from foresee_dsl.drivers.protocol import Control, Mission, Observation, SeenActor, VehicleLimits
from foresee_dsl.kernels.constants import COMFORTABLE_MPS2, HARDEST_BRAKING_MPS2
from foresee_dsl.simulate.actors.dynamics import Bicycle
from foresee_dsl.simulate.sensing.settings import EXACT, NO_DROPOUTS, NO_NOISE, SensorSettings
from foresee_dsl.simulate.trace import STEP_S, Trace

CLEAR_SIGHT = SensorSettings(scan_s=STEP_S, latency_s=0.0, noise=NO_NOISE, dropouts=NO_DROPOUTS, localisation=EXACT)
"""The driver's sensors: the standard ones without noise and latency, as the reaction time is modelled by the driver."""

_CATCHES_UP_S = 2.0
"""Time in which the driver catches up with the recorded ego if nothing makes it slower, s. Ours."""
_KEPT_S = 1.0
"""Time for which the driver continues to brake after the last conflict, s. Ours."""
_STANDS_OFF_M = 1.0
"""Distance at which the driver aims to stop before an actor that comes into its way, m. Ours."""
_SAME_MPS2 = 0.1
"""If the wanted acceleration differs by less than this from the recorded one, the driver drives as recorded, m/s^2.
Ours: people do not feel such a difference.
"""
_DECIDES_EVERY = 2
"""Frames between decisions: 10 Hz, the rate of the standard sensors."""


class DriveAhead(Replay):
    """Drives the recorded path of a run as an anticipating driver would.

    Attributes:
        from_s: until then the ego follows the clip's recorded states, whatever its driver answers.
        braked_s: time at which it first braked for an actor that came into its way, s; None if it never did.
        braked_mps2: its hardest braking for such an actor, m/s^2.
    """

    name = "anticipating"
    version = "1"

    def __init__(self, trace: Trace, way: ExtendedPath, scene: Scene) -> None:
        super().__init__(trace, None, scene, way)
        recorded = scene.ego.recorded
        self.from_s = recorded[-1].time_s if recorded else 0.0
        self._way = way
        self._free_from = round(self.from_s / STEP_S)
        self._info = trace.actors[0]
        self._before: dict[int, SeenActor] = {}
        # Times by track number, s: when the actor was first in conflict, when it last was, and from when the driver
        # acts.
        self._noticed: dict[int, float] = {}
        self._met: dict[int, float] = {}
        self._acts: dict[int, float] = {}
        self._wish, self._caution, self._level = 0.0, math.inf, 0.0
        self._departed = False
        self._quiet_s, self._brakes = math.inf, 0.0
        self._slowed: dict[str, int] = {}
        self.braked_s: float | None = None
        self.braked_mps2 = 0.0

    @property
    def slowed_for(self) -> list[str]:
        """Return the hazards for which the driver was slower than the recorded ego, the hazard with the longest effect
        first.
        """
        return sorted(self._slowed, key=lambda what: -self._slowed[what])

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        """Begin at the run's first frame."""
        super().reset(mission, vehicle, seed)
        self._mission, self._first, self._crossings = mission, priority_ways(mission), crossings_of(mission)

    def _control(self, bicycle: Bicycle, observation: Observation) -> Control:
        """Follow the recorded states up to `from_s`, then drive by its own decisions."""
        others = self._others(observation)
        if self._frame % _DECIDES_EVERY == 0:
            self._decide(observation, others)
        if self._as_recorded():
            self._level = self._state.acceleration
            return self._follow(bicycle)
        change = JERK_MPS3 * STEP_S
        self._level = min(max(self._wish, self._level - change), self._level + change)
        return self._on_path(bicycle, -self._level)

    def _as_recorded(self) -> bool:
        """Return whether the ego still drives exactly as recorded.

        This ends when caution first requires a lower speed.
        """
        speeds = self._way.recorded_mps
        if self._frame < self._free_from:
            return True
        if self._frame >= len(speeds) - 1:
            self._departed = True
        elif not self._departed:
            recorded = float(speeds[self._frame + 1] - speeds[self._frame]) / STEP_S
            self._departed = self._caution < recorded - _SAME_MPS2
        return not self._departed

    def _others(self, observation: Observation) -> list[tuple[int, Other]]:
        others = []
        for seen in observation.actors:
            was = self._before.get(seen.track)
            course, acceleration, rate = seen.heading_rad, 0.0, 0.0
            if was is not None:
                dx, dy = seen.x - was.x, seen.y - was.y
                course = math.atan2(dy, dx) if math.hypot(dx, dy) > MOVED_M else course
                acceleration = (seen.speed_mps - was.speed_mps) / STEP_S
                rate = math.remainder(seen.heading_rad - was.heading_rad, math.tau) / STEP_S
            others.append((seen.track, Other(seen.kind, seen.x, seen.y, seen.heading_rad, course, seen.speed_mps,
                                            acceleration, rate, seen.length_m, seen.width_m)))  # fmt: skip
        self._before = {seen.track: seen for seen in observation.actors}
        return others

    def _decide(self, observation: Observation, others: list[tuple[int, Other]]) -> None:
        now, speed = observation.time_s, self._state.speed
        ego = PredictedEgo(self._way, self._along, speed, self._info.length_m, self._info.width_m, self._first,
                  self._crossings)  # fmt: skip
        people = [other for _, other in others]
        wish = math.inf
        slowing = min(_hazards(ego, people), key=Hazard.allows, default=None)
        expects = slowing is not None and slowing.allows() < speed + 1.0
        if slowing is not None:
            wanted = max((slowing.allows() - speed) / EXPECTED_REACTION_S, -EASES_MPS2)
            if wanted < min(0.0, self._usual(now)):
                self._slowed[slowing.what] = self._slowed.get(slowing.what, 0) + 1
            wish = min(wish, wanted)
        wish = min(wish, self._behind(ego, people), self._signal(observation))
        self._caution = min(wish, -self._for_conflicts(ego, others, now, expects) or math.inf)
        self._wish = min(self._caution, self._usual(now))

    def _usual(self, now: float) -> float:
        """Return the acceleration to the recorded speed at this place, but never ahead of the recorded ego, m/s^2."""
        speed = self._state.speed
        late_m = self._way.along_at(now) - self._along
        frame = min(self._frame, len(self._way.recorded_mps) - 1)
        paced = float(self._way.recorded_mps[frame]) + late_m / _CATCHES_UP_S
        wanted = min(self._way.recorded_at(self._along + speed * EXPECTED_REACTION_S), paced)
        return min(max((wanted - speed) / EXPECTED_REACTION_S, -COMFORTABLE_MPS2), SETS_OFF_MPS2)

    def _behind(self, ego: PredictedEgo, others: list[Other]) -> float:
        """Return the acceleration that keeps two seconds behind the vehicle in front, m/s^2; infinite if there is no
        such vehicle.
        """
        if not others:
            return math.inf
        along, left, heading = self._way.beside(np.array([(other.x, other.y) for other in others]))
        wish = math.inf
        for k, other in enumerate(others):
            same = other.kind != "pedestrian" and math.cos(other.heading_rad - float(heading[k])) > math.cos(0.5)
            gap = float(along[k]) - ego.along_m - (other.length_m + ego.length_m) / 2
            if same and gap > 0 and abs(float(left[k])) < (other.width_m + ego.width_m) / 2:
                wanted = max(gap / HEADWAY_S, 0.0)
                wish = min(wish, max((min(wanted, other.speed_mps + 0.5) - ego.speed_mps) / HEADWAY_S, -EASES_MPS2)
                           if wanted < ego.speed_mps else math.inf)  # fmt: skip
        return wish

    def _signal(self, observation: Observation) -> float:
        """Return the acceleration that stops the ego at a signal that is not green, m/s^2.

        The acceleration is infinite if the ego need not stop.
        """
        state, speed = self._state, self._state.speed
        line = self._mission.centreline
        nearest = int(np.argmin(np.hypot(line[:, 0] - state.x, line[:, 1] - state.y)))
        front = float(self._mission.s[nearest]) + self._info.length_m / 2
        for junction in self._mission.junctions:
            room = junction.stop_s - front
            if junction.signal is None or room < 0.0:
                continue
            if observation.signals.get(junction.signal) in ("red", "amber"):
                needed = speed**2 / (2 * max(room, 0.1))
                return -needed if EASES_MPS2 / 2 < needed <= COMFORTABLE_MPS2 else math.inf
            break
        return math.inf

    def _for_conflicts(self, ego: PredictedEgo, others: list[tuple[int, Other]], now: float, expects: bool) -> float:
        """Return the braking for actors that come into the ego's path, m/s^2; 0 until the reaction time has passed."""
        meetings = conflicts(ego, [other for _, other in others])
        needed = 0.0
        for (track, other), meets in zip(others, meetings, strict=True):
            if meets is None:
                if now - self._met.get(track, now) > _KEPT_S:
                    self._noticed.pop(track, None)
                    self._acts.pop(track, None)
                continue
            self._met[track] = now
            since = self._noticed.setdefault(track, now)
            if not meets.certain:
                continue
            # The driver reacts faster to an actor that it has watched already: the foot is over the brake.
            expected = expects or now - since >= EVALUATION_S - 1e-9
            acts_s = self._acts.setdefault(track, now + (EXPECTED_REACTION_S if expected else REACTION_S))
            if now >= acts_s - 1e-9:
                needed = max(needed, _needed(ego, other, meets.within_s))
        if needed > 0.0:
            self.braked_s = now if self.braked_s is None else self.braked_s
            self.braked_mps2 = max(self.braked_mps2, needed)
            self._quiet_s, self._brakes = now, needed
        elif now - self._quiet_s < _KEPT_S:
            needed = min(self._brakes, COMFORTABLE_MPS2)
        return needed


def _needed(ego: PredictedEgo, other: Other, within_s: float) -> float:
    """Return the braking for an actor that enters the ego's path in `within_s`, m/s^2.

    The braking is comfortable, or harder if that is needed.
    """
    _, _, heading = ego.way.at(np.array([ego.along_m]))[0].tolist()
    with_mps = max(other.speed_mps * math.cos(other.heading_rad - heading), 0.0)
    sheds = max(ego.speed_mps - (with_mps if other.kind != "pedestrian" else 0.0), 0.0)
    room = max(sheds * within_s - _STANDS_OFF_M, 0.1)
    needed = sheds**2 / (2 * room)
    return COMFORTABLE_MPS2 if needed <= COMFORTABLE_MPS2 else min(needed * 1.2, HARDEST_BRAKING_MPS2)


_TOWARDS_MPS = 0.2
"""A walker walks towards the way if its speed towards the way's line is above this, m/s. Ours: a seventh of walking
pace.
"""
_HALF_CROSSING_M = 2.0
_APPROACHES_M = 8.0
"""The driver slows for a walker who walks towards the way and is nearer to it than this, m. Ours: five seconds of
walking.
"""


@dataclass(frozen=True)
class Hazard:
    """A place that the driver passes at a careful speed.

    Attributes:
        what: its name in reports. from_m: distance ahead of the ego's front at which the careful speed must be reached.
            speed_mps: the careful speed.
    """

    what: str
    from_m: float
    speed_mps: float

    def allows(self) -> float:
        """Return the largest present speed from which easy braking reaches the careful speed in time, m/s."""
        return math.sqrt(self.speed_mps**2 + 2 * EASES_MPS2 * max(self.from_m, 0.0))


def _careful_mps(gap_m: float, walks_mps: float, slowest_mps: float) -> float:
    """Return the largest speed, m/s, at which a walker who steps out from beside the path is not hit.

    It is never lower than `slowest_mps`.
    """
    return max(2 * HARDEST_MPS2 * (gap_m / walks_mps - EXPECTED_REACTION_S), slowest_mps)


def _hazards(ego: PredictedEgo, others: list[Other]) -> list[Hazard]:
    """Return the hazards ahead, from the actors in sight."""
    if not others:
        return []
    along, left, heading = ego.way.beside(np.array([(other.x, other.y) for other in others]))
    slow_places = []
    for k, other in enumerate(others):
        across = _half_across(other, float(heading[k]))
        half = _half_along(other, float(heading[k]))
        gap = abs(float(left[k])) - across - ego.width_m / 2
        front = ego.along_m + ego.length_m / 2
        if other.kind == "pedestrian" and ego.crossings:
            slow_places += _at_crossing(ego, other, front)
        if float(along[k]) + half < front or gap <= 0.0:
            continue
        before = float(along[k]) - half - front
        slow_places += _of(other, others, gap, before, float(left[k]), float(heading[k]))
    return slow_places


def _at_crossing(ego: PredictedEgo, walker: Other, front: float) -> list[Hazard]:
    """Return the crossings with priority for walkers that this walker may enter."""
    slow_places = []
    for path in ego.crossings:
        (x0, y0), (x1, y1) = path[0], path[-1]
        length = math.hypot(x1 - x0, y1 - y0)
        share = ((walker.x - x0) * (x1 - x0) + (walker.y - y0) * (y1 - y0)) / max(length, 0.1) ** 2
        nearest = min(max(share, 0.0), 1.0)
        away = math.hypot(walker.x - x0 - nearest * (x1 - x0), walker.y - y0 - nearest * (y1 - y0))
        middle = np.array([[(x0 + x1) / 2, (y0 + y1) / 2]])
        along, aside, _ = ego.way.beside(middle)
        if away < AT_CROSSING_M and float(along[0]) > front and abs(float(aside[0])) < length:
            before = float(along[0]) - front - _HALF_CROSSING_M - _stopping_m(SLOWEST_AT_BUS_MPS)
            slow_places.append(Hazard("a walker at a crossing", before, SLOWEST_AT_BUS_MPS))
    return slow_places


def _of(other: Other, others: list[Other], gap: float, before: float, left: float, heading: float) -> list[Hazard]:
    if other.kind == "pedestrian":
        return _walker(other, others, gap, before, left, heading)
    small = other.kind in ("bicycle", "motorcycle") or other.width_m < HIDES_M
    if small or other.speed_mps > NEARLY_STANDS_MPS or gap > BESIDE_M:
        return []
    bus, people = other.kind == "bus", _people_near(other, others)
    slowest = SLOWEST_AT_BUS_MPS if bus or people else SLOWED_TO_MPS
    speed = _careful_mps(gap, RUNNING_MPS if bus else WALKING_MPS, slowest)
    what = "a bus that stands" if bus else "a stopped vehicle with people near it" if people else "a stopped vehicle"
    return [Hazard(what, before - _stopping_m(speed), speed)]


def _walker(other: Other, others: list[Other], gap: float, before: float, left: float, heading: float) -> list[Hazard]:
    towards = -math.copysign(1.0, left) * other.speed_mps * math.sin(other.course_rad - heading)
    stands = other.speed_mps < NEARLY_STANDS_MPS
    near = gap < CLOSE_M or (stands and gap < KERB_M)
    if not near and not (towards > _TOWARDS_MPS and gap < _APPROACHES_M):
        return []
    beside_vehicle = any(o.kind not in ("pedestrian", "bicycle") and _people_near(o, [other]) for o in others)
    slowest = SLOWEST_AT_BUS_MPS if beside_vehicle or towards > _TOWARDS_MPS else SLOWED_TO_MPS
    speed = _careful_mps(gap, max(WALKING_MPS, towards), slowest)
    return [Hazard("a walker at the kerb", before - _stopping_m(speed), speed)]


def _people_near(vehicle: Other, others: list[Other]) -> bool:
    return vehicle.speed_mps < NEARLY_STANDS_MPS and any(
        other.kind == "pedestrian"
        and math.hypot(other.x - vehicle.x, other.y - vehicle.y) < vehicle.length_m / 2 + NEAR_VEHICLE_M
        for other in others
    )


def _stopping_m(speed_mps: float) -> float:
    return speed_mps * EXPECTED_REACTION_S + speed_mps**2 / (2 * HARDEST_MPS2)


def _half_across(other: Other, heading_rad: float) -> float:
    turned = other.heading_rad - heading_rad
    return (other.length_m * abs(math.sin(turned)) + other.width_m * abs(math.cos(turned))) / 2


def _half_along(other: Other, heading_rad: float) -> float:
    turned = other.heading_rad - heading_rad
    return (other.length_m * abs(math.cos(turned)) + other.width_m * abs(math.sin(turned))) / 2
