"""Which signals the driver sees: each has a head before the junction and one behind it; one in view is enough.

SUMO's signals have no place. Here the near head stands right of the stop line as high as a van, the far one hangs over
the road straight on, behind the junction: what the ego sees when it waits at the line. A lorry in front may hide both.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.drivers.protocol import Mission
from foresee_dsl.simulate.sensing.settings import SensorSettings
from foresee_dsl.simulate.sensing.sight import Sight

FloatArray = NDArray[np.float64]

NEAR_AHEAD_M, NEAR_RIGHT_M, NEAR_HEIGHT_M = 2.0, 3.0, 2.6
"""The near head from where the ego's lane meets the stop line. Ours: behind the line, at the kerb of a lane of 3.3 m;
2.1 m is the usual least height over a pavement."""
FAR_AHEAD_M, FAR_HEIGHT_M = 20.0, 5.0
"""The far head. Ours: across a junction of two lanes a direction with its crossings; 4.5 m is the usual least height
over a road."""


class SignalHeads:
    """The signals on the ego's way."""

    def __init__(self, mission: Mission, settings: SensorSettings) -> None:
        """Put the heads where they are."""
        self._least_cos = math.cos(min(settings.signal_view_rad / 2, math.pi))
        passages = [passage for passage in mission.junctions if passage.signal is not None]
        self._signals = [passage.signal or "" for passage in passages for _ in range(2)]
        self._places = np.array([_heads(mission, passage.stop_s) for passage in passages]).reshape(-1, 2)
        self._heights = np.tile((NEAR_HEIGHT_M, FAR_HEIGHT_M), len(passages))
        self._exits_s = np.repeat(np.array([passage.exit_s for passage in passages], dtype=np.float64), 2)

    def in_view(self, sight: Sight, ego: tuple[float, float, float], s: float, poses: FloatArray) -> tuple[str, ...]:
        """Return the keys of the signals in range and view that the ego has not left behind.

        Args:
            sight: lines of sight. ego: x, y, heading. s: its length along the mission's line.
            poses: [N, >=3] of the others.
        """
        if not self._signals:
            return ()
        x, y, heading = ego
        offsets = self._places - (x, y)
        gaps = np.hypot(offsets[:, 0], offsets[:, 1])
        forward = offsets[:, 0] * math.cos(heading) + offsets[:, 1] * math.sin(heading)
        near = np.flatnonzero(
            (gaps <= sight.signal_range_m) & (forward >= gaps * self._least_cos) & (self._exits_s > s)
        )
        if not len(near):
            return ()
        clear = near[sight.clear(x, y, poses, self._places[near], self._heights[near])]
        return tuple(dict.fromkeys(self._signals[k] for k in clear.tolist()))


def _heads(mission: Mission, stop_s: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the places of the near and the far head."""
    s = np.array((stop_s - 1.0, stop_s))
    (x0, x), (y0, y) = (np.interp(s, mission.s, mission.centreline[:, k]).tolist() for k in (0, 1))
    heading = math.atan2(y - y0, x - x0)
    cos, sin = math.cos(heading), math.sin(heading)
    near = (x + NEAR_AHEAD_M * cos + NEAR_RIGHT_M * sin, y + NEAR_AHEAD_M * sin - NEAR_RIGHT_M * cos)
    return near, (x + FAR_AHEAD_M * cos, y + FAR_AHEAD_M * sin)
