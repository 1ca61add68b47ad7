"""What the timeline shows: speeds, accelerations, the gap, the time to collision and who sees whom, frame by frame."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.compile.bundle import ModelSpec, SumoBundle
from foresee_dsl.kernels.boxes import pairwise_box_distance
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.simulate.results.near_misses import times_to_collision
from foresee_dsl.simulate.sensing.settings import STANDARD
from foresee_dsl.simulate.sensing.sight import Bodies, Sight
from foresee_dsl.simulate.sensing.weather import Air
from foresee_dsl.simulate.trace import ACCELERATION, HEADING, SPEED, Trace, X, Y
from foresee_dsl.story.facts import Facts

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


SIGNAL_AHEAD_M = 60.0
"""A signal farther ahead is not shown. Ours: from 50 km/h one brakes for it from here on."""
SIGNAL_BEHIND_M = 3.0
"""An ego that stands a little over the line still waits for it."""


@dataclass(frozen=True)
class Measures:
    """The ego and its opponent, a value a frame; NaN (or False) where the opponent is absent, or there is none.

    Attributes:
        time_s: [T]. ego_mps, other_mps: speeds. ego_mps2, other_mps2: accelerations.
        gap_m: between the footprints. ttc_s: time to collision along the paths, infinite where none lies ahead.
        ego_sees: the opponent is in range of the ego's sensors, and nothing hides it.
        other_sees: the same for somebody with the ego's sensors in the opponent's place.
    """

    time_s: FloatArray
    ego_mps: FloatArray
    other_mps: FloatArray
    ego_mps2: FloatArray
    other_mps2: FloatArray
    gap_m: FloatArray
    ttc_s: FloatArray
    ego_sees: BoolArray
    other_sees: BoolArray


def measure(trace: Trace, bundle: SumoBundle, opponent: str) -> Measures:
    """Return what happened between the ego and an opponent ("": nobody) in a run of a compiled test case."""
    states = trace.states
    ego = trace.time_s, states[:, 0, SPEED], states[:, 0, ACCELERATION]
    if not opponent:
        nan, never = np.full(trace.frames, np.nan), np.zeros(trace.frames, np.bool_)
        return Measures(ego[0], ego[1], nan, ego[2], nan, nan, nan, never, never)
    k = trace.index(opponent)
    return Measures(
        time_s=ego[0],
        ego_mps=ego[1],
        other_mps=states[:, k, SPEED],
        ego_mps2=ego[2],
        other_mps2=states[:, k, ACCELERATION],
        gap_m=pairwise_box_distance(trace.boxes(0), trace.boxes(k)),
        ttc_s=times_to_collision(trace, k),
        ego_sees=_sees(trace, bundle, 0, k),
        other_sees=_sees(trace, bundle, k, 0),
    )


def signal_ahead(trace: Trace, case: TestCase) -> list[str]:
    """Return for each frame what the next signal on the ego's way shows (`red`, `amber`, `green`), "" for none near."""
    facts = Facts.of(trace, case)
    line, info = facts.bundle.scene.ego.line, trace.actors[0]
    if line is None or not trace.signals:
        return [""] * trace.frames
    signalled = [passage for passage in line.passages if passage.movement.tls is not None]
    found = []
    for frame, (x, y, heading) in enumerate(trace.states[:, 0][:, [X, Y, HEADING]].tolist()):
        here = line.project(x + info.front_m * math.cos(heading), y + info.front_m * math.sin(heading))[0]
        ahead = (p for p in signalled if -SIGNAL_BEHIND_M <= p.entry_s - here <= SIGNAL_AHEAD_M)
        passage = next(ahead, None)
        found.append(facts.colour(passage.movement, frame) if passage is not None else "")
    return found


def _sees(trace: Trace, bundle: SumoBundle, observer: int, seen: int) -> BoolArray:
    """Return at which frames a sensor on an actor has another one in sight."""
    others = [k for k in range(len(trace.actors)) if k != observer]
    sight = Sight(
        Bodies.of(_models(bundle, trace, others)),
        bundle.network.buildings,
        STANDARD,
        Air(bundle.scene.rain, bundle.scene.fog, bundle.scene.sun),
    )
    wanted, found = others.index(seen), np.zeros(trace.frames, np.bool_)
    poses = trace.states[:, :, [X, Y, HEADING]]
    for frame in np.flatnonzero(~np.isnan(poses[:, observer, 0]) & ~np.isnan(poses[:, seen, 0])).tolist():
        x, y, heading = poses[frame, observer].tolist()
        found[frame] = wanted in sight.seen(x, y, heading, poses[frame, others])
    return found


def _models(bundle: SumoBundle, trace: Trace, columns: Sequence[int]) -> list[ModelSpec]:
    by_id = {actor.id: actor.model for actor in bundle.scene.actors}
    return [by_id[trace.actors[k].id] for k in columns]
