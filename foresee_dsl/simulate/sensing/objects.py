"""The object list of the sensors: the actors in sight that are not missed, measured with noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields, make_dataclass
from functools import lru_cache
from typing import Any, cast

import numpy as np

from foresee_dsl.drivers.protocol import ActorClass, SeenActor
from foresee_dsl.drivers.tracking import ObjectTable
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.object_list import ScanSettings, measured
from foresee_dsl.kernels.records import dtype_of
from foresee_dsl.kernels.sight import SightLimits
from foresee_dsl.kernels.tracks import MEASURED
from foresee_dsl.simulate.sensing.noise import Streams, keys_of
from foresee_dsl.simulate.sensing.settings import SensorSettings
from foresee_dsl.simulate.sensing.sight import Bodies, Sight
from foresee_dsl.simulate.trace import STEP_S

Pose = tuple[float, float, float]

LEAST_SIZE = 0.5
"""Smallest measured length or width, as a share of the true one. Ours: it keeps sizes positive, and is far beyond the
errors of STANDARD."""


def frames_of(time_s: float) -> int:
    """Return the nearest number of frames."""
    return round(time_s / STEP_S)


_Row = make_dataclass("_Row", [(field.name, field.type) for field in fields(SeenActor)], slots=True)
"""A mutable class from which `SeenActor`s are created fast. A frozen dataclass sets each field through a function call,
which takes 1 us for eight fields; a mutable class with the same fields takes a quarter of that. The instance is then
turned into a `SeenActor`: Python allows `__class__` to be set to a class with the same slots."""


_AT_ONCE = 1024
"""Number of track numbers in a block; each block is used up in a random order. Ours: more than a run needs."""


@lru_cache(maxsize=16)  # cached, because most runs of a campaign have the same seed
def _order(seed: int) -> tuple[int, ...]:
    return tuple(np.argsort(keys_of(seed, ("tracks",), _AT_ONCE)[0], kind="stable").tolist())


class SensedTracks:
    """Assigns track numbers to objects; each number is used for one object of a run only."""

    def __init__(self, seed: int, forgets_frames: int) -> None:
        """Begin a run. An object that was not seen for more than `forgets_frames` frames gets a new number."""
        self._order = _order(seed)
        self._forgets = forgets_frames
        self._count = 0
        self._last: dict[int, tuple[int, int]] = {}
        self.objects: dict[int, int] = {}
        """The object of each track number so far, in the order in which the numbers were first used."""

    def of(self, index: int, frame: int) -> int:
        """Return the track number of an object that is seen at a frame; frames must come in order."""
        last = self._last.get(index)
        if last is not None and frame - last[1] <= self._forgets:
            number = last[0]
        else:
            rounds, k = divmod(self._count, _AT_ONCE)
            number = self._order[k] + rounds * _AT_ONCE
            self._count += 1
            self.objects[number] = index
        self._last[index] = (number, frame)
        return number


def seen_actors(table: ObjectTable) -> tuple[SeenActor, ...]:
    """Return an object list in the form that a driver gets."""
    seen = []
    for number, kind, row in zip(table.numbers, table.kinds, table.measured.tolist(), strict=True):
        actor = _Row(number, kind, *row[:MEASURED])
        actor.__class__ = SeenActor
        seen.append(actor)
    return tuple(seen)


class ObjectList:
    """Measures the other actors from the ego's position.

    Each position is measured relative to the ego and converted to the map with the ego's estimated pose, so that an
    error of the ego's localisation moves and turns all objects.
    """

    def __init__(self, bodies: Bodies, names: Sequence[str], sight: Sight, settings: SensorSettings, seed: int) -> None:
        """Begin a run with these objects: their bodies, their names, and the lines of sight to them."""
        noise = settings.noise
        slow = noise.slow_share
        self._sight, self._kinds = sight, cast(tuple[ActorClass, ...], bodies.kinds)
        spreads = {"pedestrian": noise.pedestrian_heading_rad}
        heading_rad = np.array([spreads.get(kind, noise.heading_rad) for kind in bodies.kinds], dtype=np.float64)
        self._bodies = sight.bodies.copy()
        self._bodies["heading_spread"] = heading_rad
        limits = SightLimits(*sight.limits[0].item())
        self._settings = np.array([_scan_settings(limits, settings)], dtype_of(ScanSettings))
        self._poses = np.empty((2, 3))
        self._noise = Streams(seed, names, (slow, slow, slow, slow, 1.0, 1.0), max(frames_of(noise.slow_s), 1))
        self._tracks = SensedTracks(seed, frames_of(settings.forgets_s))

    @property
    def numbered(self) -> Mapping[int, int]:
        """Return the index of the object of each track number so far, in the order in which the numbers were first
        used.
        """
        return self._tracks.objects

    def measure(self, frame: int, ego: Pose, estimated: Pose, states: FloatArray) -> tuple[SeenActor, ...]:
        """Return the measured objects, the nearest first; arguments as for `table`."""
        return seen_actors(self.table(frame, ego, estimated, states))

    def table(self, frame: int, ego: Pose, estimated: Pose, states: FloatArray) -> ObjectTable:
        """Return the object list as arrays.

        Args:
            frame: absolute frame, in the time of the run from which the clip was cut.
            ego: true pose: x, y, heading. estimated: the ego's pose as its localisation estimates it.
            states: [N, >=4] x, y, heading, speed of the others; NaN where absent.
        """
        kinds, track = self._kinds, self._tracks.of
        rows = self._rows(frame, ego, estimated, states)
        seen = [int(k) for k in rows[:, -1].tolist()]
        return ObjectTable([track(k, frame) for k in seen], [kinds[k] for k in seen], rows)

    def reported(self, frame: int, ego: Pose, states: FloatArray) -> frozenset[int]:
        """Return the indices of the objects that a scan at a frame would report; arguments as for `table`.

        It assigns no track numbers, so a query changes nothing.
        """
        return frozenset(int(row[-1]) for row in self._rows(frame, ego, ego, states).tolist())

    def _rows(self, frame: int, ego: Pose, estimated: Pose, states: FloatArray) -> FloatArray:
        walls, noise = self._sight.walls.near(ego[0], ego[1]), self._noise
        poses, states = self._poses, np.ascontiguousarray(states)
        poses[0], poses[1] = ego, estimated
        return measured(frame, poses, states, self._bodies, walls, noise.keys, noise.scales, self._settings)


@lru_cache(maxsize=16)
def _scan_settings(limits: SightLimits, settings: SensorSettings) -> ScanSettings:
    values: dict[str, Any] = asdict(settings.noise)
    values |= {f"missed_{name}": value for name, value in asdict(settings.dropouts).items()}
    values |= limits._asdict()
    values |= {"least_size": LEAST_SIZE, "slow_frames": max(frames_of(settings.noise.slow_s), 1)}
    values["missed_frames"] = max(frames_of(settings.dropouts.lasts_s), 1)
    return ScanSettings(**{name: values[name] for name in ScanSettings._fields})
