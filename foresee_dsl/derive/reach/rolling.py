"""Rolls out the allowed changes of operators: the actors' new poses, and their gaps to the recorded ego.

It has the settings of the ranker `reach`, too.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from foresee_dsl.avoidance.candidates.scoring import NOTICE_S
from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.compile.placement.scene import DRY_FRICTION
from foresee_dsl.derive.operators.ours import Shift
from foresee_dsl.derive.operators.paper import RECOVERS_S, ModelSwap, Steer
from foresee_dsl.derive.operators.situation import ActorsRun, Numeric, Situation
from foresee_dsl.derive.presets import MutationPreset
from foresee_dsl.forecast.pair_goal import PairGoal
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.boxes import box_distance
from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.language.model import Clip, Quantity
from foresee_dsl.language.model.derived import PROPERTIES
from foresee_dsl.simulate.actors.dynamics import lateral_limit_mps2
from foresee_dsl.simulate.trace import HEADING, SPEED, STEP_S, YAW_RATE, Trace, X, Y

_CRAWLS_MPS = 0.5
"""At a lower speed than this, the recorded yaw rate does not tell the curvature, so the wheels are assumed to be
straight, m/s. Ours.
"""
_TIGHTEST_PER_M = 0.3
"""Largest curvature that is computed from a recorded yaw rate, 1/m. Ours: a car's turning circle has a radius of
5.5 m."""


@dataclass(frozen=True, slots=True)
class ReachSettings:
    """Settings of the ranker `reach`. All ours, chosen on the even half of the test cases (docs/background/rankers.md).

    Attributes:
        every_s: time between the examined onsets. Ours: whole seconds, as in the exhaustive search.
        nearest: number of actors examined per onset, the nearest to the ego first.
        within_m: distance to the ego above which an actor is not examined. Ours: two vehicles that meet at 30 km/h
            cover it in 2.4 s.
        looks_s: duration of the roll-out of a change. Ours: for steering 4 s, 5 s and 7 s give 37, 37 and 31 failures;
            for the others 4 s, 5 s and 8 s give 53, 59 and 61 findings in 1.34 h, 1.51 h and 1.70 h.
        step_s: time step of the roll-out. Ours: a vehicle in town turns by less than 4 deg in it.
        shares: largest number of values per change that are rolled out, evenly spaced over the allowed ones.
        decided: largest number of values that reach the ego for which careful drivers are rolled out.
        met_weight: weight of an actor that comes near the ego without a change within `met_s` after the onset; the
            weight is halved at 1 m. Ours: of 0.15, 0.3 and 0.6, 0.3 gave as many failures as any, and as many
            avoidable ones.
        met_s: see `met_weight`.
        again: worth of a kind of contact the second time, as a share of the first. Ours: 0.3, 0.5 and 0.7 differ by
            little.
        notice_s: shortest time from the change to a contact that counts, as no driver reacts sooner. Of 1.15 s and
            2 s, the first has more findings, and more avoidable ones.
        swap_within_m: recorded gap to the ego above which an actor's model is not swapped, swap_reach_m: gap that a
            swap must reach. Ours: these save time, as most swaps have no effect.
        proposals: maximum number of ranked changes; the points of the ranker `foresee` follow them.
    """

    every_s: float = 1.0
    nearest: int = 3
    within_m: float = 40.0
    looks_s: float = 5.0
    step_s: float = 0.1
    shares: int = 41
    decided: int = 6
    met_weight: float = 0.3
    met_s: float = 10.0
    again: float = 0.5
    notice_s: float = NOTICE_S
    swap_within_m: float = 6.0
    swap_reach_m: float = 1.0
    proposals: int = 24


class _Limits(NamedTuple):
    """Limits of P vehicles, [P, 1] each: m, rad, rad/s, m, m/s^2.

    `rear_axle`: distance of the rear axle behind the middle.
    """

    wheelbase: FloatArray
    steer: FloatArray
    rate: FloatArray
    rear_axle: FloatArray
    lateral: FloatArray

    @classmethod
    def of(cls, specs: list[ModelSpec]) -> _Limits:
        rows = [
            (s.wheelbase_m, s.max_steer_rad, s.steer_rate_rad_s, s.wheelbase_m + s.front_overhang_m - s.length_m / 2,
             lateral_limit_mps2(s.name, DRY_FRICTION))
            for s in specs
        ]  # fmt: skip
        return cls(*np.array(rows).T[:, :, None])


def steered(
    trace: Trace,
    models: Mapping[str, ModelSpec],
    onsets: tuple[FloatArray, FloatArray],
    shares: FloatArray,
    hold_s: float | None,
    step_s: float,
) -> FloatArray:
    """Return the poses of vehicles whose wheels get an offset, [P, N, T, 3] (m, m, rad).

    Args:
        trace: the recorded run. models: all models, by name.
        onsets: the vehicles' columns, [P], and the frames, [P, T], of which the first is the onset.
        shares: [P, N] offsets, as shares of the largest steering angle.
        hold_s: how long the offset acts; None: to the end. Afterwards the vehicle returns to its recorded heading.
        step_s: time between frames.
    """
    actors, frames = onsets
    states = trace.states[frames, actors[:, None]]
    limits = _Limits.of([models[trace.actors[k].model] for k in actors])
    speeds, yaw = np.nan_to_num(states[..., SPEED]), np.nan_to_num(states[..., YAW_RATE])
    bends = np.where(speeds > _CRAWLS_MPS, yaw / np.maximum(speeds, _CRAWLS_MPS), 0.0)
    bends = np.clip(bends, -_TIGHTEST_PER_M, _TIGHTEST_PER_M)
    heading = np.repeat(states[:, :1, HEADING], shares.shape[1], axis=1)
    x = states[:, :1, X] - limits.rear_axle * np.cos(heading)
    y = states[:, :1, Y] - limits.rear_axle * np.sin(heading)
    wheels = np.repeat(np.arctan(bends[:, :1] * limits.wheelbase), shares.shape[1], axis=1)
    recorded = np.unwrap(np.nan_to_num(states[..., HEADING]), axis=1)
    strayed = np.zeros_like(heading)
    poses = np.empty((*shares.shape, frames.shape[1], 3))
    for k in range(frames.shape[1]):
        poses[:, :, k, 0] = x + limits.rear_axle * np.cos(heading)
        poses[:, :, k, 1] = y + limits.rear_axle * np.sin(heading)
        poses[:, :, k, 2] = heading
        if k + 1 == frames.shape[1]:
            break
        squared = np.maximum(speeds[:, k : k + 1], _CRAWLS_MPS) ** 2
        way = (speeds[:, k : k + 1] + speeds[:, k + 1 : k + 2]) / 2 * step_s
        if hold_s is None or k * step_s < hold_s - 1e-9:
            most = np.minimum(limits.steer, np.arctan(limits.lateral * limits.wheelbase / squared))
            wanted = np.arctan(bends[:, k : k + 1] * limits.wheelbase) + shares * limits.steer
            wanted = np.clip(wanted, -most, most)
            wheels = wheels + np.clip(wanted - wheels, -limits.rate * step_s, limits.rate * step_s)
            curvature = np.tan(wheels) / limits.wheelbase
            held = limits.lateral / squared
            turn = way * np.clip(curvature, -held, held)
            strayed = heading + turn - recorded[:, k + 1 : k + 2]
        else:
            strayed = strayed * np.exp(-step_s / RECOVERS_S)
            turn = recorded[:, k + 1 : k + 2] + strayed - heading
        x = x + way * np.cos(heading + turn / 2)
        y = y + way * np.sin(heading + turn / 2)
        heading = heading + turn
    return poses


_CLOSE_M = 2.0
"""If the gap between the circles around two bodies is smaller than this, the distance between their footprints is
computed, m. Otherwise the distance between the circles is exact enough.
"""
_AFTER_POINT_S = 1.0
"""Time after the risky point up to which operators need the run (`Situation.driven_m`), s."""


@dataclass(frozen=True)
class RolledChange:
    """An operator that acts on an actor from a moment on. `onset`: the frame. `actor`: the actor's column."""

    onset: int
    actor: int
    operator: Numeric | ModelSwap


@dataclass(frozen=True, eq=False)
class RollOut:
    """A change that was rolled out with some of its allowed values.

    Attributes:
        values: [N], SI units; for a model swap, indices among the models that fit.
        frames: [T] frames of the run; the run's last frame is repeated after its end.
        poses: [N, T, 3] poses of the actor: m, m, rad.
        gaps: [N, T] gaps to the recorded ego's footprint, m; exact below some metres, infinite after the run's end.
    """

    change: RolledChange
    values: FloatArray
    frames: FloatArray
    poses: FloatArray
    gaps: FloatArray

    @property
    def every(self) -> int:
        """Return the number of frames per step."""
        return int(self.frames[1] - self.frames[0])

    @property
    def steps(self) -> int:
        """Return the number of whole steps before the run's end."""
        return int(np.count_nonzero(np.diff(self.frames) == self.every))


class _Moment(Situation):
    """The situation at a moment of a run before a clip is cut; the actors' statements have their default values."""

    @cached_property
    def columns(self) -> dict[str, int]:
        """Return the columns of the actors that are present."""
        there = ~np.isnan(self.trace.states[0, :, X])
        return {info.id: k for k, info in enumerate(self.trace.actors) if k and there[k]}

    def present_value(self, actor: str, name: str) -> Quantity | None:
        """Return an actor's place on its path for `moving`; for other properties, the default."""
        definition = PROPERTIES[name]
        if definition.dimension is None:
            return None
        if name == "moving" and actor in self.trace.on_tracks:
            return None  # its place follows from the time of its track
        if name == "moving":
            along = float(self.trace.along[0, self.columns[actor]])
            return None if math.isnan(along) else Quantity.of(along, definition.dimension, 2)
        return None if definition.default is None else Quantity.of(definition.default.si, definition.dimension, 2)


_NO_CLIP = Clip(name="none", parent="none.foresee", pin="sha256:000000000000", body=())
"""Placeholder for the clips, which are not cut yet."""


@dataclass(frozen=True, eq=False)
class Rolling:
    """Rolls changes out along a run that passed.

    Attributes:
        operators: the operators of the preset that can be rolled out. gaps: [A, T] gaps of the actors to the ego, m.
        models_of: for each swap, the models that fit.
        goal: the goal of the actor whose changes are rolled out. Its margins (SI units) take the place of the gaps.
    """

    trace: Trace
    models: Mapping[str, ModelSpec]
    preset: MutationPreset
    settings: ReachSettings
    operators: Sequence[Numeric | ModelSwap]
    gaps: FloatArray
    models_of: dict[RolledChange, tuple[str, ...]] = field(default_factory=dict)
    goal: PairGoal | None = None

    def changes(self, onset: int, actors: Sequence[int]) -> Iterator[tuple[RolledChange, FloatArray]]:
        """Yield the changes of some actors (columns) from a frame on, with all allowed values."""
        moment = self.moment(onset)
        for actor in actors:
            name = self.trace.actors[actor].id
            if name not in moment.columns:
                continue
            for operator in self.operators:
                if isinstance(operator, ModelSwap):
                    yield from self._swaps(moment, onset, actor, operator)
                    continue
                values = operator.values(moment, name, self.preset)
                if len(values):
                    yield RolledChange(onset, actor, operator), np.array(values, dtype=np.float64)

    def moment(self, onset: int) -> Situation:
        """Return the situation at a frame at which a clip would begin, without cutting the clip."""
        frames = round((self.settings.looks_s + _AFTER_POINT_S) / STEP_S) + 1
        return _Moment(
            clip=_NO_CLIP, trace=self.trace.part(onset, onset + frames), frame=round(self.settings.looks_s / STEP_S),
            ranked="", models=self.models, swappable=tuple(sorted(self.models)), onset_s=0.0,
        )  # fmt: skip

    def _swaps(
        self, moment: Situation, onset: int, actor: int, operator: ModelSwap
    ) -> Iterator[tuple[RolledChange, FloatArray]]:
        """Yield the model swap of a moving actor, if another model of its class can bring the actor near the ego.

        Whether models fit is slow to compute, so it is computed only for an actor that would come near.
        """
        info, until = self.trace.actors[actor], onset + round(self.settings.looks_s / STEP_S)
        moves = np.nanmax(self.trace.states[onset : until + 1, actor, SPEED]) > STANDS_MPS
        if not moves or self.gaps[actor, onset : until + 1].min() > self.settings.swap_within_m:
            return
        change = RolledChange(onset, actor, operator)
        self.models_of[change] = tuple(
            n for n, spec in self.models.items() if spec.kind == info.kind and n != info.model
        )
        if not self.models_of[change]:
            return
        rolled = self._shifted(change, np.arange(len(self.models_of[change]), dtype=np.float64))
        if rolled.gaps.min() > self.settings.swap_reach_m:
            return
        if models := operator.fitting(moment, info.id):
            self.models_of[change] = models
            yield change, np.arange(len(models), dtype=np.float64)

    def rolled(self, changes: Sequence[tuple[RolledChange, FloatArray]]) -> list[RollOut]:
        """Return changes that were rolled out, each with up to `settings.shares` of its allowed values, evenly
        spaced.
        """
        chosen = [(change, _evenly(values, self.settings.shares)) for change, values in changes]
        steers = [(change, values) for change, values in chosen if isinstance(change.operator, Steer)]
        rolled = self._steered(steers)
        rolled += [self._shifted(change, values) for change, values in chosen if not isinstance(change.operator, Steer)]
        return sorted(rolled, key=lambda r: (r.change.onset, r.change.actor, r.change.operator.name))

    def _frames(self, onset: int) -> FloatArray:
        every = round(self.settings.step_s / STEP_S)
        steps = np.arange(round(self.settings.looks_s / self.settings.step_s) + 1)
        return np.minimum(onset + every * steps, self.trace.frames - 1)

    def _steered(self, chosen: Sequence[tuple[RolledChange, FloatArray]]) -> list[RollOut]:
        if not chosen:
            return []
        most = max(len(values) for _, values in chosen)
        # A row with fewer values is filled up by repeating its own values.
        shares = np.array([np.resize(values, most) for _, values in chosen])
        frames = np.array([self._frames(change.onset) for change, _ in chosen])
        actors = np.array([change.actor for change, _ in chosen])
        poses = steered(self.trace, self.models, (actors, frames), shares, self.preset.steer.hold_s,
                        self.settings.step_s)  # fmt: skip
        gaps = self._gaps(poses, actors, frames)
        return [
            RollOut(change, values, frames[k], poses[k, : len(values)], gaps[k, : len(values)])
            for k, (change, values) in enumerate(chosen)
        ]

    def _shifted(self, change: RolledChange, values: FloatArray) -> RollOut:
        frames = self._frames(change.onset)
        part = self.trace.part(change.onset, int(frames[-1]) + 1)
        boxes = part.boxes(change.actor)
        match change.operator:
            case ModelSwap() as swap:
                names = [self.models_of[change][round(k)] for k in values]
                own = self.models[self.trace.actors[change.actor].model]
                tracks = swap.tracks(boxes, [self.models[name] for name in names], own)
            case Shift() as shift:
                actor = part.actors[change.actor].id
                if (was := self.moment(change.onset).present_value(actor, shift.property)) is None:
                    raise LookupError(f"{actor} has no {shift.property} that {shift.name} could change")
                tracks = shift.tracks(boxes, shift.shifts(values, was.si), ActorsRun(part, change.actor, self.models))
            case _:
                raise TypeError(f"{change.operator.name} has no track")
        tracks = tracks[:, frames - change.onset]
        gaps = self._gaps(tracks[None, :, :, :3], np.array([change.actor]), frames[None], tracks[None, :, 0, 3:])[0]
        return RollOut(change, values, frames, tracks[:, :, :3], gaps)

    def _gaps(
        self, poses: FloatArray, actors: FloatArray, frames: FloatArray, sizes: FloatArray | None = None
    ) -> FloatArray:
        """Return the distances of actors at poses [P, N, T, 3] to the recorded ego: [P, N, T] m, infinite where absent.

        `sizes`: [P, N, 2] lengths and widths of the actors, m; None: their recorded ones.
        """
        trace = self.trace
        ego, info = trace.states[frames, 0][..., [X, Y, HEADING]], trace.actors[0]
        if sizes is None:
            own = np.array([(trace.actors[k].length_m, trace.actors[k].width_m) for k in actors])
            sizes = np.repeat(own[:, None], poses.shape[1], axis=1)
        gone = np.isnan(trace.states[frames, actors[:, None], X])
        gone[:, 1:] |= frames[:, 1:] == frames[:, :-1]  # a frame beyond the run's end
        if self.goal is not None:
            margins = self._margins(self.goal, poses, frames, sizes)
            return np.where(np.isnan(margins) | gone[:, None, :], np.inf, margins)
        circles = (np.hypot(sizes[..., 0], sizes[..., 1]) + math.hypot(info.length_m, info.width_m))[..., None] / 2
        apart = np.hypot(poses[..., 0] - ego[:, None, :, 0], poses[..., 1] - ego[:, None, :, 1])
        gaps = np.where(np.isnan(apart) | gone[:, None, :], np.inf, np.maximum(apart - circles, 0.0))
        p, n, t = np.nonzero(gaps < _CLOSE_M)
        egos = np.column_stack([ego[p, t], np.broadcast_to((info.length_m, info.width_m), (len(p), 2))])
        gaps[p, n, t] = box_distance(egos, np.column_stack([poses[p, n, t], sizes[p, n]]))
        return gaps

    def _margins(self, goal: PairGoal, poses: FloatArray, frames: FloatArray, sizes: FloatArray) -> FloatArray:
        """Return the margins of a goal, [P, N, T] in SI units, NaN where an actor is absent; see `_gaps`."""
        trace, shape = self.trace, poses.shape[:3]
        moved = np.hypot(*np.moveaxis(np.diff(poses[..., :2], axis=2), -1, 0)) / self.settings.step_s
        speeds = np.concatenate([moved, moved[:, :, -1:]], axis=2)
        info, own = trace.actors[0], trace.states[frames, 0][:, None]
        ego = np.broadcast_to(own, (*shape, own.shape[-1])).reshape(-1, own.shape[-1])
        egos = np.column_stack([ego[:, [X, Y, HEADING]], np.broadcast_to((info.length_m, info.width_m), (len(ego), 2))])
        sides = np.broadcast_to(sizes[:, :, None], (*shape, 2)).reshape(-1, 2)
        boxes = np.column_stack([poses.reshape(-1, 3), sides])
        return goal.margins(egos, ego[:, SPEED], boxes, speeds.reshape(-1)).reshape(shape)


def _evenly(values: FloatArray, most: int) -> FloatArray:
    """Return at most `most` of some values, evenly spaced, in their order."""
    if len(values) <= most:
        return values
    return values[np.round(np.linspace(0, len(values) - 1, most)).astype(np.intp)]
