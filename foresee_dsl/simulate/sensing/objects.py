"""The object list: who is in sight and not missed, measured with noise."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.drivers.protocol import SeenActor
from foresee_dsl.simulate.sensing.noise import Streams
from foresee_dsl.simulate.sensing.settings import SensorSettings
from foresee_dsl.simulate.sensing.sight import Bodies, Sight
from foresee_dsl.simulate.sensing.tracks import Tracks
from foresee_dsl.simulate.trace import STEP_S

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
Pose = tuple[float, float, float]

LEAST_SIZE = 0.5
"""No side is measured shorter than this share of it. Ours: far beyond the errors of STANDARD; sizes stay positive."""


def frames_of(time_s: float) -> int:
    """Return the nearest number of frames."""
    return round(time_s / STEP_S)


class ObjectList:
    """Measures the others from where the ego is.

    What is measured is where an object is relative to the ego; it is put on the map by where the ego takes itself to
    be. So an error of the ego's localisation moves and turns all objects with the ego.
    """

    def __init__(self, bodies: Bodies, names: Sequence[str], sight: Sight, settings: SensorSettings, seed: int) -> None:
        """Begin a run.

        Args:
            bodies, names: the N objects. sight: of the same. settings: of the sensors. seed: of the run.
        """
        noise = settings.noise
        slow = noise.slow_share
        self._settings, self._sight = settings, sight
        self._kinds, self._sizes = bodies.kinds, bodies.sizes_m
        self._heading_rad = np.array(
            [noise.pedestrian_heading_rad if kind == "pedestrian" else noise.heading_rad for kind in bodies.kinds]
        )
        self._noise = Streams(
            seed,
            names,
            (slow, slow, slow, slow, 1.0, 1.0),
            max(frames_of(noise.slow_s), 1),
            max(frames_of(settings.dropouts.lasts_s), 1),
        )
        self._tracks = Tracks(seed, frames_of(settings.forgets_s))

    def measure(self, frame: int, ego: Pose, taken: Pose, states: FloatArray) -> tuple[SeenActor, ...]:
        """Return who is seen, the nearest first.

        Args:
            frame: absolute: in the time of the run that the clip was cut from.
            ego: where it is, x, y, heading. taken: where its localisation has it.
            states: [N, 4] x, y, heading, speed of the others; NaN where there is none.
        """
        who, offsets, gaps = self._sight.seen(*ego, states)
        missed = self._settings.dropouts
        if missed.least > 0.0 or missed.most > 0.0:
            chance = missed.least + missed.most * (gaps / self._sight.range_m[who]) ** missed.steepness
            found = self._noise.chances(frame)[who] >= chance
            who, offsets, gaps = who[found], offsets[found], gaps[found]
        order = np.argsort(gaps, kind="stable")
        who, offsets, gaps = who[order], offsets[order], gaps[order]
        rows = self._measured(frame, ego, taken, states[who], who, offsets, gaps).tolist()
        return tuple(
            SeenActor(self._tracks.of(k, frame), self._kinds[k], *row)
            for k, row in zip(who.tolist(), rows, strict=True)
        )

    def _measured(
        self,
        frame: int,
        ego: Pose,
        taken: Pose,
        states: FloatArray,
        who: IntArray,
        offsets: FloatArray,
        gaps: FloatArray,
    ) -> FloatArray:
        """Return [S, 6] x, y, heading, speed, length, width of those in sight, with errors."""
        noise = self._settings.noise
        errors = self._noise.normals(frame)[who]
        # Radial and lateral errors as shares of the distance, so that they turn with the line of sight.
        per_m = 1.0 / np.maximum(gaps, 1.0)
        radial = errors[:, 0] * (noise.radial_m + noise.radial_share * gaps) * per_m
        lateral = errors[:, 1] * (noise.lateral_m + noise.lateral_rad * gaps) * per_m
        dx, dy = offsets[:, 0], offsets[:, 1]
        mx, my = dx + radial * dx - lateral * dy, dy + radial * dy + lateral * dx
        turned = taken[2] - ego[2]
        cos, sin = math.cos(turned), math.sin(turned)
        speed = states[:, 3]
        spread = np.minimum(noise.speed_mps + noise.speed_share * speed, noise.speed_most_mps)
        rows = np.empty((len(who), 6))
        rows[:, 0] = taken[0] + mx * cos - my * sin
        rows[:, 1] = taken[1] + mx * sin + my * cos
        heading = states[:, 2] + errors[:, 2] * self._heading_rad[who] + turned
        rows[:, 2] = heading - math.tau * np.round(heading / math.tau)
        rows[:, 3] = np.maximum(speed + errors[:, 3] * spread, 0.0)
        rows[:, 4:] = self._sizes[who] * np.maximum(1.0 + noise.size_share * errors[:, 4:], LEAST_SIZE)
        return rows
