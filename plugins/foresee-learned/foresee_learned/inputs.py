"""The inputs of the learned drivers' networks: two pictures and a few numbers, computed from an observation.

Training computes its inputs with this same code from recorded observations, so that the two cannot differ.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.drivers.protocol import EgoState, FloatArray, Mission, Observation, SeenActor, VehicleLimits, Window
from foresee_dsl.errors import DriverError
from foresee_dsl.kernels.arrays import IntArray
from foresee_learned.rasters.fill import box_pixels
from foresee_learned.rasters.layout import BIRDS_EYE, BIRDS_EYE_CHANNELS, FORWARD

Picture = NDArray[np.uint8]
Vector = NDArray[np.float32]
Place = tuple[float, float, float]
"""A place: x, y (m) and heading (rad)."""

AHEAD_M, BEHIND_M, SIDE_M = 48.0, 16.0, 32.0
"""The part of the view from above that the networks get, m. Ours: ahead as far as braking from 70 km/h takes with 4
m/s^2; behind and to the sides as far as an overtaking car (at 50 km/h) and a crossing car (at 30 km/h) drive in two
seconds."""
DRAWN_CHANNELS = tuple(name for name in BIRDS_EYE_CHANNELS if name != "ego")
"""Channels taken from the bird's-eye view: all except the ego's own footprint, which is the same in every picture."""
PAST_S = (0.5, 1.0)
"""Age of the object lists of the past channels, s."""
CHANNELS = (*DRAWN_CHANNELS, *(f"past_{seconds}_s" for seconds in PAST_S))
"""Channels of `LearnedInputs.birds_eye`."""
_SCALE = BIRDS_EYE.m_per_px
BIRDS_EYE_SHAPE = (
    len(CHANNELS),
    round((AHEAD_M + BEHIND_M) / BIRDS_EYE.m_per_px),
    round(2 * SIDE_M / BIRDS_EYE.m_per_px),
)
FORWARD_SHAPE = FORWARD.shape
TURNS = ("straight", "left", "right", "back")
"""Turns at junctions (`JunctionPassage.turn`); if none of them is set, there is no junction ahead within
`COMMAND_M`."""
COMMAND_M = 40.0
"""The turn at a junction is commanded from this distance before its stop line, m, up to the junction's end. Ours: half
of the view."""
GOALS_M = (8.0, 24.0)
"""Distances of the goal points along the route, m. The driver steers for the first one at town speed; the second shows
the bend behind it. TransFuser's points are 7.5 m to 50 m ahead (the smallest and largest distance of its route
planner)."""
VECTOR = (
    *("speed_mps", "speed_limit_mps"),
    *(f"goal_{distance:.0f}_m_{axis}" for distance in GOALS_M for axis in ("ahead_m", "left_m")),
    *(f"turn_{turn}" for turn in TURNS),
)
"""Content of `LearnedInputs.vector`, in this order; turns are 0 or 1."""

_WINDOW = Window(
    round(BIRDS_EYE.rows_ahead - AHEAD_M / _SCALE),
    round(BIRDS_EYE.columns / 2 - SIDE_M / _SCALE),
    *BIRDS_EYE_SHAPE[1:],
)
"""The part of the view from above that is drawn."""
_OWN = Window(0, 0, *BIRDS_EYE_SHAPE[1:])
"""The same part in its own pixels, in which the route and the past are drawn."""
_DRAWN = len(DRAWN_CHANNELS)
_LEAST_PX = 2.0
"""Shortest length of a side when drawn, px, as in `rasters.birdseye`."""
_ROUTE = CHANNELS.index("route")
_ROUTE_M = 1.5
"""Width of the route in the view from above, m."""
_EDGE_M = 2.0
"""A piece of the route whose middle is farther than this outside the picture covers none of its pixels, m."""
_BACK_M, _ON_M = 10.0, 25.0
"""The ego's place on its route is searched from `_BACK_M` behind its last place to `_ON_M` ahead of the farthest place
that it may have reached, m."""
_TURNED_M2 = 20.0
"""Penalty for a place at which the route runs in the opposite direction, as a squared distance, m^2: where a route
turns back, its two lanes of 3.3 m are beside each other."""
_SLACK_S = 1e-6


@dataclass(frozen=True, slots=True)
class LearnedInputs:
    """The inputs of one decision.

    Attributes:
        birds_eye: [20, 128, 128], channels as in `CHANNELS`; `AHEAD_M` ahead, `BEHIND_M` behind, `SIDE_M` to each side.
        forward: [13, 64, 160], the unchanged view ahead.
        vector: [10] float32, see `VECTOR`.
    """

    birds_eye: Picture
    forward: Picture
    vector: Vector


class InputMaker:
    """Computes the inputs of a run's decisions from consecutive observations."""

    def __init__(self, mission: Mission, vehicle: VehicleLimits) -> None:  # noqa: ARG002  room for what it can do
        """Begin at the mission's start, with no past."""
        self._route, self._line = _Route(mission), _boxes_along(mission)
        self._seen: deque[tuple[float, tuple[SeenActor, ...]]] = deque()

    @property
    def place_s(self) -> float:
        """Return the ego's length along its route when the last inputs were computed, m."""
        return self._route.at_s

    def make(self, observation: Observation) -> LearnedInputs:
        """Return the inputs; their past is taken from earlier observations."""
        self.note(observation)
        return self.draw(observation, [self._ago(observation.time_s, seconds) for seconds in PAST_S])

    def note(self, observation: Observation) -> None:
        """Store an observation without computing inputs, as part of the past of later ones; `make` stores its own
        observation.
        """
        now = observation.time_s
        self._seen.append((now, observation.actors))
        while len(self._seen) > 1 and self._seen[1][0] <= now - max(PAST_S) + _SLACK_S:
            self._seen.popleft()

    def draw(self, observation: Observation, past: Sequence[Sequence[SeenActor]]) -> LearnedInputs:
        """Return the inputs of an observation with this past.

        Args:
            observation: the present observation; its time must not be before the time of an earlier call's observation.
            past: for each time of `PAST_S`, the object list at that time; empty if there was no list.
        """
        views, ego = observation.views, observation.ego
        if views is None:
            raise DriverError("a learned driver needs pictures, and this observation has none (Observation.views)")
        birds_eye = np.empty(BIRDS_EYE_SHAPE, np.uint8)
        birds_eye[:_DRAWN] = views.birds_eye(_WINDOW)[:_DRAWN]
        birds_eye[_DRAWN:] = birds_eye[_ROUTE] = 0
        pose = (ego.x, ego.y, ego.heading_rad)
        line = self._line[_in_sight(pose, self._line)]
        before = [(a.x, a.y, a.heading_rad, a.length_m, a.width_m) for actors in past for a in actors]
        ago = [_DRAWN + k for k, actors in enumerate(past) for _ in actors]
        channels = np.array([_ROUTE] * len(line) + ago, np.int64)
        box, pixel = _covered(pose, np.concatenate((line, np.array(before).reshape(-1, 5))))
        birds_eye.reshape(len(CHANNELS), -1)[channels[box], pixel] = 255
        vector = self._route.vector(observation.time_s, ego)
        return LearnedInputs(birds_eye, views.forward(), vector)

    def _ago(self, now_s: float, seconds: float) -> tuple[SeenActor, ...]:
        """Return the newest object list that is at least this old; none if the run is younger."""
        for time_s, actors in reversed(self._seen):
            if time_s <= now_s - seconds + _SLACK_S:
                return actors
        return ()


def _boxes_along(mission: Mission) -> FloatArray:
    """Return the mission's line as boxes, one for each step: [N, 5] x, y, heading, length, width.

    The view from above shows the route only up to the goal. A clip's goal is the end of its window, in the middle of
    its parent's route. Drawn to the end of the mission's line, the route looks the same in both.
    """
    points = np.asarray(mission.centreline, dtype=np.float64)
    step = np.diff(points, axis=0)
    length = np.hypot(step[:, 0], step[:, 1])
    middle, heading = (points[1:] + points[:-1]) / 2, np.arctan2(step[:, 1], step[:, 0])
    return np.column_stack([middle, heading, length, np.full(len(step), _ROUTE_M)])


def _in_sight(pose: Place, boxes: FloatArray) -> NDArray[np.bool_]:
    """Return which boxes may be in the picture."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    dx, dy = boxes[:, 0] - pose[0], boxes[:, 1] - pose[1]
    ahead: FloatArray = c * dx + s * dy
    return (ahead > -BEHIND_M - _EDGE_M) & (ahead < AHEAD_M + _EDGE_M) & (abs(c * dy - s * dx) < SIDE_M + _EDGE_M)


def _covered(pose: Place, boxes: FloatArray) -> tuple[IntArray, IntArray]:
    """Return the pixels that boxes cover as seen from the ego's present place: the box, and the pixel's flat index.

    `boxes`: [N, 5] x, y, heading, length, width.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    dx, dy = boxes[:, 0] - pose[0], boxes[:, 1] - pose[1]
    turned = boxes[:, 2] - pose[2]
    size = np.maximum(boxes[:, 3:] / _SCALE, _LEAST_PX)
    drawn = np.column_stack(
        (
            (SIDE_M - (c * dy - s * dx)) / _SCALE,
            (AHEAD_M - (c * dx + s * dy)) / _SCALE,
            -np.sin(turned),
            -np.cos(turned),
            size,
        )
    )
    return box_pixels(drawn, _OWN)


class _Route:
    """The ego's place on its route, and the route ahead of it."""

    def __init__(self, mission: Mission) -> None:
        self._mission = mission
        self._points: FloatArray = np.asarray(mission.centreline, dtype=np.float64)
        self._s: FloatArray = np.asarray(mission.s, dtype=np.float64)
        step = np.diff(self._points, axis=0)
        self._x, self._y = self._points.T.copy()  # contiguous copies, because `interp` would copy them at each call
        self._step, self._length2 = step, np.maximum((step**2).sum(axis=1), 1e-12)
        self._along: FloatArray = step / np.sqrt(self._length2)[:, None]
        self.at_s, self._time_s = float(mission.start_s), 0.0

    def vector(self, time_s: float, ego: EgoState) -> Vector:
        """Return `VECTOR` of an ego; its place on the route is remembered for the next call."""
        s = self._place(time_s, ego)
        limit = float(np.interp(s, self._s, self._mission.speed_limit_mps))
        c, sine = math.cos(ego.heading_rad), math.sin(ego.heading_rad)
        numbers = [ego.speed_mps, limit]
        for distance in GOALS_M:
            dx = float(np.interp(s + distance, self._s, self._x)) - ego.x
            dy = float(np.interp(s + distance, self._s, self._y)) - ego.y
            numbers += [c * dx + sine * dy, c * dy - sine * dx]
        command = next(
            (j.turn for j in self._mission.junctions if j.stop_s - COMMAND_M <= s < j.exit_s),
            None,
        )
        numbers += [float(turn == command) for turn in TURNS]
        return np.array(numbers, dtype=np.float32)

    def _place(self, time_s: float, ego: EgoState) -> float:
        """Return the ego's length along its route, m: the nearest place that it can have reached."""
        driven = max(time_s - self._time_s, 0.0) * max(ego.speed_mps, 15.0)
        low, high = np.searchsorted(self._s, (self.at_s - _BACK_M, self.at_s + _ON_M + driven))
        part = slice(max(int(low) - 1, 0), max(int(high), 2))
        start, step = self._points[:-1][part], self._step[part]
        dx, dy = ego.x - start[:, 0], ego.y - start[:, 1]
        share = np.clip((dx * step[:, 0] + dy * step[:, 1]) / self._length2[part], 0.0, 1.0)
        off = (dx - share * step[:, 0]) ** 2 + (dy - share * step[:, 1]) ** 2
        heading = self._along[part] @ np.array((math.cos(ego.heading_rad), math.sin(ego.heading_rad)))
        best = int(np.argmin(off + _TURNED_M2 * np.maximum(-heading, 0.0)))
        at = part.start + best
        s = self._s[at] + float(share[best]) * (self._s[at + 1] - self._s[at])
        self.at_s, self._time_s = float(s), time_s
        return self.at_s
