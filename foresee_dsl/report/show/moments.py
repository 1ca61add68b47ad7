"""Chooses the moments of a run for its strip: start, opponent visible, reaction, shortly before contact, contact."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from foresee_dsl.kernels.arrays import BoolArray, FloatArray
from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.report.show.measures import Measures
from foresee_dsl.simulate.trace import STEP_S, Trace

VISIBLY_BRAKES_MPS2 = 2.0
"""The ego counts as braking if it decelerates by more than this for `LASTS_S`, m/s^2. Ours: releasing the accelerator
gives less than 1, comfortable braking 2."""
STARTS_MPS = 0.3
"""An actor that stood has set off when it is faster than this, m/s. Ours: a standing vehicle in SUMO drifts more
slowly."""
LASTS_S = 0.2
"""A braking must last at least this long, s. Ours: shorter ones are noise."""
BEFORE_CONTACT_S = 1.0
"""Time between the last picture before a contact and the contact, s. Ours: the last moment at which a driver could
react."""
APART_S = 0.25
"""Moments that are closer together than this share a picture, s. Ours: at 50 km/h a car moves by less than its
length."""
TEXTS = 2
"""Maximum number of events in the caption of a picture; the most important events are chosen."""
MOST, LEAST = 6, 4
"""Largest and smallest number of pictures in a strip."""
_LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"


@dataclass(frozen=True)
class Snapshot:
    """A moment with a picture: its letter in strip and timeline, its frame, its time, s, and its events in words."""

    letter: str
    frame: int
    time_s: float
    text: str


def snapshots(trace: Trace, measures: Measures, opponent: str, *, most: int = MOST) -> tuple[Snapshot, ...]:
    """Return the most important moments of a run in the order of time, `LEAST` to `most` of them if it is long enough.

    Args:
        trace: the run. measures: its values. opponent: id of the opponent, "" for none. most: maximum number.
    """
    last = trace.frames - 1
    end = _end(trace, measures)
    candidates: list[tuple[int, int, str]] = [
        (0, 0, "start"),
        (0, end, _ending(trace, measures, end)),
    ]  # for each event its rank, frame and text
    if end < last:
        candidates.append((5, last, "end"))
    if (seen := _first(measures.ego_sees, 1)) is not None:
        candidates.append((1, seen, "now seen" if measures.ego_sees[:1].any() else "first seen"))
    if (moves := _begins(measures.other_mps, STARTS_MPS)) is not None:
        candidates.append((3, moves, "sets off"))
    after = _reaction_from(measures, seen, moves)
    if (brakes := _first(_lasting(measures.ego_mps2 < -VISIBLY_BRAKES_MPS2), after, end + 1)) is not None:
        candidates.append((2, brakes, "ego brakes"))
    if (stands := _first(measures.ego_mps < STANDS_MPS, 1)) is not None and measures.ego_mps[0] >= STANDS_MPS:
        candidates.append((4, stands, "ego stands"))
    near = end - round(BEFORE_CONTACT_S / STEP_S)
    if opponent and near > 0:
        candidates.append((2, near, f"{BEFORE_CONTACT_S:g} s before"))
    return _numbered(trace, _filled(_spaced(candidates, most), end))


def _end(trace: Trace, measures: Measures) -> int:
    """Return the last frame of the run; if the run passed, the frame of the smallest gap."""
    gaps = measures.gap_m
    if trace.meta.get("verdict") != "pass" or not np.isfinite(gaps).any():
        return trace.frames - 1
    return int(np.nanargmin(gaps))


def _ending(trace: Trace, measures: Measures, end: int) -> str:
    hit = next((event.what for event in reversed(trace.events) if event.what in ("collision", "off_road")), "")
    if hit:
        return "contact" if hit == "collision" else "off the road"
    return "nearest" if np.isfinite(measures.gap_m[end]) else "end"


def _reaction_from(measures: Measures, *events: int | None) -> int:
    """Return the first frame at which braking may be a reaction: when the opponent becomes visible or sets off."""
    frames = [frame for frame in events if frame is not None]
    return min(frames) if frames and not measures.ego_sees[:1].any() else 1


def _first(holds: BoolArray, start: int, stop: int | None = None) -> int | None:
    """Return the first frame in `start` to `stop` at which a condition begins to hold; None without one."""
    rising = np.flatnonzero(holds[1:] & ~holds[:-1]) + 1 if len(holds) > 1 else np.empty(0, np.intp)
    within = rising[(rising >= start) & (rising < (len(holds) if stop is None else stop))]
    return int(within[0]) if within.size else None


def _lasting(holds: BoolArray) -> BoolArray:
    """Return the frames from which a condition holds for at least `LASTS_S`."""
    count = round(LASTS_S / STEP_S)
    lasting = holds.copy()
    for shift in range(1, count):
        lasting[: len(holds) - shift] &= holds[shift:]
        lasting[len(holds) - shift :] = False
    return lasting


def _begins(speeds: FloatArray, least: float) -> int | None:
    """Return the frame at which an actor that stands at the start sets off; None if it does not."""
    if not len(speeds) or not speeds[0] < STANDS_MPS:
        return None
    return _first(speeds > least, 1)


def _spaced(candidates: list[tuple[int, int, str]], most: int) -> list[tuple[int, str]]:
    """Return the most important moments.

    The words of a moment that is close to a more important one are added to that one.
    """
    moments: dict[int, list[str]] = {}
    for _, frame, text in sorted(candidates, key=lambda candidate: candidate[0]):
        near = next((other for other in moments if abs(other - frame) * STEP_S < APART_S), None)
        if near is not None:
            moments[near] = [*moments[near], text][:TEXTS]
        elif len(moments) < most:
            moments[frame] = [text]
    return sorted((frame, ", ".join(texts)) for frame, texts in moments.items())


def _filled(moments: list[tuple[int, str]], end: int) -> list[tuple[int, str]]:
    """Return at least `LEAST` moments: the middle of the longest interval before the contact is added as often as
    needed.
    """
    while len(moments) < LEAST:
        before = [frame for frame, _ in moments if frame <= end]
        pauses = [(b - a, (a + b) // 2) for a, b in pairwise(before)]
        pause, middle = max(pauses, default=(0, 0))
        if pause * STEP_S < 2 * APART_S:
            break
        moments = sorted([*moments, (middle, "")])
    return moments


def _numbered(trace: Trace, moments: list[tuple[int, str]]) -> tuple[Snapshot, ...]:
    return tuple(
        Snapshot(_LETTERS[k % len(_LETTERS)], frame, float(trace.time_s[frame]), text)
        for k, (frame, text) in enumerate(moments)
    )
