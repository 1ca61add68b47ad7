"""Records one run: a driver drives, the expert advises in the background, and the useful frames are kept."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from foresee_learned.rasters.ground import GroundMap
from foresee_learned.rasters.layout import CAMERA_AHEAD_M

from foresee_dsl.compile.bundle import ModelSpec, SumoBundle
from foresee_dsl.drivers.protocol import Closing, Control, Driver, Mission, Observation, VehicleLimits
from foresee_dsl.kernels.arrays import FloatArray, IntArray
from foresee_dsl.simulate.results.verdict import RunResult
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.sensing import STANDARD
from foresee_dsl.simulate.sensing.sight import Bodies, Sight
from foresee_dsl.simulate.sensing.views import CAMERA_RANGE_M, StepViews
from foresee_dsl.simulate.sensing.weather import Air
from foresee_dsl.simulate.trace import HEADING, SPEED, X, Y
from training.noise import Bursts, disturbed_start
from training.samples import COLOURS, FRAME_S, KINDS, POINTS, RecordedNetwork, RecordedRun, Shape
from training.shadow import Advice, Expert

KEPT = (0, 4)
"""Indices of the recorded frames among each ten frames (half a second)."""
VIEW_M, AHEAD_M = 48.0, 68.0
"""Range of the view from above, m; `AHEAD_M` includes the way that the ego can drive within the second of its past."""
BOX_M = 60.0
"""Largest distance of boxes in sight that are labels, m."""
_PASTS = (10, 20)
_BURST_ECHO_S = 3.0
HELD_UP_S, HELPS_S = 6.0, 4.0
"""A pupil that stands for `HELD_UP_S` where the expert would drive is helped: the expert drives for `HELPS_S`. Ours."""
OUTSIDE_M, RESCUED = 0.1, 0.7
"""In this share of the runs (`RESCUED`) a pupil that is this far outside of its lanes is helped too. Ours: otherwise a
kerb soon ends the run."""


WRONG_STEER, WRONG_PEDALS = 0.08, 0.4
"""Errors above which a pupil's answer differs from the expert's. Ours: 3 degrees of the wheels; a third of the
brakes."""


class Disturbance(NamedTuple):
    """The disturbances of a run.

    Attributes:
        start: whether the ego's start is moved.
        bursts: whether there are bursts of wrong controls.
        pause_s: mean time between two bursts, s.
    """

    start: bool = False
    bursts: bool = False
    pause_s: float = 9.0


UNDISTURBED = Disturbance()


@dataclass
class _Frame:
    """One recorded frame."""

    number: int
    measured: int
    ego: list[float]
    colours: list[int]
    seen: list[tuple[float, ...]]
    true: FloatArray
    advice: Advice
    drives: bool
    chance: float


class Enough(Exception):  # noqa: N818  no error: the run has nothing new to tell
    """Ends a run."""


@dataclass
class Recorder:
    """A driver that records the run of a pupil (or of the expert, without a pupil).

    Attributes:
        share: share of the stretches of 4 s in which the expert drives instead of the pupil.
        easy: factor on the frequency with which easy frames are kept.
    """

    bundle: SumoBundle
    rng: np.random.Generator
    pupil: Driver | None = None
    bursts: Bursts | None = None
    disturbance: Disturbance = UNDISTURBED
    share: float = 0.0
    easy: float = 1.0
    frames: list[_Frame] = field(default_factory=list)
    name = "recorder"
    version = "1"

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        """Begin a run."""
        scene = self.bundle.scene
        self.mission, self.vehicle = mission, vehicle
        self.models: tuple[ModelSpec, ...] = tuple(actor.model for actor in scene.actors[1:])
        self._expert = Expert(mission, vehicle, self.models)
        air = Air(scene.rain, scene.fog, scene.sun)
        self.range_m = air.object_range_m(CAMERA_RANGE_M)
        self._sight = Sight(Bodies.of(self.models), self.bundle.network.buildings, STANDARD, air)
        self._sizes = np.array([(a.length_m, a.width_m) for a in self.models]).reshape(-1, 2)
        self._advice: Advice | None = None
        self._held_up_s = 0.0
        self._errs = False
        self._rescued = self.pupil is not None and bool(self.rng.random() < RESCUED)
        self._helps_until_s = -math.inf
        self._drawn_until_s, self._expert_has_it = 0.0, self.pupil is None
        if self.disturbance.bursts:
            self.bursts = Bursts(self.rng, vehicle, self.disturbance.pause_s)
        if self.pupil is not None:
            self.pupil.reset(mission, vehicle, seed)

    def step(self, observation: Observation) -> Control:
        """Answer with the pupil's or the expert's control."""
        views = observation.views
        if not isinstance(views, StepViews):
            raise TypeError("recording needs the pictures' truth")
        number = round(observation.time_s / FRAME_S)
        if number % 2 == 0 or self._advice is None:
            self._advice = self._expert.advise(observation, views.pose, views.states)
            control = self._advice.control
        else:
            control = self._expert.hold(observation, views.pose)
        advice = self._advice
        drives = self.pupil is None or self._takes_over(observation, advice)
        if self.pupil is not None:
            answer = self.pupil.step(observation)  # also while it is helped: it must see every step
            self._errs = _differ(answer, control)
            control = control if drives else answer
        if number % 10 in KEPT:
            self.frames.append(self._frame(number, observation, views, advice, drives))
        return control if self.bursts is None else self.bursts.put_into(control, observation)

    def close(self) -> None:
        """Close the pupil."""
        if isinstance(self.pupil, Closing):
            self.pupil.close()

    def _takes_over(self, observation: Observation, advice: Advice) -> bool:
        """Whether the expert drives a pupil's run for now: by chance, or since the pupil stands or leaves its lanes."""
        time_s = observation.time_s
        if time_s >= self._drawn_until_s:
            self._drawn_until_s = time_s + HELPS_S
            self._expert_has_it = bool(self.rng.random() < self.share)
        idle = observation.ego.speed_mps < 0.3 and advice.acceleration_mps2 > 0.5
        self._held_up_s = self._held_up_s + FRAME_S if idle else 0.0
        if self._rescued and advice.outside_m > OUTSIDE_M:
            self._helps_until_s = time_s + HELPS_S
        if self._held_up_s > HELD_UP_S:
            self._held_up_s, self._helps_until_s = 0.0, time_s + HELPS_S
        return self._expert_has_it or time_s < self._helps_until_s

    def _frame(self, number: int, observation: Observation, views: StepViews, advice: Advice, drives: bool) -> _Frame:
        ego, pose, states = observation.ego, views.pose, views.states
        numbers = [ego.x, ego.y, ego.heading_rad, ego.speed_mps, ego.acceleration_mps2, ego.yaw_rate_rad_s]
        colours = [
            COLOURS.index(observation.signals.get(j.signal)) if j.signal is not None else 0
            for j in self.mission.junctions
        ]
        measured = observation.time_s if observation.measured_s is None else observation.measured_s
        return _Frame(
            number,
            round(measured / FRAME_S),
            [*numbers, ego.steer_rad, *pose],
            colours,
            self._seen_rows(observation),
            self._true_rows(pose, states),
            advice,
            drives,
            self._chance(observation, advice),
        )

    def _seen_rows(self, observation: Observation) -> list[tuple[float, ...]]:
        ego, rows = observation.ego, []
        c, s = math.cos(ego.heading_rad), math.sin(ego.heading_rad)
        for rank, a in enumerate(observation.actors):
            dx, dy = a.x - ego.x, a.y - ego.y
            ahead, left = c * dx + s * dy, c * dy - s * dx
            if -VIEW_M - a.length_m < ahead < AHEAD_M + a.length_m and abs(left) < VIEW_M + a.length_m:
                place = (a.x, a.y, a.heading_rad, a.speed_mps, a.length_m, a.width_m)
                rows.append((float(a.track), float(KINDS.index(a.kind)), float(rank), *place))
        return rows

    def _true_rows(self, pose: tuple[float, float, float], states: FloatArray) -> FloatArray:
        """Return [K, 6] actor, in sight, x, y, heading, speed of those that a label or the camera shows."""
        if not len(states):
            return np.empty((0, 6))
        c, s = math.cos(pose[2]), math.sin(pose[2])
        dx, dy = states[:, X] - pose[0], states[:, Y] - pose[1]
        ahead, left = c * dx + s * dy - CAMERA_AHEAD_M, c * dy - s * dx
        radius = np.hypot(self._sizes[:, 0], self._sizes[:, 1]) / 2
        visible = (ahead + radius > 0) & (ahead - radius < CAMERA_RANGE_M)
        visible &= np.abs(left) - 1.5 * radius <= np.maximum(ahead + radius, 0.0)
        in_sight = np.zeros(len(states), np.bool_)
        in_sight[self._sight.seen(*pose, states)] = True
        in_sight &= np.hypot(dx, dy) < BOX_M
        rows = np.flatnonzero(visible | in_sight)
        return np.column_stack((rows, in_sight[rows], states[rows][:, [X, Y, HEADING, SPEED]]))

    def _chance(self, observation: Observation, advice: Advice) -> float:
        """Return the probability with which a frame like this one is kept; there are more than enough of standing and
        of free roads."""
        ego, control = observation.ego, advice.control
        if self.bursts is not None and observation.time_s - self.bursts.ended_s < _BURST_ECHO_S:
            return 1.0
        if self._errs and ego.speed_mps > 0.3:
            return 1.0
        if ego.speed_mps < 0.3 and advice.target_speed_mps < 0.5:
            return 0.1 * self.easy
        bends = abs(control.steer) > 0.08 or abs(ego.yaw_rate_rad_s) > 0.06
        if bends or advice.acceleration_mps2 < -0.8 or ego.speed_mps < 0.3 or advice.stop_m < 25.0:
            return 1.0
        c, s = math.cos(ego.heading_rad), math.sin(ego.heading_rad)
        for a in observation.actors:
            dx, dy = a.x - ego.x, a.y - ego.y
            ahead, left = c * dx + s * dy, c * dy - s * dx
            if -2.0 < ahead < 22.0 and abs(left) < (7.0 if a.kind == "pedestrian" else 2.2):
                return 1.0
        return 0.35 * self.easy


def _differ(control: Control, other: Control) -> bool:
    """Return whether a pupil's answer differs from the expert's, so that its error is worth keeping."""
    pedals = abs((control.throttle - control.brake) - (other.throttle - other.brake))
    return abs(control.steer - other.steer) > WRONG_STEER or pedals > WRONG_PEDALS


def record(
    bundle: SumoBundle,
    seed: int,
    about: Mapping[str, Any],
    *,
    disturbance: Disturbance = UNDISTURBED,
    pupil: Driver | None = None,
    share: float = 0.0,
    easy: float = 1.0,
) -> tuple[RecordedRun | None, RunResult]:
    """Drive a test case and return its recording; None if no frame was worth keeping. The same arguments give the same
    result."""
    rng = np.random.Generator(np.random.PCG64(seed))
    if disturbance.start:
        bundle = disturbed_start(bundle, rng)
    recorder = Recorder(bundle, rng, pupil, disturbance=disturbance, share=share, easy=easy)
    result = run(bundle, recorder, seed=seed, deadlines=None)
    about_run = {**about, "seed": seed, "verdict": result.verdict.value, "duration_s": round(result.duration_s, 2)}
    about_run |= {"disturbed": [disturbance.start, disturbance.bursts], "reason": result.reason}
    chosen = rng.random(len(recorder.frames)) < [frame.chance for frame in recorder.frames]
    return (_kept(bundle, recorder, chosen, about_run) if chosen.any() else None), result


def _kept(bundle: SumoBundle, recorder: Recorder, chosen: IntArray, about: dict[str, Any]) -> RecordedRun:
    """Return the chosen frames with labels, and the frames of their past without labels."""
    frames = recorder.frames
    index = {frame.number: k for k, frame in enumerate(frames)}
    labelled = set(np.flatnonzero(chosen).tolist())
    past = {index.get(frames[k].number - back, k) for k in labelled for back in _PASTS}
    kept = [frames[k] for k in sorted(labelled | past)]
    indices = [k for k, j in enumerate(sorted(labelled | past)) if j in labelled]
    ego, others = bundle.scene.ego.model, recorder.models
    labels = [
        (k, a.acceleration_mps2, a.control.steer, a.target_speed_mps, a.stop, a.stop_m, a.signal, kept[k].drives)
        for k in indices
        for a in (kept[k].advice,)
    ]
    seen = [(k, row[0], row[1], *row[2:]) for k, frame in enumerate(kept) for row in frame.seen]
    true = [np.column_stack((np.full(len(kept[k].true), k), kept[k].true)) for k in indices]
    return RecordedRun(
        about=about,
        mission=recorder.mission,
        vehicle=recorder.vehicle,
        network=network_of(bundle),
        shapes=tuple(Shape(m.kind, m.length_m, m.width_m, m.height_m) for m in (ego, *others)),
        range_m=recorder.range_m,
        frames=np.array([(frame.number, frame.measured) for frame in kept], dtype=np.int64),
        ego=np.array([frame.ego for frame in kept]),
        colours=np.array([f.colours for f in kept], np.uint8).reshape(len(kept), len(recorder.mission.junctions)),
        seen=np.array(seen, dtype=np.float64).reshape(-1, 10),
        true=np.concatenate([np.empty((0, 7)), *true]),
        label_rows=np.array(labels, dtype=np.float64).reshape(-1, 8),
        trajectories=np.array([kept[k].advice.trajectory for k in indices]).reshape(-1, POINTS, 2),
    )


def network_of(bundle: SumoBundle) -> RecordedNetwork:
    """Return the part of a test case's network that pictures need."""
    key = bundle.net_file.parent.name
    buildings = tuple(tuple((float(x), float(y)) for x, y in outline) for outline in bundle.network.buildings)
    return RecordedNetwork(key, GroundMap.of(bundle.network), buildings)
