"""Compares decisions of `pdm` with a plain way to the same answer, in random scenes; run it without compiled kernels.

The plain way integrates each proposal on its own, rolls all of them out, and compares each with all actors.
`NUMBA_DISABLE_JIT=1 python -m tests.support.plain_pdm SCENES` prints what happened in the scenes as JSON.
"""

from __future__ import annotations

import json
import math
import sys
from typing import NamedTuple

import numpy as np

from foresee_dsl.drivers.pdm.route import build_route
from foresee_dsl.drivers.pdm.situation import read_situation
from foresee_dsl.drivers.protocol import EgoState, FloatArray, JunctionPassage, Observation, SeenActor
from foresee_dsl.drivers.tracking import Tracker
from foresee_dsl.kernels.arrays import Records
from foresee_dsl.kernels.pdm import proposals, scoring
from foresee_dsl.kernels.pdm import settings as cfg
from foresee_dsl.kernels.pdm.decision import decide
from foresee_dsl.kernels.pdm.prediction import FRAMES, TIMES_S, match, predict
from foresee_dsl.kernels.pdm.records import LEADER, PROPOSAL_RESULT, ROLLED
from foresee_dsl.kernels.pdm.right_of_way import find_wall
from foresee_dsl.kernels.pdm.route import near_foes
from tests.support.driving import SEDAN, crossing_foe, line, mission

POINTS = line((95, math.inf), (4 * math.pi, 8), (60, math.inf))
FOES = tuple(
    crossing_foe(POINTS, line((120, math.inf), start=start), entry_s=60, has_priority=has_priority)
    for start, has_priority in (((173, 3.5, math.pi), True), ((97, -60, math.pi / 2), False))
)
TASK = mission(POINTS, left_m=3.0, right_m=5.0, junctions=[JunctionPassage("j", 90.0, 112.0, "left", None, FOES)])
ROUTE = build_route(TASK, SEDAN)
HELD = 2
"""Number of frames between two accelerations of a roll-out."""


class Choice(NamedTuple):
    """The chosen offset, m, and acceleration, m/s^2; the index of the proposal, and whether any proposal is allowed."""

    offset_m: float
    acceleration_mps2: float
    proposal: int
    allowed: bool


def random_scene(rng: np.random.Generator) -> Observation:
    """Return an observation of a few actors around the ego, of all kinds, some of them in its way."""
    x = rng.uniform(20, 88)
    speed = rng.choice([0.0, rng.uniform(0.5, 16)])
    ego = EgoState(x, rng.normal(0, 0.4), rng.normal(0, 0.05), speed, rng.uniform(-3, 2), 0.0, 0.0)
    actors = []
    for k in range(rng.integers(0, 7)):
        kind = str(rng.choice(["car", "car", "truck", "bicycle", "pedestrian", "obstacle"]))
        place = x + rng.uniform(-20, 45), rng.normal(0, 4)
        heading, pace = rng.choice([0.0, rng.uniform(-4, 4)]), rng.choice([0.0, rng.uniform(0, 15)])
        actors.append(SeenActor(k, kind, *place, heading, pace, rng.uniform(0.5, 8), rng.uniform(0.5, 2.5)))  # type: ignore[arg-type]
    return Observation(0.0, ego, tuple(actors), {})


def leaders_of(egos: Records, actors: Records, predicted: Records, offset: float) -> Records:
    """Return the leader in every `HELD`th frame at an offset, [K], in operations of numpy."""
    frames = predicted[:, ::HELD]
    leaders = np.zeros(len(TIMES_S[::HELD]), LEADER)
    leaders["s"] = proposals.FAR_M
    if not len(actors):
        return leaders
    rear, side = frames["s"] - frames["reach_s"], egos[0]["width"] / 2 + cfg.CORRIDOR_MARGIN_M
    ahead = (rear > egos[0]["s"] + egos[0]["front"] - 1.0) & (np.abs(frames["d"] - offset) < frames["reach_d"] + side)
    farther = np.where(actors["passable"], cfg.PASSABLE_GAP_M - cfg.MINIMUM_GAP_M, 0.0)
    s = np.where(ahead, rear - farther[:, None], proposals.FAR_M)
    nearest, each = s.argmin(axis=0), np.arange(s.shape[1])
    leaders["s"], leaders["speed"] = s[nearest, each], np.maximum(frames["speed_s"][nearest, each], 0.0)
    return leaders


def wishes_of(egos: Records, offsets: FloatArray) -> list[tuple[float, int, float, float]]:
    """Return each proposal: the offset to head for, the index of the offset with its leaders, the share of the speed,
    and the largest acceleration.
    """
    ego, here = egos[0], int(np.abs(offsets - egos[0]["d"]).argmin())
    driving = [(float(offset), o, share, math.inf) for o, offset in enumerate(offsets) for share in cfg.SPEED_SHARES]
    hardest = -float(ego["strongest"])
    braking = [(d, o, 1.0, a) for d, o in ((float(ego["d"]), here), (float(offsets[0]), 0))
               for a in (-cfg.BRAKING_MPS2, hardest)]  # fmt: skip
    return driving + braking


def plain_choice(observation: Observation) -> Choice:
    """Return the choice from all proposals, none of which is left out or shares anything with others."""
    situation, points = read_situation(ROUTE, SEDAN, observation), ROUTE.points
    egos, actors, ego = situation.egos, situation.actors, situation.egos[0]
    near = near_foes(egos, ROUTE.foes, ROUTE.junctions)
    matches = match(actors, near, ROUTE.paths)
    predicted = predict(egos, actors, near, ROUTE.paths, matches, points)
    proposals.find_passable(egos, actors, points, ROUTE.junctions)
    wall_s = find_wall(egos, actors, near, matches, ROUTE.junctions, np.array([-1.0]), points)
    offsets, allowed = proposals.find_offsets(egos, actors, points), proposals.allowed_speeds(ego, points, wall_s)
    leaders = np.stack([leaders_of(egos, actors, predicted, offset) for offset in offsets])
    wishes = wishes_of(egos, offsets)
    moves = [
        proposals._integrate(ego, np.array([[share], [most]]), np.array([o]), leaders, allowed)
        for _, o, share, most in wishes
    ]
    s, speed, first = (np.concatenate(values) for values in zip(*moves, strict=True))
    motions = proposals.Motions(np.array([wish[0] for wish in wishes]), np.arange(len(wishes)), s, speed, first)
    rolled, assessments = np.empty((len(wishes), FRAMES), ROLLED), np.zeros(len(wishes), PROPOSAL_RESULT)
    for p in range(len(wishes)):
        proposals.roll(ego, motions, p, rolled[p])
        proposals.place_footprints(ego, points, rolled[p])
    marks = scoring.conflicts(egos, actors, predicted, rolled, motions.heads_for)
    hits = np.concatenate([marks["hit"], np.ones((len(wishes), 1), bool)], axis=1)
    assessments["done"], assessments["collides"] = True, hits.argmax(axis=1)
    assessments["close"], assessments["touches"] = marks["close"].sum(axis=1), marks["ttc"].any(axis=1)
    for p in range(len(wishes)):
        brakes = p >= len(wishes) - proposals.BRAKING
        within = brakes or scoring._keeps_lanes(rolled[p], points, ego["width"] / 2)
        assessments[p]["allowed"] = assessments[p]["collides"] == FRAMES and within
    best = (
        _of_allowed(ego, motions, assessments)
        if assessments["allowed"].any()
        else _of_none(rolled, assessments["collides"])
    )
    return Choice(float(motions.heads_for[best]), float(first[best]), best, bool(assessments["allowed"].any()))


def _of_allowed(ego: np.void, motions: proposals.Motions, assessments: Records) -> int:
    progress = [proposals.progress_of(ego, motions, p) for p in range(len(assessments))]
    most_m = max(way for way, allowed in zip(progress, assessments["allowed"], strict=True) if allowed)
    return int(np.argmax([scoring._points(ego, motions, p, most_m, assessments[p]) for p in range(len(assessments))]))


def _of_none(rolled: Records, collides: FloatArray) -> int:
    impact = rolled["speed"][np.arange(len(rolled)), np.minimum(collides, FRAMES - 1)]
    if collides.max() < FRAMES and TIMES_S[collides.max()] < cfg.EMERGENCY_S:
        return min(range(len(rolled)), key=lambda p: (impact[p], -collides[p], p))
    return min(range(len(rolled)), key=lambda p: (-collides[p], impact[p], p))


def main(scenes: int) -> dict[str, int]:
    """Compare both ways in random scenes; return the numbers of scenes, of those whose best proposal is not the first
    one, of those in which none is allowed, and of proposals that the fast way rolled out.
    """
    rng, rolled_out, assess = np.random.default_rng(8), [], scoring._assess
    counts = {"scenes": scenes, "not_first": 0, "none_allowed": 0, "rolled_out": 0}

    def counting(*arguments: object) -> None:
        rolled_out.append(1)
        assess(*arguments)  # type: ignore[arg-type]

    scoring._assess = counting
    for number in range(scenes):
        observation = random_scene(rng)
        egos = read_situation(ROUTE, SEDAN, observation).egos
        tracks = Tracker().update(observation)
        road = ROUTE.points, ROUTE.coarse, ROUTE.foes, ROUTE.paths, ROUTE.junctions
        offset, acceleration, _ = decide(egos, tracks.table, *road, np.array([-1.0]), np.empty((0, 0, 4)))
        plain = plain_choice(observation)
        assert (offset, acceleration) == plain[:2], f"scene {number}: {offset, acceleration} instead of {plain}"
        counts["not_first"] += plain.proposal > 0
        counts["none_allowed"] += not plain.allowed
    counts["rolled_out"] = len(rolled_out)
    return counts


if __name__ == "__main__":
    sys.stdout.write(json.dumps(main(int(sys.argv[1]))))
