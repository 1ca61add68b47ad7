"""Makes one decision of the driver `pdm`, from tracks to the pedals, in one call; and the control between decisions."""

from __future__ import annotations

import math

import numpy as np

from foresee_dsl.kernels.arrays import FloatArray, Records
from foresee_dsl.kernels.compiling import CUBE, FLOAT, FLOATS, TABLE, compiled, inner
from foresee_dsl.kernels.pdm import proposals
from foresee_dsl.kernels.pdm import records as r
from foresee_dsl.kernels.pdm import settings as cfg
from foresee_dsl.kernels.pdm.prediction import know, match, predict
from foresee_dsl.kernels.pdm.records import ACTOR
from foresee_dsl.kernels.pdm.right_of_way import find_wall
from foresee_dsl.kernels.pdm.route import curvature_at, near_foes, place_actors, place_ego
from foresee_dsl.kernels.pdm.scoring import best_proposal, others_near
from foresee_dsl.kernels.tracks import TRACKS


@compiled(r.EGOS, r.ROUTE, FLOAT)
def steer(egos: Records, route: Records, offset: float) -> float:
    """Return the front-wheel angle, rad, that makes the lateral error decay over the distance driven, critically
    damped.

    In the route's coordinates, d'' = -2 d' / l - (d - offset) / l^2 with l from `decay_length`; the curvature of the
    route is fed forward. In bends the rear axle is kept inside the line by the distance that the car's centre is
    outside.
    """
    ego = egos[0]
    speed, s = ego["forward"], ego["s"]
    bend = curvature_at(route, s + speed * cfg.CURVATURE_PREVIEW_S)
    inwards = curvature_at(route, s) * ego["centre"] ** 2 / 2
    error = ego["d"] - offset - inwards
    length = proposals.decay_length(speed, error, ego["sharpest"])
    slope = math.tan(max(-1.0, min(1.0, ego["heading_error"])))
    curvature = bend - error / length**2 - 2.0 * slope / length
    grip = ego["grip"] / max(speed, 1.0) ** 2
    curvature = max(-grip, min(grip, curvature))
    angle = math.atan(ego["wheelbase"] * curvature)
    return float(max(-ego["steer_max"], min(ego["steer_max"], angle)))


@compiled(r.EGOS, FLOAT, FLOAT)
def pedals(egos: Records, angle: float, acceleration: float) -> tuple[float, float, float]:
    """Return steering, throttle and brake, as shares of their maximum, for a wheel angle and an acceleration.

    The brake holds a standing car that should not accelerate.
    """
    ego = egos[0]
    steering_share = angle / ego["steer_max"]
    if ego["speed"] < cfg.COAST_MPS and acceleration <= 0.0:
        return steering_share, 0.0, cfg.HOLD_BRAKE
    if acceleration >= 0.0:
        return steering_share, min(acceleration / ego["motor"], 1.0), 0.0
    return steering_share, 0.0, min(-acceleration / ego["brakes"], 1.0)


@inner
def _follow(egos: Records, route: Records, offset: float, acceleration: float) -> tuple[float, float, float]:
    """Return steering, throttle and brake for an offset (m) and an acceleration.

    Except for hard braking, the acceleration is kept near the current one; together with the lag of the drivetrain this
    limits the jerk.
    """
    ego = egos[0]
    if acceleration >= -cfg.BRAKING_MPS2:
        now = ego["acceleration"] if ego["speed"] > cfg.COAST_MPS else 0.0
        acceleration = float(max(now - cfg.SMOOTHING_MPS2, min(now + cfg.SMOOTHING_MPS2, acceleration)))
    return pedals(egos, steer(egos, route, offset), acceleration)


@compiled(r.EGOS, r.ROUTE, TABLE, FLOAT, FLOAT)
def hold(
    egos: Records, route: Records, coarse: FloatArray, offset: float, acceleration: float
) -> tuple[float, float, float]:
    """Return steering, throttle and brake that continue an earlier decision; fills in the ego's position."""
    place_ego(egos, route, coarse)
    return _follow(egos, route, offset, acceleration)


@inner
def choose(
    egos: Records,
    tracks: Records,
    route: Records,
    foes: Records,
    paths: Records,
    junctions: Records,
    braking: FloatArray,
    futures: FloatArray,
) -> tuple[proposals.Motions, int, float]:
    """Return the proposals, the index of the best one, and the length along the route that the front bumper may not
    pass; arguments as for `decide`. The ego's position must be filled in before.
    """
    ego, actors = egos[0], np.empty(len(tracks), ACTOR)
    place_actors(egos, tracks, route, actors)
    near = near_foes(egos, foes, junctions)
    matches = match(actors, near, paths)
    predicted = predict(egos, actors, near, paths, matches, route)
    if len(futures) > 0:
        know(egos, actors, futures, route, predicted)
    proposals.find_passable(egos, actors, route, junctions)
    wall_s = find_wall(egos, actors, near, matches, junctions, braking, route)
    offsets, allowed = proposals.find_offsets(egos, actors, route), proposals.allowed_speeds(ego, route, wall_s)
    motions = proposals.find_motions(ego, actors, predicted, offsets, allowed)
    return motions, best_proposal(ego, route, others_near(ego, actors, predicted, motions), motions), wall_s


@compiled(r.EGOS, TRACKS, r.ROUTE, TABLE, r.FOES, r.PATHS, r.JUNCTIONS, FLOATS, CUBE)
def decide(
    egos: Records,
    tracks: Records,
    route: Records,
    coarse: FloatArray,
    foes: Records,
    paths: Records,
    junctions: Records,
    braking: FloatArray,
    futures: FloatArray,
) -> tuple[float, float, tuple[float, float, float]]:
    """Choose the best proposal: its offset, m, its acceleration, and steering, throttle and brake for them.

    Fills in the ego's position on the route. `coarse`: see `locate`; `braking`: see `find_wall`; `futures`: see `know`;
    an array without actors means the driver's own prediction.
    """
    place_ego(egos, route, coarse)
    motions, best, _ = choose(egos, tracks, route, foes, paths, junctions, braking, futures)
    offset, acceleration = motions.heads_for[best], motions.acceleration[motions.of[best]]
    return offset, acceleration, _follow(egos, route, offset, acceleration)
