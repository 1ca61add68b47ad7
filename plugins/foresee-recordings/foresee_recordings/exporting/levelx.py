"""Runs as tables with the columns of inD (levelXdata): centres, headings in degrees, a row for each track and frame.

The tables of a run are `NN_tracks.csv`, `NN_tracksMeta.csv` and `NN_recordingMeta.csv`, with NN from 00 on. Tracks have
numbers, as tools for the data sets expect; the ego is track 0, and the last column of `tracksMeta` has our names.
"""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from foresee_dsl.simulate.trace import ACCELERATION, STEP_S, YAW_RATE, Trace, X
from foresee_recordings.exporting.runs import Run, lost_in_all
from foresee_recordings.recording import Track

_KINDS = ("car", "van", "truck", "bus", "motorcycle", "bicycle", "pedestrian")
"""Our kinds that are words of the data sets, those of rounD; others are cars."""
_TRACKS = ("recordingId", "trackId", "frame", "trackLifetime", "xCenter", "yCenter", "heading", "width", "length",
           "xVelocity", "yVelocity", "xAcceleration", "yAcceleration", "lonVelocity", "latVelocity",
           "lonAcceleration", "latAcceleration")  # fmt: skip
_TRACKS_META = ("recordingId", "trackId", "initialFrame", "finalFrame", "numFrames", "width", "length", "class", "name")
_RECORDING_META = ("recordingId", "locationId", "frameRate", "speedLimit", "weekday", "startTime", "duration",
                   "numTracks", "numVehicles", "numVRUs", "latLocation", "lonLocation", "xUtmOrigin", "yUtmOrigin",
                   "orthoPxToMeter")  # fmt: skip
_VRUS = ("pedestrian", "bicycle")


def write(folder: Path, run: Run) -> None:
    """Write the tables of a run."""
    tracks = run.recording.tracks
    _write(folder / f"{run.number:02d}_tracks.csv", _TRACKS, _rows(run))
    meta = [
        (run.number, k, frames[0], frames[-1], len(frames), f"{track.width_m:.3f}", f"{track.length_m:.3f}",
         track.kind if track.kind in _KINDS else "car", track.id)
        for k, track in enumerate(tracks)
        for frames in [_frames(track)]
    ]  # fmt: skip
    _write(folder / f"{run.number:02d}_tracksMeta.csv", _TRACKS_META, meta)
    vrus = sum(track.kind in _VRUS for track in tracks)
    seconds = f"{run.trace.frames * STEP_S:.2f}"
    facts = (run.number, 0, f"{1 / STEP_S:g}", -1, "", 0, seconds, len(tracks), len(tracks) - vrus, vrus, 0, 0, 0, 0, 1)
    _write(folder / f"{run.number:02d}_recordingMeta.csv", _RECORDING_META, [facts])


def left_out(run: Run) -> Counter[str]:
    """Return counts of what these tables do not express."""
    obstacles = sum(track.kind == "obstacle" for track in run.recording.tracks)
    return lost_in_all(run) + Counter(
        {"networks": 1, "signals": len(run.bundle.signals), "classes of obstacles, which are cars": obstacles}
    )


def _frames(track: Track) -> list[int]:
    frames: list[int] = np.rint(track.time_s / STEP_S).astype(int).tolist()
    return frames


def _rows(run: Run) -> Iterator[Sequence[object]]:
    for k, track in enumerate(run.recording.tracks):
        frames = _frames(track)
        x, y, heading, speed = track.states.T
        c, s = np.cos(heading), np.sin(heading)
        ahead, left = _accelerations(run.trace, track)
        columns = np.column_stack(
            (x, y, np.degrees(heading) % 360.0, np.full_like(x, track.width_m), np.full_like(x, track.length_m),
             speed * c, speed * s, ahead * c - left * s, ahead * s + left * c, speed, np.zeros_like(x), ahead, left)
        )  # fmt: skip
        for frame, values in zip(frames, columns.tolist(), strict=True):
            yield run.number, k, frame, frame - frames[0], *(f"{value:.4f}" for value in values)


def _accelerations(trace: Trace, track: Track) -> tuple[np.ndarray, np.ndarray]:
    """Return the accelerations along and to the left of the heading, m/s^2 ([N] each)."""
    index = next(k for k, actor in enumerate(trace.actors) if actor.id == track.id)
    rows = trace.states[~np.isnan(trace.states[:, index, X]), index]
    return rows[:, ACCELERATION], track.states[:, 3] * rows[:, YAW_RATE]


def _write(file: Path, columns: Sequence[str], rows: Iterator[Sequence[object]] | Sequence[Sequence[object]]) -> None:
    with file.open("w", encoding="utf-8", newline="") as out:
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(rows)
