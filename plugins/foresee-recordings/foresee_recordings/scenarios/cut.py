"""The seconds of a recording that a test case contains: its ego, the actors around it, and whether it can be used."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from foresee_dsl.kernels.boxes import box_overlap
from foresee_dsl.simulate.trace import STEP_S
from foresee_recordings.mining.rows import EGO_KINDS
from foresee_recordings.mining.traffic import IntArray, Traffic, X, Y

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


def unusable(traffic: Traffic, cut: Cut) -> str:
    """Return why a part of a recording cannot be a test case; empty if it can.

    The recorded drive itself must be a possible one: its box must not overlap that of another actor, which happens in
    recordings with wrong sizes or positions.
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
        hit = box_overlap(traffic.boxes(traffic.rows(cut.ego, frames)), traffic.boxes(traffic.rows(other, frames)))
        if hit.any():
            at_s = traffic.time_s(int(frames[int(np.argmax(hit))]))
            return (
                f"the recorded boxes of {track.id} and {traffic.tracks[other].id} overlap at {at_s:.2f} s, "
                "so the recorded drive itself would fail"
            )
    return ""


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
