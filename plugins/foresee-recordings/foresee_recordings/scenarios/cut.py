"""The seconds of a recording that a test case contains: its ego, the actors around it, and whether it can be used."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np

from foresee_dsl.compile.bundle import ActorKind
from foresee_dsl.compile.catalogue import CLASS_DEFAULTS
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.kernels.boxes import box_distance, box_overlap
from foresee_dsl.simulate.results.outcome import WHEEL_INSET_M
from foresee_dsl.simulate.trace import STEP_S
from foresee_recordings.mining.rows import EGO_KINDS
from foresee_recordings.mining.traffic import HEADING, IntArray, Traffic, X, Y

TOLERANCE_M = 0.2
"""Distance that the recorded drive must keep from other actors and from the road's edge, m. Ours: a driver that answers
the recorded trajectory is up to 0.2 m beside it (57 test cases of NGSIM's roads)."""
BEYOND_GOAL_M = 5.0
"""Length of road that an ego needs beyond its front at the goal, m. Ours: the way in a quarter of a second at 70 km/h,
in which a run that has arrived ends."""
LEAST_S = 3.0
"""Shortest test case, s. Ours: less than a driver needs to see, decide and brake."""


@dataclass(frozen=True)
class Cut:
    """Seconds of a recording.

    Attributes:
        ego, others: numbers of the actors. begins_s, ends_s: times in the recording. left_out: number of actors that
            are there at these times, but too far away.
    """

    ego: int
    others: tuple[int, ...]
    begins_s: float
    ends_s: float
    left_out: int

    @property
    def lasts_s(self) -> float:
        """The duration, s."""
        return self.ends_s - self.begins_s


def cut_around(traffic: Traffic, ego: int, begins_s: float, ends_s: float, radius_m: float) -> Cut:
    """Return the part of these seconds in which the ego is there, with the actors that come within a radius of it."""
    first = max(traffic.frame_at(begins_s), int(traffic.first[ego]))
    last = min(traffic.frame_at(ends_s), int(traffic.last[ego]))
    others, far = [], 0
    for other in range(len(traffic)):
        begin, end = max(first, int(traffic.first[other])), min(last, int(traffic.last[other]))
        if other == ego or begin > end:
            continue
        away = traffic.part(other, begin, end)[:, [X, Y]] - traffic.part(ego, begin, end)[:, [X, Y]]
        if float((away**2).sum(axis=1).min()) <= radius_m**2:
            others.append(other)
        else:
            far += 1
    return Cut(ego, tuple(others), traffic.time_s(first), traffic.time_s(last), far)


def unusable(traffic: Traffic, cut: Cut, network: RoadNetwork, offset: tuple[float, float]) -> str:
    """Return why a part of a recording cannot be a test case; empty if it can.

    The recorded drive itself must be a possible one: its box must not overlap that of another actor, which happens in
    recordings with wrong sizes or positions, and its wheels must be on the road.

    Args:
        traffic: the recording. cut: the part. network: its roads. offset: from the recording's positions to the
            network's, m.
    """
    track = traffic.tracks[cut.ego]
    if track.kind not in EGO_KINDS:
        return f"{track.id} is a {track.kind}, which a driver cannot drive"
    if cut.lasts_s < LEAST_S - STEP_S / 2:
        return f"{track.id} is in the recording for {max(cut.lasts_s, 0.0):.1f} s of these seconds only"
    for other in cut.others:
        frames = _common(traffic, cut, other)
        if not len(frames):
            continue
        mine, theirs = (traffic.boxes(traffic.rows(actor, frames)) for actor in (cut.ego, other))
        apart = box_distance(mine, theirs)
        k = int(apart.argmin())
        if apart[k] < TOLERANCE_M:
            how = "overlap" if apart[k] <= 0.0 else f"are {apart[k]:.2f} m apart"
            return (
                f"the recorded boxes of {track.id} and {traffic.tracks[other].id} {how} at "
                f"{traffic.time_s(int(frames[k])):.2f} s, so the recorded drive itself would fail"
            )
    return _off_road(traffic, cut, network, offset)


def _off_road(traffic: Traffic, cut: Cut, network: RoadNetwork, offset: tuple[float, float]) -> str:
    """Return when a wheel of the ego leaves the road, as a reason; empty if none does."""
    track, first = traffic.tracks[cut.ego], traffic.frame_at(cut.begins_s)
    states = traffic.part(cut.ego, first, traffic.frame_at(cut.ends_s))
    share = CLASS_DEFAULTS[cast(ActorKind, track.kind)]
    front = track.length_m * (0.5 - share.overhang_share)
    rear = front - track.length_m * share.wheelbase_share
    half = max(track.width_m / 2 - WHEEL_INSET_M + TOLERANCE_M, 0.0)
    cos, sin = np.cos(states[:, HEADING]), np.sin(states[:, HEADING])
    for along in (front, rear):
        for left in (half, -half):
            x = states[:, X] + offset[0] + along * cos - left * sin
            y = states[:, Y] + offset[1] + along * sin + left * cos
            off = np.flatnonzero(network.off_road_depth(np.column_stack([x, y])) > 0.0)
            if len(off):
                at_s = traffic.time_s(first + int(off[0]))
                return f"a wheel of {track.id} leaves the map's road at {at_s:.2f} s, so the recorded drive would fail"
    return ""


def goal_before_the_end(
    traffic: Traffic, cut: Cut, network: RoadNetwork, offset: tuple[float, float]
) -> tuple[float, float] | None:
    """Return a goal for an ego whose track ends where the map's roads end, m in the network's coordinates.

    Recordings often end with the map. With its last recorded place as the goal, a faster ego would drive over the end
    of the road. So the goal is a vehicle's length and some metres before it. None if the road goes on, or the ego
    hardly moves.
    """
    states = traffic.part(cut.ego, traffic.frame_at(cut.begins_s), traffic.frame_at(cut.ends_s))
    last, length_m = states[-1], traffic.tracks[cut.ego].length_m
    ahead = np.array([np.cos(last[HEADING]), np.sin(last[HEADING])]) * (length_m / 2 + BEYOND_GOAL_M)
    if network.off_road_depth((last[[X, Y]] + ahead + offset)[None])[0] <= 0.0:
        return None
    away = np.hypot(*(states[:, [X, Y]] - last[[X, Y]]).T)
    before = np.flatnonzero(away >= length_m + BEYOND_GOAL_M)
    if not len(before):
        return None
    x, y = states[int(before[-1]), [X, Y]].tolist()
    return x + offset[0], y + offset[1]


def overlapping_at_begin(traffic: Traffic, cut: Cut) -> list[tuple[int, int]]:
    """Return the pairs of other actors whose recorded boxes overlap at the beginning."""
    frame = traffic.frame_at(cut.begins_s)
    there = [k for k in cut.others if traffic.first[k] <= frame <= traffic.last[k]]
    if len(there) < 2:
        return []
    boxes = np.vstack([traffic.boxes(traffic.rows(k, np.array([frame]))) for k in there])
    hit = box_overlap(boxes[:, None], boxes[None, :])
    return [(there[i], there[j]) for i, j in zip(*np.nonzero(np.triu(hit, 1)), strict=True)]


def _common(traffic: Traffic, cut: Cut, other: int) -> IntArray:
    first = max(traffic.frame_at(cut.begins_s), int(traffic.first[other]))
    last = min(traffic.frame_at(cut.ends_s), int(traffic.last[other]))
    return np.arange(first, last + 1)
