"""Plans: the trajectory over time that is driven; and plans without the library, which stop the car along a path."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import NamedTuple

import numpy as np

from foresee_dsl.drivers.pdm.route import DriverRoute
from foresee_dsl.drivers.protocol import FloatArray
from foresee_frenetix import settings as cfg

TIMES_S = np.arange(round(cfg.HORIZON_S / cfg.PLAN_STEP_S) + 1) * cfg.PLAN_STEP_S
"""Times of the frames of every plan, [T] s."""


class Frenet(NamedTuple):
    """A state along and across the route at one moment: m, m/s, m/s^2; the lateral derivatives are over time."""

    s: float
    s_dot: float
    s_ddot: float
    d: float
    d_dot: float
    d_ddot: float


class Pose(NamedTuple):
    """The planned state of the rear axle's middle at one moment."""

    x: float
    y: float
    heading: float
    speed: float
    acceleration: float
    curvature: float


@dataclass(frozen=True)
class Motion:
    """Motions of the rear axle's middle at the frames of a plan; the last axis of each array is [T].

    Attributes:
        s, d: on the route, m. x, y: m. heading: rad. speed: m/s. curvature: 1/m.
    """

    s: FloatArray
    d: FloatArray
    x: FloatArray
    y: FloatArray
    heading: FloatArray
    speed: FloatArray
    curvature: FloatArray


MOTION = tuple(f.name for f in fields(Motion))


@dataclass(frozen=True)
class Plan(Motion):
    """The motion from `begins_s` on; arrays are [T].

    Attributes:
        acceleration: m/s^2. s_dot, s_ddot, d_dot, d_ddot: derivatives over time, with which the next plan begins.
        offset: its final offset from the middle of the lane, m. until_s: time at which it reaches that offset, s.
        emergency: whether it is an emergency stop without the library.
    """

    begins_s: float
    acceleration: FloatArray
    s_dot: FloatArray
    s_ddot: FloatArray
    d_dot: FloatArray
    d_ddot: FloatArray
    offset: float
    until_s: float
    emergency: bool = False

    def frenet(self, time_s: float) -> Frenet:
        """Return the state along and across the route at a time."""
        k, w = self._frame(time_s)
        return Frenet(*(_mix(getattr(self, name), k, w) for name in Frenet._fields))

    def pose(self, time_s: float) -> Pose:
        """Return the planned pose of the rear axle at a time."""
        k, w = self._frame(time_s)
        return Pose(*(_mix(getattr(self, name), k, w) for name in Pose._fields))

    def from_now(self, time_s: float) -> Plan:
        """Return the rest of the plan from a time on, with its last frame repeated up to the horizon."""
        at = np.minimum(TIMES_S + time_s - self.begins_s, TIMES_S[-1])
        left = {name: np.interp(at, TIMES_S, row) for name, row in vars(self).items() if isinstance(row, np.ndarray)}
        return replace(self, begins_s=time_s, **left)

    def _frame(self, time_s: float) -> tuple[int, float]:
        place = min(max((time_s - self.begins_s) / cfg.PLAN_STEP_S, 0.0), len(self.s) - 1.0)
        k = min(int(place), len(self.s) - 2)
        return k, place - k


def braking_plan(
    route: DriverRoute, begins_s: float, start: Frenet, braking_mps2: float, last: Plan | None, *, emergency: bool
) -> Plan:
    """Return a plan that stops with constant braking.

    It follows the path of the last plan or, without one, turns parallel to the lane.
    """
    until = start.s_dot / braking_mps2
    t = np.minimum(TIMES_S, until)
    s_dot = start.s_dot - braking_mps2 * t
    travelled = start.s_dot * t - braking_mps2 / 2 * t * t
    s = start.s + travelled
    slope = start.d_dot / start.s_dot if start.s_dot > cfg.CREEP_MPS / 10 else 0.0
    if last is None or last.s[-1] - last.s[0] < cfg.LEAST_WAY_M:
        d = start.d + slope * cfg.FADE_M * (1.0 - np.exp(-travelled / cfg.FADE_M))
        tilt = slope * np.exp(-travelled / cfg.FADE_M)
        bend = -tilt / cfg.FADE_M
    else:
        # The plan keeps the car's current lateral distance from the last plan.
        d = np.interp(s, last.s, last.d) + start.d - float(np.interp(start.s, last.s, last.d))
        tilt = np.interp(s, last.s, last.d_dot / np.maximum(last.s_dot, 0.1))
        bend = np.interp(s, last.s, last.curvature) - route.between("curvature", s)
    k = route.indices(s)
    x, y = place(route, s, d)
    moving = (until > TIMES_S).astype(float)
    return Plan(
        begins_s=begins_s,
        s=s,
        d=d,
        x=x,
        y=y,
        heading=route.columns["heading"][k] + np.arctan(tilt),
        speed=s_dot,
        acceleration=-braking_mps2 * moving,
        curvature=route.between("curvature", s) + bend,
        s_dot=s_dot,
        s_ddot=-braking_mps2 * moving,
        d_dot=tilt * s_dot,
        d_ddot=np.zeros_like(s),
        offset=float(d[-1]),
        until_s=begins_s + until,
        emergency=emergency,
    )


def place(route: DriverRoute, s: FloatArray, d: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return x and y (m) of points in the route's coordinates (any shape)."""
    k = route.indices(s)
    s0, x, y, cos, sin = (route.columns[name][k] for name in ("s", "x", "y", "cos", "sin"))
    part = s - s0
    return x + part * cos - d * sin, y + part * sin + d * cos


def angle_between(a: float, b: float) -> float:
    """Return a - b, wrapped to [-pi, pi), rad."""
    return (a - b + math.pi) % (2 * math.pi) - math.pi


def _mix(row: FloatArray, k: int, w: float) -> float:
    return float(row[k]) * (1.0 - w) + float(row[k + 1]) * w
