"""The mutation operators: model swap and steering (paper, section 3.4); timing and delay (ours)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import entry_points
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.random import Generator

from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.derive.presets import Preset, SteerSettings
from foresee_dsl.derive.validity import fits
from foresee_dsl.forecast.geometry import distances_to_ego
from foresee_dsl.forecast.settings import VEHICLE_KINDS, ForeseeSettings
from foresee_dsl.language.model import Actor, Change, Clip, Delay, Quantity, Steers, Timing
from foresee_dsl.simulate.actors import STANDS_MPS
from foresee_dsl.simulate.trace import SPEED, STEP_S, Trace

GROUP = "foresee_dsl.operators"
"""A package adds its own with `[project.entry-points."foresee_dsl.operators"]` and `mine = "package.module:MINE"`,
an object with a `name` and `changes`."""

GRAVITY_MPS2 = 9.81


@dataclass(frozen=True)
class Situation:
    """What an operator may look at: a clip, its unmutated run, and what the risky point is about.

    Attributes:
        trace: the clip's own run; frame 0 is the clip's beginning. frame: the risky point's.
        ranked: the id of the actor that the point is about, or "".
        models: every model that the case knows, by name. swappable: those that may be swapped in.
    """

    clip: Clip
    trace: Trace
    frame: int
    ranked: str
    models: Mapping[str, ModelSpec]
    swappable: tuple[str, ...]

    @cached_property
    def actors(self) -> dict[str, Actor]:
        """The clip's actors, by id."""
        return {item.name: item for item in self.clip.body if isinstance(item, Actor)}

    @cached_property
    def columns(self) -> dict[str, int]:
        """The columns of the clip's actors in the trace, in the trace's order."""
        return {info.id: k for k, info in enumerate(self.trace.actors) if info.id in self.actors}

    @cached_property
    def gaps(self) -> dict[str, np.ndarray[tuple[int], np.dtype[np.float64]]]:
        """Distances between the footprints of the ego and the clip's actors over the whole run, m."""
        return {actor: distances_to_ego(self.trace, k) for actor, k in self.columns.items()}

    def kind(self, actor: str) -> str:
        """Return an actor's class."""
        return self.trace.actors[self.columns[actor]].kind

    def spec(self, actor: str) -> ModelSpec:
        """Return an actor's model."""
        return self.models[self.trace.actors[self.columns[actor]].model]

    def speed_mps(self, actor: str, frame: int) -> float:
        """Return an actor's speed; 0 when it is absent."""
        speed = float(self.trace.states[frame, self.columns[actor], SPEED])
        return 0.0 if math.isnan(speed) else speed

    def way_m(self, actor: str) -> float:
        """Return how far an actor drives in the clip until a second after the risky point."""
        until = self.frame + round(1 / STEP_S)
        return float(np.nansum(self.trace.states[: until + 1, self.columns[actor], SPEED])) * STEP_S

    def follows_path(self, actor: str) -> bool:
        """Say whether an actor follows a path rather than lanes."""
        return bool(self.trace.actors[self.columns[actor]].path)

    def closest(self, frame: int, among: list[str]) -> list[str]:
        """Return actors by their distance to the ego at a frame; those that are absent then are left out."""
        return sorted(
            (a for a in among if math.isfinite(self.gaps[a][frame])),
            key=lambda a: (float(self.gaps[a][frame]), self.columns[a]),
        )


@runtime_checkable
class Operator(Protocol):
    """Proposes changes of one kind. `name` goes into the mutant's origin."""

    name: str

    def changes(self, situation: Situation, target: str, preset: Preset, rng: Generator) -> tuple[Change, ...]:
        """Draw a change of the target; empty where nothing that has an effect can be done to it."""
        ...

    def letter_target(self, situation: Situation) -> str:
        """Return the target that the paper's wording gives ("" for none)."""
        ...


class ModelSwap:
    """Another model of the same class, checked to fit.

    The paper also lets a bicycle become a pedestrian; here not: the two follow different rules in SUMO, so that the
    child would differ by more than a model.
    """

    name = "model_swap"

    def changes(self, situation: Situation, target: str, preset: Preset, rng: Generator) -> tuple[Change, ...]:
        """Draw one of the models that fit."""
        del preset
        column = situation.columns[target]
        now = situation.trace.actors[column].model
        others = sorted(
            name
            for name in situation.swappable
            if name != now and fits(situation.trace, column, 0, situation.models[name])
        )
        if not others:
            return ()
        return (Change(actor=target, property="model", was=now, now=others[int(rng.integers(len(others)))]),)

    def letter_target(self, situation: Situation) -> str:
        """Of the close actors whose closest frame lies in the window, the closest."""
        settings = ForeseeSettings()
        best = {actor: int(gaps.argmin()) for actor, gaps in situation.gaps.items()}
        relevant = [
            actor
            for actor, frame in best.items()
            if 0 < frame < situation.trace.frames - 1  # at an edge of the window, its closest frame lies outside
            and situation.gaps[actor][frame] <= settings.radius_m(situation.kind(actor))
            and situation.kind(actor) != "obstacle"
        ]
        return min(relevant, key=lambda a: (float(situation.gaps[a].min()), situation.columns[a]), default="")


class Steer:
    """A steering offset; afterwards the actor recovers its lane. Only actors on lanes can be steered."""

    name = "steer"

    def changes(self, situation: Situation, target: str, preset: Preset, rng: Generator) -> tuple[Change, ...]:
        """Draw an offset that friction, comfort and the steering rate allow."""
        settings = preset.steer
        if not _steerable(situation, target):
            return ()
        onset_s = self._onset_s(situation, settings)
        frame = situation.trace.frame_at(onset_s)
        speed = situation.speed_mps(target, frame)
        # Whoever stands at the onset is steered only where the preset does not ask for a speed (the paper's letter).
        if speed < settings.least_speed_mps:
            return ()
        bound = _largest_share(situation.spec(target), speed, settings)
        low, high = max(settings.low, -bound), min(settings.high, bound)
        value = _draw(rng, low, high, settings.step, centre=0.0, dead=max(settings.least_share * bound, settings.step))
        if value is None:
            return ()
        steers = next((i for i in situation.actors[target].body if isinstance(i, Steers)), None)
        was = steers.value if steers and isinstance(steers.value, Quantity) else Quantity.of(0.0, "ratio", 2)
        return (
            Change(
                actor=target,
                property="steer",
                was=was,
                now=Quantity.of(value, "ratio", 2),
                start=Quantity.of(onset_s, "time", 2) if settings.before_point_s is not None else None,
                duration=None if settings.hold_s is None else Quantity.of(settings.hold_s, "time", 2),
            ),
        )

    def letter_target(self, situation: Situation) -> str:
        """The vehicle that is closest to the ego at the clip's beginning."""
        steerable = [actor for actor in situation.columns if _steerable(situation, actor)]
        return next(iter(situation.closest(0, steerable)), "")

    @staticmethod
    def _onset_s(situation: Situation, settings: SteerSettings) -> float:
        if settings.before_point_s is None:
            return 0.0
        return max(0.0, situation.frame * STEP_S - settings.before_point_s)


class TimingShift:
    """Ours: the speed along one's own path, scaled; the actor still stops where it must."""

    name = "timing"

    def changes(self, situation: Situation, target: str, preset: Preset, rng: Generator) -> tuple[Change, ...]:
        """Draw a factor, within what the model can drive."""
        settings = preset.timing
        if situation.way_m(target) < settings.least_way_m:
            return ()
        column = situation.columns[target]
        fastest = float(np.nanmax(situation.trace.states[:, column, SPEED]))
        high = min(settings.high, situation.spec(target).max_speed_mps / max(fastest, STANDS_MPS))
        value = _draw(rng, settings.low, high, settings.step, centre=1.0, dead=settings.least_change)
        if value is None:
            return ()
        timing = next((i for i in situation.actors[target].body if isinstance(i, Timing)), None)
        was = timing.factor if timing and isinstance(timing.factor, Quantity) else Quantity.of(1.0, "ratio", 2)
        return (Change(actor=target, property="timing", was=was, now=Quantity.of(value, "ratio", 2)),)

    def letter_target(self, situation: Situation) -> str:
        """None: the paper has no such operator."""
        del situation
        return ""


class DelayShift:
    """Ours: a path-follower stands that much longer before it moves.

    Only for those that can stop on the spot: pedestrians, and cyclists that stand at the clip's beginning.
    """

    name = "delay"

    def changes(self, situation: Situation, target: str, preset: Preset, rng: Generator) -> tuple[Change, ...]:
        """Draw a delay."""
        settings = preset.delay
        stands = situation.speed_mps(target, 0) <= STANDS_MPS
        walks = situation.kind(target) == "pedestrian"
        if not situation.follows_path(target) or not (stands or walks):
            return ()
        if situation.way_m(target) < preset.timing.least_way_m:
            return ()
        delay = next((i for i in situation.actors[target].body if isinstance(i, Delay)), None)
        was = delay.time if delay and isinstance(delay.time, Quantity) else Quantity.of(0.0, "time", 2)
        value = _draw(rng, settings.low_s, settings.high_s, settings.step_s, centre=0.0, dead=0.0)
        if value is None:
            return ()
        return (Change(actor=target, property="delay", was=was, now=Quantity.of(was.si + value, "time", 2)),)

    def letter_target(self, situation: Situation) -> str:
        """None: the paper has no such operator."""
        del situation
        return ""


def operators() -> dict[str, Operator]:
    """Return all operators by name: ours, and those of installed packages (ours win)."""
    added = {entry.name: entry.load() for entry in sorted(entry_points(group=GROUP), key=lambda e: e.name)}
    return {**added, **{o.name: o for o in _OURS}}


_OURS: tuple[Operator, ...] = (ModelSwap(), Steer(), TimingShift(), DelayShift())


def _steerable(situation: Situation, actor: str) -> bool:
    info = situation.trace.actors[situation.columns[actor]]
    return info.kind in VEHICLE_KINDS and bool(info.route) and not info.path


def _largest_share(spec: ModelSpec, speed_mps: float, settings: SteerSettings) -> float:
    """Return the largest share of the steering angle that comfort and the steering rate allow at a speed."""
    angle = spec.max_steer_rad
    if angle <= 0:
        return 0.0
    if settings.lateral_g is not None and speed_mps > 0:
        curvature = settings.lateral_g * GRAVITY_MPS2 / speed_mps**2
        angle = min(angle, math.atan(curvature * spec.wheelbase_m))
    if settings.rate_rad_s is not None and settings.hold_s is not None:
        angle = min(angle, settings.rate_rad_s * settings.hold_s / 2)
    return angle / spec.max_steer_rad


def _draw(rng: Generator, low: float, high: float, step: float, *, centre: float, dead: float) -> float | None:
    """Draw one of the multiples of a step between two bounds, all alike, that are not within `dead` of the centre."""
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    allowed = [k for k in range(first, last + 1) if abs(k * step - centre) >= dead - 1e-9]
    return round(allowed[int(rng.integers(len(allowed)))] * step, 9) if allowed else None
