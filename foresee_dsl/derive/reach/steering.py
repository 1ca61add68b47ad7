"""Rolls many steering offsets out at once, with the bicycle model of `kernels.bicycle` at the recorded speed.

`operators.steer.Steer.rolled_out` turns the recorded steps, which is enough to compare the draws of one child. It
ignores the turning rate of the wheels and the limit of the tyres. Ours: with it, four moments of a test case reach 24
of 52 findings of the exhaustive search, with this module 37 (docs/background/rankers.md)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.compile.placement.scene import DRY_FRICTION
from foresee_dsl.derive.operators.steer import RECOVERS_S
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.simulate.actors.dynamics import lateral_limit_mps2
from foresee_dsl.simulate.trace import HEADING, SPEED, YAW_RATE, Trace, X, Y

_CRAWLS_MPS = 0.5
"""Speed below which the recorded yaw rate does not give the curvature, m/s; the wheels are then assumed straight.
Ours."""
_TIGHTEST_PER_M = 0.3
"""Largest curvature that is read from a recorded yaw rate. Ours: a car's turning circle has a radius of 5.5 m."""


class _Limits(NamedTuple):
    """Limits of the vehicles, [P, 1] each: m, rad, rad/s, m, m/s^2. `rear_axle`: its distance behind the middle."""

    wheelbase: FloatArray
    steer: FloatArray
    rate: FloatArray
    rear_axle: FloatArray
    lateral: FloatArray

    @classmethod
    def of(cls, specs: list[ModelSpec]) -> _Limits:
        rows = [
            (s.wheelbase_m, s.max_steer_rad, s.steer_rate_rad_s, s.wheelbase_m + s.front_overhang_m - s.length_m / 2,
             lateral_limit_mps2(s.name, DRY_FRICTION))
            for s in specs
        ]  # fmt: skip
        return cls(*np.array(rows).T[:, :, None])


def steered(
    trace: Trace,
    models: Mapping[str, ModelSpec],
    onsets: tuple[FloatArray, FloatArray],
    shares: FloatArray,
    hold_s: float | None,
    step_s: float,
) -> FloatArray:
    """Return the poses of vehicles whose wheels get an offset, [P, N, T, 3] (m, m, rad).

    Args:
        trace: the recorded run. models: all models, by name.
        onsets: the vehicles' columns, [P], and the frames, [P, T], of which the first is the onset.
        shares: [P, N] offsets, as shares of the largest steering angle.
        hold_s: how long the offset acts; None: to the end. Afterwards the vehicle returns to its recorded heading.
        step_s: time between frames.
    """
    actors, frames = onsets
    states = trace.states[frames, actors[:, None]]
    limits = _Limits.of([models[trace.actors[k].model] for k in actors])
    speeds, yaw = np.nan_to_num(states[..., SPEED]), np.nan_to_num(states[..., YAW_RATE])
    bends = np.where(speeds > _CRAWLS_MPS, yaw / np.maximum(speeds, _CRAWLS_MPS), 0.0)
    bends = np.clip(bends, -_TIGHTEST_PER_M, _TIGHTEST_PER_M)
    heading = np.repeat(states[:, :1, HEADING], shares.shape[1], axis=1)
    x = states[:, :1, X] - limits.rear_axle * np.cos(heading)
    y = states[:, :1, Y] - limits.rear_axle * np.sin(heading)
    wheels = np.repeat(np.arctan(bends[:, :1] * limits.wheelbase), shares.shape[1], axis=1)
    recorded = np.unwrap(np.nan_to_num(states[..., HEADING]), axis=1)
    strayed = np.zeros_like(heading)
    poses = np.empty((*shares.shape, frames.shape[1], 3))
    for k in range(frames.shape[1]):
        poses[:, :, k, 0] = x + limits.rear_axle * np.cos(heading)
        poses[:, :, k, 1] = y + limits.rear_axle * np.sin(heading)
        poses[:, :, k, 2] = heading
        if k + 1 == frames.shape[1]:
            break
        squared = np.maximum(speeds[:, k : k + 1], _CRAWLS_MPS) ** 2
        way = (speeds[:, k : k + 1] + speeds[:, k + 1 : k + 2]) / 2 * step_s
        if hold_s is None or k * step_s < hold_s - 1e-9:
            most = np.minimum(limits.steer, np.arctan(limits.lateral * limits.wheelbase / squared))
            wanted = np.arctan(bends[:, k : k + 1] * limits.wheelbase) + shares * limits.steer
            wanted = np.clip(wanted, -most, most)
            wheels = wheels + np.clip(wanted - wheels, -limits.rate * step_s, limits.rate * step_s)
            curvature = np.tan(wheels) / limits.wheelbase
            held = limits.lateral / squared
            turn = way * np.clip(curvature, -held, held)
            strayed = heading + turn - recorded[:, k + 1 : k + 2]
        else:
            strayed = strayed * np.exp(-step_s / RECOVERS_S)
            turn = recorded[:, k + 1 : k + 2] + strayed - heading
        x = x + way * np.cos(heading + turn / 2)
        y = y + way * np.sin(heading + turn / 2)
        heading = heading + turn
    return poses
