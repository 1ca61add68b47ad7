"""The outputs of the networks: their names, shapes and units in the ONNX files.

Both networks take `INPUTS` (`learned.inputs`, each with a first axis of 1). Places are in the ego's frame: metres ahead
of its centre and to its left.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Outputs = NDArray[np.float32]

INPUTS = ("birds_eye", "forward", "vector")
"""Names of the inputs; their types and shapes are uint8 [1, 20, 128, 128], uint8 [1, 13, 64, 160] and float32
[1, 10]."""

FUSION_OUTPUTS = ("waypoints", "target_speed")
FUSION_TIMES_S = tuple(0.25 * k for k in range(1, 9))
"""Times from now, s, of the output `waypoints` [1, 8, 2] of `fusion`: where the ego should be, metres ahead and to the
left."""
SPEED_BINS_MPS = (0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.5, 8.0, 10.0, 12.0, 14.0, 17.0, 20.0, 25.0)
"""Speeds to which the output `target_speed` [1, 14] of `fusion` gives probabilities, m/s; the probabilities sum up to
1."""
TARGET_SPEED_S = 1.0
"""Time from now at which the ego should have the target speed, s. The required mean acceleration is the target speed
minus the present one, divided by this."""

FUSION_SAFE_OUTPUTS = ("waypoints", "density", "stop_line", "signal")
FUSION_SAFE_TIMES_S = tuple(0.3 * k for k in range(1, 11))
"""Times from now, s, of the output `waypoints` [1, 10, 2] of `fusion_safe`; the waypoints are as in
`FUSION_TIMES_S`."""
DENSITY_ROWS = 24
DENSITY_CELL_M = 2.0
DENSITY_AHEAD_M, DENSITY_SIDE_M = 40.0, 24.0
"""Reach of the output `density` [1, 8, 24, 24] of `fusion_safe`, m. Its squares are 2 m large; row 0 reaches to 40 m
ahead, the last row to 8 m behind; column 0 reaches to 24 m on the left. InterFuser has 20 by 20 squares of 1 m; ours
reach as far as braking from 50 km/h takes."""
DENSITY_CHANNELS = (
    *("occupied", "ahead_m", "left_m", "length_m", "width_m", "heading_cos", "heading_sin", "speed_mps"),
)
"""Channels of `density`. occupied: probability that the middle of a road user is in the square; ahead_m, left_m: that
middle relative to the square's middle; the heading is relative to the ego's; speed_mps: speed over ground."""
STOP_LINE_M = 30.0
"""The output `stop_line` [1, 1] is the probability that the ego must stop for a stop line at most this far ahead, m."""
SIGNALS = ("red", "amber", "green", "other")
"""States of the route's next signal; the output `signal` [1, 4] has the probability of each. `other`: the signal is off
or not seen, or there is no signal."""


@dataclass(frozen=True, slots=True)
class Occupied:
    """A road user in a density map, in the ego's frame; the heading is relative to the ego's."""

    probability: float
    ahead_m: float
    left_m: float
    length_m: float
    width_m: float
    heading_rad: float
    speed_mps: float


def square_middle(row: int, column: int) -> tuple[float, float]:
    """Return the middle of a square of the density map: metres ahead, metres left."""
    return DENSITY_AHEAD_M - (row + 0.5) * DENSITY_CELL_M, DENSITY_SIDE_M - (column + 0.5) * DENSITY_CELL_M


def target_speed(probabilities: Outputs) -> float:
    """Return the mean of the target speed, m/s. `probabilities`: [1, 14], those of `SPEED_BINS_MPS`."""
    return float(np.asarray(probabilities, np.float64).reshape(-1) @ np.array(SPEED_BINS_MPS))


def road_users(density: Outputs, least_probability: float = 0.5) -> Iterator[Occupied]:
    """Yield the road users of a density map [1, 8, 24, 24].

    A square contains a road user if it is occupied with at least this probability, and with a higher probability than
    its eight neighbours.
    """
    occupied = density[0, 0]
    columns = occupied.shape[1]
    for square in np.flatnonzero(occupied >= least_probability).tolist():
        row, column = divmod(square, columns)
        around = occupied[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2]
        if occupied[row, column] < around.max():
            continue
        probability, ahead, left, length, width, c, s, speed = density[0, :, row, column].tolist()
        ahead_m, left_m = square_middle(row, column)
        yield Occupied(
            probability=probability,
            ahead_m=ahead_m + ahead,
            left_m=left_m + left,
            length_m=length,
            width_m=width,
            heading_rad=math.atan2(s, c),
            speed_mps=speed,
        )
