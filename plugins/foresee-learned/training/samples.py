"""Recorded runs: from each kept frame the observation with its pictures comes back, and the expert's labels.

    for run in read(Path("round0_000.npz")):
        for k in run.labelled:                     # the frames to train on
            run.observation(k)                     # as the driver had it; `.views` draws its pictures
            run.past(k, 0.5), run.past(k, 1.0)     # the frames half a second and a second earlier, or None
            run.labels(k)

Frames lie at 0.0 and 0.2 s of every half second, so that a frame's past of 0.5 s and 1.0 s is there as well. All are
multiples of 0.1 s: object lists have the age that a driver sees that decides ten times a second. What is not needed is
left out: frames that are neither labelled nor the past of such; actors that no picture can show.

Needed to read and to draw: numpy and what `foresee_learned.rasters` imports; no SUMO.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from foresee_learned.rasters import GROUP_OF
from foresee_learned.rasters.ground import GroundMap, remember
from numpy.typing import NDArray

from foresee_dsl.drivers.protocol import EgoState, Mission, Observation, SeenActor, SignalColour, VehicleLimits
from foresee_dsl.kernels.arrays import FloatArray, IntArray
from foresee_dsl.language.model_classes import CLASSES
from foresee_dsl.simulate.sensing.views import RunViews, StepViews

FRAME_S = 0.05
"""Time between two frame numbers, s."""
POINT_S, POINTS = 0.25, 12
"""The expert's trajectory has a point each quarter of a second, up to 3 s."""
KINDS: tuple[str, ...] = CLASSES
COLOURS: tuple[SignalColour | None, ...] = (None, "red", "amber", "green", "off")
"""Colours of a signal as the driver sees it; None: not seen."""
SIGNAL_STATES = ("red", "amber", "green", "other")

EGO = ("x", "y", "heading", "speed", "acceleration", "yaw_rate", "steer", "true_x", "true_y", "true_heading")
SEEN = ("frame", "track", "kind", "rank", "x", "y", "heading", "speed", "length", "width")
TRUE = ("frame", "actor", "in_sight", "x", "y", "heading", "speed")
LABELS = ("frame", "acceleration", "steer", "target_speed", "stop", "stop_m", "signal", "expert_drives")
LINE = ("x", "y", "s", "speed_limit", "left", "right")


class Labels(NamedTuple):
    """What the expert would do at a frame, and what is around.

    Attributes:
        trajectory: [12, 2] where the middle of the ego's footprint would be after 0.25 s, 0.5 s, ... 3 s: metres ahead
            of and to the left of where it is.
        acceleration_mps2, steer: the expert's decision; steer: -1 (right) to 1 (left).
        target_speed_mps: how fast the expert would be a second from now.
        stop: whether a stop line binds it: red, or it must give way there, or there is no room beyond.
        stop_m: how far the ego's front is from that line (or from where it waits); 100: there is none.
        signal: index into `SIGNAL_STATES` of the next signal on the route that is seen; "other" where none is.
        boxes: [K, 6] the others that the sensors can see, as they are: ahead, left (m), heading relative to the ego
            (rad), length, width (m), speed (m/s). groups: [K] index into `layout.GROUPS`.
        expert_drives: whether the expert drove the ego at this frame (noise put into its controls or not).
    """

    trajectory: FloatArray
    acceleration_mps2: float
    steer: float
    target_speed_mps: float
    stop: bool
    stop_m: float
    signal: int
    boxes: FloatArray
    groups: IntArray
    expert_drives: bool

    def at(self, times_s: Sequence[float] | FloatArray) -> FloatArray:
        """Return the trajectory at other times, [T, 2]."""
        marks_s = np.arange(POINTS + 1) * POINT_S
        points = np.vstack([(0.0, 0.0), self.trajectory])
        return np.stack([np.interp(times_s, marks_s, points[:, axis]) for axis in (0, 1)], axis=1)


class RecordedNetwork:
    """The part of a network that pictures need: its ground and its buildings. It takes the place of a `RoadNetwork`."""

    def __init__(self, key: str, ground: GroundMap, buildings: tuple[tuple[tuple[float, float], ...], ...]) -> None:
        self.key, self.ground, self.buildings = key, ground, buildings
        remember(self, ground)


@dataclass(frozen=True)
class Shape:
    """The measures of a recorded actor."""

    kind: str
    length_m: float
    width_m: float
    height_m: float


@dataclass(frozen=True, eq=False)
class RecordedRun:
    """What is kept of one run. Numbers of frames are indices into its tables.

    Attributes:
        about: `name` (of the case), `family`, `driver`, `sensors`, `seed`, `verdict`, `duration_s`, `hash` (the case's
            meaning), and what the recorder adds.
        mission: without the streams that cross it (drivers that look at pictures do not use them).
        shapes: of the ego and of all others. range_m: how far the weather lets the camera see.
        frames: [F] each frame's time and the time of its object list, in steps of 0.05 s.
        ego: [F, 10] columns `EGO`; the first seven as the vehicle measures them. colours: [F, J] index into `COLOURS`
            for each junction of the mission.
        seen: [S, 10] columns `SEEN`, sorted by frame and rank. true: [T, 7] columns `TRUE`, sorted by frame.
        label_rows: [L, 8] columns `LABELS`. trajectories: [L, 12, 2].
    """

    about: dict[str, Any]
    mission: Mission
    vehicle: VehicleLimits
    network: RecordedNetwork
    shapes: tuple[Shape, ...]
    range_m: float
    frames: IntArray
    ego: FloatArray
    colours: NDArray[np.uint8]
    seen: FloatArray
    true: FloatArray
    label_rows: FloatArray
    trajectories: FloatArray = field(repr=False)

    @property
    def labelled(self) -> IntArray:
        """Numbers of the frames with labels, [L]."""
        return self.label_rows[:, 0].astype(np.int64)

    def time_s(self, k: int) -> float:
        """Return a frame's time."""
        return round(int(self.frames[k, 0]) * FRAME_S, 6)

    def past(self, k: int, back_s: float) -> int | None:
        """Return the number of the frame this much earlier; None if the run had not begun."""
        wanted = int(self.frames[k, 0]) - round(back_s / FRAME_S)
        index = int(np.searchsorted(self.frames[:, 0], wanted))
        return index if index < len(self.frames) and self.frames[index, 0] == wanted else None

    def observation(self, k: int) -> Observation:
        """Return the driver's observation at a frame; `views` draws the same pictures."""
        ego = EgoState(*self.ego[k, :7].tolist())
        rows = self.seen[self._seen_from[k] : self._seen_from[k + 1]]
        actors = tuple(
            SeenActor(int(row[1]), KINDS[int(row[2])], *row[4:])  # type: ignore[arg-type]
            for row in rows.tolist()
        )
        signals: dict[str, SignalColour] = {}
        for junction, code in zip(self.mission.junctions, self.colours[k].tolist(), strict=True):
            colour = COLOURS[code]
            if junction.signal is not None and colour is not None:
                signals[junction.signal] = colour
        states = np.full((len(self.shapes) - 1, 3), np.nan)
        there = self.true[self._true_from[k] : self._true_from[k + 1]]
        states[there[:, 1].astype(np.int64)] = there[:, 3:6]
        x, y, heading = self.ego[k, 7:].tolist()
        views = StepViews(self.views, ego, actors, signals, (x, y, heading), states)
        return Observation(self.time_s(k), ego, actors, signals, round(int(self.frames[k, 1]) * FRAME_S, 6), views)

    def labels(self, k: int) -> Labels:
        """Return the labels of a labelled frame."""
        row = self._label_of[k]
        acceleration, steer, target, stop, stop_m, signal, drives = self.label_rows[row, 1:].tolist()
        there = self.true[self._true_from[k] : self._true_from[k + 1]]
        there = there[there[:, 2] > 0]
        x, y, heading = self.ego[k, 7:].tolist()
        c, s = math.cos(heading), math.sin(heading)
        dx, dy = there[:, 3] - x, there[:, 4] - y
        turned = np.remainder(there[:, 5] - heading + math.pi, math.tau) - math.pi
        others = there[:, 1].astype(np.int64)
        sizes = self._sizes[others]
        boxes = np.column_stack((c * dx + s * dy, c * dy - s * dx, turned, sizes, there[:, 6]))
        return Labels(
            self.trajectories[row], acceleration, steer, target, stop > 0, stop_m, int(signal), boxes,
            self._groups[others], drives > 0,
        )  # fmt: skip

    @cached_property
    def views(self) -> RunViews:
        """The common part of all pictures of the run; with the route, the map takes some megabytes once a picture is
        drawn."""
        ego, *others = self.shapes
        return RunViews(self.network, self.mission, ego, others, range_m=self.range_m)  # type: ignore[arg-type]

    def forget_views(self) -> None:
        """Free the memory for drawing."""
        self.__dict__.pop("views", None)

    @cached_property
    def _seen_from(self) -> IntArray:
        return np.searchsorted(self.seen[:, 0], np.arange(len(self.frames) + 1))

    @cached_property
    def _true_from(self) -> IntArray:
        return np.searchsorted(self.true[:, 0], np.arange(len(self.frames) + 1))

    @cached_property
    def _label_of(self) -> dict[int, int]:
        return {int(k): row for row, k in enumerate(self.label_rows[:, 0])}

    @cached_property
    def _sizes(self) -> FloatArray:
        return np.array([(shape.length_m, shape.width_m) for shape in self.shapes[1:]]).reshape(-1, 2)

    @cached_property
    def _groups(self) -> IntArray:
        return np.array([GROUP_OF[shape.kind] for shape in self.shapes[1:]], dtype=np.int64)


def read(path: Path) -> tuple[RecordedRun, ...]:
    """Return the runs of a file, or of all `.npz` files of a folder in the order of their names."""
    from training.shards import read_shard

    files = sorted(path.glob("*.npz")) if path.is_dir() else [path]
    return tuple(run for file in files for run in read_shard(file))


def samples(runs: Sequence[RecordedRun]) -> Iterator[tuple[RecordedRun, int]]:
    """Yield all labelled frames."""
    for run in runs:
        for k in run.labelled.tolist():
            yield run, k
