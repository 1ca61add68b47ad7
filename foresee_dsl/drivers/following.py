"""Follows the trajectory of a driver: turns it, step by step, into an acceleration and a wheel angle.

A driver that answers a `Trajectory` instead of a `Control` leaves the pedals and the wheel to this tracker.

- Lateral: the curvature of the path ahead, and a feedback of the rear axle's lateral and heading error with two equal
  poles along the path (a linearised path-following law for the kinematic bicycle: Rajamani, Vehicle Dynamics and
  Control, 2nd ed., section 2.2, for the model; Morin and Samson, Motion Control of Wheeled Mobile Robots, section 34.4
  of the Springer Handbook of Robotics, 2008, for the law).
- Along the path: the trajectory's acceleration, taken ahead by the lag of drivetrain and brakes, and a feedback of the
  speed and of the position.

It uses the ego's measured state only. How far the ego really was from its trajectory is measured beside it
(`Deviation`), so that a report can tell an error of the tracker from one of the plan.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from foresee_dsl.drivers.parts import PlannedMotion
from foresee_dsl.drivers.protocol import EgoState, Trajectory, VehicleLimits
from foresee_dsl.kernels.bicycle import BRAKE_LAG_S, THROTTLE_LAG_S
from foresee_dsl.kernels.constants import COMFORTABLE_MPS2, GRAVITY_MPS2, STANDS_MPS, STEP_S

BEGINS_LATER_S = 0.5
"""Latest beginning of a new trajectory after the current time, s. Ours: a plan for ten steps ahead; a later one is on
another clock."""
SHORTEST_M = 0.3
"""Length of a trajectory below which it has no direction, m. Ours: six standard deviations of the localisation."""
SMOOTHED_M = 1.0
"""Heading and curvature of the path are means over this length before and after a place, m. Ours: lanes of networks
have corners every 2 to 4 m."""
SETTLES_M, SETTLES_S = 2.0, 0.4
"""Length along the path in which a lateral error decreases to 37 %: `SETTLES_M`, m, or more at speed: the way of
`SETTLES_S`, s. Ours: on bundled scenarios the largest deviation is 0.26 m; with 2.5 m and 0.5 s it is 0.29 m."""
LATERAL_MOST_M = 1.0
"""Largest lateral error to which the feedback reacts, m. Ours: the ego then approaches at 14 degrees at most."""
SPEED_GAIN_PER_S, PLACE_GAIN_PER_S2 = 1.6, 0.64
"""Gains of the errors of speed and position along the path: two equal poles with a time constant of 1.25 s. Ours: six
times the lag of the drivetrain, so that the lag does not make it oscillate."""
ALONG_MOST_M = 3.0
"""Largest error along the path to which the feedback reacts, m. Ours: limits the correction to 1.9 m/s^2."""
RESTS_M = 0.3
"""A standing ego whose trajectory stands too does not move for an error below this, m. Ours: see `SHORTEST_M`."""
STEERS_AHEAD_S = STEP_S
"""The wheel angle is that of the path this much ahead of the ego, s, because the wheels turn at their rate. Ours:
measured on the bundled scenarios, with 0, 0.05 and 0.1 s."""
FAR_M, LATE_M = 0.5, 2.0
"""Deviation from the trajectory, sideways and along it, above which a report says that the ego did not follow its plan.
Ours: half of the distance at which drivers pass, and the margin of a stop line."""


@dataclass(frozen=True, slots=True)
class Deviation:
    """How far the ego was from the trajectories that its driver answered: the largest values of a run.

    The true position is compared with the trajectory that was followed in the step before.

    Attributes:
        lateral_m: largest distance from the path, m. lateral_s: its time in the run, s.
        along_m: largest distance along the path from the planned position, m; positive if the ego was ahead of it.
        along_s: its time in the run, s.
    """

    lateral_m: float
    lateral_s: float
    along_m: float
    along_s: float

    @property
    def is_large(self) -> bool:
        """Whether the ego was so far from its trajectory that a failure may be the tracker's and not the planner's."""
        return self.lateral_m > FAR_M or abs(self.along_m) > LATE_M

    @property
    def sentence(self) -> str:
        """The deviation in words."""
        word = "ahead of" if self.along_m > 0 else "behind"
        return (
            f"at most {self.lateral_m:.2f} m beside the driver's trajectory (at {self.lateral_s:.2f} s), "
            f"{abs(self.along_m):.2f} m {word} it (at {self.along_s:.2f} s)"
        )


def checked_trajectory(trajectory: Trajectory, now_s: float) -> None:
    """Check a new trajectory.

    Raises:
        ValueError: its arrays do not fit together, a value is not a finite number, there are fewer than two points, the
            times do not ascend, a speed is negative, it is over already, or it begins much later.
    """
    times, points = np.asarray(trajectory.time_s), np.asarray(trajectory.points)
    says = "the driver answered a Trajectory"
    if times.ndim != 1 or points.shape != (len(times), 2):
        raise ValueError(f"{says} with time_s of shape {times.shape} and points of shape {points.shape}; "
                         "they must be [N] and [N, 2]")  # fmt: skip
    if len(times) < 2:
        raise ValueError(f"{says} with {len(times)} point(s); it needs at least two")
    columns = {"time_s": times, "points": points}
    for name in ("heading_rad", "speed_mps"):
        if (column := getattr(trajectory, name)) is not None:
            columns[name] = np.asarray(column)
            if columns[name].shape != times.shape:
                raise ValueError(f"{says} whose {name} has the shape {columns[name].shape}; it must be {times.shape}")
    for name, column in columns.items():
        if column.dtype.kind not in "fiu" or not np.isfinite(column).all():
            raise ValueError(f"{says} in whose {name} a value is not a finite number")
    if (fall := np.flatnonzero(np.diff(times) <= 0)).size:
        k = int(fall[0])
        raise ValueError(f"{says} whose times do not ascend: {times[k]:g} s is followed by {times[k + 1]:g} s")
    if "speed_mps" in columns and columns["speed_mps"].min() < 0:
        raise ValueError(f"{says} with the speed {columns['speed_mps'].min():g} m/s; the ego cannot reverse")
    hint = "its times must be on the clock of observation.time_s"
    if times[-1] <= now_s:
        raise ValueError(f"{says} that ended at {times[-1]:g} s, and it is {now_s:g} s; {hint}")
    if times[0] > now_s + BEGINS_LATER_S:
        raise ValueError(f"{says} that begins at {times[0]:g} s, and it is {now_s:g} s; {hint}")


class Course:
    """A trajectory as functions of time and of the length along its path.

    Between two points, positions follow cubic curves (Hermite, with slopes from the neighbouring points). Before its
    first and after its last point the path goes straight on. After its end, the ego brakes along it to a stop.

    Args:
        trajectory: a trajectory that was checked. heading_rad: the ego's heading now, for a trajectory that does not
            move and has no headings.
    """

    def __init__(self, trajectory: Trajectory, heading_rad: float) -> None:
        times = np.array(trajectory.time_s, dtype=np.float64)
        points = np.array(trajectory.points, dtype=np.float64)
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
        self._times, self._along = times, along
        self._slopes = np.maximum(np.gradient(along, times, edge_order=2 if len(times) > 2 else 1), 0.0)
        self._speeds = self._slopes if trajectory.speed_mps is None else np.array(trajectory.speed_mps, np.float64)
        self.length_m = float(along[-1])
        if self.length_m < SHORTEST_M:
            if trajectory.heading_rad is not None:
                heading_rad = float(trajectory.heading_rad[0])
            points = points[0] + np.array([[0.0, 0.0], [math.cos(heading_rad), math.sin(heading_rad)]])
            marks = np.array([0.0, 1.0])
        else:
            moved = np.concatenate([[True], np.diff(along) > 1e-3])
            points, marks = points[moved], along[moved]
        self._marks, self._points = marks, points
        self._tangents = np.gradient(points, marks, axis=0, edge_order=2 if len(marks) > 2 else 1)
        self._headings = np.unwrap(np.arctan2(self._tangents[:, 1], self._tangents[:, 0]))
        areas = np.diff(marks) * (self._headings[1:] + self._headings[:-1]) / 2
        self._turned = np.concatenate([[0.0], np.cumsum(areas)])

    def along_at(self, time_s: float) -> tuple[float, float]:
        """Return the length along the path, m, and the speed, m/s, that are planned for a time."""
        times, along = self._times, self._along
        first, last = float(times[0]), float(times[-1])
        if time_s <= first:
            speed = float(self._speeds[0])
            return float(along[0]) - speed * (first - time_s), speed
        if time_s >= last:
            speed = float(self._speeds[-1])
            late = min(time_s - last, speed / COMFORTABLE_MPS2)
            return float(along[-1]) + (speed - COMFORTABLE_MPS2 * late / 2) * late, speed - COMFORTABLE_MPS2 * late
        k = int(np.searchsorted(times, time_s, side="right")) - 1
        span = float(times[k + 1] - times[k])
        share = (time_s - float(times[k])) / span
        place = _hermite(share, span, along[k], along[k + 1], self._slopes[k], self._slopes[k + 1])
        return place, float(self._speeds[k] + share * (self._speeds[k + 1] - self._speeds[k]))

    def place_at(self, along_m: float) -> tuple[float, float]:
        """Return x and y at a length along the path, m."""
        marks, points, tangents = self._marks, self._points, self._tangents
        for end in (0, -1):
            beyond = along_m - float(marks[end])
            if (beyond <= 0) if end == 0 else (beyond >= 0):
                direction = float(self._headings[end])
                x, y = points[end].tolist()
                return x + beyond * math.cos(direction), y + beyond * math.sin(direction)
        k = int(np.searchsorted(marks, along_m, side="right")) - 1
        span = float(marks[k + 1] - marks[k])
        share = (along_m - float(marks[k])) / span
        x, y = (
            _hermite(share, span, points[k, axis], points[k + 1, axis], tangents[k, axis], tangents[k + 1, axis])
            for axis in (0, 1)
        )
        return x, y

    def direction_at(self, along_m: float) -> tuple[float, float]:
        """Return direction, rad, and curvature, 1/m (left positive), at a length along the path, m.

        Both are means over `SMOOTHED_M` on either side, or less near the path's ends.
        """
        marks, headings = self._marks, self._headings
        end = float(marks[-1])
        at = min(max(along_m, 0.0), end)
        half = min(SMOOTHED_M, at, end - at)
        low, high = max(at - SMOOTHED_M, 0.0), min(at + SMOOTHED_M, end)
        first, middle, last = np.interp((low, at, high), marks, headings).tolist()
        if half > 1e-3:
            before, after = (self._turned_until(at + side * half) for side in (-1, 1))
            middle = (after - before) / (2 * half)
        inside = 0.0 <= along_m <= end
        return middle, (last - first) / max(high - low, 1e-6) if inside else 0.0

    def _turned_until(self, along_m: float) -> float:
        """Return the integral of the direction over the path from its beginning to a place, rad m."""
        marks, headings = self._marks, self._headings
        k = min(int(np.searchsorted(marks, along_m, side="right")) - 1, len(marks) - 2)
        rest = along_m - float(marks[k])
        slope = float(headings[k + 1] - headings[k]) / float(marks[k + 1] - marks[k])
        return float(self._turned[k]) + rest * (float(headings[k]) + slope * rest / 2)

    def nearest(self, x: float, y: float, near_m: float) -> float:
        """Return the length along the path of the place that is nearest to a point, searched from `near_m` on."""
        at = near_m
        for _ in range(_SEARCHES):
            place_x, place_y = self.place_at(at)
            direction, _ = self.direction_at(at)
            step = (x - place_x) * math.cos(direction) + (y - place_y) * math.sin(direction)
            at += step
            if abs(step) < _NEAR_ENOUGH_M:
                break
        return at


_SEARCHES, _NEAR_ENOUGH_M = 5, 1e-3
"""Largest number of steps of the search for the nearest place, and the step at which it ends, m. Ours: two steps are
usual."""


def _hermite(share: float, span: float, first: float, last: float, slope: float, last_slope: float) -> float:
    """Return the value of a cubic curve between two points with these values and slopes, at a share of the span."""
    rest = 1.0 - share
    return float(
        rest * rest * ((1.0 + 2.0 * share) * first + share * span * slope)
        + share * share * ((3.0 - 2.0 * share) * last - rest * span * last_slope)
    )


class Follower:
    """Follows the trajectories of one run.

    Args:
        vehicle: the limits of the ego's vehicle. at_once: whether the vehicle takes an acceleration and a wheel angle
            without delay (ideal control); there is then no lag to compensate.
    """

    def __init__(self, vehicle: VehicleLimits, *, at_once: bool = False) -> None:
        self._vehicle, self._at_once = vehicle, at_once
        self._trajectory: Trajectory | None = None
        self._course: Course | None = None
        self._along_m = 0.0
        self._worst: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)

    @property
    def deviation(self) -> Deviation:
        """The largest deviation so far."""
        return Deviation(*self._worst)

    def measure(self, x: float, y: float, time_s: float) -> None:
        """Compare the ego's true position, m, with the trajectory that was followed up to this time."""
        course = self._course
        if course is None:
            return
        planned, _ = course.along_at(time_s)
        at = course.nearest(x, y, planned)
        place_x, place_y = course.place_at(at)
        beside, ahead = math.hypot(x - place_x, y - place_y), at - planned
        lateral, lateral_s, along, along_s = self._worst
        if beside > lateral:
            lateral, lateral_s = beside, time_s
        if abs(ahead) > abs(along):
            along, along_s = ahead, time_s
        self._worst = lateral, lateral_s, along, along_s

    def motion(self, trajectory: Trajectory, ego: EgoState, now_s: float) -> PlannedMotion:
        """Return the acceleration and the wheel angle with which the ego follows a trajectory in the next step.

        Args:
            trajectory: a new one, or the object of an earlier call, which may be over by now. ego: its measured state.
            now_s: the current time, s.

        Raises:
            ValueError: a new trajectory is not usable (`checked_trajectory`).
        """
        if trajectory is not self._trajectory or self._course is None:
            checked_trajectory(trajectory, now_s)
            self._trajectory, self._course = trajectory, Course(trajectory, ego.heading_rad)
            self._along_m, _ = self._course.along_at(now_s)
        course = self._course
        self._along_m = course.nearest(ego.x, ego.y, self._along_m)
        return PlannedMotion(self._acceleration(course, ego, now_s), self._wheel(course, ego))

    def _acceleration(self, course: Course, ego: EgoState, now_s: float) -> float:
        planned, speed = course.along_at(now_s)
        ahead_s = 0.0 if self._at_once else THROTTLE_LAG_S
        rate = self._rate(course, now_s + ahead_s)
        if rate < 0 and not self._at_once:
            rate = self._rate(course, now_s + BRAKE_LAG_S)
        missing = min(max(planned - self._along_m, -ALONG_MOST_M), ALONG_MOST_M)
        _, soon = course.along_at(now_s + STEP_S + ahead_s)
        if ego.speed_mps < STANDS_MPS and max(speed, soon) < STANDS_MPS and missing < RESTS_M:
            return -COMFORTABLE_MPS2  # the brake holds the ego
        wanted = rate + SPEED_GAIN_PER_S * (speed - ego.speed_mps) + PLACE_GAIN_PER_S2 * missing
        vehicle = self._vehicle
        return min(max(wanted, -vehicle.emergency_braking_mps2), vehicle.acceleration_mps2)

    @staticmethod
    def _rate(course: Course, time_s: float) -> float:
        """Return the planned acceleration over the step that begins at a time, m/s^2."""
        (_, before), (_, after) = course.along_at(time_s), course.along_at(time_s + STEP_S)
        return (after - before) / STEP_S

    def _wheel(self, course: Course, ego: EgoState) -> float:
        """Return the wheel angle, rad."""
        behind, at, speed = self._vehicle.rear_axle_m, self._along_m, ego.speed_mps
        direction, bend = course.direction_at(at)
        # Only the rear axle moves along the vehicle's heading. In a left bend the centre, `behind` metres ahead of it,
        # moves to the left of the heading, by the angle `slip`.
        slip = math.asin(min(max(behind * bend, -_SLIP_MOST), _SLIP_MOST))
        heading = direction - slip
        x, y = course.place_at(at)
        rear_x, rear_y = x - behind * math.cos(heading), y - behind * math.sin(heading)
        ego_x = ego.x - behind * math.cos(ego.heading_rad)
        ego_y = ego.y - behind * math.sin(ego.heading_rad)
        beside = (ego_y - rear_y) * math.cos(heading) - (ego_x - rear_x) * math.sin(heading)
        beside = min(max(beside, -LATERAL_MOST_M), LATERAL_MOST_M)
        turned = math.remainder(ego.heading_rad - heading, math.tau)
        _, ahead = course.direction_at(at + (0.0 if self._at_once else speed * STEERS_AHEAD_S))
        lateral = min(max(behind * ahead, -_SLIP_MOST), _SLIP_MOST)
        feed_forward = ahead / math.sqrt(1.0 - lateral * lateral)
        settles = max(SETTLES_M, speed * SETTLES_S)
        curvature = feed_forward - 2.0 / settles * math.sin(turned) - beside / (settles * settles)
        most = self._vehicle.friction * GRAVITY_MPS2 / max(speed * speed, 1e-6)
        curvature = min(max(curvature, -most), most)
        limit = self._vehicle.steer_max_rad
        return min(max(math.atan(self._vehicle.wheelbase_m * curvature), -limit), limit)


_SLIP_MOST = 0.9
"""Largest sine of the angle between the motion of the centre and the heading. Ours: the angle of a turn whose radius is
the distance between centre and rear axle, which no vehicle can drive, is a right angle."""
