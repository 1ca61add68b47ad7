"""The Intelligent Driver Model (Treiber, Hennecke, Helbing 2000, Physical Review E 62, equations 2 and 3).

Constants: Treiber and Kesting 2013, Traffic Flow Dynamics, table 11.2, city traffic, cited from memory and not checked.
(Table I of the paper of 2000, from memory too, is for motorways: 0.73 m/s^2 take half a minute to 50 km/h.)
"""

from __future__ import annotations

import math

TIME_GAP_S = 1.0
MINIMUM_GAP_M = 2.0
ACCELERATION_MPS2 = 1.0
BRAKING_MPS2 = 1.5
EXPONENT = 4
LEAST_GAP_M = 0.1
"""Ours: nearer than this counts as this, so that nothing is divided by zero."""


def free_acceleration(speed_mps: float, desired_mps: float) -> float:
    """Return the acceleration on a free road, m/s^2: a (1 - (v / v0)^4)."""
    return ACCELERATION_MPS2 * (1.0 - (speed_mps / desired_mps) ** EXPONENT)


def desired_gap(speed_mps: float, closing_mps: float) -> float:
    """Return the gap that is wished for, m: s0 + max(0, v T + v dv / (2 sqrt(a b))).

    Args:
        speed_mps: the own speed. closing_mps: by how much it is faster than who drives in front.
    """
    dynamic = speed_mps * (TIME_GAP_S + closing_mps / (2.0 * math.sqrt(ACCELERATION_MPS2 * BRAKING_MPS2)))
    return MINIMUM_GAP_M + max(0.0, dynamic)


def acceleration(speed_mps: float, desired_mps: float, gap_m: float, leader_mps: float) -> float:
    """Return the IDM's acceleration, m/s^2: a (1 - (v / v0)^4 - (s* / s)^2); not bounded below.

    Args:
        speed_mps: own speed. desired_mps: v0, above 0.
        gap_m: bumper to bumper; infinite where nobody is in front.
        leader_mps: the speed of who is in front, along the lane.
    """
    wish = desired_gap(speed_mps, speed_mps - leader_mps) / max(gap_m, LEAST_GAP_M)
    return free_acceleration(speed_mps, desired_mps) - ACCELERATION_MPS2 * wish * wish
