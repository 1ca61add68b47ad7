"""Conversions between our states and nuPlan's, without nuplan-devkit.

Both have x east, y north, and headings counter-clockwise from east. Ours is the centre of the footprint, nuPlan's the
middle of the rear axle; nuPlan counts time in whole microseconds.
"""

from __future__ import annotations

import math

import numpy as np

from foresee_dsl.drivers.protocol import FloatArray, VehicleLimits

START_S = 100.0
"""Time of nuPlan's clock at our time 0, s: its times must not be negative, and the history begins before 0. Ours."""


def rear_axle(x: float, y: float, heading_rad: float, vehicle: VehicleLimits) -> tuple[float, float]:
    """Return the middle of the rear axle of a vehicle whose centre is given."""
    behind_m = vehicle.rear_axle_m
    return x - behind_m * math.cos(heading_rad), y - behind_m * math.sin(heading_rad)


def centres(axles: FloatArray, heading_rad: FloatArray, vehicle: VehicleLimits) -> FloatArray:
    """Return the centres, [N, 2], of rear axles, [N, 2]."""
    ahead = np.column_stack((np.cos(heading_rad), np.sin(heading_rad)))
    return np.asarray(axles + vehicle.rear_axle_m * ahead, dtype=np.float64)


def time_us(time_s: float) -> int:
    """Return nuPlan's time of one of ours, microseconds."""
    return round((time_s + START_S) * 1e6)


def time_s(time_us: FloatArray) -> FloatArray:
    """Return our times of nuPlan's, s."""
    return np.asarray(time_us / 1e6 - START_S, dtype=np.float64)
