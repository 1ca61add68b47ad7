"""The object list: who is in sight and not missed, measured with noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, make_dataclass

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.drivers.protocol import SeenActor
from foresee_dsl.kernels.object_list import measured
from foresee_dsl.simulate.sensing.noise import Streams
from foresee_dsl.simulate.sensing.settings import SensorSettings
from foresee_dsl.simulate.sensing.sight import Bodies, Sight
from foresee_dsl.simulate.sensing.tracks import Tracks
from foresee_dsl.simulate.trace import STEP_S

FloatArray = NDArray[np.float64]
Pose = tuple[float, float, float]

LEAST_SIZE = 0.5
"""No side is measured shorter than this share of it. Ours: far beyond the errors of STANDARD; sizes stay positive."""


def frames_of(time_s: float) -> int:
    """Return the nearest number of frames."""
    return round(time_s / STEP_S)


_Row = make_dataclass("_Row", [(field.name, field.type) for field in fields(SeenActor)], slots=True)
"""What becomes a `SeenActor`. A frozen class sets its fields one by one through a function, which takes 1 us for eight
of them; an ordinary one with the same fields takes a quarter of it. Python lets an object become one of another class
that has the same slots."""


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
        self._sight, self._kinds = sight, bodies.kinds
        spreads = {"pedestrian": noise.pedestrian_heading_rad}
        heading_rad = np.array([spreads.get(kind, noise.heading_rad) for kind in bodies.kinds], dtype=np.float64)
        self._bodies = np.ascontiguousarray(np.column_stack([sight.bodies, heading_rad]))
        self._numbers = np.concatenate([sight.limits, _numbers(settings)])
        self._noise = Streams(seed, names, (slow, slow, slow, slow, 1.0, 1.0), max(frames_of(noise.slow_s), 1))
        self._tracks = Tracks(seed, frames_of(settings.forgets_s))

    def measure(self, frame: int, ego: Pose, taken: Pose, states: FloatArray) -> tuple[SeenActor, ...]:
        """Return who is seen, the nearest first.

        Args:
            frame: absolute: in the time of the run that the clip was cut from.
            ego: where it is, x, y, heading. taken: where its localisation has it.
            states: [N, >=4] x, y, heading, speed of the others; NaN where there is none.
        """
        walls, noise = self._sight.walls.near(ego[0], ego[1]), self._noise
        states = np.ascontiguousarray(states)
        rows = measured(frame, *ego, *taken, states, self._bodies, walls, noise.keys, noise.scales, self._numbers)
        kinds, track, seen = self._kinds, self._tracks.of, []
        for row in rows.tolist():
            k = int(row.pop())
            actor = _Row(track(k, frame), kinds[k], *row)
            actor.__class__ = SeenActor
            seen.append(actor)
        return tuple(seen)


def _numbers(settings: SensorSettings) -> tuple[float, ...]:
    """Return what `kernels.object_list.measured` needs of the settings, in its order."""
    noise, missed = settings.noise, settings.dropouts
    return (
        noise.radial_m,
        noise.radial_share,
        noise.lateral_m,
        noise.lateral_rad,
        noise.speed_mps,
        noise.speed_share,
        noise.speed_most_mps,
        noise.size_share,
        LEAST_SIZE,
        max(frames_of(noise.slow_s), 1),
        missed.least,
        missed.most,
        missed.steepness,
        max(frames_of(missed.lasts_s), 1),
    )
