"""Actors that Python moves: along a path (pedestrians, cyclists), and back to a lane after a steering perturbation.

Both are restored from what a clip holds. A path-follower is its length along the path and its speed; an actor under
recovery is its `BicycleState` and the time.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import atan, atan2, cos, hypot, nan, pi, sin, sqrt, tan
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.compile.bundle import Steering
from foresee_dsl.compile.polyline import Polyline, wrap
from foresee_dsl.drivers.protocol import Control, VehicleLimits
from foresee_dsl.simulate.collision import Mover
from foresee_dsl.simulate.dynamics import GRAVITY_MPS2, Bicycle, BicycleState

FloatArray = NDArray[np.float64]

STOP_LINE_M = 0.5
"""A front halts this far before a stop line, and has passed it when it is this far beyond. Ours: SUMO's cars halt
within 1 m of the line."""

SLOWING_S = 0.4
"""Excess speed is shed with this time constant, and limits are looked at this far ahead, which makes up for it. Ours:
four times the lag of the brakes."""

STRAYS_M = 1.0
"""Further than this from its lane's centre an actor looks where its wheels point and not along its lane. Ours: a car
in a lane of 3.3 m that is 1 m off has a side on the marking."""

ARC_S, ARC_STRAYING_S = 0.5, 3.0
"""How far along the arc of its wheels it looks, in and out of its lane. Ours: in it, for what has come upon it; out of
it, the time in which any speed in a town is braked away (25 m/s at 8 m/s^2)."""

PLANNED_SHARE = 0.8
"""Share of comfortable braking that is planned with; ours, the rest is for the lag."""


class LineLike(Protocol):
    """What is needed of a route's centreline (`compile.geometry.RouteLine` has it)."""

    @property
    def s(self) -> FloatArray:
        """[N] m along the line."""
        ...

    @property
    def speed_limit(self) -> FloatArray:
        """[N] m/s."""
        ...

    @property
    def curvature(self) -> FloatArray:
        """[N] 1/m, left positive."""
        ...

    def at(self, s: float, /) -> tuple[float, float, float]:
        """Return x, y and heading at a length; straight on beyond the ends."""
        ...

    def project(self, x: float, y: float, near_s: float | None = None) -> tuple[float, float]:
        """Return the length nearest to a point, and how far to the left of the line it lies."""
        ...


@dataclass(frozen=True, slots=True)
class FollowerPose:
    """Where a path-follower is: centre (m), heading (rad), speed (m/s), acceleration (m/s^2), yaw rate (rad/s)."""

    x: float
    y: float
    heading: float
    speed: float
    acceleration: float
    yaw_rate: float


class PathFollower:
    """Moves along a polyline toward a pace, and stops at its end and where it is told to.

    Each step follows from `along_m` and `speed_mps` (and the pace and the stop in force), so one restored from those
    continues on the same positions.

    Args:
        path: [N, 2] m.
        pace_mps: the speed that it takes up.
        acceleration_mps2, braking_mps2: how fast it does so; positive.
        length_m: its footprint's length: the heading is that of the path between its rear and its front, so that a
            cyclist turns gradually at a corner.
        along_m, speed_mps: where it is and how fast.

    Raises:
        ValueError: the path has no length, or a rate is not positive.

    Attributes:
        pace_mps: may be changed at any time; 0 halts it.
        stop_m: a length along the path where it must wait, None when it may go on. One that lies behind, or nearer
            than it can brake for, does not hold it.
    """

    def __init__(
        self,
        path: FloatArray | Sequence[Sequence[float]],
        *,
        pace_mps: float,
        acceleration_mps2: float,
        braking_mps2: float,
        length_m: float = 0.0,
        along_m: float = 0.0,
        speed_mps: float = 0.0,
    ) -> None:
        if not (acceleration_mps2 > 0 and braking_mps2 > 0):
            raise ValueError(f"rates must be positive: {acceleration_mps2} and {braking_mps2} m/s^2")
        points = np.asarray(path, dtype=np.float64).reshape(-1, 2)
        if not np.isfinite(points).all() or len(points) < 2 or not np.ptp(points, axis=0).max() > 0:
            raise ValueError(f"a path needs two different points: {points.tolist()}")
        self.line = Polyline.of(points)
        self.pace_mps = pace_mps
        self.acceleration_mps2, self.braking_mps2 = acceleration_mps2, braking_mps2
        self.stop_m: float | None = None
        self.along_m, self.speed_mps = along_m, speed_mps
        self._half_m = length_m / 2
        self._placed: tuple[float, tuple[float, float, float]] = (nan, (0.0, 0.0, 0.0))

    @property
    def arrived(self) -> bool:
        """It has come to the end of its path."""
        return self.along_m >= self.line.length_m

    def pose(self) -> FollowerPose:
        """Return where it is, as if it kept its speed (acceleration and yaw rate 0)."""
        x, y, heading = self._place()
        return FollowerPose(x, y, heading, self.speed_mps, 0.0, 0.0)

    def step(self, dt: float) -> FollowerPose:
        """Move on by `dt` seconds and return where it is then."""
        before, heading_before = self.speed_mps, self._place()[2]
        speed = max(before - self.braking_mps2 * dt, min(self.pace_mps, before + self.acceleration_mps2 * dt), 0.0)
        for stop in self._stops():
            room = stop - self.along_m
            speed = min(speed, max(self._approach(room, dt), before - self.braking_mps2 * dt, 0.0))
            if room <= (before + speed) / 2 * dt + 1e-9 and speed <= self.braking_mps2 * dt:
                # The last step: onto the very point, and still.
                self.along_m, self.speed_mps = stop, 0.0
                return self._moved(before, heading_before, dt)
        self.along_m = min(self.along_m + (before + speed) / 2 * dt, self.line.length_m)
        self.speed_mps = 0.0 if self.arrived else speed
        return self._moved(before, heading_before, dt)

    def _moved(self, before: float, heading_before: float, dt: float) -> FollowerPose:
        x, y, heading = self._place()
        return FollowerPose(
            x, y, heading, self.speed_mps, (self.speed_mps - before) / dt, wrap(heading - heading_before) / dt
        )

    def _stops(self) -> Iterable[float]:
        if self.stop_m is not None and self.along_m <= self.stop_m < self.line.length_m:
            yield self.stop_m
        yield self.line.length_m

    def _approach(self, room: float, dt: float) -> float:
        """The largest speed at the end of this step from which braking still ends within `room`."""
        b = self.braking_mps2
        left = room - self.speed_mps * dt / 2
        return b * (sqrt(max(0.0, dt * dt / 4 + 2 * left / b)) - dt / 2)

    def _place(self) -> tuple[float, float, float]:
        # A step asks where it was and where it is; where it was is known from the step before.
        if self._placed[0] != self.along_m:
            self._placed = (self.along_m, self._look_up())
        return self._placed[1]

    def _look_up(self) -> tuple[float, float, float]:
        x, y, heading = self.line.at(self.along_m)
        if self._half_m > 0:
            rear, front = self.line.at(self.along_m - self._half_m), self.line.at(self.along_m + self._half_m)
            dx, dy = front[0] - rear[0], front[1] - rear[1]
            if hypot(dx, dy) > self._half_m / 2:  # less: the path folds back on itself here
                heading = atan2(dy, dx)
        return x, y, heading


@dataclass(frozen=True, slots=True)
class RecoverySettings:
    """How an actor drives that SUMO does not move any more. All ours, unless said otherwise.

    Attributes:
        lookahead_s, lookahead_min_m: pure pursuit aims this far ahead. Measured from 14 to 30 m/s on a car and a bus
            thrown 14 m off their lane: 0.5 s swings past it by 5 m, 0.9 s by 1 m, 1.2 s by 0.5 m; all back within
            8 s from 0.7 s to 1.2 s. In turns a longer one cuts the corner. The least keeps it calm when crawling.
        recovery_mps2: lateral acceleration of the way back to the lane: 0.4 g, not half of what dry tyres hold.
        headway_s, standstill_m: of the car-following model; SUMO's tau and minGap, so that a taken-over actor keeps
            the gaps that it kept before.
        margin_m: a body counts as ahead when it comes this near to the swept corridor.
        sight_m: how far ahead it looks.
    """

    lookahead_s: float = 1.0
    lookahead_min_m: float = 5.0
    recovery_mps2: float = 4.0
    headway_s: float = 1.0
    standstill_m: float = 2.5
    margin_m: float = 0.2
    sight_m: float = 80.0


class LaneRecovery:
    """Drives an actor taken over from SUMO: steering offset for a while, then back to its lane.

    Laterally: while the offset acts, the wheels stand where the lane's bend needs them plus the offset, and nothing
    corrects the error; afterwards pure pursuit (Coulter, CMU-RI-TR-92-01). Longitudinally: the Intelligent Driver Model
    (Treiber et al., 2000) toward its cruising speed within the limits, against the nearest body in its way.

    Args:
        limits: of the actor.
        line: the centreline of its route.
        cruise_mps: what it drives where nothing hinders it.
        offset: share of the largest steering angle (left positive), from when (s) and for how long (None: to the end).
        lateral_bound_mps2: the offset may not ask for more lateral acceleration; None: as much as the tyres hold.
        brakes: False: it takes no notice of others.
        settings: see there.
    """

    def __init__(
        self,
        limits: VehicleLimits,
        line: LineLike,
        *,
        cruise_mps: float,
        offset: Steering | None = None,
        lateral_bound_mps2: float | None = None,
        brakes: bool = True,
        settings: RecoverySettings | None = None,
    ) -> None:
        self.limits = limits
        self.bicycle = Bicycle(limits)
        self.line = line
        self.settings = settings or RecoverySettings()
        self.cruise_mps, self.offset, self.brakes = cruise_mps, offset, brakes
        grip = limits.friction * GRAVITY_MPS2
        self.offset_mps2 = grip if lateral_bound_mps2 is None else min(grip, lateral_bound_mps2)
        self.recovery_mps2 = min(grip, self.settings.recovery_mps2)
        self._marks: list[float] = line.s.tolist()
        self._allowed = _allowed_speed(line, PLANNED_SHARE * limits.braking_mps2)
        self._curvature: list[float] = line.curvature.tolist()
        self._near_s: float | None = None

    def take_over(self, x: float, y: float, heading: float, speed: float, acceleration: float = 0.0) -> BicycleState:
        """Return the state of an actor that SUMO moved until now; its wheels stand as its lane's bend needs them.

        Args:
            x, y: centre of the footprint (m). heading: rad. speed: m/s. acceleration: m/s^2.
        """
        curvature = self._curvature[self._mark(self.line.project(x, y)[0])]
        steer = self.bicycle.steer_for(curvature)
        return BicycleState(x, y, heading, speed, acceleration, speed * curvature, steer)

    def done(self, state: BicycleState) -> bool:
        """Whether it has come to the end of its route."""
        return self._along(state)[0] >= self._marks[-1] - 1e-6

    def step(
        self,
        state: BicycleState,
        time_s: float,
        others: Sequence[Mover],
        dt: float,
        *,
        stop_s: float | None = None,
    ) -> BicycleState:
        """Return the state `dt` seconds later.

        Args:
            state: now.
            time_s: now.
            others: the bodies around it, itself not among them; NaN where absent.
            dt: s.
            stop_s: length along its line that its front may not pass (a red signal); None when it may go. One that it
                has passed, or cannot stop at, does not hold it.
        """
        s, beside = self._along(state)
        offset = self._offset_now(time_s)
        steer = self._steering(state, offset, s, dt)
        hindrances: list[tuple[float, float]] = []
        if self.brakes:
            strays = offset != 0 or abs(beside) > STRAYS_M
            found = (self._ahead(state, s, other, strays=strays) for other in others)
            hindrances.extend(hindrance for hindrance in found if hindrance is not None)
        if stop_s is not None:
            hindrances.extend(self._line_ahead(state, stop_s - s - self.limits.length_m / 2))
        acceleration = self._pedals(state.speed, s, hindrances)
        return self.bicycle.step(state, self._control(state, steer, acceleration), dt)

    def _along(self, state: BicycleState) -> tuple[float, float]:
        self._near_s, left = self.line.project(state.x, state.y, self._near_s)
        return self._near_s, left

    def _offset_now(self, time_s: float) -> float:
        if self.offset is None:
            return 0.0
        since = time_s - self.offset.start_s
        # Half a microsecond of tolerance: times are sums of steps.
        within = since >= -5e-7 and (self.offset.duration_s is None or since < self.offset.duration_s - 5e-7)
        return self.offset.value if within else 0.0

    def _steering(self, state: BicycleState, offset: float, s: float, dt: float) -> float:
        """Angle of the front wheels (rad) to turn to."""
        limit = self.limits.steer_max_rad
        if offset:
            steer = self.bicycle.steer_for(self._curvature[self._mark(s)]) + offset * limit
            bound = self.offset_mps2
        else:
            steer, bound = self._pursuit(state, s), self.recovery_mps2
        # The speed that it may have at the end of the step: the bound holds there too.
        speed = state.speed + self.limits.acceleration_mps2 * dt
        limit = min(limit, atan(bound * self.limits.wheelbase_m / (speed * speed))) if speed > 0 else limit
        return max(-limit, min(limit, steer))

    def _pursuit(self, state: BicycleState, s: float) -> float:
        """Angle of the front wheels that takes the rear axle on an arc to the point aimed at."""
        ahead = max(self.settings.lookahead_min_m, self.settings.lookahead_s * state.speed)
        x, y = self.bicycle.rear_axle(state)
        # The rear axle lies behind the centre that was projected.
        tx, ty, _ = self.line.at(s - self.bicycle.rear_axle_m + ahead)
        angle = wrap(atan2(ty - y, tx - x) - state.heading)
        distance = hypot(tx - x, ty - y)
        if abs(angle) > pi / 2:  # the point lies behind: turn as hard as the bounds allow
            return self.limits.steer_max_rad if angle > 0 else -self.limits.steer_max_rad
        return atan(2 * self.limits.wheelbase_m * sin(angle) / distance)

    def _pedals(self, speed: float, s: float, hindrances: Iterable[tuple[float, float]]) -> float:
        """Acceleration (m/s^2) of the Intelligent Driver Model; each hindrance is the room to it and its speed."""
        limits = self.limits
        allowed = self._allowed[self._mark(s + speed * SLOWING_S)]
        wanted = max(0.1, min(self.cruise_mps, allowed, limits.max_speed_mps))
        if speed < wanted:
            free = limits.acceleration_mps2 * (1 - (speed / wanted) ** 4)
        else:  # the model's own answer to too much speed is weak near the wanted speed; slow down at a rate instead
            free = max((wanted - speed) / SLOWING_S, -limits.braking_mps2)
        acceleration = free
        for room, their_speed in hindrances:
            closing = speed * (speed - their_speed) / (2 * sqrt(limits.acceleration_mps2 * limits.braking_mps2))
            desired = self.settings.standstill_m + max(0.0, speed * self.settings.headway_s + closing)
            hindered = max(free, 0.0) - limits.acceleration_mps2 * (desired / max(room, 0.1)) ** 2
            acceleration = min(acceleration, hindered)
        return max(acceleration, -limits.emergency_braking_mps2)

    def _line_ahead(self, state: BicycleState, room: float) -> tuple[tuple[float, float], ...]:
        """A stop line as if it were a body that stands; nothing when it is behind or can no longer be stopped at."""
        can_stop = state.speed**2 <= 2 * self.limits.emergency_braking_mps2 * (room + STOP_LINE_M)
        if room < -STOP_LINE_M or not can_stop:
            return ()
        # The model keeps `standstill_m` from a body; the front comes nearer than that to a line.
        return ((room + self.settings.standstill_m - STOP_LINE_M, 0.0),)

    def _ahead(self, state: BicycleState, s: float, other: Mover, *, strays: bool) -> tuple[float, float] | None:
        """Room to a body and its speed in our direction, None when it is not in the way."""
        dx, dy = other.x - state.x, other.y - state.y
        if not hypot(dx, dy) <= self.settings.sight_m:  # NaN is not there
            return None
        c, si = cos(state.heading), sin(state.heading)
        along, left = dx * c + dy * si, dy * c - dx * si
        if along <= 0:
            return None
        return self._on_arc(state, other, along, left, strays=strays) or self._in_lane(s, other, along, strays=strays)

    def _on_arc(
        self, state: BicycleState, other: Mover, along: float, left: float, *, strays: bool
    ) -> tuple[float, float] | None:
        """What lies on the arc that the wheels now describe; `along`, `left`: where it is in our frame (m).

        Who keeps the lane looks at the lane: its wheels say little about where it will be in a second.
        """
        arc = tan(state.steer) / self.limits.wheelbase_m
        facing = state.heading + arc * along
        room = along - self.limits.length_m / 2 - _half_extent(other, facing)
        # A sharp arc is left again soon: beyond a radian it says nothing.
        if room > state.speed * (ARC_STRAYING_S if strays else ARC_S) or abs(arc) * along > 1:
            return None
        reach = self.limits.width_m / 2 + self.settings.margin_m + _half_extent(other, facing + pi / 2)
        if abs(left - arc * along * along / 2) > reach:
            return None
        return room, other.speed * cos(other.heading - facing)

    def _in_lane(self, s: float, other: Mover, along: float, *, strays: bool) -> tuple[float, float] | None:
        """What stands or drives in its lane matters to those who are in it."""
        if strays:
            return None
        there, beside = self.line.project(other.x, other.y, s + along)
        facing = self.line.at(there)[2]
        reach = self.limits.width_m / 2 + self.settings.margin_m + _half_extent(other, facing + pi / 2)
        if there <= s or abs(beside) > reach:
            return None
        room = there - s - self.limits.length_m / 2 - _half_extent(other, facing)
        return room, other.speed * cos(other.heading - facing)

    def _mark(self, s: float) -> int:
        """Index of the line's point at or before this length."""
        return max(0, min(len(self._marks) - 1, bisect_right(self._marks, s) - 1))

    def _control(self, state: BicycleState, steer: float, acceleration: float) -> Control:
        limits = self.limits
        wheel = steer / limits.steer_max_rad if limits.steer_max_rad > 0 else 0.0
        if acceleration >= 0:
            can = limits.acceleration_mps2 * max(0.05, 1 - state.speed / limits.max_speed_mps)
            return Control(wheel, min(1.0, acceleration / can), 0.0)
        return Control(wheel, 0.0, min(1.0, -acceleration / limits.emergency_braking_mps2))


def _allowed_speed(line: LineLike, braking_mps2: float) -> list[float]:
    """Speed at each point of a line from which this braking meets every limit that follows."""
    limits: list[float] = line.speed_limit.tolist()
    s: list[float] = line.s.tolist()
    for k in range(len(limits) - 2, -1, -1):
        limits[k] = min(limits[k], sqrt(limits[k + 1] ** 2 + 2 * braking_mps2 * (s[k + 1] - s[k])))
    return limits


def _half_extent(body: Mover, angle: float) -> float:
    """Half the length of a body's shadow on a line in direction `angle`."""
    turned = angle - body.heading
    return (body.length * abs(cos(turned)) + body.width * abs(sin(turned))) / 2
