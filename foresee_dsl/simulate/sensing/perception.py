"""The driver's observations of a run, one a frame."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.drivers.protocol import EgoState, Mission, Observation, SeenActor, SignalColour
from foresee_dsl.simulate.cast import Cast
from foresee_dsl.simulate.dynamics import BicycleState
from foresee_dsl.simulate.rasters import RunViews
from foresee_dsl.simulate.rasters.layout import CAMERA_RANGE_M
from foresee_dsl.simulate.sensing.noise import Streams
from foresee_dsl.simulate.sensing.objects import ObjectList, Pose, frames_of
from foresee_dsl.simulate.sensing.settings import STANDARD, SensorSettings
from foresee_dsl.simulate.sensing.sight import Bodies, Sight
from foresee_dsl.simulate.sensing.signals import SignalHeads
from foresee_dsl.simulate.sensing.weather import Air
from foresee_dsl.simulate.trace import STEP_S

FloatArray = NDArray[np.float64]

_LATE = frozenset({"actors", "signals", "ego", "views"})


@dataclass(eq=False, slots=True)
class _Scan:
    """What there was to measure at an absolute frame, and what was measured once somebody looks.

    Attributes:
        pose, s: the ego's. states: [N, 4] x, y, heading, speed of the others. shown: each signal's colour.
    """

    frame: int
    pose: Pose
    s: float
    states: FloatArray
    shown: dict[str, SignalColour]
    measured: bool = False
    actors: tuple[SeenActor, ...] = ()
    signals: dict[str, SignalColour] = field(default_factory=dict)


class _Told(Observation):
    """An observation that is measured when it is first looked at: a driver that plans every other step pays for that.

    It is the same whenever that is: noise is a function of time, and the scans are measured in their order.
    """

    __slots__ = ("_now", "_scan", "_sensing")
    _sensing: Sensing
    _scan: _Scan
    _now: tuple[int, BicycleState, FloatArray]

    def __getattr__(self, name: str) -> object:
        """Fill in what has not been looked at yet (Python asks here for slots that are empty)."""
        if name not in _LATE:
            raise AttributeError(name)
        self._sensing.tell(self, self._scan, self._now)
        return object.__getattribute__(self, name)

    def __reduce__(self) -> tuple[object, ...]:
        """Go to another process as what was seen, without the pictures."""
        return Observation, (self.time_s, self.ego, self.actors, self.signals, self.measured_s)


class Sensing:
    """The sensors of the ego in one run. Ask once a frame, from the first on.

    Noise is a function of the seed, the actor and the time in the parent's run, so that a clip begins with the noise
    that its parent had there. A clip has no past: what was measured before its first frame is taken from where
    everybody would have been with the speed of that frame.
    """

    def __init__(self, cast: Cast, mission: Mission, seed: int, settings: SensorSettings = STANDARD) -> None:
        """Mount the sensors.

        Args:
            cast: the actors. mission: whose signals are meant. seed: of the run. settings: what the sensors can do.
        """
        scene = cast.scene
        others = cast.actors[1:]
        bodies = Bodies.of([actor.placed.model for actor in others])
        air = Air(scene.rain, scene.fog, scene.sun)
        self._cast, self._air, self._settings = cast, air, settings
        self._began = frames_of(scene.began_s)
        self._latency, self._scan = frames_of(settings.latency_s), max(frames_of(settings.scan_s), 1)
        self._sight = Sight(bodies, cast.network.buildings, settings, air)
        self._objects = ObjectList(bodies, [actor.id for actor in others], self._sight, settings, seed)
        self._heads = SignalHeads(mission, settings)
        # The mission's line may begin elsewhere than the scene's.
        self._shift_s = mission.start_s - scene.start_s
        self._links = {
            passage.signal: (passage.signal.rpartition(":")[0], int(passage.signal.rpartition(":")[2]))
            for passage in mission.junctions
            if passage.signal is not None
        }
        where = settings.localisation
        self._drifts = Streams(seed, (f"{scene.ego.id}'s pose",), (1.0, 1.0, 1.0), max(frames_of(where.drifts_s), 1))
        self._spread = np.array((where.position_m, where.position_m, where.heading_rad))
        self._pipe: deque[_Scan] = deque()
        self._unseen: deque[_Scan] = deque()
        self._mission = mission

    @cached_property
    def _views(self) -> RunViews:
        air, settings, scene = self._air, self._settings, self._cast.scene
        models = [actor.placed.model for actor in self._cast.actors[1:]]
        camera_m = air.object_range_m(CAMERA_RANGE_M) if settings.weather else CAMERA_RANGE_M
        return RunViews(self._cast.network, self._mission, scene.ego.model, models, range_m=camera_m)

    def observe(self, states: FloatArray) -> Observation:
        """Return what the driver learns at the frame that the cast is at.

        Args:
            states: [1 + N, >=4] x, y, heading, speed of the ego and the others, NaN where absent; not to be changed
                afterwards.
        """
        cast = self._cast
        ego, others = cast.ego, states[1:, :4]
        s = cast.progress.of(ego, cast.frame)[0] + self._shift_s
        now, pose = self._began + cast.frame, (ego.x, ego.y, ego.heading)
        ready = now - self._latency
        if not self._pipe:
            for frame in range(ready - ready % self._scan, now, self._scan):
                self._take(self._before(frame, others, s))
        if now % self._scan == 0:
            self._take(_Scan(now, pose, s, others, self._shown()))
        while len(self._pipe) > 1 and self._pipe[1].frame <= ready:
            self._pipe.popleft()
        got = self._pipe[0]
        told = _Told.__new__(_Told)
        put = object.__setattr__
        put(told, "time_s", cast.time_s)
        put(told, "measured_s", round((got.frame - self._began) * STEP_S, 6))
        put(told, "_sensing", self)
        put(told, "_scan", got)
        put(told, "_now", (now, ego.bicycle(), others))
        return told

    def tell(self, told: Observation, scan: _Scan, now: tuple[int, BicycleState, FloatArray]) -> None:
        """Fill in an observation.

        Args:
            told: it. scan: what it is about. now: its absolute frame, where the ego is, and the others' states.
        """
        while not scan.measured:  # in their order, as track numbers are given out so
            self._measure(self._unseen.popleft())
        frame, ego, states = now
        put = object.__setattr__
        put(told, "ego", _moved(ego.as_ego(), self._taken(frame, ego.pose)))
        put(told, "actors", scan.actors)
        put(told, "signals", dict(scan.signals))
        put(told, "views", self._views.at(told, ego.pose, states))

    def _take(self, scan: _Scan) -> None:
        self._pipe.append(scan)
        self._unseen.append(scan)

    def _shown(self) -> dict[str, SignalColour]:
        return {key: self._cast.world.colour(*link) for key, link in self._links.items()}

    def _measure(self, scan: _Scan) -> None:
        scan.measured = True
        scan.actors = self._objects.measure(scan.frame, scan.pose, self._taken(scan.frame, scan.pose), scan.states)
        scan.signals = {
            key: scan.shown[key] for key in self._heads.in_view(self._sight, scan.pose, scan.s, scan.states)
        }

    def _before(self, frame: int, states: FloatArray, s: float) -> _Scan:
        """What there was at a frame before the first one."""
        ego, back_s = self._cast.ego, (self._began - frame) * STEP_S
        before = states.copy()
        before[:, 0] -= states[:, 3] * np.cos(states[:, 2]) * back_s
        before[:, 1] -= states[:, 3] * np.sin(states[:, 2]) * back_s
        way = ego.speed * back_s
        pose = (ego.x - way * math.cos(ego.heading), ego.y - way * math.sin(ego.heading), ego.heading)
        return _Scan(frame, pose, s - way, before, self._shown())

    def _taken(self, frame: int, pose: Pose) -> Pose:
        """Where the ego's localisation has it."""
        dx, dy, turned = (self._drifts.normals(frame)[0] * self._spread).tolist()
        return pose[0] + dx, pose[1] + dy, math.remainder(pose[2] + turned, math.tau)


def _moved(ego: EgoState, pose: Pose) -> EgoState:
    """An ego's state at another pose; speed, acceleration, yaw rate and steering are measured on board, exactly."""
    return replace(ego, x=pose[0], y=pose[1], heading_rad=pose[2])
