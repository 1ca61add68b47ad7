"""Where the others will be: constant velocity, along a foe's path, along the road, or straight on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.drivers import pdm_settings as cfg
from foresee_dsl.drivers.pdm_route import GRID_M, PATH_M, FoePath, Projection, Route
from foresee_dsl.drivers.pdm_situation import Actors, BoolArray, Situation
from foresee_dsl.drivers.protocol import FloatArray

TIMES_S = np.arange(round(cfg.HORIZON_S / cfg.ROLLOUT_STEP_S) + 1) * cfg.ROLLOUT_STEP_S
"""[T] the frames of every roll-out and prediction."""
FOE_STRIDE = 2
STEEPEST_BEND = 0.6
"""Ours: offset times curvature; at 1 the centre of the bend is reached, and the route's coordinates end."""
CREEP_MPS = 4.0
CREEP_BRAKING_MPS2 = 2.0
"""Ours: who waits inside the junction for the ego creeps slower than this and is trusted to stop this gently."""


class FoeMatches(NamedTuple):
    """Who is on which foe's path: foes [F], and [A, F]: on it or not, length along it, speed along it, offset."""

    foes: tuple[FoePath, ...]
    on: BoolArray
    s: FloatArray
    speed: FloatArray
    d: FloatArray


@dataclass(frozen=True)
class Prediction:
    """Footprints over the horizon, [A, T] each.

    Attributes:
        x, y, cos, sin: centre and heading. half_length: m, growing where speed is uncertain. s, d: on the route.
        reach_s, reach_d: half of the footprint's extent along and across the route. speed_s: m/s along the route.
    """

    x: FloatArray
    y: FloatArray
    cos: FloatArray
    sin: FloatArray
    half_length: FloatArray
    s: FloatArray
    d: FloatArray
    reach_s: FloatArray
    reach_d: FloatArray
    speed_s: FloatArray


def match_foes(situation: Situation, foes: tuple[FoePath, ...]) -> FoeMatches:
    """Find who is on which foe's path; who is in the ego's lane is on none."""
    actors, own = situation.actors, situation.own
    shape = (actors.count, len(foes))
    index = np.zeros(shape, dtype=np.int64)
    gathered = np.zeros((4, *shape))
    for k, foe in enumerate(foes):
        gx, gy = foe.x[::FOE_STRIDE], foe.y[::FOE_STRIDE]
        nearest = ((actors.x[:, None] - gx) ** 2 + (actors.y[:, None] - gy) ** 2).argmin(axis=1) * FOE_STRIDE
        index[:, k] = nearest
        gathered[:, :, k] = foe.x[nearest], foe.y[nearest], foe.cos[nearest], foe.sin[nearest]
    rx, ry = actors.x[:, None] - gathered[0], actors.y[:, None] - gathered[1]
    cos, sin = gathered[2], gathered[3]
    shift = np.array([f.shift_m for f in foes])
    s = index * PATH_M - shift + rx * cos + ry * sin
    d = ry * cos - rx * sin
    cosine = actors.cos[:, None] * cos + actors.sin[:, None] * sin
    walking = np.array([f.foe.pedestrian for f in foes], dtype=bool)
    # Somebody on foot may use a crossing in either direction; somebody who stands faces anywhere.
    aligned = np.where(walking, np.abs(cosine), cosine) > np.cos(cfg.FOE_HEADING_RAD)
    aligned |= walking & (actors.speed < cfg.COAST_MPS)[:, None]
    reach = np.where(walking, 2 * cfg.FOE_REACH_M, cfg.FOE_REACH_M)
    lengths = np.array([f.length_m for f in foes])
    on = aligned & (np.abs(d) < reach) & (s < lengths) & ~own[:, None] & ~actors.obstacle[:, None]
    on &= walking == actors.pedestrian[:, None]
    return FoeMatches(foes, on, s, cosine * actors.speed[:, None], d)


def predict(situation: Situation, matches: FoeMatches) -> Prediction:
    """Roll everybody out over the horizon."""
    route, actors, now = situation.route, situation.actors, situation.now
    shape = (actors.count, len(TIMES_S))
    x, y, cos, sin, s, d = (np.empty(shape) for _ in range(6))
    chosen = _chosen_foes(actors, matches)
    along = (chosen < 0) & _follows_road(route, actors, now)
    straight = np.flatnonzero((chosen < 0) & ~along)
    with_foe = np.flatnonzero(chosen >= 0)
    half_length = np.repeat(actors.half_length[:, None], len(TIMES_S), axis=1)
    _straight(actors, straight, (x, y, cos, sin, half_length))
    for a in with_foe.tolist():
        _on_path(actors, a, matches, int(chosen[a]), (x, y, cos, sin))
    others = np.concatenate([straight, with_foe])
    if others.size:
        p = route.project(x[others], y[others], situation.pose.s, situation.reach_m, stride=20)
        s[others], d[others] = p.s, p.d
    if along.any():
        _on_road(route, actors, now, along, (x, y, cos, sin, s, d))
    k = route.indices(s)
    turn_cos = np.abs(cos * route.cos[k] + sin * route.sin[k])
    turn_sin = np.abs(sin * route.cos[k] - cos * route.sin[k])
    width = actors.half_width[:, None]
    return Prediction(
        x=x,
        y=y,
        cos=cos,
        sin=sin,
        half_length=half_length,
        s=s,
        d=d,
        reach_s=half_length * turn_cos + width * turn_sin,
        reach_d=half_length * turn_sin + width * turn_cos,
        speed_s=np.asarray(np.gradient(s, cfg.ROLLOUT_STEP_S, axis=1)),
    )


def _follows_road(route: Route, actors: Actors, now: Projection) -> BoolArray:
    """Return who is near the route and along or against it, where the route's bend leaves room for that: [A]."""
    cosine = actors.cos * route.cos[now.index] + actors.sin * route.sin[now.index]
    bend = route.curvature[now.index] * now.d
    near, along = np.abs(now.d) < cfg.ALIGNED_REACH_M, np.abs(cosine) > np.cos(cfg.ALIGNED_RAD)
    return np.asarray(near & along & (bend < STEEPEST_BEND))


def _chosen_foes(actors: Actors, matches: FoeMatches) -> NDArray[np.int64]:
    """Return the foe whose path each actor (on wheels) is nearest to, -1 for none: [A]."""
    if not matches.foes:
        return np.full(actors.count, -1, dtype=np.int64)
    distance = np.where(matches.on, np.abs(matches.d), np.inf)
    best = distance.argmin(axis=1)
    # On foot, only who walks along the path follows it; the predictions of the others go straight.
    backwards = matches.speed[np.arange(actors.count), best] <= 0
    found = np.isfinite(distance[np.arange(actors.count), best]) & ~(actors.pedestrian & backwards)
    return np.where(found, best, -1)


def _straight(actors: Actors, who: NDArray[np.int64], into: tuple[FloatArray, ...]) -> None:
    x, y, cos, sin, half_length = into
    speeds_up = np.where(actors.speed[who] > cfg.COAST_MPS, actors.speeds_up[who], 0.0)
    grows = speeds_up[:, None] * TIMES_S**2 / 4  # half of how far the front may run ahead
    half_length[who] += grows
    distance = actors.speed[who, None] * TIMES_S + grows
    cos[who], sin[who] = actors.cos[who, None], actors.sin[who, None]
    x[who] = actors.x[who, None] + distance * cos[who]
    y[who] = actors.y[who, None] + distance * sin[who]


def _on_path(actors: Actors, a: int, matches: FoeMatches, k: int, into: tuple[FloatArray, ...]) -> None:
    """Predict one actor along a foe's path, its offset kept; one that must give way and can is taken to stop."""
    foe, x, y, cos, sin = matches.foes[k], *into
    s0, speed, d = float(matches.s[a, k]), float(matches.speed[a, k]), float(matches.d[a, k])
    s = s0 + speed * TIMES_S
    stop = None if foe.foe.has_priority else stopping_point(foe, s0 + float(actors.half_length[a]), speed)
    if stop is not None and speed > cfg.COAST_MPS:
        # v^2 / 2b = room, so that it stands after 2 room / v.
        room = max(stop - s0 - float(actors.half_length[a]), 1e-3)
        t = np.minimum(TIMES_S, 2 * room / speed)
        s = s0 + speed * t - speed * speed / (4 * room) * t * t
    i = np.minimum(np.maximum((s + foe.shift_m) / PATH_M, 0.0), len(foe.x) - 1.001)
    j = i.astype(np.int64)
    part = (i - j) * PATH_M
    cos[a], sin[a] = foe.cos[j], foe.sin[j]
    x[a] = foe.x[j] + part * cos[a] - d * sin[a]
    y[a] = foe.y[j] + part * sin[a] + d * cos[a]


def stopping_point(foe: FoePath, front_s: float, speed: float) -> float | None:
    """Return where somebody who must give way is trusted to stop: at the entry, else (creeping) at the conflict."""
    entry, conflict = foe.foe.entry_s, foe.foe.conflict_path_s[0]
    if front_s < entry and speed * speed <= 2 * cfg.FOE_STOPS_MPS2 * (entry - front_s):
        return entry
    if front_s < conflict and speed < CREEP_MPS and speed * speed <= 2 * CREEP_BRAKING_MPS2 * (conflict - front_s):
        return conflict
    return None


def _on_road(route: Route, actors: Actors, now: Projection, who: BoolArray, into: tuple[FloatArray, ...]) -> None:
    """Predict actors in the route's own coordinates: constant speed along it and across it."""
    x, y, cos, sin, s, d = into
    k = now.index[who]
    turn_cos = actors.cos[who] * route.cos[k] + actors.sin[who] * route.sin[k]
    turn_sin = actors.sin[who] * route.cos[k] - actors.cos[who] * route.sin[k]
    drift = np.where(np.abs(turn_sin) > cfg.DRIFT_DEADBAND_RAD, turn_sin, 0.0)
    s[who] = now.s[who, None] + (actors.speed[who] * turn_cos)[:, None] * TIMES_S
    d[who] = now.d[who, None] + (actors.speed[who] * drift)[:, None] * TIMES_S
    j = route.indices(s[who])
    part = s[who] - (route.origin_s + j * GRID_M)
    x[who] = route.x[j] + part * route.cos[j] - d[who] * route.sin[j]
    y[who] = route.y[j] + part * route.sin[j] + d[who] * route.cos[j]
    cos[who] = route.cos[j] * turn_cos[:, None] - route.sin[j] * turn_sin[:, None]
    sin[who] = route.sin[j] * turn_cos[:, None] + route.cos[j] * turn_sin[:, None]
