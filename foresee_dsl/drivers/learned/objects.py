"""The road users of the density map, remembered for a moment: the network loses one for a frame now and then."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from foresee_dsl.drivers.learned import settings as cfg
from foresee_dsl.drivers.learned.outputs import Occupied
from foresee_dsl.drivers.protocol import EgoState


class _Known(NamedTuple):
    """An object where it was last seen: x, y (m) and heading (rad) in the world, and when."""

    x: float
    y: float
    heading_rad: float
    time_s: float
    was: Occupied


class Objects:
    """Adds to what is seen now what was seen a moment ago, moved on by its speed."""

    def __init__(self) -> None:
        self._known: list[_Known] = []

    def update(self, seen: Sequence[Occupied], ego: EgoState, time_s: float) -> list[Occupied]:
        """Return the objects that are seen now, with plausible sizes, and those that were seen a moment ago."""
        found = [
            replace(one, length_m=max(one.length_m, cfg.LEAST_M), width_m=max(one.width_m, cfg.LEAST_M)) for one in seen
        ]
        kept: list[_Known] = []
        for known in self._known:
            again = _moved(known, ego, time_s)
            seen_again = any(_apart_m(one, again) < cfg.SAME_OBJECT_M for one in found)
            if not seen_again and time_s - known.time_s <= cfg.OBJECT_KEPT_S:
                kept.append(known)
        remembered = [_moved(known, ego, time_s) for known in kept]
        self._known = kept + [_in_world(one, ego, time_s) for one in found if one.probability >= cfg.SURE]
        return found + remembered


def _in_world(one: Occupied, ego: EgoState, time_s: float) -> _Known:
    cos, sin = math.cos(ego.heading_rad), math.sin(ego.heading_rad)
    x, y = ego.x + cos * one.ahead_m - sin * one.left_m, ego.y + sin * one.ahead_m + cos * one.left_m
    return _Known(x, y, one.heading_rad + ego.heading_rad, time_s, one)


def _apart_m(one: Occupied, other: Occupied) -> float:
    return math.hypot(one.ahead_m - other.ahead_m, one.left_m - other.left_m)


def _moved(known: _Known, ego: EgoState, time_s: float) -> Occupied:
    """Return an object in the ego's present frame, where it has come since it was seen."""
    way = known.was.speed_mps * (time_s - known.time_s)
    dx = known.x + way * math.cos(known.heading_rad) - ego.x
    dy = known.y + way * math.sin(known.heading_rad) - ego.y
    cos, sin = math.cos(ego.heading_rad), math.sin(ego.heading_rad)
    return replace(
        known.was,
        ahead_m=dx * cos + dy * sin,
        left_m=dy * cos - dx * sin,
        heading_rad=known.heading_rad - ego.heading_rad,
    )
