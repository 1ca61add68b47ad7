"""From which moment a mutant's run differs from its clip's: which actor, and how much."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from foresee_dsl.simulate.trace import HEADING, SPEED, Trace, X, Y

DIFFERS_M, DIFFERS_MPS, DIFFERS_RAD = 0.05, 0.05, 0.01
"""What is less is the same for people. Ours: a twentieth of a metre in a picture is under a pixel."""
VISIBLE_M = 0.3
"""Ours: in a window of 16 m it is a dot of a panel in characters."""
_MOST = 6
"""Actors that are named. Ours: more are background."""


@dataclass(frozen=True)
class Departure:
    """When an actor is first somewhere else (or faster, or turned) than in the parent's run.

    Attributes:
        actor: the id. time_s: when. largest_m, largest_at_s: the largest distance between both while both runs go on.
        how: in words: what differs first. model: the models' names where these differ, else "".
    """

    actor: str
    time_s: float
    largest_m: float
    largest_at_s: float
    how: str
    model: str = ""


def departures(parent: Trace, child: Trace) -> tuple[Departure, ...]:
    """Return the actors that go other ways in the child's run, the first to do so first."""
    frames = min(parent.frames, child.frames)
    columns = {info.id: k for k, info in enumerate(parent.actors)}
    found = []
    for k, info in enumerate(child.actors):
        if info.id not in columns:
            found.append(Departure(info.id, 0.0, 0.0, 0.0, "is only in this run"))
            continue
        column = columns[info.id]
        model = parent.actors[column].model
        one = _departure(parent, child, column, k, frames)
        if model != info.model:
            how, largest, at = ("", 0.0, 0.0) if one is None else (one.how, one.largest_m, one.largest_at_s)
            one = Departure(info.id, 0.0, largest, at, how, f"{model} => {info.model}")
        if one is not None:
            found.append(one)
    gone = columns.keys() - {info.id for info in child.actors}
    found += [Departure(name, 0.0, 0.0, 0.0, "is not in this run") for name in sorted(gone)]
    return tuple(sorted(found, key=lambda one: (one.time_s, one.actor != "ego", one.actor)))


def parts_from(parent: Trace, child: Trace) -> float:
    """Return from when on two pictures of both runs differ: somebody is `VISIBLE_M` away; infinite for never, s."""
    frames = min(parent.frames, child.frames)
    ids = {info.id: k for k, info in enumerate(parent.actors)}
    pairs = [(ids[info.id], k) for k, info in enumerate(child.actors) if info.id in ids]
    was, now = (trace.states[:frames][:, list(columns), :2]
                for trace, columns in zip((parent, child), zip(*pairs, strict=True), strict=True))  # fmt: skip
    far = np.hypot(*np.moveaxis(now - was, 2, 0))
    apart = ((far > VISIBLE_M) | (np.isnan(was[..., X]) != np.isnan(now[..., X]))).any(axis=1)
    if not apart.any():
        return math.inf if parent.frames >= child.frames else float(child.time_s[frames])
    return float(child.time_s[int(apart.argmax())])


def _departure(parent: Trace, child: Trace, a: int, b: int, frames: int) -> Departure | None:
    was, now = parent.states[:frames, a], child.states[:frames, b]
    gone = np.isnan(was[:, X]) != np.isnan(now[:, X])
    far = np.nan_to_num(np.hypot(now[:, X] - was[:, X], now[:, Y] - was[:, Y]))
    faster = np.nan_to_num(now[:, SPEED] - was[:, SPEED])
    turned = np.nan_to_num(np.abs((now[:, HEADING] - was[:, HEADING] + np.pi) % (2 * np.pi) - np.pi))
    differs = gone | (far > DIFFERS_M) | (np.abs(faster) > DIFFERS_MPS) | (turned > DIFFERS_RAD)
    if not differs.any():
        return None
    first, largest = int(differs.argmax()), int(far.argmax())
    if gone[first]:
        how = "is gone" if np.isnan(now[first, X]) else "is still there"
    elif abs(faster[first]) > DIFFERS_MPS:
        how = f"is {abs(float(faster[first])):.1f} m/s {'faster' if faster[first] > 0 else 'slower'}"
    elif far[first] > DIFFERS_M:
        how = f"is {float(far[first]):.2f} m elsewhere"
    else:
        how = f"is turned by {np.degrees(float(turned[first])):.1f} deg"
    name = child.actors[b].id
    return Departure(name, float(child.time_s[first]), float(far[largest]), float(child.time_s[largest]), how)


def in_words(found: Sequence[Departure]) -> tuple[str, ...]:
    """Return a sentence an actor: who departs first, then the others in the order in which they do."""
    lines = []
    for one in found[:_MOST]:
        model = f"is another model ({one.model})" if one.model else ""
        how = ", and ".join(part for part in (model, one.how) if part)
        grows = f", up to {one.largest_m:.1f} m away at {one.largest_at_s:.2f} s" if one.largest_m > DIFFERS_M else ""
        lines.append(f"from {one.time_s:.2f} s {one.actor} {how}{grows}")
    if len(found) > _MOST:
        lines.append(f"and {len(found) - _MOST} more")
    return tuple(lines) or ("nobody moves in another way: both runs are the same",)
