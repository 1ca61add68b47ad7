"""Predicts the other actors: at constant speed along a crossing stream's path, along the road, or straight on."""

from __future__ import annotations

import math

import numpy as np

from foresee_dsl.kernels.arrays import FloatArray, Records
from foresee_dsl.kernels.compiling import CUBE, compiled, inner
from foresee_dsl.kernels.pdm import records as r
from foresee_dsl.kernels.pdm import settings as cfg
from foresee_dsl.kernels.pdm.records import MATCH, PREDICTED
from foresee_dsl.kernels.pdm.route import ALIGNED_COSINE, grid_point, project_predicted, reach_of

TIMES_S: FloatArray = np.arange(round(cfg.HORIZON_S / cfg.ROLLOUT_STEP_S) + 1, dtype=np.float64) * cfg.ROLLOUT_STEP_S
"""[T] times of the frames of every roll-out and prediction, s."""
FRAMES = len(TIMES_S)
PATH_M = 1.0
"""Spacing of the points of the crossing streams' paths, m."""
PATH_STRIDE = 2
STEEPEST_BEND = 0.6
"""Largest product of offset and curvature at which an actor is predicted along the road. Ours: at 1 the actor is at the
centre of the bend, where the route's coordinates end."""
CREEP_MPS = 4.0
CREEP_BRAKING_MPS2 = 2.0
"""Maximum speed, m/s, and braking, m/s^2, of a vehicle that creeps while it waits for the ego inside a junction, and is
expected to stop. Ours."""
FOE_COSINE = math.cos(cfg.FOE_HEADING_RAD)


@compiled(r.ACTORS, r.FOES, r.PATHS)
def match(actors: Records, foes: Records, paths: Records) -> Records:
    """Return the matches of actors with the paths of crossing streams, [A, F].

    An actor in the ego's lane matches no path, and a pedestrian crossing's path matches pedestrians only.
    """
    matches = np.empty((len(actors), len(foes)), MATCH)
    for f in range(len(foes)):
        foe = foes[f]
        start, on_foot = foe["first"], foe["walking"]
        reach = 2 * cfg.FOE_REACH_M if on_foot else cfg.FOE_REACH_M
        for a in range(len(actors)):
            actor, place = actors[a], matches[a, f]
            if actor["own_lane"] or actor["obstacle"] or on_foot != actor["pedestrian"]:
                place["on"], place["s"], place["speed"], place["d"] = False, 0.0, 0.0, 0.0
                continue
            x, y = actor["x"], actor["y"]
            i, nearest = start, np.inf
            for j in range(start, foe["end"], PATH_STRIDE):
                dx, dy = x - paths[j]["x"], y - paths[j]["y"]
                away = dx * dx + dy * dy
                if away < nearest:
                    i, nearest = j, away
            rx, ry, tx, ty = x - paths[i]["x"], y - paths[i]["y"], paths[i]["cos"], paths[i]["sin"]
            s = (i - start) * PATH_M - foe["added"] + rx * tx + ry * ty
            d = ry * tx - rx * ty
            cosine = actor["cos"] * tx + actor["sin"] * ty
            # Pedestrians use a crossing in both directions; a standing pedestrian may face in any direction.
            aligned = (abs(cosine) if on_foot else cosine) > FOE_COSINE or (on_foot and actor["speed"] < cfg.COAST_MPS)
            place["on"] = aligned and abs(d) < reach and s < foe["length"]
            place["s"], place["speed"], place["d"] = s, cosine * actor["speed"], d
    return matches


@inner
def _nearest_foe(matches: Records, pedestrian: bool) -> int:
    """Return the index of the stream whose path is nearest to an actor, from its matches [F]; -1: none."""
    best, nearest = -1, np.inf
    for f in range(len(matches)):
        if matches[f]["on"] and abs(matches[f]["d"]) < nearest:
            best, nearest = f, abs(matches[f]["d"])
    # Only a pedestrian who walks along the path is predicted on it; other pedestrians are predicted straight on.
    return -1 if best >= 0 and pedestrian and matches[best]["speed"] <= 0 else best


@inner
def _stopping_point(entry: float, conflict: float, front_s: float, speed: float) -> float:
    """Return where an actor that must give way is expected to stop; infinite if it is not expected to stop.

    That is the entry of the junction or, if the actor creeps, the conflict.
    """
    if front_s < entry and speed * speed <= 2 * cfg.FOE_STOPS_MPS2 * (entry - front_s):
        return entry
    if front_s < conflict and speed < CREEP_MPS and speed * speed <= 2 * CREEP_BRAKING_MPS2 * (conflict - front_s):
        return conflict
    return np.inf


@inner
def _on_path(actor: np.void, place: np.void, foe: np.void, paths: Records, out: Records) -> None:
    """Predict an actor along a crossing stream's path at a constant offset; it stops if it must and can give way.

    `place`: the actor's `Match` with the stream. Fills `out`, [T].
    """
    s0, speed, d = place["s"], place["speed"], place["d"]
    begin, count, half, stop, room = foe["first"], foe["end"] - foe["first"], actor["half_length"], np.inf, 0.0
    if not foe["has_priority"] and speed > cfg.COAST_MPS:
        stop = _stopping_point(foe["entry"], foe["meets"], s0 + half, speed)
        room = max(stop - s0 - half, 1e-3)
    for n in range(FRAMES):
        s, predicted = s0 + speed * TIMES_S[n], out[n]
        if stop < np.inf:
            # v^2 / 2b = room, so the actor stops after the time 2 room / v.
            t = min(TIMES_S[n], 2 * room / speed)
            s = s0 + speed * t - speed * speed / (4 * room) * t * t
        i = min(max((s + foe["added"]) / PATH_M, 0.0), count - 1.001)
        j = max(int(i), 0)
        point = paths[begin + j]
        part, cos, sin = (i - j) * PATH_M, point["cos"], point["sin"]
        predicted["x"] = point["x"] + part * cos - d * sin
        predicted["y"] = point["y"] + part * sin + d * cos
        predicted["cos"], predicted["sin"], predicted["half_length"] = cos, sin, half


@inner
def _straight(actor: np.void, out: Records) -> None:
    """Predict an actor straight on: fill `out` [T]."""
    x, y, cos, sin = actor["x"], actor["y"], actor["cos"], actor["sin"]
    speed, half = actor["speed"], actor["half_length"]
    rate = actor["speeds_up"] if speed > cfg.COAST_MPS else 0.0
    for n in range(FRAMES):
        t, predicted = TIMES_S[n], out[n]
        grows = rate * (t * t) / 4  # half the distance by which the front may be ahead of the prediction
        distance = speed * t + grows
        predicted["x"], predicted["y"] = x + distance * cos, y + distance * sin
        predicted["cos"], predicted["sin"], predicted["half_length"] = cos, sin, half + grows


@inner
def _on_road(actor: np.void, route: Records, out: Records) -> None:
    """Predict an actor in the route's coordinates, with constant speeds along and across the route: fill `out` [T]."""
    cos, sin, speed, half = actor["cos"], actor["sin"], actor["speed"], actor["half_length"]
    s0, d0, road = actor["s"], actor["d"], route[actor["point"]]
    turn_cos = cos * road["cos"] + sin * road["sin"]
    turn_sin = sin * road["cos"] - cos * road["sin"]
    drift = turn_sin if abs(turn_sin) > cfg.DRIFT_DEADBAND_RAD else 0.0
    for n in range(FRAMES):
        s, d, predicted = s0 + speed * turn_cos * TIMES_S[n], d0 + speed * drift * TIMES_S[n], out[n]
        road = route[grid_point(route, s)]
        part, base_cos, base_sin = s - road["s"], road["cos"], road["sin"]
        predicted["x"] = road["x"] + part * base_cos - d * base_sin
        predicted["y"] = road["y"] + part * base_sin + d * base_cos
        predicted["cos"] = base_cos * turn_cos - base_sin * turn_sin
        predicted["sin"] = base_sin * turn_cos + base_cos * turn_sin
        predicted["half_length"], predicted["s"], predicted["d"] = half, s, d


@inner
def _add_reach(actors: Records, route: Records, out: Records) -> None:
    """Fill the extents along and across the route and the speed along it."""
    last = out.shape[1] - 1
    for a in range(len(actors)):
        half_width = actors[a]["half_width"]
        for n in range(last + 1):
            predicted = out[a, n]
            road = route[grid_point(route, predicted["s"])]
            cos, sin, half = predicted["cos"], predicted["sin"], predicted["half_length"]
            turn_cos = abs(cos * road["cos"] + sin * road["sin"])
            turn_sin = abs(sin * road["cos"] - cos * road["sin"])
            predicted["reach_s"] = half * turn_cos + half_width * turn_sin
            predicted["reach_d"] = half * turn_sin + half_width * turn_cos
            before, after = max(n - 1, 0), min(n + 1, last)
            predicted["speed_s"] = (out[a, after]["s"] - out[a, before]["s"]) / ((after - before) * cfg.ROLLOUT_STEP_S)


@compiled(r.EGOS, r.ACTORS, r.FOES, r.PATHS, r.MATCHES, r.ROUTE)
def predict(egos: Records, actors: Records, foes: Records, paths: Records, matches: Records, route: Records) -> Records:
    """Predict all actors [A] over the horizon, [A, T]; `matches`: [A, F] with the crossing streams `foes` [F]."""
    out, free = np.empty((len(actors), FRAMES), PREDICTED), np.empty(len(actors), dtype=np.bool_)
    for a in range(len(actors)):
        actor, f = actors[a], _nearest_foe(matches[a], actors[a]["pedestrian"])
        road = route[actor["point"]]
        cosine = actor["cos"] * road["cos"] + actor["sin"] * road["sin"]
        along = abs(actor["d"]) < cfg.ALIGNED_REACH_M and abs(cosine) > ALIGNED_COSINE
        free[a] = f >= 0 or not along or road["curvature"] * actor["d"] >= STEEPEST_BEND
        if f >= 0:
            _on_path(actor, matches[a, f], foes[f], paths, out[a])
        elif free[a]:
            _straight(actor, out[a])
        else:
            _on_road(actor, route, out[a])
    project_predicted(free, out, route, egos[0]["s"], reach_of(egos[0]))
    _add_reach(actors, route, out)
    return out


@compiled(r.EGOS, r.ACTORS, CUBE, r.ROUTE, r.PREDICTION)
def know(egos: Records, actors: Records, futures: FloatArray, route: Records, out: Records) -> None:
    """Replace predictions, [A, T], by the true future motion of the actors, [A, T, 4] x, y, heading, speed (NaN:
    unknown).
    """
    certain = np.zeros(len(actors), dtype=np.bool_)
    for a in range(len(actors)):
        certain[a] = not np.isnan(futures[a, 0, 0])
        if certain[a]:
            for n in range(FRAMES):
                predicted, heading = out[a, n], futures[a, n, 2]
                predicted["x"], predicted["y"] = futures[a, n, 0], futures[a, n, 1]
                predicted["cos"], predicted["sin"] = math.cos(heading), math.sin(heading)
                predicted["half_length"] = actors[a]["half_length"]
    project_predicted(certain, out, route, egos[0]["s"], reach_of(egos[0]))
    _add_reach(actors, route, out)
