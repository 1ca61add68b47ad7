"""Compares a mutant's run with its clip's: which actors differ, from when on, and by how much."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from foresee_dsl.simulate.trace import HEADING, SPEED, Trace, X, Y

DIFFERS_M, DIFFERS_MPS, DIFFERS_RAD = 0.05, 0.05, 0.01
"""Smaller differences in place (m), speed (m/s) and heading (rad) are ignored. Ours: 0.05 m in a picture is less than a
pixel."""
VISIBLE_M = 0.3
"""Distance from which on two panels differ visibly, m. Ours: one dot of a panel in characters, at 16 m a side."""
_MOST = 6
"""Maximum number of actors that are named. Ours: the others are background."""


@dataclass(frozen=True)
class Departure:
    """The first deviation of an actor from the parent's run.

    Attributes:
        actor: id of the actor. time_s: time of the first deviation, s. how: that deviation in words.
        largest_m, largest_at_s: largest distance between both runs, m, and its time, s, while both last.
        model: the names of both models; "" if they are the same.
    """

    actor: str
    time_s: float
    largest_m: float
    largest_at_s: float
    how: str
    model: str = ""


def departures(parent: Trace, child: Trace) -> tuple[Departure, ...]:
    """Return the actors that move differently in the child's run, in the order in which they begin to."""
    frames = min(parent.frames, child.frames)
    columns = {info.id: k for k, info in enumerate(parent.actors)}
    listed = []
    for k, info in enumerate(child.actors):
        if info.id not in columns:
            listed.append(Departure(info.id, 0.0, 0.0, 0.0, "is only in this run"))
            continue
        column = columns[info.id]
        model = parent.actors[column].model
        departure = _departure(parent, child, column, k, frames)
        if model != info.model:
            how, largest, at = (
                ("", 0.0, 0.0) if departure is None else (departure.how, departure.largest_m, departure.largest_at_s)
            )
            departure = Departure(info.id, 0.0, largest, at, how, f"{model} => {info.model}")
        if departure is not None:
            listed.append(departure)
    gone = columns.keys() - {info.id for info in child.actors}
    listed += [Departure(name, 0.0, 0.0, 0.0, "is not in this run") for name in sorted(gone)]
    return tuple(sorted(listed, key=lambda departure: (departure.time_s, departure.actor != "ego", departure.actor)))


def parts_from(parent: Trace, child: Trace) -> float:
    """Return the time from which on pictures of both runs differ, s: an actor is `VISIBLE_M` away; infinite if none."""
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


def in_words(departing: Sequence[Departure]) -> tuple[str, ...]:
    """Return a sentence for each deviating actor, in the order in which they deviate."""
    lines = []
    for departure in departing[:_MOST]:
        model = f"is another model ({departure.model})" if departure.model else ""
        how = ", and ".join(part for part in (model, departure.how) if part)
        grows = (
            f", up to {departure.largest_m:.1f} m away at {departure.largest_at_s:.2f} s"
            if departure.largest_m > DIFFERS_M
            else ""
        )
        lines.append(f"from {departure.time_s:.2f} s {departure.actor} {how}{grows}")
    if len(departing) > _MOST:
        lines.append(f"and {len(departing) - _MOST} more")
    return tuple(lines) or ("all actors move in the same way: both runs are the same",)
