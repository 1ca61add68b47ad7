"""The file of recorded tracks that a test case uses (`use tracks`)."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from foresee_recordings.recording import FloatArray, Recording, Track
from foresee_recordings.scenarios.naming import one_line

COLUMNS = "time_s,actor,x_m,y_m,heading_deg,speed_mps"
_PLAIN = re.compile(r"[A-Za-z0-9_.:-]{1,40}")
"""Matches names that are written as they are; `,`, quotes and spaces would need rules of their own."""


def plain_name(track: Track, number: int) -> str:
    """Return the name of an actor in the file: its id, or `tN` for an id with other characters."""
    return track.id if _PLAIN.fullmatch(track.id) else f"t{number}"


def samples(track: Track, begins_s: float, ends_s: float, offset: tuple[float, float]) -> FloatArray:
    """Return the samples of a track between two times, [N, 5]: s since the first time, x, y (m, in the network's
    coordinates), heading (deg), speed (m/s). The states at both times are interpolated; empty if the track has none."""
    first, last = max(begins_s, float(track.time_s[0])), min(ends_s, float(track.time_s[-1]))
    if last < first:
        return np.empty((0, 5))
    inside = track.time_s[(track.time_s > first) & (track.time_s < last)]
    # Times are written in milliseconds, so two that round to the same one are one.
    times = np.unique(np.round(np.concatenate([[first], inside, [last]]) - begins_s, 3))
    states = (track.at(min(max(time_s + begins_s, first), last)) for time_s in times.tolist())
    table = np.array([state for state in states if state is not None]).reshape(-1, 4)
    table = np.column_stack([times, table])
    table[:, 1] += offset[0]
    table[:, 2] += offset[1]
    table[:, 3] = np.degrees(np.remainder(table[:, 3] + np.pi, 2 * np.pi) - np.pi)
    return table


def tracks_text(recording: Recording, tables: Mapping[str, FloatArray]) -> str:
    """Return the file with the samples of each actor, by its name in the file; see `samples`."""
    rows = [(row[0], name, row) for name, table in tables.items() for row in table.tolist()]
    lines = [
        f"{time_s:.3f},{name},{x:.3f},{y:.3f},{heading:.2f},{speed:.3f}"
        for time_s, name, (_, x, y, heading, speed) in sorted(rows, key=lambda row: (round(row[0], 3), row[1]))
    ]
    head = ("# foresee tracks 1", f"# recording {one_line(recording.source.name)} sha256:{recording.sha256}", COLUMNS)
    return "\n".join((*head, *lines)) + "\n"
