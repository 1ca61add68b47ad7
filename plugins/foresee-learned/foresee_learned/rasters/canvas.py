"""Pictures of a run: the map, the route and the buildings are drawn once; each step adds the moving objects."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.drivers.protocol import Mission, SeenActor, SignalColour, Window
from foresee_dsl.kernels.arrays import FloatArray, IntArray
from foresee_dsl.simulate.mission import heading_at, signal_heads
from foresee_dsl.simulate.sensing.views import CAMERA_RANGE_M, RunViews, StepViews
from foresee_dsl.simulate.trace import HEADING, SPEED, Trace, X, Y
from foresee_learned.rasters.birdseye import BirdsEye, Pose, StopLine
from foresee_learned.rasters.camera import Camera
from foresee_learned.rasters.ground import GroundMap
from foresee_learned.rasters.layout import (
    FORWARD_CHANNELS,
    GROUP_OF,
    GROUPS,
    HEIGHTS_M,
    SIGNAL_HEIGHT_M,
    SIGNAL_WIDTH_M,
    WHOLE,
)

_LAMPS: dict[str, int] = {name: FORWARD_CHANNELS.index(name) for name in ("red", "amber", "green")}
_FIRST_GROUP = FORWARD_CHANNELS.index(GROUPS[0])


class Canvas:
    """Draws a run's pictures from plain arrays. Nothing is drawn before the first picture is requested, not even the
    map.
    """

    def __init__(
        self,
        network: RoadNetwork,
        route: FloatArray | None = None,
        stops: Sequence[StopLine] = (),
        ego_size_m: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        """Use what is constant during a run: the network (its map is cached), the ego's line ([N, 2] m) and its stop
        lines.

        An ego without a size (length, width) is not drawn.
        """
        self._network, self._route, self._stops, self._ego_size_m = network, route, tuple(stops), ego_size_m

    @classmethod
    def of_mission(cls, network: RoadNetwork, mission: Mission, ego_size_m: tuple[float, float]) -> Canvas:
        """Return the canvas of a run: the route ends at the mission's goal."""
        to_goal = mission.centreline[mission.s <= mission.goal_s]
        return cls(network, to_goal, stops_of(mission), ego_size_m)

    def birds_eye(
        self,
        pose: Pose,
        actors: FloatArray,
        groups: IntArray,
        signals: Mapping[str, SignalColour] | None = None,
        window: Window = WHOLE,
    ) -> NDArray[np.uint8]:
        """Draw the view from above, [19, 192, 192] uint8; arguments as `BirdsEye.draw`."""
        return self._birds_eye.draw(pose, actors, groups, signals or {}, window)

    def forward(
        self,
        pose: Pose,
        bodies: FloatArray,
        groups: IntArray,
        signals: Mapping[str, SignalColour] | None = None,
        *,
        range_m: float = CAMERA_RANGE_M,
    ) -> NDArray[np.uint8]:
        """Draw the view of the camera, [13, 64, 160] uint8.

        Args:
            pose: x, y (m) of the ego's middle, its heading (rad).
            bodies: [K, 6] x, y (m), heading (rad), length, width, height (m); NaN where one is absent.
            groups: [K] index into `layout.GROUPS`.
            signals: the colours that are seen; lamps that are off are dark.
            range_m: range of sight in this weather, m.
        """
        boxes = np.column_stack((bodies[:, :5], np.zeros(len(bodies)), bodies[:, 5]))
        labels, half = groups + _FIRST_GROUP, SIGNAL_HEIGHT_M / 2
        lamps = [
            (x, y, stop.heading_rad, SIGNAL_WIDTH_M, SIGNAL_WIDTH_M, middle - half, middle + half, _LAMPS[colour])
            for stop in self._stops
            if (colour := (signals or {}).get(stop.signal or "", "off")) in _LAMPS
            for x, y, middle in stop.heads
        ]
        if lamps:
            boxes = np.concatenate((boxes, [lamp[:7] for lamp in lamps]))
            labels = np.concatenate((labels, [lamp[7] for lamp in lamps]))
        return self._camera.draw(pose, boxes, labels, range_m=range_m)

    @cached_property
    def _ground(self) -> GroundMap:
        return GroundMap.of(self._network)

    @cached_property
    def _birds_eye(self) -> BirdsEye:
        ground = self._ground if self._route is None else self._ground.with_route(self._route)
        return BirdsEye(ground, self._stops, self._ego_size_m)

    @cached_property
    def _camera(self) -> Camera:
        return Camera(self._ground, self._network.buildings)


@dataclass(frozen=True)
class _RunPictures:
    """The common part of the pictures of a run.

    Attributes:
        sizes: [K, 3] length, width, height of the others, m.
        groups: [K] index into `layout.GROUPS`.
    """

    canvas: Canvas
    sizes: FloatArray
    groups: IntArray


_of_runs: WeakKeyDictionary[RunViews, _RunPictures] = WeakKeyDictionary()


def _pictures_of(run: RunViews) -> _RunPictures:
    if run not in _of_runs:
        canvas = Canvas.of_mission(run.network, run.mission, (run.ego.length_m, run.ego.width_m))
        sizes = np.array([(model.length_m, model.width_m, model.height_m) for model in run.others], dtype=np.float64)
        groups = np.array([GROUP_OF[model.kind] for model in run.others], dtype=np.int64)
        _of_runs[run] = _RunPictures(canvas, sizes.reshape(-1, 3), groups)
    return _of_runs[run]


def canvas_of(run: RunViews) -> Canvas:
    """Return the canvas that draws the pictures of a run, for views of other packages."""
    return _pictures_of(run).canvas


def birds_eye_view(step: StepViews, window: Window | None = None) -> NDArray[np.uint8]:
    """Draw the observation from above, around the ego's estimated place, [19, 192, 192]; or a part of the picture."""
    actors, groups = seen_arrays(step.actors)
    pose = (step.ego.x, step.ego.y, step.ego.heading_rad)
    return canvas_of(step.run).birds_eye(pose, actors, groups, step.signals, window or WHOLE)


def forward_view(step: StepViews) -> NDArray[np.uint8]:
    """Draw the view of the camera, [13, 64, 160], with the true shapes."""
    run = _pictures_of(step.run)
    bodies = np.hstack((step.states[:, :3], run.sizes))
    return run.canvas.forward(step.pose, bodies, run.groups, step.signals, range_m=step.run.range_m)


def seen_arrays(actors: Iterable[SeenActor]) -> tuple[FloatArray, IntArray]:
    """Return an object list as `Canvas.birds_eye` takes it."""
    seen = tuple(actors)
    rows = [(a.x, a.y, a.heading_rad, a.speed_mps, a.length_m, a.width_m) for a in seen]
    groups = np.array([GROUP_OF[a.kind] for a in seen], dtype=np.int64)
    return np.array(rows, dtype=np.float64).reshape(-1, 6), groups


def stops_of(mission: Mission) -> tuple[StopLine, ...]:
    """Return the stop lines of a mission's junctions."""
    lines = []
    for junction in mission.junctions:
        x, y, heading = heading_at(mission, junction.stop_s)
        heads = tuple(signal_heads(mission, junction.stop_s))  # the heads that the sensors use, too
        # The line is as wide as the free width in the ego's direction, so it crosses all of its lanes.
        left, right = (float(np.interp(junction.stop_s, mission.s, side)) for side in (mission.left_m, mission.right_m))
        off_line_m = (left - right) / 2
        middle = (x - off_line_m * math.sin(heading), y + off_line_m * math.cos(heading))
        lines.append(StopLine(*middle, heading, left + right, junction.signal, heads))
    return tuple(lines)


class RecordedFrames:
    """Converts a trace to the arrays for a `Canvas`: the true positions of all actors."""

    def __init__(self, trace: Trace) -> None:
        """Read the actors of a run. A trace holds no heights, so each actor gets the usual height of its class."""
        self._states = trace.states
        others = trace.actors[1:]
        self._sizes = np.array([(a.length_m, a.width_m) for a in others]).reshape(-1, 2)
        self._heights = np.array([HEIGHTS_M[a.kind] for a in others], dtype=np.float64)
        self.groups = np.array([GROUP_OF[a.kind] for a in others], dtype=np.int64)
        """Index into `layout.GROUPS` for each actor except the ego, [A - 1]."""

    def pose(self, frame: int) -> Pose:
        """Return the ego's x, y (m) and heading (rad)."""
        x, y, heading = self._states[frame, 0, [X, Y, HEADING]].tolist()
        return x, y, heading

    def actors(self, frame: int) -> FloatArray:
        """Return [A - 1, 6] x, y, heading, speed, length, width: for `Canvas.birds_eye`."""
        return np.hstack((self._states[frame, 1:][:, [X, Y, HEADING, SPEED]], self._sizes))

    def bodies(self, frame: int) -> FloatArray:
        """Return [A - 1, 6] x, y, heading, length, width, height: for `Canvas.forward`."""
        return np.column_stack((self._states[frame, 1:][:, [X, Y, HEADING]], self._sizes, self._heights))
