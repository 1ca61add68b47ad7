"""What is seen, put on the route: the ego, the others, and the crossing streams that are near."""

from __future__ import annotations

import math

import numpy as np

from foresee_dsl.kernels.compiling import FLOAT, TABLE, compiled, inner
from foresee_dsl.kernels.pdm import settings as cfg
from foresee_dsl.kernels.pdm.records import ACTORS, EGOS, FOE, FOES, JUNCTIONS, ROUTE, FloatArray, IntArray, Records
from foresee_dsl.kernels.pdm.route import locate, project_actors
from foresee_dsl.kernels.tracks import BICYCLE, OBSTACLE, PEDESTRIAN, TRACKS

OWN_LANE_M = 1.2
"""Ours: an aligned actor this near the centreline is in the ego's lane, whatever crossing stream runs there too."""
BRAKING_ALREADY_MPS2 = -1.0
"""Ours: a vehicle that brakes this hard has decided to stop, and keeps to it (instead of a memory)."""
BRAKING_ALREADY_FACTOR = 1.5
"""Ours: it then accepts this much more braking before it gives up; covers the lag of the brakes."""
LEAST_REACH_M = 30.0
ALIGNED_COSINE = math.cos(cfg.ALIGNED_RAD)


@compiled(EGOS, ROUTE, TABLE)
def place_ego(egos: Records, route: Records, coarse: FloatArray) -> None:
    """Fill the fields of the ego [1] that say where it is on the route."""
    ego = egos[0]
    back = ego["centre"]
    x, y = ego["x"] - back * math.cos(ego["heading"]), ego["y"] - back * math.sin(ego["heading"])
    ego["s"], ego["d"], ego["heading_error"] = locate(x, y, ego["heading"], route, coarse)
    ego["forward"] = max(ego["speed"], 0.0)
    middle_s = ego["s"] + back
    ego["front_s"], ego["rear_s"] = middle_s + ego["length"] / 2, middle_s - ego["length"] / 2


@inner
def reach_of(ego: np.void) -> float:
    """Return how far ahead predictions are put on the route, m."""
    return max(LEAST_REACH_M, float(ego["forward"] * cfg.HORIZON_S + 25.0))


@compiled(EGOS, TRACKS, ROUTE, ACTORS)
def place_actors(egos: Records, tracks: Records, route: Records, actors: Records) -> None:
    """Fill the actors [A] from their tracks [A]; the ego has its place already. Only `passable` is left open."""
    for a in range(len(tracks)):
        track, one = tracks[a], actors[a]
        kind, heading = track["kind"], track["heading"]
        one["x"], one["y"], one["cos"], one["sin"] = track["x"], track["y"], math.cos(heading), math.sin(heading)
        one["speed"], one["half_length"], one["half_width"] = (
            track["speed"],
            track["length"] * 0.5,
            track["width"] * 0.5,
        )
        one["pedestrian"], one["obstacle"], one["speeds_up"] = kind == PEDESTRIAN, kind == OBSTACLE, 0.0
        if kind == PEDESTRIAN:
            one["speeds_up"] = cfg.PEDESTRIAN_SPEEDS_UP_MPS2
        if kind == BICYCLE:
            one["speeds_up"] = cfg.BICYCLE_SPEEDS_UP_MPS2
    project_actors(actors, route, egos[0]["s"], max(reach_of(egos[0]), cfg.JUNCTION_REACH_M))
    for a in range(len(actors)):
        one = actors[a]
        road = route[one["point"]]
        cosine = one["cos"] * road["cos"] + one["sin"] * road["sin"]
        one["own_lane"] = abs(one["d"]) < OWN_LANE_M and cosine > ALIGNED_COSINE and not one["pedestrian"]
        one["passable"] = False


@compiled(EGOS, FLOAT, FLOAT)
def stops_before(egos: Records, wall_s: float, braking: float) -> bool:
    """Tell whether the ego can stop before a place with this braking (more, where it brakes already)."""
    ego = egos[0]
    if ego["acceleration"] < BRAKING_ALREADY_MPS2:
        braking *= BRAKING_ALREADY_FACTOR
    room = wall_s - ego["front_s"]
    return bool(ego["speed"] < cfg.COAST_MPS or 2 * braking * room >= ego["speed"] ** 2)


@inner
def near_junctions(ego: np.void, junctions: Records) -> IntArray:
    """Return the indices of the junctions that the ego is in or comes to."""
    found, count = np.empty(len(junctions), dtype=np.int64), 0
    for k in range(len(junctions)):
        if ego["rear_s"] < junctions[k]["end_s"] and junctions[k]["stop_s"] < ego["front_s"] + cfg.JUNCTION_REACH_M:
            found[count] = k
            count += 1
    return found[:count]


@compiled(EGOS, FOES, JUNCTIONS)
def near_foes(egos: Records, foes: Records, junctions: Records) -> Records:
    """Return the crossing streams of the junctions that the ego is in or comes to."""
    found, count = np.empty(len(foes), FOE), 0
    near = near_junctions(egos[0], junctions)
    for f in range(len(foes)):
        for n in range(len(near)):
            if foes[f]["junction"] == near[n]:
                found[count] = foes[f]
                count += 1
    return found[:count]
