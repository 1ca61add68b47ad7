"""The behaviour layer: a named state, where to stop, whom to follow, and beside the lane's middle by how much.

It says what the planner shall try; the planner says how. Signals, right of way and queues are judged by the functions
of `pdm`, people on foot also by those of `idm`.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.drivers.frenetix import settings as cfg
from foresee_dsl.drivers.frenetix.plan import TIMES_S
from foresee_dsl.drivers.idm.traffic import read_others, walkers
from foresee_dsl.drivers.pdm import settings as pdm_settings
from foresee_dsl.drivers.pdm.prediction import TIMES_S as PREDICTED_S
from foresee_dsl.drivers.pdm.reading import FoeMatches, Prediction, Situation
from foresee_dsl.drivers.pdm.situation import BoolArray
from foresee_dsl.drivers.pdm.steps import leaders, offsets, passable, wall
from foresee_dsl.drivers.protocol import FloatArray

STRIDE = round(TIMES_S[1] / PREDICTED_S[1])
"""A plan's frame is every so many frames of a prediction."""
AT_LINE_M = 2.0
"""Ours: a stop this near to a stop line is for the signal (or the queue behind it), any other gives way."""
FOLLOWS_S = 6.0
"""Ours: whoever is reached later than this at the present speed is not followed yet."""
WALKER_AIR_M = 1.5
"""Ours: it stops this far before somebody on foot, half more than a car keeps from a conflict."""
WALKER_BRAKING_MPS2 = 1.0
"""Ours: it gives way to somebody on foot once that takes this much braking: until then it is mostly sensor noise that
turns people on the pavement towards the road."""
WALKER_TIMES = 3
WALKER_URGENT_MPS2 = 3.0
"""Ours: and once three plans in a row (0.3 s) say so, or this much is needed. One plan in four did for somebody
who only walked along the pavement."""
BESIDE_M = 0.3
"""Ours: air on either side within which somebody who is not aligned with the road counts as standing in the way."""


class State(StrEnum):
    """What the car is about."""

    CRUISE = "cruise"
    FOLLOW = "follow"
    YIELD = "yield"
    STOP = "stop"


@dataclass(frozen=True)
class Behaviour:
    """What the planner is asked for.

    Attributes:
        state: its name. stop_s: the length along the route that the front bumper may not pass; None: the way is free.
        offsets: [O] m, the lateral offsets to try, the middle of the lane first.
        lead_s, lead_speed: [O, T] m and m/s, the rear of who is in front on each of them (far away: nobody).
    """

    state: State
    stop_s: float | None
    offsets: FloatArray
    lead_s: FloatArray
    lead_speed: FloatArray


class Patience:
    """Gives way to people on foot once it is sure that they want to cross: with noisy headings some only seem to."""

    def __init__(self) -> None:
        self._times = 0

    def walker(self, situation: Situation) -> float | None:
        """Return where it stops for somebody on foot, m along the route; call it once a plan."""
        gap = walkers(situation, read_others(situation))
        if gap is None:
            self._times = 0
            return None
        room = max(gap - WALKER_AIR_M, 0.0)
        needed = situation.pose.speed**2 / (2 * max(room, 0.1))
        self._times += 1
        sure = self._times >= WALKER_TIMES or needed > WALKER_URGENT_MPS2
        if situation.pose.speed > pdm_settings.COAST_MPS and not (sure and needed > WALKER_BRAKING_MPS2):
            return None
        return situation.ego.front_s + room


def decide(situation: Situation, matches: FoeMatches, prediction: Prediction, patience: Patience) -> Behaviour:
    """Return what to do now.

    Args:
        situation: what is seen. matches: who is on which foe's path, of the junctions that are near.
        prediction: where the others will be, at `pdm`'s frames. patience: what lasts from plan to plan.
    """
    can_pass = passable(situation)
    tried = offsets(situation, can_pass)
    ahead = np.flatnonzero(_is_ahead(situation))
    lead_s, lead_speed = leaders(situation, _some(prediction, ahead), tried, can_pass[ahead])
    lead_s, lead_speed = lead_s[:, ::STRIDE], lead_speed[:, ::STRIDE]
    stop_s = wall(situation, matches, can_pass)
    state = State.CRUISE
    walker_s = patience.walker(situation)
    if walker_s is not None:
        stop_s = walker_s if stop_s is None else min(stop_s, walker_s)
    if stop_s is not None:
        lines = [j.stop_s for j in situation.route.junctions]
        state = State.STOP if any(abs(stop_s - line) < AT_LINE_M for line in lines) else State.YIELD
    elif lead_s[0, 0] - situation.ego.front_s < cfg.MINIMUM_GAP_M + FOLLOWS_S * situation.pose.speed:
        state = State.FOLLOW
    return Behaviour(state, stop_s, tried, lead_s, lead_speed)


def _is_ahead(situation: Situation) -> BoolArray:
    """Tell who may be a leader: who drives along the route, or is in the corridor already (on wheels): [A].

    Those who cross are no leaders at the moment when they will be in the way: a plan keeps clear of where they are.
    """
    actors, now, route = situation.actors, situation.now, situation.route
    cosine = actors.cos * route.cos[now.point] + actors.sin * route.sin[now.point]
    side = actors.half_width + (actors.half_length - actors.half_width) * np.sqrt(np.maximum(1.0 - cosine**2, 0.0))
    inside = np.abs(now.d) < side + situation.vehicle.width_m / 2 + BESIDE_M
    return np.asarray(~actors.pedestrian & (inside | (cosine > np.cos(pdm_settings.ALIGNED_RAD))))


def _some(prediction: Prediction, who: NDArray[np.int64]) -> Prediction:
    return Prediction(*(getattr(prediction, field.name)[who] for field in fields(prediction)))
