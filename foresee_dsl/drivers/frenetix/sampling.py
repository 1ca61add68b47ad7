"""Which ends of motions the library is asked for: durations, speeds and offsets that the behaviour makes worth it."""

from __future__ import annotations

import numpy as np

from foresee_dsl.drivers.frenetix import settings as cfg
from foresee_dsl.drivers.frenetix.behaviour import Behaviour
from foresee_dsl.drivers.frenetix.plan import Frenet, Plan
from foresee_dsl.drivers.frenetix.planner import Ends, stop_time
from foresee_dsl.drivers.pdm.situation import Situation
from foresee_dsl.kernels.pdm import settings as pdm_settings
from foresee_dsl.kernels.pdm.proposals import FAR_M

STANDS_MPS = 0.5
APART_M = 0.3
"""Ours: to stay where it is beside the middle is offered where no other offset is nearer than this."""
LEAST_S = 0.6
"""Ours: what is left of a manoeuvre is sampled down to this; three frames of a plan."""


def ends(situation: Situation, behaviour: Behaviour, start: Frenet, last: Plan | None) -> Ends:
    """Return every offset with every speed in every duration, the stops at the places to stop at, and the last plan's
    own end (or a manoeuvre would be put off for ever: what is sampled ends no sooner than `END_TIMES_S` from now)."""
    offsets = behaviour.offsets
    if np.abs(offsets - start.d).min() > APART_M:
        offsets = np.append(offsets, round(start.d, 2))
    top = _top_speed(situation)
    pairs = [
        (time, speed)
        for time in cfg.END_TIMES_S
        for speed in _speeds(situation, start, min(top, _rise(situation, start, time)))
    ]
    pairs += [(time, cfg.STOP_SPEED_MPS) for time in _stops(situation, behaviour, start)]
    left_s = 0.0 if last is None or last.emergency else last.until_s - situation.observation.time_s
    if last is not None and left_s > LEAST_S:
        pairs.append((left_s, max(float(last.s_dot[-1]), cfg.STOP_SPEED_MPS)))
    time, speed = np.array(pairs).T
    count = len(offsets)
    return Ends(np.repeat(time, count), np.repeat(speed, count), np.tile(offsets, len(pairs)))


def _top_speed(situation: Situation) -> float:
    """Return the highest speed that the route allows within the horizon, m/s."""
    route, s = situation.route, situation.ego.s
    first, last = route.index(s), route.index(s + situation.ego.forward * cfg.HORIZON_S + 10.0)
    return float(route.points["profile"][first : last + 1].max())


def _rise(situation: Situation, start: Frenet, time_s: float) -> float:
    """Return the highest speed that the motor reaches in a time, m/s."""
    return start.s_dot + cfg.RISE * min(situation.vehicle.acceleration_mps2, cfg.ACCELERATION_MPS2) * time_s


def _speeds(situation: Situation, start: Frenet, most: float) -> list[float]:
    """Return the end speeds: shares of the highest, that of the road at hand, the present one, and a stop."""
    here = float(situation.route.between("profile", start.s))
    found = [most * share for share in cfg.SPEED_SHARES]
    found += [min(start.s_dot, most), min(here, most), cfg.STOP_SPEED_MPS]
    return list(dict.fromkeys(round(max(speed, cfg.STOP_SPEED_MPS), 2) for speed in found))


def _stops(situation: Situation, behaviour: Behaviour, start: Frenet) -> list[float]:
    """Return the durations of the stops right at the stop place, and right behind who stands ahead."""
    front_s = start.s + situation.vehicle.wheelbase_m + situation.vehicle.front_overhang_m
    places = [] if behaviour.stop_s is None else [behaviour.stop_s]
    leaders = behaviour.leaders[:, 0]
    standing = leaders["s"][leaders["speed"] < STANDS_MPS]
    places += [float(s) - cfg.MINIMUM_GAP_M for s in np.unique(standing) if s < FAR_M]
    reach = float(situation.route.points["profile"].max()) * cfg.HORIZON_S
    times = [stop_time(start, place - front_s) for place in places if place - front_s < reach]
    found = [time for time in times if time is not None and time < cfg.LONGEST_STOP_S]
    return found if start.s_dot > pdm_settings.COAST_MPS else []
