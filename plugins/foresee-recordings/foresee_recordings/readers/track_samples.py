"""Collects the samples of one actor while a file is read, and turns them into a track."""

from __future__ import annotations

import hashlib
import re
from array import array
from collections import Counter
from pathlib import Path

import numpy as np

from foresee_dsl.files import open_outside
from foresee_recordings.reading import Request
from foresee_recordings.recording import STATES, FloatArray, RecordingError, Track

LARGEST = 1e8
"""Largest time, coordinate or speed of a sample, in SI units. Ours: as for networks, above UTM's northings (1e7 m)."""
STANDING_M = 0.05
"""Smallest displacement between two samples that shows a direction, m. Ours: the noise of tracked positions."""
NOT_FINITE = "samples with a number that is not finite or far too large"
SAME_TIME = "samples with the time of an earlier sample of the same actor"
_BLOCK_BYTES = 1 << 20
_COLUMNS = 1 + len(STATES)


class Samples:
    """The samples of one actor, 40 bytes each, in the order of the file."""

    def __init__(self) -> None:
        self._numbers = array("d")

    def __len__(self) -> int:
        return len(self._numbers) // _COLUMNS

    def add(self, time_s: float, x: float, y: float, heading: float, speed: float) -> None:
        """Append a sample; a heading or a speed that the file does not have is NaN."""
        self._numbers.extend((time_s, x, y, heading, speed))

    def track(
        self, id_: str, kind: str, size_m: tuple[float, float], left_out: Counter[str], *, sized: bool = True
    ) -> Track | None:
        """Return the track, sorted by time; None if no sample is usable.

        Missing headings and speeds are computed from the motion. Unusable samples are counted in `left_out`.
        """
        rows = np.array(self._numbers, dtype=np.float64).reshape(-1, _COLUMNS)
        usable = (np.abs(rows[:, :3]) < LARGEST).all(axis=1)
        usable &= ~(np.abs(rows[:, 3:]) >= LARGEST).any(axis=1)  # NaN stands for a missing number
        rows = rows[usable]
        order = np.argsort(rows[:, 0], kind="stable")
        rows = rows[order]
        first = np.concatenate(([True], np.diff(rows[:, 0]) > 0.0))[: len(rows)]
        left_out[NOT_FINITE] += int((~usable).sum())
        left_out[SAME_TIME] += int((~first).sum())
        rows = rows[first]
        if not len(rows):
            return None
        time_s, states = rows[:, 0].copy(), rows[:, 1:].copy()
        _complete(time_s, states)
        return Track(id_, kind, *size_m, time_s, states, sized)


def _complete(time_s: FloatArray, states: FloatArray) -> None:
    """Replace missing headings and speeds by those of the motion."""
    missing = np.isnan(states[:, 2:])
    if not missing.any():
        return
    if len(states) == 1:
        states[:, 2:][missing] = 0.0
        return
    step = np.gradient(states[:, :2], time_s, axis=0)
    moved = np.hypot(*np.gradient(states[:, :2], axis=0).T) >= STANDING_M
    index = np.arange(len(states))
    # while an actor stands, it keeps the direction of its last motion; before its first motion, that of this
    last = np.maximum.accumulate(np.where(moved, index, -1))
    first = int(np.argmax(moved)) if moved.any() else 0
    direction = np.arctan2(step[:, 1], step[:, 0])[np.where(last >= 0, last, first)]
    states[missing[:, 0], 2] = direction[missing[:, 0]]
    states[missing[:, 1], 3] = np.hypot(*step.T)[missing[:, 1]]


def source_hash(path: Path) -> str:
    """Return the SHA-256 of a file, hexadecimal.

    Raises:
        RecordingError: it cannot be read, or exceeds the limit `file`.
    """
    digest = hashlib.sha256()
    try:
        with open_outside(path) as file:
            while block := file.read(_BLOCK_BYTES):
                digest.update(block)
    except OSError as err:
        raise RecordingError(f"{path} cannot be read: {err.strerror or err}") from err
    return digest.hexdigest()


def name_for(text: str) -> str:
    """Return a name for files: `USA_US101-1_1_T-1` becomes `usa_us101_1_1_t_1`."""
    name = re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")
    return name if name[:1].isalpha() else f"recording_{name}".strip("_")


def wanted(request: Request, actor: str) -> bool:
    """Return whether a request wants an actor."""
    return not request.actors or actor in request.actors


def check_any(request: Request, tracks: tuple[Track, ...]) -> None:
    """Raise an error for a recording without tracks, which says whether the request left all of them out.

    Raises:
        RecordingError: there are no tracks.
    """
    if tracks:
        return
    narrowed = request.actors or request.begins_s > float("-inf") or request.ends_s < float("inf")
    why = "no actor in the requested seconds and of the requested ids" if narrowed else "no actors"
    raise RecordingError(f"{request.path} has {why}")
