"""The route's even grid: look-ups on it, and projections of the ego, the other actors and the crossing streams."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foresee_dsl.kernels.arrays import BoolArray, FloatArray, IntArray, Records
from foresee_dsl.kernels.compiling import FLOAT, TABLE, compiled, inner
from foresee_dsl.kernels.pdm import records as r
from foresee_dsl.kernels.pdm import settings as cfg
from foresee_dsl.kernels.pdm.records import FOE
from foresee_dsl.kernels.tracks import BICYCLE, OBSTACLE, PEDESTRIAN, TRACKS

GRID_M = 0.1
"""Spacing of the route's grid, m: fine enough to look up speeds without interpolation (0.04 m/s at 5 m/s)."""
COARSE = 10
"""Stride of the grid points that the projection of a point searches: 10 points, 1 m."""
SEARCH_BEHIND_M = 30.0
SAMPLED = 16
"""Stride of the coarse points that give a first upper bound of the distance. Ours: about the root of their number."""
ROUNDING_M = 0.001
"""Slack of that bound, m, so that rounding errors never make the search skip the nearest point. Ours: larger than those
errors."""


@inner
def grid_point(route: Records, s: float) -> int:
    """Return the grid point at a length along a route, clamped to the route."""
    return min(max(int((s - route[0]["s"]) * (1.0 / GRID_M)), 0), len(route) - 1)


@inner
def grid_place(route: Records, s: float) -> tuple[int, float]:
    """Return the grid point before a length along a route, and the fraction of the step to the next one.

    Values are interpolated because the grid begins at the mission's start, and decisions must not depend on that:
    otherwise a run resumed in the middle would differ.
    """
    place = min(max((s - route[0]["s"]) * (1.0 / GRID_M), 0.0), len(route) - 1.001)
    k = max(int(place), 0)
    return k, place - k


@inner
def curvature_at(route: Records, s: float) -> float:
    """Return the route's curvature at a length, 1/m."""
    k, share = grid_place(route, s)
    here = route[k]["curvature"]
    return float(here + share * (route[k + 1]["curvature"] - here))


@inner
def profile_at(route: Records, s: float) -> float:
    """Return the profile's speed limit at a length along the route, m/s."""
    k, share = grid_place(route, s)
    here = route[k]["profile"]
    return float(here + share * (route[k + 1]["profile"] - here))


@inner
def _point_by_division(route: Records, s: float) -> int:
    """Return the grid point at a length, by division; sometimes not that of `grid_point`, which multiplies."""
    return min(max(int((s - route[0]["s"]) / GRID_M), 0), len(route) - 1)


@inner
def least_room(route: Records, from_s: float, to_s: float) -> tuple[float, float]:
    """Return the least free widths on the left and on the right of a stretch of the route, m."""
    least_left, least_right = np.inf, np.inf
    first, last = _point_by_division(route, from_s), _point_by_division(route, to_s)
    for i in range(first, last + 1):
        least_left, least_right = min(least_left, route[i]["left"]), min(least_right, route[i]["right"])
    return least_left, least_right


@inner
def _cost(x: float, y: float, cos: float, sin: float, coarse: FloatArray, i: int) -> tuple[float, float]:
    """Return the square of the distance from a place to a coarse point, m^2, without and with a cost for the
    heading."""
    dx, dy = x - coarse[0, i], y - coarse[1, i]
    square = dx * dx + dy * dy
    return square, square + 12.5 * (1.0 - (cos * coarse[2, i] + sin * coarse[3, i]))


@inner
def _nearest_coarse(x: float, y: float, cos: float, sin: float, coarse: FloatArray) -> int:
    """Return the index of the coarse point with the least cost, the first of equal ones.

    The largest distance between neighbours is known, so points that are certainly too far are skipped: a sixth of them
    is evaluated.

    `coarse`: [5, N / COARSE] x, y, cos and sin of every `COARSE`th point of the route; the first number of the last row
    is the largest distance between two neighbours, m.
    """
    count, spacing, reach = coarse.shape[1], coarse[4, 0], np.inf
    for i in range(0, count, SAMPLED):
        reach = min(reach, _cost(x, y, cos, sin, coarse, i)[1])
    reach = math.sqrt(max(reach, 0.0)) + ROUNDING_M
    k, least, i = 0, np.inf, 0
    while i < count:
        square, cost = _cost(x, y, cos, sin, coarse, i)
        if cost < least:
            k, least = i, cost
        ahead = (math.sqrt(square) - reach) / spacing
        i += int(min(ahead, float(count))) if ahead > 1.0 else 1  # 1 also for NaN
    return k


@compiled(FLOAT, FLOAT, FLOAT, r.ROUTE, TABLE)
def locate(x: float, y: float, heading: float, route: Records, coarse: FloatArray) -> tuple[float, float, float]:
    """Return the length along the whole route, the offset (m) and the heading error (rad) of a place and heading.

    A route may cross itself, so that the place is ambiguous: the heading adds a cost of up to 5 m (ours: a lane and a
    half).

    `coarse`: see `_nearest_coarse`.
    """
    k = _nearest_coarse(x, y, math.cos(heading), math.sin(heading), coarse) * COARSE
    for _ in range(2):  # first with the tangent at the coarse point, then with that at the resulting point
        at = route[k]
        along = (x - at["x"]) * at["cos"] + (y - at["y"]) * at["sin"]
        k = min(max(k + int(np.rint(along / GRID_M)), 0), len(route) - 1)
    at = route[k]
    along = (x - at["x"]) * at["cos"] + (y - at["y"]) * at["sin"]
    across = (y - at["y"]) * at["cos"] - (x - at["x"]) * at["sin"]
    error = (heading - at["heading"] + np.pi) % (2 * np.pi) - np.pi
    return at["s"] + along, across, error


class Stretch(NamedTuple):
    """A part of the route for the projection of actors: every `stride`th grid point from `first` on.

    Attributes:
        x, y: [M] coordinates of these points, m.
    """

    first: int
    stride: int
    x: FloatArray
    y: FloatArray


@inner
def _stretch(route: Records, ego_s: float, ahead_m: float, stride: int) -> Stretch:
    """Return the stretch from `SEARCH_BEHIND_M` behind the ego to `ahead_m` before it."""
    first, until = _point_by_division(route, ego_s - SEARCH_BEHIND_M), _point_by_division(route, ego_s + ahead_m) + 1
    count = max((until - first + stride - 1) // stride, 1)
    x, y = np.empty(count), np.empty(count)
    for i in range(count):
        at = route[first + i * stride]
        x[i], y[i] = at["x"], at["y"]
    return Stretch(first, stride, x, y)


@inner
def _foot(x: float, y: float, route: Records, part: Stretch, nearest: int) -> tuple[int, float, float]:
    """Project a point onto a stretch: return the grid point, the distance beyond it along the route, and the offset.

    `nearest`: the nearest point of the stretch.
    """
    k = part.first + nearest * part.stride
    at = route[k]
    along = (x - at["x"]) * at["cos"] + (y - at["y"]) * at["sin"]
    # A second projection at the point that the tangent leads to, within one stride, keeps bends exact.
    step = min(max(np.rint(along / GRID_M), -float(part.stride)), float(part.stride))
    k = min(max(k + int(step), 0), len(route) - 1)
    at = route[k]
    rx, ry = x - at["x"], y - at["y"]
    return k, rx * at["cos"] + ry * at["sin"], ry * at["cos"] - rx * at["sin"]


@inner
def nearest_points(x: FloatArray, y: FloatArray, part: Stretch) -> FloatArray:
    """Return the nearest point of a stretch for each place [T], the first of equally near ones.

    The loop over places is inside the loop over points, so that the processor compares several places at once; for
    that, the indices are floats like the distances.
    """
    least, nearest = np.full(len(x), np.inf), np.zeros(len(x))
    for i in range(len(part.x)):
        at_x, at_y, index = part.x[i], part.y[i], float(i)
        for t in range(len(x)):
            dx, dy = x[t] - at_x, y[t] - at_y
            away = dx * dx + dy * dy
            nearer = away < least[t]
            nearest[t] = index if nearer else nearest[t]
            least[t] = away if nearer else least[t]
    return nearest


@inner
def project_actors(actors: Records, route: Records, ego_s: float, ahead_m: float) -> None:
    """Fill `s`, `d` and `point` of the actors, from the stretch up to `ahead_m` before the ego."""
    part, x, y = _stretch(route, ego_s, ahead_m, COARSE), np.empty(len(actors)), np.empty(len(actors))
    for a in range(len(actors)):
        x[a], y[a] = actors[a]["x"], actors[a]["y"]
    nearest = nearest_points(x, y, part)
    for a in range(len(actors)):
        actor = actors[a]
        k, along, across = _foot(x[a], y[a], route, part, int(nearest[a]))
        actor["s"], actor["d"], actor["point"] = route[k]["s"] + along, across, k


@inner
def _until_rest(frames: Records) -> int:
    """Return the number of frames of a prediction [T] up to the last one at a new place."""
    t = len(frames) - 1
    while t > 0 and frames[t]["x"] == frames[t - 1]["x"] and frames[t]["y"] == frames[t - 1]["y"]:
        t -= 1
    return t + 1


@inner
def project_predicted(which: BoolArray, predicted: Records, route: Records, ego_s: float, ahead_m: float) -> None:
    """Fill `s` and `d` of the predictions, [A, T], of those actors whose flag is set."""
    part, last = _stretch(route, ego_s, ahead_m, 2 * COARSE), predicted.shape[1] - 1
    x, y = np.empty(last + 1), np.empty(last + 1)
    for a in range(len(which)):
        if not which[a]:
            continue
        frames = predicted[a]
        moving = _until_rest(frames)  # the frames after these are at the same place: a standing actor has one
        for t in range(moving):
            x[t], y[t] = frames[t]["x"], frames[t]["y"]
        nearest = nearest_points(x[:moving], y[:moving], part)
        for t in range(moving):
            k, along, across = _foot(x[t], y[t], route, part, int(nearest[t]))
            frames[t]["s"], frames[t]["d"] = route[k]["s"] + along, across
        for t in range(moving, last + 1):
            frames[t]["s"], frames[t]["d"] = frames[moving - 1]["s"], frames[moving - 1]["d"]


OWN_LANE_M = 1.2
"""Distance from the centreline within which an aligned actor is in the ego's lane, even if a crossing stream's path
runs there too, m. Ours."""
BRAKING_ALREADY_MPS2 = -1.0
"""If the ego's acceleration is below this, m/s^2, it has decided to stop and keeps that decision, which therefore needs
no memory. Ours."""
BRAKING_ALREADY_FACTOR = 1.5
"""Factor on the braking that the ego then accepts before it drives on after all. Ours: it makes up for the lag of the
brakes."""
LEAST_REACH_M = 30.0
ALIGNED_COSINE = math.cos(cfg.ALIGNED_RAD)


@compiled(r.EGOS, r.ROUTE, TABLE)
def place_ego(egos: Records, route: Records, coarse: FloatArray) -> None:
    """Fill in the ego's [1] position on the route."""
    ego = egos[0]
    back = ego["centre"]
    x, y = ego["x"] - back * math.cos(ego["heading"]), ego["y"] - back * math.sin(ego["heading"])
    ego["s"], ego["d"], ego["heading_error"] = locate(x, y, ego["heading"], route, coarse)
    ego["forward"] = max(ego["speed"], 0.0)
    middle_s = ego["s"] + back
    ego["front_s"], ego["rear_s"] = middle_s + ego["length"] / 2, middle_s - ego["length"] / 2


@inner
def reach_of(ego: np.void) -> float:
    """Return the distance ahead of the ego within which predictions are projected onto the route, m."""
    return max(LEAST_REACH_M, float(ego["forward"] * cfg.HORIZON_S + 25.0))


@compiled(r.EGOS, TRACKS, r.ROUTE, r.ACTORS)
def place_actors(egos: Records, tracks: Records, route: Records, actors: Records) -> None:
    """Fill the actors [A] from their tracks [A], except `passable`; the ego's position must be filled in before."""
    for a in range(len(tracks)):
        track, actor = tracks[a], actors[a]
        kind, heading = track["kind"], track["heading"]
        actor["x"], actor["y"], actor["cos"], actor["sin"] = (
            track["x"],
            track["y"],
            math.cos(heading),
            math.sin(heading),
        )
        actor["speed"] = track["speed"]
        actor["half_length"], actor["half_width"] = track["length"] * 0.5, track["width"] * 0.5
        actor["pedestrian"], actor["obstacle"], actor["speeds_up"] = kind == PEDESTRIAN, kind == OBSTACLE, 0.0
        if kind == PEDESTRIAN:
            actor["speeds_up"] = cfg.PEDESTRIAN_SPEEDS_UP_MPS2
        if kind == BICYCLE:
            actor["speeds_up"] = cfg.BICYCLE_SPEEDS_UP_MPS2
    project_actors(actors, route, egos[0]["s"], max(reach_of(egos[0]), cfg.JUNCTION_REACH_M))
    for a in range(len(actors)):
        actor = actors[a]
        road = route[actor["point"]]
        cosine = actor["cos"] * road["cos"] + actor["sin"] * road["sin"]
        actor["own_lane"] = abs(actor["d"]) < OWN_LANE_M and cosine > ALIGNED_COSINE and not actor["pedestrian"]
        actor["passable"] = False


@compiled(r.EGOS, FLOAT, FLOAT)
def stops_before(egos: Records, wall_s: float, braking: float) -> bool:
    """Return whether the ego can stop before a place with this braking (with more if it already brakes)."""
    ego = egos[0]
    if ego["acceleration"] < BRAKING_ALREADY_MPS2:
        braking *= BRAKING_ALREADY_FACTOR
    room = wall_s - ego["front_s"]
    return bool(ego["speed"] < cfg.COAST_MPS or 2 * braking * room >= ego["speed"] ** 2)


@inner
def near_junctions(ego: np.void, junctions: Records) -> IntArray:
    """Return the indices of the junctions that the ego is in or approaches."""
    indices, count = np.empty(len(junctions), dtype=np.int64), 0
    for k in range(len(junctions)):
        if ego["rear_s"] < junctions[k]["end_s"] and junctions[k]["stop_s"] < ego["front_s"] + cfg.JUNCTION_REACH_M:
            indices[count] = k
            count += 1
    return indices[:count]


@compiled(r.EGOS, r.FOES, r.JUNCTIONS)
def near_foes(egos: Records, foes: Records, junctions: Records) -> Records:
    """Return the crossing streams of the junctions that the ego is in or approaches."""
    streams, count = np.empty(len(foes), FOE), 0
    near = near_junctions(egos[0], junctions)
    for f in range(len(foes)):
        for n in range(len(near)):
            if foes[f]["junction"] == near[n]:
                streams[count] = foes[f]
                count += 1
    return streams[:count]
