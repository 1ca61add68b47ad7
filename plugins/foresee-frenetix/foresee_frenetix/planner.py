"""Samples trajectories with the library frenetix, from the end states that fit a behaviour to feasible trajectories."""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass
from typing import Any

import frenetix
import numpy as np
from frenetix.trajectory_functions import FillCoordinates
from frenetix.trajectory_functions import cost_functions as costs
from frenetix.trajectory_functions import feasability_functions as feasibility
from numpy.typing import NDArray

from foresee_dsl.drivers.pdm.route import DriverRoute
from foresee_dsl.drivers.pdm.situation import RoadSituation
from foresee_dsl.drivers.protocol import FloatArray, VehicleLimits
from foresee_dsl.kernels.arrays import BoolArray
from foresee_dsl.kernels.constants import GRAVITY_MPS2
from foresee_dsl.kernels.pdm import settings as pdm_settings
from foresee_dsl.kernels.pdm.proposals import FAR_M
from foresee_dsl.kernels.pdm.route import GRID_M
from foresee_frenetix import settings as cfg
from foresee_frenetix.behaviour import Behaviour
from foresee_frenetix.plan import MOTION, TIMES_S, Frenet, Motion, Plan, angle_between, place

# Otherwise the library reports each sample that it rejects.
logging.getLogger("default_frenetix_logger").setLevel(logging.WARNING)
FRAMES = len(TIMES_S)
READ_OUT = 4
APART_M = 0.3
"""The current offset is sampled too if it is at least this far from all other offsets, m. Ours."""
LEAST_S = 0.6
"""The rest of a manoeuvre is sampled only if it lasts at least this long, s. Ours: three frames of a plan."""


@dataclass(frozen=True)
class RouteStretch:
    """One stretch of the route. Lengths in the library differ slightly from ours, because it measures along a polyline
    of its own.

    Attributes:
        number: number of the stretch. system: the library's coordinate system.
        route_s, own_s: [M] lengths of the same points on the route and in the library's coordinates, m.
    """

    number: int
    # A frenetix.CoordinateSystemWrapper; `Any`, because the library's stubs name a module that does not exist.
    system: Any
    route_s: FloatArray
    own_s: FloatArray

    def to_route(self, own_s: FloatArray) -> FloatArray:
        """Return lengths on the route (any shape), m."""
        return np.asarray(np.interp(own_s, self.own_s, self.route_s))


def window_number(route: DriverRoute, s: float) -> int:
    """Return the number of the stretch that contains the rear axle."""
    return max(math.floor((s - route.origin_s) / cfg.WINDOW_M), 0)


def make_window(route: DriverRoute, number: int) -> RouteStretch:
    """Create the coordinates from `BEHIND_M` behind a stretch to beyond the reach of a plan from it."""
    stride = round(cfg.REFERENCE_STEP_M / GRID_M)
    reach = cfg.WINDOW_M + float(route.columns["profile"].max()) * cfg.HORIZON_S + 20.0
    begin = number * cfg.WINDOW_M
    first = max(round((begin - cfg.BEHIND_M) / GRID_M), 0)
    last = min(round((begin + reach) / GRID_M), len(route.points))
    points = np.column_stack([route.columns[name][first:last:stride] for name in ("x", "y")])
    system = frenetix.CoordinateSystemWrapper(points)
    # frenetix 0.4.0 adds points of its own before the first one.
    line = np.array(system.ref_line)
    ahead = float(system.ref_pos[int(np.abs(line - points[0]).sum(axis=1).argmin())])
    lengths = np.hypot(*np.diff(points, axis=0).T).astype(np.float64)
    own_s = ahead + np.concatenate([np.zeros(1), np.cumsum(lengths)])
    route_s: FloatArray = route.origin_s + GRID_M * np.arange(first, last, stride, dtype=np.float64)
    return RouteStretch(number, system, route_s, own_s)


@dataclass(frozen=True)
class Ends:
    """The sampled end states, [P] each: duration (s), final speed (m/s) and final offset (m, on the route)."""

    time: FloatArray
    speed: FloatArray
    offset: FloatArray


@dataclass(frozen=True)
class Candidates(Motion):
    """Feasible trajectories; the arrays of `Motion` are [P, T].

    Attributes:
        offset: [P] final offsets, m. cost: [P] cost of jerk and offset, as computed by the library.
        samples: the library's samples, in the same order.
    """

    offset: FloatArray
    cost: FloatArray
    samples: tuple[Any, ...]  # objects of type frenetix.TrajectorySample

    def take(self, which: NDArray[np.int64]) -> Candidates:
        """Return the candidates with these indices, in this order."""
        arrays = {name: getattr(self, name)[which] for name in (*MOTION, "offset", "cost")}
        return Candidates(**arrays, samples=tuple(self.samples[k] for k in which.tolist()))


class Planner:
    """Samples with the library's handler, in the coordinates of the stretch that contains the car.

    Everything runs in this thread: the library's concurrent evaluation is not used.

    Two faults of frenetix 0.4.0 are worked around. The second derivatives of a filled sample (`s_ddot`, `d_ddot`, and
    with them `a` and `kappa`) are half of the second derivatives of the sample's positions; its polynomials are right.
    And its headings jump from pi to -pi, which its check of the yaw rate takes for a turn. Therefore headings are those
    of the route plus the sample's angle to it; accelerations and curvatures are computed from speeds, headings and
    polynomials; and the limits of the car are checked with these values. The library's own check of the curvature is
    kept, because it only rejects bends that are far too sharp. (Its bound of the curvature's rate, a fixed 0.4 1/(m s),
    rejects every path through a bend of 10 m: the lanes' own curvature changes faster.)
    """

    def __init__(self, route: DriverRoute, vehicle: VehicleLimits) -> None:
        self._route, self._vehicle = route, vehicle
        self._handler = frenetix.TrajectoryHandler(dt=cfg.PLAN_STEP_S)
        self._window: RouteStretch | None = None
        steer, wheelbase = vehicle.steer_max_rad, vehicle.wheelbase_m
        grip = pdm_settings.FRICTION_SHARE * vehicle.friction * GRAVITY_MPS2
        self._handler.add_feasability_function(
            feasibility.CheckCurvatureConstraint(deltaMax=steer, wheelbase=wheelbase, wholeTrajectory=True)
        )
        for cost in (
            costs.CalculateLateralJerkCost("lateral jerk", cfg.LATERAL_JERK_WEIGHT),
            costs.CalculateLongitudinalJerkCost("longitudinal jerk", cfg.LONGITUDINAL_JERK_WEIGHT),
            costs.CalculateDistanceToReferencePathCost("offset", cfg.OFFSET_WEIGHT),
        ):
            self._handler.add_cost_function(cost)
        self._sharpest = math.tan(steer) / wheelbase
        self._grip_mps2 = grip * cfg.LATERAL_SHARE
        self._braking_mps2 = min(vehicle.emergency_braking_mps2, grip)

    def begin(self, situation: RoadSituation) -> Frenet:
        """Return the car's state in the route's coordinates; the curvature is that of its wheels.

        Raises `ValueError` if the car is too far off the route for the library's coordinates, `RuntimeError` if it
        heads against the route.
        """
        state, back = situation.observation.ego, self._vehicle.rear_axle_m
        window = self._at(situation.ego.s)
        heading, speed = state.heading_rad, situation.ego.forward
        axle = np.array([state.x - back * math.cos(heading), state.y - back * math.sin(heading)])
        acceleration = state.acceleration_mps2 if speed > pdm_settings.COAST_MPS else 0.0
        own = frenetix.CartesianPlannerState(axle, heading, speed, acceleration, state.steer_rad)
        initial = frenetix.compute_initial_state(window.system, own, self._vehicle.wheelbase_m, False)
        s, s_dot, s_ddot = initial.x0_lon.tolist()
        d, d_dot, d_ddot = initial.x0_lat.tolist()
        return Frenet(float(window.to_route(np.array(s))), s_dot, s_ddot, d, d_dot, d_ddot)

    def sample(self, start: Frenet, heading_rad: float, ends: Ends) -> Candidates:
        """Return the feasible motions from a state with this heading to these end states."""
        window = self._at(start.s)
        slow = start.s_dot < cfg.LOW_SPEED_MPS
        own_s = float(np.interp(start.s, window.route_s, window.own_s))
        matrix = _matrix(start, ends, own_s, self._slow_slope(start, heading_rad) if slow else None)
        handler = self._handler
        handler.reset_Trajectories()
        handler.add_function(FillCoordinates(slow, heading_rad, window.system, cfg.HORIZON_S))
        if len(matrix):
            handler.generate_trajectories(matrix, slow)
            handler.evaluate_all_current_functions(False)
        samples = tuple(t for t in handler.get_sorted_trajectories() if t.feasible)
        candidates = _read_out(samples, window, self._route)
        fits = self._fits(candidates)
        return candidates if fits.all() else candidates.take(np.flatnonzero(fits))

    def _fits(self, candidates: Candidates) -> BoolArray:
        """Return which candidates the car can drive, given its wheels, grip, motor and brakes, [P]."""
        acceleration = np.diff(candidates.speed, axis=1) / cfg.PLAN_STEP_S
        bend = np.abs(candidates.curvature)
        fits = (bend < self._sharpest) & (bend * candidates.speed**2 < self._grip_mps2)
        good = (acceleration > -self._braking_mps2) & (acceleration < self._vehicle.acceleration_mps2)
        return np.asarray(fits.all(axis=1) & good.all(axis=1))

    def plan(self, candidates: Candidates, k: int, begins_s: float) -> Plan:
        """Return a candidate as a plan."""
        d_dot, d_ddot, s_dot, s_ddot = _derivatives(candidates.samples[k])
        speed, motion = candidates.speed[k], {name: getattr(candidates, name)[k] for name in MOTION}
        return Plan(
            begins_s=begins_s,
            **motion,
            acceleration=np.gradient(speed, cfg.PLAN_STEP_S, edge_order=2),
            s_dot=s_dot,
            s_ddot=s_ddot,
            d_dot=d_dot,
            d_ddot=d_ddot,
            offset=float(candidates.offset[k]),
            until_s=begins_s + float(candidates.samples[k].sampling_parameters[1]),
        )

    def _slow_slope(self, start: Frenet, heading_rad: float) -> float:
        """Return d d / d s: from the motion, or from the heading if the car stands."""
        if start.s_dot > cfg.CREEP_MPS:
            return start.d_dot / start.s_dot
        return math.tan(angle_between(heading_rad, float(self._route.columns["heading"][self._route.index(start.s)])))

    def _at(self, s: float) -> RouteStretch:
        number = window_number(self._route, s)
        if self._window is None or self._window.number != number:
            self._window = make_window(self._route, number)
        return self._window


def travel(start: Frenet, time: FloatArray, speed: FloatArray) -> FloatArray:
    """Return the length of the library's quartic to an end speed (with zero final acceleration) in a time, m."""
    return time / 2 * (start.s_dot + speed) + time * time / 12 * start.s_ddot


def stop_time(start: Frenet, length_m: float) -> float | None:
    """Return the duration of the library's quartic that stops after a length, s; None if the car would have to reverse
    for it.
    """
    # length = T v / 2 + T^2 a / 12; the speed stays positive for T <= 3 v / -a.
    v, a = start.s_dot, start.s_ddot
    if length_m <= 0.0 or v <= 0.0:
        return None
    root = v * v / 4 + a * length_m / 3
    if root < 0.0:
        return None
    time = 2 * length_m / (v / 2 + math.sqrt(root))
    return time if a >= 0.0 or time < 3 * v / -a else None


def _matrix(start: Frenet, ends: Ends, own_s: float, slope: float | None) -> FloatArray:
    """Return the library's sampling matrix, [P, 13]: times, initial state, final state.

    With a slope (low-velocity mode) lateral derivatives are over the length along the route, otherwise over time.
    """
    d_dot, d_ddot, v = start.d_dot, start.d_ddot, start.s_dot
    if slope is not None:
        d_dot, d_ddot = slope, (d_ddot - slope * start.s_ddot) / (v * v) if v > cfg.CREEP_MPS else 0.0
    long_enough = travel(start, ends.time, ends.speed) > cfg.LEAST_WAY_M
    matrix = np.zeros((int(long_enough.sum()), 13))
    matrix[:, 1] = ends.time[long_enough]
    matrix[:, 2:5] = own_s, start.s_dot, start.s_ddot
    matrix[:, 5] = ends.speed[long_enough]
    matrix[:, 7:10] = start.d, d_dot, d_ddot
    matrix[:, 10] = ends.offset[long_enough]
    return matrix


def _read_out(samples: tuple[Any, ...], window: RouteStretch, route: DriverRoute) -> Candidates:
    """Return the samples as candidates, cut at the horizon.

    Reading an array takes 2 us, more than computing it, so arrays that follow from others are not read.
    """
    flat: list[Any] = []
    for sample in samples:
        frenet = sample.curvilinear
        flat += (frenet.s, frenet.d, frenet.s_dot, frenet.theta)
    if any(len(row) != FRAMES for row in flat[::READ_OUT]):  # a stop that lasts beyond the horizon
        flat = [row[:FRAMES] for row in flat]
    rows = np.concatenate(flat) if flat else np.zeros(0)
    s, d, s_dot, turned = rows.reshape(len(samples), READ_OUT, FRAMES).transpose(1, 0, 2)
    s = window.to_route(s)
    turned = (turned + np.pi) % (2 * np.pi) - np.pi
    heading = route.between("heading", s) + turned
    speed = s_dot * (1.0 - route.between("curvature", s) * d) / np.cos(turned)
    x, y = place(route, s, d)
    turn = np.gradient(heading, cfg.PLAN_STEP_S, axis=1, edge_order=2)
    curvature = np.where(speed > pdm_settings.COAST_MPS, turn / np.maximum(speed, pdm_settings.COAST_MPS), 0.0)
    ends = np.array([t.sampling_parameters[10] for t in samples], dtype=float)
    cost = np.array([t.cost for t in samples], dtype=float)
    return Candidates(s, d, x, y, heading, speed, curvature, ends, cost, samples)


def _derivatives(sample: Any) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:  # noqa: ANN401  see `RouteStretch.system`
    """Return d' and d'', s' and s'' over time, from the library's polynomials; the docstring of `Planner`
    explains why.
    """
    along, across, ends_s = sample.trajectory_long, sample.trajectory_lat, float(sample.sampling_parameters[1])
    t = np.minimum(TIMES_S, ends_s)
    v = np.array([along(x, 1.0) for x in t.tolist()])
    a = np.array([along(x, 2.0) for x in t.tolist()])
    slow = float(sample.sampling_parameters[3]) < cfg.LOW_SPEED_MPS
    at = np.array([along(x, 0.0) for x in t.tolist()]) - float(sample.sampling_parameters[2]) if slow else t
    first = np.array([across(x, 1.0) for x in at.tolist()])
    second = np.array([across(x, 2.0) for x in at.tolist()])
    return (first * v, second * v * v + first * a, v, a) if slow else (first, second, v, a)


def ends(situation: RoadSituation, behaviour: Behaviour, start: Frenet, last: Plan | None) -> Ends:
    """Return each offset with each speed and each duration, the stops, and the end of the last plan.

    Without the end of the last plan a manoeuvre would never end, because all other samples end at least `END_TIMES_S`
    from now.
    """
    offsets = behaviour.offsets
    if np.abs(offsets - start.d).min() > APART_M:
        offsets = np.append(offsets, round(start.d, 2))
    route, s = situation.route, situation.ego.s
    first, last_point = route.index(s), route.index(s + situation.ego.forward * cfg.HORIZON_S + 10.0)
    top = float(route.columns["profile"][first : last_point + 1].max())
    gain = cfg.RISE * min(situation.vehicle.acceleration_mps2, cfg.ACCELERATION_MPS2)
    pairs = [
        (time, speed)
        for time in cfg.END_TIMES_S
        for speed in _speeds(situation, start, min(top, start.s_dot + gain * time))
    ]
    pairs += [(time, cfg.STOP_SPEED_MPS) for time in _stops(situation, behaviour, start)]
    left_s = 0.0 if last is None or last.emergency else last.until_s - situation.observation.time_s
    if last is not None and left_s > LEAST_S:
        pairs.append((left_s, max(float(last.s_dot[-1]), cfg.STOP_SPEED_MPS)))
    time, speed = np.array(pairs).T
    count = len(offsets)
    return Ends(np.repeat(time, count), np.repeat(speed, count), np.tile(offsets, len(pairs)))


def _speeds(situation: RoadSituation, start: Frenet, most: float) -> list[float]:
    """Return the end speeds: shares of the highest, the current speed, the route's speed here, and a stop."""
    here = float(situation.route.between("profile", start.s))
    speeds = [most * share for share in cfg.SPEED_SHARES]
    speeds += [min(start.s_dot, most), min(here, most), cfg.STOP_SPEED_MPS]
    return list(dict.fromkeys(round(max(speed, cfg.STOP_SPEED_MPS), 2) for speed in speeds))


def _stops(situation: RoadSituation, behaviour: Behaviour, start: Frenet) -> list[float]:
    """Return the durations of stops: exactly at the stop place, and directly behind standing actors ahead."""
    front_s = start.s + situation.vehicle.wheelbase_m + situation.vehicle.front_overhang_m
    places = [] if behaviour.stop_s is None else [behaviour.stop_s]
    leaders = behaviour.leaders[:, 0]
    standing = leaders["s"][leaders["speed"] < pdm_settings.SENSED_STANDS_MPS]
    places += [float(s) - cfg.MINIMUM_GAP_M for s in np.unique(standing) if s < FAR_M]
    reach = float(situation.route.columns["profile"].max()) * cfg.HORIZON_S
    times = [stop_time(start, place - front_s) for place in places if place - front_s < reach]
    durations = [time for time in times if time is not None and time < cfg.LONGEST_STOP_S]
    return durations if start.s_dot > pdm_settings.COAST_MPS else []
