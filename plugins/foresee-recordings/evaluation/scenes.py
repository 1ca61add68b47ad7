"""Generated scenes of a few actors: each has a situation of a kind, or something that resembles it and is none.

A scene is planned on a road (`s` along it, `d` to its left) or around a junction, sampled at 10 Hz, and blurred as
recordings from drones are: 5 cm, half a degree, 0.1 m/s. What is planted follows from the numbers of the plan, not from
any measure of the code under test.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from foresee_recordings.recording import FloatArray, Track
from numpy.random import Generator

RATE_S = 0.1
NOISE_M, NOISE_RAD, NOISE_MPS = 0.05, math.radians(0.5), 0.1
LANE_M = 3.5
CAR = ("car", 4.5, 1.8)
PERSON = ("pedestrian", 0.5, 0.5)
LASTS_S = 16.0
T = np.arange(0.0, LASTS_S, RATE_S)


@dataclass
class Scene:
    """Actors of one scene, by name: `ego`, `other`, and background; `moment_s` is None if it has no situation."""

    moment_s: float | None
    actors: dict[str, tuple[tuple[str, float, float], FloatArray, FloatArray]] = field(default_factory=dict)

    def add(self, name: str, x: FloatArray, y: FloatArray, what: tuple[str, float, float] = CAR) -> None:
        """Add an actor by its places at the times `T`."""
        self.actors[name] = (what, x, y)


@dataclass(frozen=True)
class Road:
    """A road of constant curvature, 1/m."""

    curvature: float

    def place(self, s: FloatArray, d: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return x and y of places along the road."""
        if abs(self.curvature) < 1e-9:
            return s, d
        radius = 1 / self.curvature
        turned = s * self.curvature
        return (radius - d) * np.sin(turned), radius - (radius - d) * np.cos(turned)


def tracks_of(scene: Scene, prefix: str, at: tuple[float, float], begins_s: float, rng: Generator) -> list[Track]:
    """Return the blurred tracks of a scene that is turned at random and moved to a place and a time."""
    turn = rng.uniform(-math.pi, math.pi)
    cos, sin = math.cos(turn), math.sin(turn)
    tracks = []
    for name, ((kind, length, width), px, py) in scene.actors.items():
        x, y = at[0] + cos * px - sin * py, at[1] + sin * px + cos * py
        vx, vy = np.gradient(x, RATE_S), np.gradient(y, RATE_S)
        speed = np.hypot(vx, vy)
        heading = np.arctan2(vy, vx)
        moving = np.flatnonzero(speed > 0.1)
        if len(moving):  # a standing actor keeps the heading with which it came, or leaves
            before = np.searchsorted(moving, np.arange(len(T)), side="right") - 1
            heading = heading[moving[np.maximum(before, 0)]]
        count = len(T)
        states = np.column_stack(
            [
                x + rng.normal(0, NOISE_M, count),
                y + rng.normal(0, NOISE_M, count),
                heading + rng.normal(0, NOISE_RAD, count),
                np.maximum(speed + rng.normal(0, NOISE_MPS, count), 0.0),
            ]
        )
        tracks.append(Track(f"{prefix}_{name}", kind, length, width, begins_s + T, states))
    return tracks


# --- motions along a road ---------------------------------------------------------------------------------------------


def travelled(speed: FloatArray) -> FloatArray:
    """Return the length driven at these speeds from the first time on."""
    return np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * RATE_S)])


def slowing(v0: float, begins_s: float, braking: float, least: float) -> FloatArray:
    """Return speeds: constant, then a braking that builds up in 0.3 s, down to a least speed."""
    rate = braking * np.clip((T - begins_s) / 0.3, 0.0, 1.0)
    return np.maximum(v0 - np.concatenate([[0.0], np.cumsum((rate[1:] + rate[:-1]) / 2 * RATE_S)]), least)


def moved_over(d0: float, d1: float, begins_s: float, lasts_s: float) -> FloatArray:
    """Return lateral places during a lane change."""
    share = np.clip((T - begins_s) / lasts_s, 0.0, 1.0)
    return d0 + (d1 - d0) * (1 - np.cos(math.pi * share)) / 2


def crossing_time(d0: float, d1: float, begins_s: float, lasts_s: float, at_d: float) -> float:
    """Return when a lane change reaches a lateral place."""
    share = math.acos(1 - 2 * (at_d - d0) / (d1 - d0)) / math.pi
    return begins_s + lasts_s * share


def a_road(rng: Generator) -> Road:
    """Return a straight or bent road."""
    return Road(float(rng.choice([0.0, 0.0, 1 / 300, -1 / 300, 1 / 700, -1 / 700])))


def background(scene: Scene, road: Road, ego_s: FloatArray, rng: Generator) -> None:
    """Add two cars that have nothing to do with the scene: far ahead in the ego's lane, and oncoming two lanes off."""
    scene.add("ahead", *road.place(ego_s + rng.uniform(140, 180), np.zeros(len(T))))
    oncoming = ego_s[-1] - rng.uniform(8, 20) * T
    scene.add("oncoming", *road.place(oncoming, np.full(len(T), 3.2 * LANE_M + 2.0)))


def cut_in(planted: bool, rng: Generator) -> Scene:
    """A lane change close ahead of the ego; else one far ahead, behind, by the ego, away, or none."""
    road, v, side = a_road(rng), rng.uniform(8, 33), rng.choice([-1.0, 1.0])
    begins, lasts = rng.uniform(4, 7), rng.uniform(2.5, 6)
    d0, d1 = side * LANE_M, 0.0
    enters = crossing_time(d0, d1, begins, lasts, side * 1.8)
    faster = rng.uniform(-0.8, 3)
    lateral_ego, lateral = np.zeros(len(T)), moved_over(d0, d1, begins, lasts)
    gap = max(rng.uniform(0.35, 1.6) * v, 4.0)
    if gap > 1.7 * v:
        gap = 1.6 * v
    if not planted:
        match rng.integers(8):
            case 0:
                gap = rng.uniform(2.6, 4.0) * v
            case 1:
                gap = -rng.uniform(12, 40)
                faster = rng.uniform(-1, 0.5)
            case 2:
                lateral = d0 + rng.uniform(0.2, 0.5) * np.sin(T * rng.uniform(0.3, 1.0))
            case 3:  # the ego itself changes to the lane behind the other
                lateral, lateral_ego = np.full(len(T), d0), moved_over(0.0, d0, begins, lasts)
            case 4:
                lateral = moved_over(0.0, d0, begins, lasts)
            case 5:
                lateral, faster = np.full(len(T), d0), rng.choice([-1, 1]) * rng.uniform(3, 8)
            case 6:
                lateral = d0 - side * 1.0 * np.exp(-(((T - enters) / 1.5) ** 2))
            case 7:
                lateral = moved_over(2 * d0, d0, begins, lasts)
    scene = Scene(enters if planted else None)
    s = v * T
    s_other = s + 4.5 + gap + faster * (T - enters)
    scene.add("ego", *road.place(s, lateral_ego))
    scene.add("other", *road.place(s_other, lateral))
    background(scene, road, s, rng)
    return scene


def hard_braking(planted: bool, rng: Generator) -> Scene:
    """A braking of 4.8 to 8 m/s^2; else one of up to 3.2 m/s^2."""
    road, v, begins = a_road(rng), rng.uniform(10, 30), rng.uniform(3, 7)
    braking = rng.uniform(4.8, 8.0) if planted else rng.uniform(0.5, 3.2)
    s = travelled(slowing(v, begins, braking, max(v - rng.uniform(8, 20), 0.0)))
    scene = Scene(begins + 0.8 if planted else None)
    scene.add("ego", *road.place(s, np.zeros(len(T))))
    scene.add("ahead", *road.place(v * T + 150, np.zeros(len(T))))
    return scene


def closing(ttc_s: float | None, rng: Generator) -> Scene:
    """An ego that nears a slower car, and begins to brake at a time to collision, which becomes a quarter smaller
    before it has braked to its speed; None: it passes by, in the next lane."""
    road, v = a_road(rng), rng.uniform(12, 30)
    speed = v - rng.uniform(5, 10)
    nearest = rng.uniform(6, 9)
    lateral = 0.0 if ttc_s is not None else rng.choice([-1, 1]) * LANE_M
    gap_at = (v - speed) * (ttc_s or 0.5)
    own = slowing(v, nearest, 1.3 * (v - speed) / max(ttc_s or 1.0, 0.35), speed) if ttc_s else np.full(len(T), v)
    s = travelled(own)
    s_other = speed * T
    k = int(nearest / RATE_S)
    scene = Scene(nearest)
    scene.add("ego", *road.place(s - s[k], np.zeros(len(T))))
    scene.add("other", *road.place(s_other - s_other[k] + 4.5 + gap_at, np.full(len(T), lateral)))
    scene.add("oncoming", *road.place(100.0 - 15 * (T - nearest), np.full(len(T), 2 * LANE_M + 1.0)))
    return scene


def low_ttc(planted: bool, rng: Generator) -> Scene:
    """An approach down to 0.5 to 1.2 s; else down to 2 to 3 s, or past a car in the next lane."""
    scene = closing(rng.uniform(0.5, 1.2) if planted else (rng.uniform(2.7, 4.0) if rng.random() < 0.7 else None), rng)
    scene.moment_s = scene.moment_s if planted else None
    return scene


def short_headway(planted: bool, rng: Generator) -> Scene:
    """A car that follows with 0.35 to 0.75 s for at least 4 s; else with 1.2 to 3 s, or for a second only."""
    road, v, begins = a_road(rng), rng.uniform(10, 32), rng.uniform(4, 6)
    far, close = rng.uniform(1.3, 3.0), rng.uniform(0.35, 0.75)
    lateral = np.zeros(len(T))
    headway = far + (close - far) * np.clip((T - begins) / 3.0, 0, 1)
    if not planted:
        match rng.integers(3):
            case 0:
                headway = np.full(len(T), far)
            case 1:
                headway = far + (0.8 - far) * np.exp(-(((T - 8) / 0.7) ** 2))
            case 2:
                lateral = np.full(len(T), rng.choice([-1, 1]) * LANE_M)
    s = v * T
    scene = Scene(begins + 6 if planted else None)
    scene.add("ego", *road.place(s, np.zeros(len(T))))
    scene.add("other", *road.place(s + 4.5 + headway * v, lateral))
    scene.add("oncoming", *road.place(300.0 - v * T, np.full(len(T), 2 * LANE_M + 1.0)))
    return scene


# --- crossing paths ---------------------------------------------------------------------------------------------------


def along(points: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the places along a line of points."""
    marks = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    return np.interp(s, marks, points[:, 0]), np.interp(s, marks, points[:, 1])


def passing(pet_s: float, angle_rad: float, rng: Generator, second: tuple[str, float, float] = CAR) -> Scene:
    """Two actors on straight lines that cross: the second one reaches the place `pet_s` after the first has left it."""
    what = [CAR, second]
    speeds = [rng.uniform(5, 14) if kind == "car" else rng.uniform(0.9, 1.8) for kind, *_ in what]
    order = [0, 1] if rng.random() < 0.5 else [1, 0]
    sine, cosine = abs(math.sin(angle_rad)), abs(math.cos(angle_rad))
    # Half the length of way over which an actor touches the strip that the other's body sweeps.
    half = [(what[1 - k][2] + what[k][2] * cosine) / (2 * sine) + what[k][1] / 2 for k in (0, 1)]
    first, then = order
    middle = rng.uniform(6, 8)
    times = {first: middle, then: middle + half[first] / speeds[first] + pet_s + half[then] / speeds[then]}
    scene = Scene(times[then] - half[then] / speeds[then])
    for k, name in enumerate(("ego", "other")):
        s = speeds[k] * (T - times[k])
        turn = 0.0 if k == 0 else angle_rad
        scene.add(name, s * math.cos(turn), s * math.sin(turn), what[k])
    return scene


def low_pet(planted: bool, rng: Generator) -> Scene:
    """A PET of 0.2 to 1.2 s; else of 1.8 to 5 s."""
    pet = rng.uniform(0.2, 1.2) if planted else rng.uniform(1.8, 5.0)
    scene = passing(pet, rng.choice([-1, 1]) * math.radians(rng.uniform(50, 130)), rng)
    scene.moment_s = scene.moment_s if planted else None
    return scene


def crossing_pedestrian(planted: bool, rng: Generator) -> Scene:
    """A pedestrian who crosses within 0.5 to 4.3 s; else one who crosses at another time, walks along, or waits."""
    turn = rng.choice([-1, 1]) * math.radians(rng.uniform(70, 110))
    scene = passing(rng.uniform(0.5, 4.3) if planted else rng.uniform(5.8, 7.0), turn, rng, PERSON)
    if planted:
        return scene
    scene.moment_s = None
    ego = scene.actors["ego"]
    match rng.integers(3):
        case 1:
            scene.add("other", 1.3 * (T - 5), np.full(len(T), rng.choice([-1, 1]) * rng.uniform(2.5, 5)), PERSON)
        case 2:
            y = np.minimum(-12 + 1.4 * T, -rng.uniform(1.8, 3))
            scene.add("other", np.full(len(T), 2.0), y, PERSON)
    scene.actors["ego"] = ego
    return scene


def left_turn() -> FloatArray:
    """Return the line of a left turn from the south to the west, with a radius of 10 m."""
    angles = np.linspace(0, math.pi / 2, 40)
    arc = np.column_stack([-8.25 + 10 * np.cos(angles), -8.25 + 10 * np.sin(angles)])
    return np.vstack([[(1.75, -120.0)], arc, [(-120.0, 1.75)]])


def unprotected_left(planted: bool, rng: Generator) -> Scene:
    """A left turn across the way of an oncoming car, within about 0.6 to 3.5 s; else later, or another movement."""
    line = left_turn()
    oncoming = np.array([(-1.75, 160.0), (-1.75, -160.0)])
    speed, other_speed = rng.uniform(5, 8), rng.uniform(8, 15)
    # Both lines pass (-1.75, 1.0): 127.6 m along the left turn, 159 m along the other's way.
    ego_at, other_at = 127.4, 159.2
    half = 3.2 / speed + 3.4 / other_speed
    pet, sign = rng.uniform(0.6, 3.5), rng.choice([-1, 1])
    kind = -1 if planted else rng.integers(5)
    match kind:
        case 0:
            pet = rng.uniform(7.0, 8.0)
        case 1:  # the ego goes straight on
            line = np.array([(1.75, -120.0), (1.75, 160.0)])
        case 2:  # the ego turns right
            line = line * (-1, 1) + (10.0, 0.0)
        case 3:  # the other one comes from the right
            oncoming = np.array([(160.0, 1.5), (-160.0, 1.0)])
            other_at, pet = 161.75, rng.uniform(1.0, 4.0)
        case 4:  # the other one comes from the left
            oncoming = np.array([(-160.0, -1.75), (160.0, -1.75)])
            ego_at, other_at = 124.0, 161.0
    at = rng.uniform(6, 8)
    scene = Scene(at if planted else None)
    scene.add("ego", *along(line, ego_at + speed * (T - at)))
    scene.add("other", *along(oncoming, other_at + other_speed * (T - at - sign * (pet + half))))
    return scene


def near_miss(planted: bool, rng: Generator) -> Scene:
    """An approach down to 0.4 to 0.8 s, or a PET of 0.2 to 0.8 s; else at least 1.4 s of either."""
    value = rng.uniform(0.4, 0.8) if planted else rng.uniform(1.8, 4.0)
    scene = closing(value, rng) if rng.random() < 0.5 else passing(value, math.radians(rng.uniform(60, 120)), rng)
    scene.moment_s = scene.moment_s if planted else None
    return scene


MAKERS: dict[str, Callable[[bool, Generator], Scene]] = {
    maker.__name__: maker
    for maker in (
        cut_in, hard_braking, unprotected_left, crossing_pedestrian, low_ttc, low_pet, short_headway, near_miss,
    )
}  # fmt: skip
