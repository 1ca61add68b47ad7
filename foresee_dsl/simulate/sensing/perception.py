"""The driver's observations of a run, one a frame."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.drivers.protocol import EgoState, Mission, Observation, SeenActor, SignalColour
from foresee_dsl.simulate.cast import Cast
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

_ABSENT = (math.nan, math.nan, math.nan, math.nan)


class _Measured(NamedTuple):
    """What was measured at an absolute frame."""

    frame: int
    actors: tuple[SeenActor, ...]
    signals: dict[str, SignalColour]


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
        self._cast, self._others = cast, others
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
        self._pipe: deque[_Measured] = deque()
        models = [actor.placed.model for actor in others]
        camera_m = air.object_range_m(CAMERA_RANGE_M) if settings.weather else CAMERA_RANGE_M
        self._views = RunViews(cast.network, mission, scene.ego.model, models, range_m=camera_m)

    def observe(self) -> Observation:
        """Return what the driver learns at the frame that the cast is at."""
        cast = self._cast
        ego = cast.ego
        states = np.array(
            [(a.x, a.y, a.heading, a.speed) if a.present else _ABSENT for a in self._others], dtype=np.float64
        ).reshape(-1, 4)
        s = cast.progress.of(ego, cast.frame)[0] + self._shift_s
        now, pose = self._began + cast.frame, (ego.x, ego.y, ego.heading)
        ready = now - self._latency
        if not self._pipe:
            for frame in range(ready - ready % self._scan, now, self._scan):
                self._pipe.append(self._measure_before(frame, states, s))
        taken = self._taken(now, pose)
        if now % self._scan == 0:
            self._pipe.append(self._measure(now, pose, taken, states, s))
        while len(self._pipe) > 1 and self._pipe[1].frame <= ready:
            self._pipe.popleft()
        got = self._pipe[0]
        told = Observation(
            time_s=cast.time_s,
            ego=_moved(ego.bicycle().as_ego(), taken),
            actors=got.actors,
            signals=dict(got.signals),
            measured_s=round((got.frame - self._began) * STEP_S, 6),
        )
        return replace(told, views=self._views.at(told, pose, states))

    def _measure(self, frame: int, pose: Pose, taken: Pose, states: FloatArray, s: float) -> _Measured:
        actors = self._objects.measure(frame, pose, taken, states)
        colours = {
            key: self._cast.world.colour(*self._links[key]) for key in self._heads.in_view(self._sight, pose, s, states)
        }
        return _Measured(frame, actors, colours)

    def _measure_before(self, frame: int, states: FloatArray, s: float) -> _Measured:
        """Measure at a frame before the first one."""
        ego, back_s = self._cast.ego, (self._began - frame) * STEP_S
        before = states.copy()
        before[:, 0] -= states[:, 3] * np.cos(states[:, 2]) * back_s
        before[:, 1] -= states[:, 3] * np.sin(states[:, 2]) * back_s
        way = ego.speed * back_s
        pose = (ego.x - way * math.cos(ego.heading), ego.y - way * math.sin(ego.heading), ego.heading)
        return self._measure(frame, pose, self._taken(frame, pose), before, s - way)

    def _taken(self, frame: int, pose: Pose) -> Pose:
        """Where the ego's localisation has it."""
        dx, dy, turned = (self._drifts.normals(frame)[0] * self._spread).tolist()
        return pose[0] + dx, pose[1] + dy, math.remainder(pose[2] + turned, math.tau)


def _moved(ego: EgoState, pose: Pose) -> EgoState:
    """An ego's state at another pose; speed, acceleration, yaw rate and steering are measured on board, exactly."""
    return replace(ego, x=pose[0], y=pose[1], heading_rad=pose[2])
