"""The values of the timeline at each frame: speeds, accelerations, gap, time to collision, mutual visibility."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.kernels.arrays import BoolArray, FloatArray
from foresee_dsl.kernels.boxes import box_distance
from foresee_dsl.language.document import TestCase
from foresee_dsl.simulate.results.criticality import CriticalityMeasure, criticality
from foresee_dsl.simulate.sensing.sight import sight_of
from foresee_dsl.simulate.trace import ACCELERATION, HEADING, SPEED, Trace, X, Y
from foresee_dsl.story.facts import Facts

SIGNAL_SHOWN_M = 60.0
"""A signal farther ahead than this is not shown, m. Ours: at 50 km/h a driver begins to brake at this distance."""
SIGNAL_SHOWN_BEHIND_M = 3.0
"""A signal is shown until the ego's front is this far beyond the stop line, m, because an ego may stop a little beyond
it. Ours."""


@dataclass(frozen=True)
class Measures:
    """Values of the ego and its opponent at each frame, [T]; NaN (or False) if the opponent is absent.

    Attributes:
        time_s: time. ego_mps, other_mps: speeds. ego_mps2, other_mps2: accelerations.
        gap_m: distance between the footprints.
        ttc_s: time to collision along the actors' paths; infinite if they do not meet. ego_sees: whether the opponent
            is in range of the ego's sensors and not hidden. other_sees: whether the ego would be visible to the same
            sensors at the opponent's place.
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
    """Return the values of a run of a compiled test case; `opponent`: id of an actor, "" for none."""
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
        gap_m=box_distance(trace.boxes(0), trace.boxes(k)),
        ttc_s=np.nan_to_num(criticality(trace, k)[CriticalityMeasure.TTC], nan=np.inf),
        ego_sees=_sees(trace, bundle, 0, k),
        other_sees=_sees(trace, bundle, k, 0),
    )


def signal_ahead(trace: Trace, case: TestCase) -> list[str]:
    """Return the colour of the next signal on the ego's route at each frame; "" if none is near."""
    facts = Facts.of(trace, case)
    line, info = facts.bundle.scene.ego.line, trace.actors[0]
    if line is None or not trace.signals:
        return [""] * trace.frames
    signalled = [passage for passage in line.passages if passage.movement.tls is not None]
    colours = []
    for frame, (x, y, heading) in enumerate(trace.states[:, 0][:, [X, Y, HEADING]].tolist()):
        here = line.project(x + info.front_m * math.cos(heading), y + info.front_m * math.sin(heading))[0]
        ahead = (p for p in signalled if -SIGNAL_SHOWN_BEHIND_M <= p.entry_s - here <= SIGNAL_SHOWN_M)
        passage = next(ahead, None)
        colours.append(facts.colour(passage.movement, frame) if passage is not None else "")
    return colours


def _sees(trace: Trace, bundle: SumoBundle, observer: int, target: int) -> BoolArray:
    """Return at which frames sensors on the observer see the target, [T]; both are columns of the trace."""
    others = [k for k in range(len(trace.actors)) if k != observer]
    sight = sight_of(bundle, observer=observer)
    index, visible = others.index(target), np.zeros(trace.frames, np.bool_)
    poses = trace.states[:, :, [X, Y, HEADING]]
    for frame in np.flatnonzero(~np.isnan(poses[:, observer, 0]) & ~np.isnan(poses[:, target, 0])).tolist():
        x, y, heading = poses[frame, observer].tolist()
        visible[frame] = index in sight.seen(x, y, heading, poses[frame, others])
    return visible
