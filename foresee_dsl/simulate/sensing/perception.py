"""Creates the driver's observations of a run, one per frame."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, make_dataclass
from functools import cached_property
from typing import Any, cast

import numpy as np

from foresee_dsl.drivers.protocol import EgoState, Mission, Observation, SeenActor, SignalColour
from foresee_dsl.drivers.tracking import ObjectTable
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.measuring import Part
from foresee_dsl.simulate.actors.simulation import Simulation
from foresee_dsl.simulate.mission import signal_heads
from foresee_dsl.simulate.sensing.noise import Streams
from foresee_dsl.simulate.sensing.objects import ObjectList, Pose, frames_of, seen_actors
from foresee_dsl.simulate.sensing.settings import STANDARD, SensorSettings
from foresee_dsl.simulate.sensing.sight import Bodies, Sight
from foresee_dsl.simulate.sensing.views import CAMERA_RANGE_M, RunViews, StepViews
from foresee_dsl.simulate.sensing.weather import Air
from foresee_dsl.simulate.trace import HEADING, SPEED, STEP_S, X, Y

_MEASURED_LATER = frozenset({"actors", "signals", "ego", "views"})


@dataclass(eq=False, slots=True)
class _Scan:
    """The true state at an absolute frame, and, once the driver has read them, the measurements of that state.

    Attributes:
        measured_s: the frame's time in this run. pose: the ego's pose. states: [N, >=4] x, y, heading, speed of the
            others. heads: indices of the signal heads in range. colours: colours of these signals.
    """

    frame: int
    measured_s: float
    pose: Pose
    states: FloatArray
    heads: list[int]
    colours: dict[str, SignalColour]
    table: ObjectTable | None = None
    signals: dict[str, SignalColour] | None = None
    actors: tuple[SeenActor, ...] | None = None


_OpenEgoState: Any = make_dataclass(
    "_OpenEgoState", [(field.name, field.type) for field in fields(EgoState)], slots=True
)
"""A mutable class from which `EgoState`s are created fast; `objects._Row` explains how."""


class _LazyObservation(Observation):
    """An observation that is measured when the driver first reads it, which saves time if the driver does not read each
    one.

    Its values do not depend on the time of reading, because noise is a function of time and scans are measured in
    order.
    """

    __slots__ = ("_source",)
    _source: tuple[Sensing, _Scan, int, FloatArray]

    def __getattr__(self, name: str) -> object:
        """Measure a field when it is first read; Python calls this method for a slot that is still empty."""
        if name not in _MEASURED_LATER:
            raise AttributeError(name)
        sensing, scan, frame, states = self._source
        value: object
        if name == "ego":
            value = sensing.ego_state(frame, states)
        elif name == "actors":
            value = sensing.actors(scan)
        elif name == "signals":
            value = sensing.signals(scan)
        else:
            value = sensing.views(self, states)
        object.__setattr__(self, name, value)
        return value

    def object_table(self) -> ObjectTable | None:
        """Return the object list as arrays, for the bundled drivers.

        None for a copy made by `dataclasses.replace`, whose actors may have been changed.
        """
        source = getattr(self, "_source", None)
        return source[0].table(source[1]) if source is not None else None

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle the observation as a plain one, without the pictures."""
        return Observation, (self.time_s, self.ego, self.actors, self.signals, self.measured_s)


class Sensing:
    """The sensors of the ego in one run. Call `observe` once a frame, from the first frame on.

    Noise is a function of the seed, the actor and the time in the parent's run, so that a clip begins with the noise
    that its parent had at that time. A clip has no past: scans before its first frame assume that all actors moved with
    the speeds that they have at the first frame.
    """

    def __init__(
        self, simulation: Simulation, mission: Mission, seed: int, settings: SensorSettings = STANDARD
    ) -> None:
        """Prepare the sensors of a run; the `mission` says which signals they observe."""
        scene = simulation.scene
        others = simulation.actors[1:]
        bodies = Bodies.of([actor.placed.model for actor in others])
        air = Air(scene.rain, scene.fog, scene.sun)
        self._simulation, self._air, self._settings = simulation, air, settings
        self._began = frames_of(scene.began_s)
        self._latency, self._scan = frames_of(settings.latency_s), max(frames_of(settings.scan_s), 1)
        self._sight = Sight(bodies, simulation.network.buildings, settings, air)
        self._objects = ObjectList(bodies, [actor.id for actor in others], self._sight, settings, seed)
        self._heads = SignalHeads(mission, settings)
        # The mission's line and the scene's line may begin at different places, so lengths along them differ by this.
        self._shift_s = mission.start_s - scene.start_s
        self._links = {
            passage.signal: (passage.signal.rpartition(":")[0], int(passage.signal.rpartition(":")[2]))
            for passage in mission.junctions
            if passage.signal is not None
        }
        where = settings.localisation
        self._drifts = Streams(seed, (f"{scene.ego.id}'s pose",), (1.0, 1.0, 1.0), max(frames_of(where.drifts_s), 1))
        self._position_m, self._heading_rad = where.position_m, where.heading_rad
        self._pipe: deque[_Scan] = deque()
        self._unseen: deque[_Scan] = deque()
        self._mission = mission
        self._numbers = {actor.id: k for k, actor in enumerate(others)}
        self._reported: tuple[int, frozenset[int]] = (-1, frozenset())

    def reports(self, actor: str) -> bool:
        """Return whether a scan at the current frame would report an actor.

        The driver's object list is older by the latency, and there is a scan only every few frames; this query ignores
        both, so that its result does not depend on earlier frames.
        """
        frame = self._simulation.frame
        if self._reported[0] != frame:
            states, _, _ = self._simulation.state_table.frame()
            x, y, heading = states[0, :3].tolist()
            self._reported = frame, self._objects.reported(self._began + frame, (x, y, heading), states[1:])
        return self._numbers.get(actor, -1) in self._reported[1]

    @property
    def numbered(self) -> Mapping[int, int]:
        """Return the index of the other actor of each track number so far; see `ObjectList.numbered`."""
        return self._objects.numbered

    def true_signals(self) -> dict[str, SignalColour]:
        """Return the colours of all signals of the mission at the current frame, in view or not."""
        lights = self._simulation.world.signals
        return {key: lights.colour(*link) for key, link in self._links.items()}

    @cached_property
    def _views(self) -> RunViews:
        air, settings, scene = self._air, self._settings, self._simulation.scene
        models = [actor.placed.model for actor in self._simulation.actors[1:]]
        camera_m = air.object_range_m(CAMERA_RANGE_M) if settings.weather else CAMERA_RANGE_M
        return RunViews(self._simulation.network, self._mission, scene.ego.model, models, range_m=camera_m)

    def observe(self, states: FloatArray) -> Observation:
        """Return the driver's observation at the current frame.

        `states`: [1 + N, 7] the columns of `Trace.states` for the ego and the others, NaN where absent; they must not
        change afterwards.
        """
        simulation = self._simulation
        now = self._began + simulation.frame
        ready = now - self._latency
        if not self._pipe:
            for frame in range(ready - ready % self._scan, now, self._scan):
                self._queue(self._scan_before(frame, states))
        if now % self._scan == 0:
            x, y, heading = states[0, :3].tolist()
            self._queue(self._scan_of(now, (x, y, heading), self._s(), states[1:]))
        while len(self._pipe) > 1 and self._pipe[1].frame <= ready:
            self._pipe.popleft()
        newest = self._pipe[0]
        observation = _LazyObservation.__new__(_LazyObservation)
        put = object.__setattr__
        put(observation, "time_s", simulation.time_s)
        put(observation, "measured_s", newest.measured_s)
        put(observation, "_source", (self, newest, now, states))
        return observation

    @Part.SENSING.measured
    def ego_state(self, frame: int, states: FloatArray) -> EgoState:
        """Return the ego's measured state at an absolute frame, from the true states.

        Speed, acceleration, yaw rate and steering are exact, because the vehicle measures them itself.
        """
        state = _OpenEgoState(*states[0].tolist())
        state.x, state.y, state.heading_rad = self._estimated_pose(frame, (state.x, state.y, state.heading_rad))
        state.__class__ = EgoState
        return cast(EgoState, state)

    @Part.SENSING.measured
    def table(self, scan: _Scan) -> ObjectTable:
        """Return the object list of a scan."""
        while scan.table is None:  # in the order of the frames, because the order decides the track numbers
            early = self._unseen.popleft()
            estimated = self._estimated_pose(early.frame, early.pose)
            early.table = self._objects.table(early.frame, early.pose, estimated, early.states)
        return scan.table

    @Part.SENSING.measured
    def actors(self, scan: _Scan) -> tuple[SeenActor, ...]:
        """Return the object list of a scan in the form that a driver gets."""
        if scan.actors is None:
            scan.actors = seen_actors(self.table(scan))
        return scan.actors

    @Part.SENSING.measured
    def signals(self, scan: _Scan) -> dict[str, SignalColour]:
        """Return the colours of the signals in view in a scan."""
        if scan.signals is None:
            in_view = self._heads.in_view(scan.heads, self._sight, scan.pose, scan.states)
            scan.signals = {key: scan.colours[key] for key in in_view}
        return dict(scan.signals)

    def views(self, observation: Observation, states: FloatArray) -> StepViews:
        """Return the pictures of an observation; `states` as in `observe`."""
        x, y, heading = states[0, :3].tolist()
        seen = observation.ego, observation.actors, observation.signals
        return StepViews(self._views, *seen, (x, y, heading), states[1:])

    def _queue(self, scan: _Scan) -> None:
        self._pipe.append(scan)
        self._unseen.append(scan)

    def _scan_of(self, frame: int, pose: Pose, s: float, states: FloatArray) -> _Scan:
        heads = self._heads.near(pose, s, self._sight.signal_range_m)
        lights = self._simulation.world.signals
        colours = {key: lights.colour(*self._links[key]) for key in self._heads.signals(heads)}
        return _Scan(frame, round((frame - self._began) * STEP_S, 6), pose, states, heads, colours)

    def _s(self) -> float:
        """Return the ego's length along the mission's line, m."""
        return self._simulation.progress.of(self._simulation.ego, self._simulation.frame)[0] + self._shift_s

    def _scan_before(self, frame: int, states: FloatArray) -> _Scan:
        """Return a scan at a frame before the first one, computed from the speeds at the first frame."""
        back_s = (self._began - frame) * STEP_S
        before = states.copy()
        before[:, X] -= states[:, SPEED] * np.cos(states[:, HEADING]) * back_s
        before[:, Y] -= states[:, SPEED] * np.sin(states[:, HEADING]) * back_s
        x, y, heading, speed = before[0, [X, Y, HEADING, SPEED]].tolist()
        return self._scan_of(frame, (x, y, heading), self._s() - speed * back_s, before[1:])

    def _estimated_pose(self, frame: int, pose: Pose) -> Pose:
        """Return the ego's pose as its localisation estimates it."""
        x, y, heading = pose
        dx, dy, turned = self._drifts.normals(frame)[0]
        return (
            x + dx * self._position_m,
            y + dy * self._position_m,
            math.remainder(heading + turned * self._heading_rad, math.tau),
        )


class SignalHeads:
    """The signals on the ego's route; each has a head before and one behind the junction, and seeing one is enough.

    SUMO's signals have no position. Here the near head is right of the stop line, as high as a van, and the far head is
    above the road straight on, behind the junction, where the ego sees it when it waits at the line. A lorry in front
    may hide both.
    """

    def __init__(self, mission: Mission, settings: SensorSettings) -> None:
        """Compute the positions of the heads."""
        self._least_cos = math.cos(min(settings.signal_view_rad / 2, math.pi))
        passages = [passage for passage in mission.junctions if passage.signal is not None]
        self._signals = [passage.signal or "" for passage in passages for _ in range(2)]
        self._places = np.array([signal_heads(mission, passage.stop_s) for passage in passages]).reshape(-1, 3)
        exits_s = [passage.exit_s for passage in passages for _ in range(2)]
        self._heads = [
            (k, x, y, s) for k, ((x, y, _), s) in enumerate(zip(self._places.tolist(), exits_s, strict=True))
        ]

    def near(self, ego: Pose, s: float, range_m: float) -> list[int]:
        """Return the indices of the heads that are in range and ahead of the ego, and whose junction it has not left.

        `ego`: x, y, heading. `s`: the ego's length along the mission's line, m.
        """
        x, y, heading = ego
        cos, sin = math.cos(heading), math.sin(heading)
        near = []
        for k, head_x, head_y, exit_s in self._heads:
            dx, dy = head_x - x, head_y - y
            gap = math.hypot(dx, dy)
            if gap <= range_m and exit_s > s and dx * cos + dy * sin >= gap * self._least_cos:
                near.append(k)
        return near

    def signals(self, heads: Iterable[int]) -> tuple[str, ...]:
        """Return the keys of the signals that these heads belong to, each once."""
        return tuple(dict.fromkeys([self._signals[k] for k in heads]))

    def in_view(self, heads: list[int], sight: Sight, ego: Pose, poses: FloatArray) -> tuple[str, ...]:
        """Return the keys of the signals of which a head is visible.

        `heads`: indices of the heads in range, in order. `ego`: x, y, heading. `poses`: [N, >=3] of the others.
        """
        if not heads:
            return ()
        first, last = heads[0], heads[-1]  # one range for all heads; the few that are beyond it cost little
        clear = sight.clear(ego[0], ego[1], poses, self._places[first : last + 1]).tolist()
        return self.signals([k for k in heads if clear[k - first]])
