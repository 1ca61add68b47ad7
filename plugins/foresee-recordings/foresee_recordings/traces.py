"""Runs as recordings: a trace has the same facts, so that its situations can be searched for and its tracks written."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from foresee_dsl.simulate.trace import HEADING, SPEED, Trace, X, Y
from foresee_recordings.recording import RecordedMap, Recording, Track


def recording_of(trace: Trace, name: str = "run", roads: RecordedMap | None = None) -> Recording:
    """Return a run as a recording; its actors keep their names."""
    tracks = []
    for k, info in enumerate(trace.actors):
        present = np.flatnonzero(~np.isnan(trace.states[:, k, X]))
        if len(present):
            states = trace.states[present, k][:, [X, Y, HEADING, SPEED]]
            tracks.append(Track(info.id, info.kind, info.length_m, info.width_m, trace.time_s[present], states))
    return Recording(
        name, Path(f"{name}.npz"), trace.digest.removeprefix("sha256:"), "trace", tuple(tracks), roads=roads
    )
