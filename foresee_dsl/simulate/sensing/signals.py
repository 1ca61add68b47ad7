"""Which signals the driver sees: each has a head before the junction and one behind it; one in view is enough.

SUMO's signals have no place. Here the near head stands right of the stop line as high as a van, the far one hangs over
the road straight on, behind the junction: what the ego sees when it waits at the line. A lorry in front may hide both.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from foresee_dsl.drivers.protocol import Mission
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.simulate.mission import signal_heads
from foresee_dsl.simulate.sensing.settings import SensorSettings
from foresee_dsl.simulate.sensing.sight import Sight

Pose = tuple[float, float, float]


class SignalHeads:
    """The signals on the ego's way."""

    def __init__(self, mission: Mission, settings: SensorSettings) -> None:
        """Put the heads where they are."""
        self._least_cos = math.cos(min(settings.signal_view_rad / 2, math.pi))
        passages = [passage for passage in mission.junctions if passage.signal is not None]
        self._signals = [passage.signal or "" for passage in passages for _ in range(2)]
        self._places = np.array([signal_heads(mission, passage.stop_s) for passage in passages]).reshape(-1, 3)
        exits_s = [passage.exit_s for passage in passages for _ in range(2)]
        self._heads = [
            (k, x, y, s) for k, ((x, y, _), s) in enumerate(zip(self._places.tolist(), exits_s, strict=True))
        ]

    def near(self, ego: Pose, s: float, range_m: float) -> list[int]:
        """Return the heads in range and ahead that the ego (x, y, heading, `s` along the mission's line) has not left
        behind."""
        x, y, heading = ego
        cos, sin = math.cos(heading), math.sin(heading)
        near = []
        for k, head_x, head_y, exit_s in self._heads:
            dx, dy = head_x - x, head_y - y
            gap = math.hypot(dx, dy)
            if gap <= range_m and exit_s > s and dx * cos + dy * sin >= gap * self._least_cos:
                near.append(k)
        return near

    def signals(self, heads: Iterable[int]) -> tuple[str, ...]:
        """Return the keys of the signals that have these heads, each once."""
        return tuple(dict.fromkeys([self._signals[k] for k in heads]))

    def in_view(self, heads: list[int], sight: Sight, ego: Pose, poses: FloatArray) -> tuple[str, ...]:
        """Return the keys of the signals of which nothing hides one of these heads, which are near and in their order.

        `ego`: x, y, heading. `poses`: [N, >=3] of the others.
        """
        if not heads:
            return ()
        first, last = heads[0], heads[-1]  # in one piece, mostly; the few between them that are not near cost little
        clear = sight.clear(ego[0], ego[1], poses, self._places[first : last + 1]).tolist()
        return self.signals([k for k in heads if clear[k - first]])
