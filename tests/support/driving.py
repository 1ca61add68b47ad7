"""A small closed loop for driver tests: hand-built missions, scripted others, the project's own vehicle dynamics."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from foresee_dsl.drivers.protocol import (
    Control,
    Driver,
    EgoState,
    Foe,
    JunctionPassage,
    Mission,
    Observation,
    SeenActor,
    SignalColour,
    VehicleLimits,
)
from foresee_dsl.simulate.actors.dynamics import Bicycle, BicycleState

STEP_S = 0.05
SEDAN = VehicleLimits(
    model="car.sedan",
    length_m=4.7,
    width_m=1.8,
    wheelbase_m=2.8,
    front_overhang_m=0.9,
    max_speed_mps=50.0,
    acceleration_mps2=3.0,
    braking_mps2=4.5,
    emergency_braking_mps2=8.0,
    steer_max_rad=0.61,
    steer_rate_rad_s=0.7,
)

Script = Callable[[float], SeenActor | None]
Signals = Callable[[float], dict[str, SignalColour]]


def line(*parts: tuple[float, float], start: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> np.ndarray:
    """Points 0.5 m apart along straights and arcs: parts are (length, radius), radius inf straight, > 0 to the left."""
    x, y, heading = start
    points = [(x, y)]
    for length, radius in parts:
        count = max(round(length / 0.5), 1)
        step = length / count
        for _ in range(count):
            turn = step / radius
            x += step * math.cos(heading + turn / 2)
            y += step * math.sin(heading + turn / 2)
            heading += turn
            points.append((x, y))
    return np.array(points)


def lengths(points: np.ndarray) -> np.ndarray:
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])


def mission(
    points: np.ndarray,
    *,
    limit_mps: float = 50 / 3.6,
    left_m: float = 1.75,
    right_m: float = 1.75,
    junctions: Sequence[JunctionPassage] = (),
    start_s: float = 5.0,
) -> Mission:
    s = lengths(points)
    n = len(s)
    return Mission(
        centreline=points,
        s=s,
        speed_limit_mps=np.full(n, limit_mps),
        left_m=np.full(n, left_m),
        right_m=np.full(n, right_m),
        start_s=start_s,
        goal_s=float(s[-1]) - 10.0,
        junctions=tuple(junctions),
        step_s=STEP_S,
    )


def moving(
    track: int,
    points: np.ndarray,
    speed: Callable[[float], float] | float,
    *,
    along_m: float = 0.0,
    kind: str = "car",
    size: tuple[float, float] = (4.5, 1.8),
    gone_at_end: bool = True,
) -> Script:
    """An actor that follows points at its own speed and ignores all others."""
    s = lengths(points)
    done: list[float] = [along_m]  # its way by step

    def at(time_s: float) -> SeenActor | None:
        frame = round(time_s / STEP_S)
        while len(done) <= frame:
            t = (len(done) - 1) * STEP_S
            done.append(done[-1] + STEP_S * (speed(t) if callable(speed) else speed))
        way = done[frame]
        if way > s[-1] and gone_at_end:
            return None
        ahead = min(way + 0.5, s[-1])
        behind = ahead - 0.5
        x, y = np.interp(way, s, points[:, 0]), np.interp(way, s, points[:, 1])
        dx = np.interp(ahead, s, points[:, 0]) - np.interp(behind, s, points[:, 0])
        dy = np.interp(ahead, s, points[:, 1]) - np.interp(behind, s, points[:, 1])
        v = speed(time_s) if callable(speed) else speed
        return SeenActor(track, kind, float(x), float(y), math.atan2(dy, dx), float(v), *size)  # type: ignore[arg-type]

    return at


def standing(
    track: int, x: float, y: float, heading: float = 0.0, kind: str = "car", size: tuple[float, float] = (4.5, 1.8)
) -> Script:
    return lambda _t: SeenActor(track, kind, x, y, heading, 0.0, *size)  # type: ignore[arg-type]


@dataclass
class Run:
    """The records of a closed-loop run, by step."""

    states: list[BicycleState] = field(default_factory=list)
    controls: list[Control] = field(default_factory=list)
    observations: list[Observation] = field(default_factory=list)
    gap_m: float = math.inf  # least distance between footprints, 0 or less: touched

    @property
    def speed(self) -> np.ndarray:
        return np.array([s.speed for s in self.states])

    @property
    def xy(self) -> np.ndarray:
        return np.array([(s.x, s.y) for s in self.states])

    @property
    def acceleration(self) -> np.ndarray:
        return np.array([s.acceleration for s in self.states])

    def lateral_error(self, points: np.ndarray) -> np.ndarray:
        """Signed distance of the middle of the car from a line, left positive."""
        fine_s = np.arange(0, lengths(points)[-1], 0.1)
        x = np.interp(fine_s, lengths(points), points[:, 0])
        y = np.interp(fine_s, lengths(points), points[:, 1])
        tx, ty = np.gradient(x, 0.1), np.gradient(y, 0.1)
        k = ((self.xy[:, :1] - x) ** 2 + (self.xy[:, 1:] - y) ** 2).argmin(axis=1)
        return tx[k] * (self.xy[:, 1] - y[k]) - ty[k] * (self.xy[:, 0] - x[k])

    def along(self, points: np.ndarray) -> np.ndarray:
        k = ((self.xy[:, :1] - points[:, 0]) ** 2 + (self.xy[:, 1:] - points[:, 1]) ** 2).argmin(axis=1)
        return lengths(points)[k]


def corners(x: float, y: float, heading: float, length: float, width: float) -> np.ndarray:
    c, s = math.cos(heading), math.sin(heading)
    base = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) * (length / 2, width / 2)
    return base @ np.array([(c, s), (-s, c)]) + (x, y)


def separation(a: np.ndarray, b: np.ndarray) -> float:
    """Largest separation over the edges' normals: negative where the boxes overlap (a lower bound of the distance)."""
    best = -math.inf
    for box in (a, b):
        for k in range(4):
            edge = box[(k + 1) % 4] - box[k]
            normal = np.array([edge[1], -edge[0]]) / np.hypot(*edge)
            pa, pb = a @ normal, b @ normal
            best = max(best, pb.min() - pa.max(), pa.min() - pb.max())
    return best


def drive(
    driver: Driver,
    task: Mission,
    *,
    start: BicycleState,
    seconds: float,
    others: Sequence[Script] = (),
    signals: Signals = lambda _t: {},
    limits: VehicleLimits = SEDAN,
    from_s: float = 0.0,
    after: Callable[[BicycleState], bool] = lambda _s: False,
) -> Run:
    """Run a driver in the loop; others are scripted and do not react. `after` ends the run early."""
    driver.reset(task, limits, seed=0)
    body, run, state = Bicycle(limits), Run(), start
    first = round(from_s / STEP_S)
    for frame in range(first, first + round(seconds / STEP_S)):
        time_s = frame * STEP_S
        seen = tuple(a for a in (script(time_s) for script in others) if a is not None)
        own = corners(state.x, state.y, state.heading, limits.length_m, limits.width_m)
        for a in seen:
            if math.hypot(a.x - state.x, a.y - state.y) < 15.0:
                gap = separation(own, corners(a.x, a.y, a.heading_rad, a.length_m, a.width_m))
                run.gap_m = min(run.gap_m, gap)
        observation = Observation(
            time_s,
            EgoState(state.x, state.y, state.heading, state.speed, state.acceleration, state.yaw_rate, state.steer),
            seen,
            signals(time_s),
        )
        answer = driver.step(observation)
        run.states.append(state)
        run.controls.append(answer)
        run.observations.append(observation)
        if after(state):
            break
        state = body.step(state, answer, STEP_S)
    return run


def crossing_foe(
    points: np.ndarray,
    other: np.ndarray,
    *,
    entry_s: float,
    has_priority: bool,
    pedestrian: bool = False,
    width_m: float = 2.2,
) -> Foe:
    """A foe with its conflict found from the two lines: where they are within `width_m` of each other."""
    distance = np.hypot(points[:, None, 0] - other[None, :, 0], points[:, None, 1] - other[None, :, 1])
    on_ego, on_other = np.flatnonzero(distance.min(axis=1) < width_m), np.flatnonzero(distance.min(axis=0) < width_m)
    s, t = lengths(points), lengths(other)
    return Foe(
        path=other,
        entry_s=entry_s,
        conflict_s=(float(s[on_ego[0]]), float(s[on_ego[-1]])),
        conflict_path_s=(float(t[on_other[0]]), float(t[on_other[-1]])),
        has_priority=has_priority,
        pedestrian=pedestrian,
    )
