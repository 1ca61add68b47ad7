"""Which moments of a run are worth a picture: start, opponent seen, reaction, near contact, contact."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from foresee_dsl.report.show.measures import BoolArray, FloatArray, Measures
from foresee_dsl.simulate.trace import STEP_S, Trace

BRAKES_MPS2 = 2.0
"""The ego brakes: more than this for `LASTS_S`. Ours: lifting the foot is under 1 m/s^2, comfortable braking 2."""
STARTS_MPS = 0.3
"""Somebody who stood walks or drives. Ours: over the drift of a standing vehicle in SUMO."""
STANDS_MPS = 0.1
"""SUMO's threshold of halting."""
LASTS_S = 0.2
"""Ours: what is shorter is noise."""
BEFORE_CONTACT_S = 1.0
"""How long before a contact it is called near. Ours: the last moment at which a driver still could react."""
APART_S = 0.25
"""Moments that are nearer share one picture. Ours: at 50 km/h that is less than a car's length."""
TEXTS = 2
"""What a picture's caption names at most: the most important ones."""
MOST, LEAST = 6, 4
"""Pictures of a strip."""
_LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"


@dataclass(frozen=True)
class Snapshot:
    """A moment that gets a picture: its letter in the strip and in the timeline, its frame, and what happens."""

    letter: str
    frame: int
    time_s: float
    text: str


def snapshots(trace: Trace, found: Measures, opponent: str, *, most: int = MOST) -> tuple[Snapshot, ...]:
    """Return the moments of a run that are most worth a picture, in the order of time; at least `LEAST`.

    Args:
        trace: the run. found: what was measured of it. opponent: its id, "" for none. most: how many at most.
    """
    last = trace.frames - 1
    end = _end(trace, found)
    wanted: list[tuple[int, int, str]] = [(0, 0, "start"), (0, end, _ending(trace, found, end))]  # rank, frame, text
    if end < last:
        wanted.append((5, last, "end"))
    if (seen := _first(found.ego_sees, 1)) is not None:
        wanted.append((1, seen, "now seen" if found.ego_sees[:1].any() else "first seen"))
    if (moves := _begins(found.other_mps, STARTS_MPS)) is not None:
        wanted.append((3, moves, "sets off"))
    after = _reaction_from(found, seen, moves)
    if (brakes := _first(_lasting(found.ego_mps2 < -BRAKES_MPS2), after, end + 1)) is not None:
        wanted.append((2, brakes, "ego brakes"))
    if (stands := _first(found.ego_mps < STANDS_MPS, 1)) is not None and found.ego_mps[0] >= STANDS_MPS:
        wanted.append((4, stands, "ego stands"))
    near = end - round(BEFORE_CONTACT_S / STEP_S)
    if opponent and near > 0:
        wanted.append((2, near, f"{BEFORE_CONTACT_S:g} s before"))
    return _numbered(trace, _filled(_spaced(wanted, most), end))


def _end(trace: Trace, found: Measures) -> int:
    """Return the frame of the contact, or of the smallest gap."""
    gaps = found.gap_m
    if trace.meta.get("verdict") != "pass" or not np.isfinite(gaps).any():
        return trace.frames - 1
    return int(np.nanargmin(gaps))


def _ending(trace: Trace, found: Measures, end: int) -> str:
    hit = next((event.what for event in reversed(trace.events) if event.what in ("collision", "off_road")), "")
    if hit:
        return "contact" if hit == "collision" else "off the road"
    return "nearest" if np.isfinite(found.gap_m[end]) else "end"


def _reaction_from(found: Measures, *events: int | None) -> int:
    """Return the frame from which braking is a reaction: when the opponent is in sight, or sets off in sight."""
    known = [frame for frame in events if frame is not None]
    return min(known) if known and not found.ego_sees[:1].any() else 1


def _first(holds: BoolArray, start: int, stop: int | None = None) -> int | None:
    """Return the first frame from `start` on at which something holds that did not hold before it."""
    rising = np.flatnonzero(holds[1:] & ~holds[:-1]) + 1 if len(holds) > 1 else np.empty(0, np.intp)
    within = rising[(rising >= start) & (rising < (len(holds) if stop is None else stop))]
    return int(within[0]) if within.size else None


def _lasting(holds: BoolArray) -> BoolArray:
    """Return where something holds that goes on for `LASTS_S`."""
    count = round(LASTS_S / STEP_S)
    found = holds.copy()
    for shift in range(1, count):
        found[: len(holds) - shift] &= holds[shift:]
        found[len(holds) - shift :] = False
    return found


def _begins(speeds: FloatArray, least: float) -> int | None:
    """Return the frame at which somebody who stood at first moves."""
    if not len(speeds) or not speeds[0] < STANDS_MPS:
        return None
    return _first(speeds > least, 1)


def _spaced(wanted: list[tuple[int, int, str]], most: int) -> list[tuple[int, str]]:
    """Return the most important ones, none too near to a more important one; its words are added to that."""
    kept: dict[int, list[str]] = {}
    for _, frame, text in sorted(wanted, key=lambda one: one[0]):
        near = next((other for other in kept if abs(other - frame) * STEP_S < APART_S), None)
        if near is not None:
            kept[near] = [*kept[near], text][:TEXTS]
        elif len(kept) < most:
            kept[frame] = [text]
    return sorted((frame, ", ".join(texts)) for frame, texts in kept.items())


def _filled(found: list[tuple[int, str]], end: int) -> list[tuple[int, str]]:
    """Return at least `LEAST` moments: the middle of the longest pause until the contact is added."""
    while len(found) < LEAST:
        before = [frame for frame, _ in found if frame <= end]
        pauses = [(b - a, (a + b) // 2) for a, b in pairwise(before)]
        pause, middle = max(pauses, default=(0, 0))
        if pause * STEP_S < 2 * APART_S:
            break
        found = sorted([*found, (middle, "")])
    return found


def _numbered(trace: Trace, found: list[tuple[int, str]]) -> tuple[Snapshot, ...]:
    return tuple(
        Snapshot(_LETTERS[k % len(_LETTERS)], frame, float(trace.time_s[frame]), text)
        for k, (frame, text) in enumerate(found)
    )
