"""Going on after a long stand: what stood in a network's training mostly went on standing."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from foresee_dsl.drivers.learned import settings as cfg
from foresee_dsl.drivers.protocol import EgoState, FloatArray, Mission


class Creeping:
    """Decides when the ego creeps: it remembers since when the ego stands, and until when it creeps."""

    def __init__(self) -> None:
        self._stands_since_s: float | None = None
        self._until_s = -math.inf

    def begins_or_goes_on(self, now_s: float, speed_mps: float, *, held: bool) -> bool:
        """Return whether the ego is to creep at a time; `held`: by a stop line that binds. To be asked in each
        decision, with times that rise."""
        if held:
            self._until_s = -math.inf
        elif now_s < self._until_s:
            return True
        if held or speed_mps >= cfg.STANDS_MPS:
            self._stands_since_s = None
            return False
        if self._stands_since_s is None:
            self._stands_since_s = now_s
        if now_s - self._stands_since_s < cfg.CREEPS_AFTER_S:
            return False
        self._stands_since_s, self._until_s = None, now_s + cfg.CREEPS_FOR_S
        return True


def along_the_route(mission: Mission, at_s: float, ego: EgoState, times_s: Sequence[float]) -> FloatArray:
    """Return waypoints along the route at the speed of creeping, [N, 2] m ahead of the ego and to its left.

    Args:
        mission: has the route. at_s: how far along it the ego is, m.
        ego: where it is. times_s: of the waypoints, from now.
    """
    s = at_s + cfg.CREEPS_MPS * np.array(times_s)
    dx = np.interp(s, mission.s, mission.centreline[:, 0]) - ego.x
    dy = np.interp(s, mission.s, mission.centreline[:, 1]) - ego.y
    cos, sin = math.cos(ego.heading_rad), math.sin(ego.heading_rad)
    return np.column_stack([dx * cos + dy * sin, dy * cos - dx * sin])
