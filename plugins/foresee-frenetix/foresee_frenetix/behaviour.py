"""The behaviour layer: decides the state, the stop, the leader, and the lateral offsets that the planner samples.

Signals, right of way and queues are evaluated by the functions of `pdm`, pedestrians also by those of `idm`.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from foresee_dsl.drivers.pdm.situation import RoadSituation, signal_brakings
from foresee_dsl.drivers.protocol import FloatArray
from foresee_dsl.kernels.arrays import BoolArray, Records
from foresee_dsl.kernels.idm import actors_on_route, gap_to_walker
from foresee_dsl.kernels.pdm import settings as pdm_settings
from foresee_dsl.kernels.pdm.prediction import TIMES_S as PREDICTED_S
from foresee_dsl.kernels.pdm.proposals import find_leaders, find_offsets, find_passable
from foresee_dsl.kernels.pdm.right_of_way import find_wall
from foresee_frenetix import settings as cfg
from foresee_frenetix.plan import TIMES_S

STRIDE = round(TIMES_S[1] / PREDICTED_S[1])
"""Number of frames of a prediction for each frame of a plan."""
AT_LINE_M = 2.0
"""A stop within this distance of a stop line is for the signal (or for the queue beyond it), m; any other stop gives
way. Ours."""
FOLLOWS_S = 6.0
"""A vehicle that the ego would reach only after more than this time, at its current speed, is not followed yet, s.
Ours."""
WALKER_AIR_M = 1.5
"""Distance before a pedestrian at which the ego stops, m. Ours: half more than before a conflict with a car."""
WALKER_BRAKING_MPS2 = 1.0
"""Braking from which the ego gives way to a pedestrian, m/s^2. Ours: if less is needed, it is mostly sensor noise that
makes pedestrians on the pavement seem to head for the road."""
WALKER_TIMES = 3
WALKER_URGENT_MPS2 = 3.0
"""The ego stops for a pedestrian if `WALKER_TIMES` consecutive plans (0.3 s) require it, or if one plan requires a
braking of at least `WALKER_URGENT_MPS2`. Ours: one plan in four required a stop for a pedestrian that only walked along
the pavement."""
BESIDE_M = 0.3
"""An actor that is not aligned with the road is in the ego's corridor if it is at most this far from the ego's side, m.
Ours."""


class State(StrEnum):
    """The state of the behaviour layer."""

    CRUISE = "cruise"
    FOLLOW = "follow"
    YIELD = "yield"
    STOP = "stop"


@dataclass(frozen=True)
class Behaviour:
    """The task of the planner.

    Attributes:
        stop_s: the length along the route that the front bumper may not pass; None: no stop.
        offsets: [O] m, the lateral offsets to sample, the middle of the lane first.
        leaders: [O, T] `Leader`s, the rear of the nearest actor ahead at each offset (far away: none).
    """

    state: State
    stop_s: float | None
    offsets: FloatArray
    leaders: Records


class Patience:
    """Decides when to give way to a pedestrian: only to one that certainly wants to cross, because with noisy headings
    others only seem to.
    """

    def __init__(self, times: int = 0) -> None:
        self.times = times

    def walker(self, situation: RoadSituation) -> float | None:
        """Return the place to stop for a pedestrian, m along the route; None: no stop. To be called once per plan."""
        others = actors_on_route(situation.egos, situation.actors, situation.route.points)
        gap = gap_to_walker(situation.egos, others)
        if gap == np.inf:
            self.times = 0
            return None
        room = max(gap - WALKER_AIR_M, 0.0)
        needed = situation.ego.forward**2 / (2 * max(room, 0.1))
        self.times += 1
        sure = self.times >= WALKER_TIMES or needed > WALKER_URGENT_MPS2
        if situation.ego.forward > pdm_settings.COAST_MPS and not (sure and needed > WALKER_BRAKING_MPS2):
            return None
        return situation.ego.front_s + room


def decide(
    situation: RoadSituation, foes: Records, matches: Records, prediction: Records, patience: Patience
) -> Behaviour:
    """Return the task of the planner for this situation.

    `matches`: [A, F] with the crossing streams of near junctions. `prediction`: [A, T] of the others, at `pdm`'s
    frames. `patience` is kept from plan to plan.
    """
    egos, ego, actors, route = situation.egos, situation.ego, situation.actors, situation.route
    find_passable(egos, actors, route.points, route.junctions)
    offsets = find_offsets(egos, actors, route.points)
    ahead = np.flatnonzero(_is_ahead(situation))
    leaders = find_leaders(egos, actors[ahead], prediction[ahead], offsets)[:, ::STRIDE]
    braking = signal_brakings(route, ego.strongest, situation.signals)
    wall_s = find_wall(egos, actors, foes, matches, route.junctions, braking, route.points)
    walker_s = patience.walker(situation)
    stop_s = min((s for s in (wall_s, walker_s) if s is not None and s < np.inf), default=None)
    state = State.CRUISE
    if stop_s is not None:
        at_line = np.abs(stop_s - route.junctions["stop_s"]) < AT_LINE_M
        state = State.STOP if at_line.any() else State.YIELD
    elif leaders["s"][0, 0] - ego.front_s < cfg.MINIMUM_GAP_M + FOLLOWS_S * ego.forward:
        state = State.FOLLOW
    return Behaviour(state, stop_s, offsets, leaders)


def _is_ahead(situation: RoadSituation) -> BoolArray:
    """Return which actors may be leaders, [A]: vehicles that drive along the route, or are already in the corridor.

    Crossing actors are not leaders; instead, each candidate trajectory is checked against their predictions.
    """
    actors = situation.actors
    road = situation.route.points[actors["point"]]
    cosine = actors["cos"] * road["cos"] + actors["sin"] * road["sin"]
    half_length, half_width = actors["half_length"], actors["half_width"]
    side = half_width + (half_length - half_width) * np.sqrt(np.maximum(1.0 - cosine**2, 0.0))
    inside = np.abs(actors["d"]) < side + situation.ego.width / 2 + BESIDE_M
    return np.asarray(~actors["pedestrian"] & (inside | (cosine > np.cos(pdm_settings.ALIGNED_RAD))))
