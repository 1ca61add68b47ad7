"""Finds the objects in sight of the ego: within range and field of view, not hidden by others or by buildings.

It also finds the lines of sight between any two actors of a simulation, and from the ego of a recorded run, without a
driver's sensors.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from foresee_dsl.compile.bundle import ModelSpec, SumoBundle
from foresee_dsl.compile.roads.polyline import Points
from foresee_dsl.kernels.arrays import BoolArray, FloatArray, IntArray, Records
from foresee_dsl.kernels.records import dtype_of
from foresee_dsl.kernels.sight import MARKS, BodyRecord, SightLimits, Wall, clear_points, in_sight, walls_near
from foresee_dsl.simulate.sensing.settings import STANDARD, ClassRanges, SensorSettings
from foresee_dsl.simulate.sensing.weather import CLEAR, Air
from foresee_dsl.simulate.trace import HEADING, Trace, X, Y

if TYPE_CHECKING:
    from foresee_dsl.simulate.actors.simulation import Simulation

_AROUND_M = 10.0
"""Distance by which the eye may move before the walls near it are looked up again, m."""


@lru_cache(maxsize=8)
def _sides(buildings: tuple[Points, ...]) -> Records:
    """Return the sides of buildings as `Wall`s; cached for each network."""
    outlines = [np.array(outline, dtype=np.float64).reshape(-1, 2) for outline in buildings]
    outlines = [outline[::-1] if _area(outline) < 0 else outline for outline in outlines if len(outline) > 2]
    sides = [np.concatenate([outline, np.roll(outline, -1, axis=0) - outline], axis=1) for outline in outlines]
    return np.concatenate([np.empty((0, 4)), *sides]).view(dtype_of(Wall))[:, 0]


def _area(outline: FloatArray) -> float:
    """Return twice the signed area of an outline, positive if it runs counter-clockwise."""
    x, y = outline[:, 0], outline[:, 1]
    return float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())


class Walls:
    """The outlines of buildings. A building does not block the view of an eye inside it."""

    def __init__(self, buildings: Iterable[Points], reach_m: float) -> None:
        """Prepare the outlines of buildings (m), open or closed, in either direction; `reach_m`: longest line
        of sight.
        """
        self._all = self._near = _sides(tuple(tuple(outline) for outline in buildings))
        self._reach_m = reach_m + 2 * _AROUND_M
        self._looked_up: tuple[float, float] | None = None

    def near(self, x: float, y: float) -> Records:
        """Return all walls that lines of sight from an eye may meet, [M]; some others may be among them."""
        at = self._looked_up
        if at is None or abs(x - at[0]) > _AROUND_M or abs(y - at[1]) > _AROUND_M:
            self._looked_up = (x, y)
            self._near = self._all[walls_near(x, y, self._all, self._reach_m)]
        return self._near


@dataclass(frozen=True)
class Bodies:
    """The bodies of N objects as far as sight depends on them: their classes, [N, 2] lengths and widths, [N] heights,
    m.
    """

    kinds: tuple[str, ...]
    sizes_m: FloatArray
    heights_m: FloatArray

    @classmethod
    def of(cls, models: Sequence[ModelSpec]) -> Bodies:
        """Return the bodies of catalogue entries."""
        rows = [(model.length_m, model.width_m, model.height_m) for model in models]
        numbers = np.array(rows, dtype=np.float64).reshape(-1, 3)
        return cls(tuple(model.kind for model in models), numbers[:, :2], numbers[:, 2])


@lru_cache(maxsize=16)
def _ranges(clear: ClassRanges, air: Air | None) -> dict[str, float]:
    """Return the range of each class, m; without `air`, weather has no effect."""
    return {kind: far if air is None else air.object_range_m(far) for kind, far in asdict(clear).items()}


class Sight:
    """Lines of sight in a scene.

    Attributes:
        range_m: [N] range of each object in this weather, m. signal_range_m: the same for signals.
        bodies, limits, walls: the input of `kernels.sight`.
    """

    def __init__(
        self, bodies: Bodies, buildings: Iterable[Points], settings: SensorSettings = STANDARD, air: Air = CLEAR
    ) -> None:
        """Prepare the lines of sight of a scene: its objects, the outlines of its buildings (m), and the weather."""
        reach = _ranges(settings.ranges, air if settings.weather else None)
        self.range_m = np.array([reach[kind] for kind in bodies.kinds], dtype=np.float64)
        self.signal_range_m = (
            air.signal_range_m(settings.signal_range_m) if settings.weather else settings.signal_range_m
        )
        self._eye_m = settings.eye_m
        shares = np.array((1.0, settings.high_share, settings.low_share))
        rises = bodies.heights_m[:, None] * shares - settings.eye_m
        rows = np.column_stack([bodies.sizes_m, rises, self.range_m, np.zeros(len(bodies.kinds))])
        self.bodies: Records = rows.view(dtype_of(BodyRecord))[:, 0]
        # A body beyond the longest range cannot hide an object that is within its range.
        reach_m = max(float(self.range_m.max(initial=0.0)), self.signal_range_m)
        all_around = settings.field_of_view_rad >= math.tau
        ahead_share = -2.0 if all_around else math.cos(settings.field_of_view_rad / 2)
        limits = SightLimits(reach_m, ahead_share, settings.seen_share * MARKS)
        self.limits = np.array([limits], dtype_of(SightLimits))
        self._reach_m, self._through = float(reach_m), settings.seen_share <= 0.0
        self.walls = Walls(buildings, reach_m)

    def seen(self, x: float, y: float, heading: float, poses: FloatArray) -> IntArray:
        """Return the indices, [S], of the objects in sight of the ego; `poses`: [N, >=3] x, y, heading, NaN where
        absent."""
        poses = np.ascontiguousarray(poses)
        return in_sight(x, y, heading, poses, self.bodies, self.walls.near(x, y), self.limits)

    def clear(self, x: float, y: float, poses: FloatArray, points: FloatArray) -> BoolArray:
        """Return, for each point, whether nothing hides it from the ego; `points`: [M, 3] x, y and height above the
        ground (m), `poses` as in `seen`."""
        if self._through:
            return np.ones(len(points), dtype=np.bool_)
        poses, walls = np.ascontiguousarray(poses), self.walls.near(x, y)
        return clear_points(x, y, self._eye_m, points, poses, self.bodies, walls, self._reach_m)


_FAR_M = 5000.0
"""A range that is longer than any distance within a network, m. Ours."""
_ALL_AROUND = replace(
    STANDARD,
    ranges=ClassRanges(**dict.fromkeys(ClassRanges.__dataclass_fields__, _FAR_M)),
    field_of_view_rad=math.tau,
    weather=False,
)


class LinesOfSight:
    """The lines of sight between the actors at the current frame.

    An actor's eye is above the middle of its footprint.
    """

    def __init__(self, simulation: Simulation) -> None:
        """Begin without eyes: the eye of an actor is prepared when it is first needed."""
        self._simulation = simulation
        self._sights: dict[int, Sight] = {}
        self._seen: dict[int, tuple[int, frozenset[int]]] = {}
        self._numbers = {actor.id: k for k, actor in enumerate(simulation.actors)}

    def clear(self, eye: str, actor: str) -> bool:
        """Return whether nothing hides an actor from another one; both must be present."""
        k, frame = self._numbers[eye], self._simulation.frame
        if self._seen.get(k, (-1, frozenset()))[0] != frame:
            self._seen[k] = frame, self._look(k)
        return self._numbers[actor] in self._seen[k][1]

    def _look(self, eye: int) -> frozenset[int]:
        simulation = self._simulation
        if eye not in self._sights:
            models = [actor.placed.model for k, actor in enumerate(simulation.actors) if k != eye]
            self._sights[eye] = Sight(Bodies.of(models), simulation.network.buildings, _ALL_AROUND)
        states, _, _ = simulation.state_table.frame()
        x, y, heading = states[eye, :3].tolist()
        seen = self._sights[eye].seen(x, y, heading, np.delete(states, eye, axis=0)[:, :3])
        return frozenset(int(k) + (int(k) >= eye) for k in seen)


def sight_of(bundle: SumoBundle, sensors: SensorSettings = STANDARD, *, observer: int = 0) -> Sight:
    """Return the lines of sight from an actor to all others through these sensors, without their noise.

    `observer`: the actor's column in a trace; 0 is the ego.
    """
    scene = bundle.scene
    bodies = Bodies.of([actor.model for column, actor in enumerate(scene.actors) if column != observer])
    return Sight(bodies, bundle.network.buildings, sensors, Air(scene.rain, scene.fog, scene.sun))


def in_view(trace: Trace, other: int, frame: int, sight: Sight) -> bool:
    """Return whether an actor (by its column) is in sight of the ego at a frame."""
    poses = trace.states[frame][:, [X, Y, HEADING]]
    x, y, heading = poses[0].tolist()
    visible = sight.seen(x, y, heading, poses[1:])
    return other - 1 in visible
