"""One decision of the driver `pdm`, from tracks to the proposal that is driven, in one call."""

from __future__ import annotations

import numpy as np

from foresee_dsl.kernels.compiling import FLOATS, TABLE, compiled, inner
from foresee_dsl.kernels.pdm.control import follow
from foresee_dsl.kernels.pdm.prediction import FRAMES, match, predict
from foresee_dsl.kernels.pdm.proposals import find_leaders, find_offsets, find_passable
from foresee_dsl.kernels.pdm.records import (
    ACTOR,
    EGOS,
    FOES,
    JUNCTIONS,
    PATHS,
    ROLLED,
    ROUTE,
    FloatArray,
    Records,
)
from foresee_dsl.kernels.pdm.right_of_way import find_wall
from foresee_dsl.kernels.pdm.rollout import allowed_speeds, before_wall, proposals, roll
from foresee_dsl.kernels.pdm.scoring import choose, find_conflicts, rate
from foresee_dsl.kernels.pdm.situation import near_foes, place_actors, place_ego
from foresee_dsl.kernels.tracks import TRACKS


@inner
def _best(egos: Records, actors: Records, predicted: Records, route: Records, wall_s: float) -> tuple[float, float]:
    """Roll out and score what is tried, and return offset and acceleration of the best proposal."""
    ego, tried = egos[0], find_offsets(egos, actors, route)
    leaders, count = find_leaders(egos, actors, predicted, tried), proposals(len(tried))
    rolled, offset = np.empty((count, FRAMES), ROLLED), np.empty(count)
    allowed = allowed_speeds(ego, route, before_wall(ego, wall_s))
    acceleration = roll(ego, leaders, tried, allowed, rolled, offset)
    found = find_conflicts(egos, actors, predicted, rolled, offset, route)
    score, collides = np.empty(count), np.empty(count, np.int64)
    rate(ego, route, rolled, found, offset, acceleration, score, collides)
    best = choose(score, collides, rolled)
    return offset[best], acceleration[best]


@compiled(EGOS, TRACKS, ROUTE, TABLE, FOES, PATHS, JUNCTIONS, FLOATS)
def decide(
    egos: Records,
    tracks: Records,
    route: Records,
    coarse: FloatArray,
    foes: Records,
    paths: Records,
    junctions: Records,
    braking: FloatArray,
) -> tuple[float, float, tuple[float, float, float]]:
    """Try the proposals and take the best: the offset to steer for, m, the acceleration, and what `go_on` makes of it.

    Args:
        egos: [1] the ego; its place on the route is filled in. tracks: [A]. route: the route's points.
        coarse: [4, N / COARSE] see `locate`. foes, paths, junctions: of the route. braking: [J] see `find_wall`.
    """
    place_ego(egos, route, coarse)
    actors = np.empty(len(tracks), ACTOR)
    place_actors(egos, tracks, route, actors)
    near = near_foes(egos, foes, junctions)
    matches = match(actors, near, paths)
    predicted = predict(egos, actors, near, paths, matches, route)
    find_passable(egos, actors, route, junctions)
    wall_s = find_wall(egos, actors, near, matches, junctions, braking, route)
    offset, wish = _best(egos, actors, predicted, route, wall_s)
    return offset, wish, follow(egos, route, offset, wish)
