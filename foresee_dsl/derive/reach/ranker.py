"""The ranker `reach`: it proposes which actor to change, when, and by which operator, by the contacts that this can
cause, and by how many of them a careful driver avoids.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple, cast

import numpy as np

from foresee_dsl.avoidance.candidates.recorded import RecordedRun
from foresee_dsl.avoidance.candidates.scoring import EGO_STANDS_MPS, avoided_by_some
from foresee_dsl.compile.bundle import ActorKind, ModelSpec
from foresee_dsl.compile.catalogue import CLASS_DEFAULTS
from foresee_dsl.derive.operators import operators
from foresee_dsl.derive.operators.paper import ModelSwap
from foresee_dsl.derive.operators.situation import Numeric
from foresee_dsl.derive.presets import MutationPreset, preset
from foresee_dsl.derive.reach.rolling import ReachSettings, Rolling, RollOut
from foresee_dsl.forecast.foresee import ForeseeRanker
from foresee_dsl.forecast.geometry import distances_to_ego
from foresee_dsl.forecast.margin import MarginRanker
from foresee_dsl.forecast.pair_goal import PairGoal
from foresee_dsl.forecast.protocol import Mutations, RiskyPoint
from foresee_dsl.forecast.settings import PEDESTRIAN_KINDS
from foresee_dsl.kernels.arrays import FloatArray, IntArray
from foresee_dsl.kernels.what_if import WhatIf
from foresee_dsl.simulate.trace import HEADING, SPEED, STEP_S, Trace, X, Y

_QUARTERS = 4
_MET = "met"
"""The role of an actor that comes near the ego although nothing was changed."""


class Tale(NamedTuple):
    """A description of a contact; contacts with equal descriptions are probably the same finding.

    Attributes:
        role: class of the actor.
        course: its heading relative to the ego's, in quarters of a turn (0: the same).
        side: side of the ego where it is, in quarters (0: front, 1: left).
        place: the ego's lane.
        stands: whether the ego stands.
    """

    role: str
    course: int
    side: int
    place: int
    stands: bool


@dataclass(frozen=True, eq=False)
class ReachPromise:
    """A change of an actor, and the contacts that its values cause.

    Attributes:
        reaching: indices of the values that reach the recorded ego.
        tales: for each kind of contact, the share of the values that cause it.
        contact_frame: mean frame of the run at which values reach the ego; if none does, the frame of the smallest gap.
    """

    rolled: RollOut
    reaching: IntArray
    tales: dict[Tale, float]
    contact_frame: int

    @property
    def onset(self) -> int:
        """Return the frame at which the change begins."""
        return self.rolled.change.onset


def _promise(trace: Trace, rolled: RollOut, gaps: FloatArray, settings: ReachSettings) -> ReachPromise:
    """Return the contacts of a change. `gaps`: [A, T] recorded gaps of the actors to the ego, m; infinite for
    obstacles."""
    least = rolled.gaps.min(axis=1)
    too_soon = (rolled.gaps[:, : round(settings.notice_s / settings.step_s)] <= 0.0).any(axis=1)
    reaching = np.flatnonzero((least <= 0.0) & ~too_soon)
    first = np.where(least <= 0.0, (rolled.gaps <= 0.0).argmax(axis=1), rolled.gaps.argmin(axis=1))
    tales: dict[Tale, float] = {}
    for n in reaching.tolist():
        tale = _tale(trace, rolled, n, int(first[n]))
        tales[tale] = tales.get(tale, 0.0) + 1.0 / len(least)
    onset = rolled.change.onset
    window = gaps[:, onset : onset + round(settings.met_s / STEP_S) + 1].min(axis=1)
    nearest = int(window.argmin())
    if np.isfinite(window[nearest]):
        tales[Tale(_MET, nearest, 0, 0, stands=False)] = settings.met_weight / (1.0 + float(window[nearest]))
    among = first[reaching] if len(reaching) else first[[int(least.argmin())]]
    return ReachPromise(rolled, reaching, tales, int(rolled.frames[round(float(among.mean()))]))


def _avoided(run: RecordedRun, promised: ReachPromise, settings: ReachSettings) -> tuple[int, int]:
    """Return of how many values that reach the ego some careful driver avoids the contact, and how many were tried: at
    most `settings.decided`.
    """
    rolled, change = promised.rolled, promised.rolled.change
    if not len(promised.reaching):
        return 0, 0
    places = np.unique(np.round(np.linspace(0, len(promised.reaching) - 1, settings.decided)).astype(np.int64))
    last = change.onset + rolled.every * rolled.steps
    info = run.trace.actors[change.actor]
    what = WhatIf(change.actor, change.onset, last, info.length_m, info.width_m, info.cruise_mps)
    return int(avoided_by_some(run, what, _rows(run, rolled, promised.reaching[places])).sum()), len(places)


def _rows(run: RecordedRun, rolled: RollOut, chosen: IntArray) -> FloatArray:
    """Return the actor's track with each of the chosen values: [C, T, 4], laid out as in `RecordedRun.tracks`."""
    change = rolled.change
    rows = np.repeat(run.tracks[None, change.actor], len(chosen), axis=0)
    every, steps = rolled.every, rolled.steps
    poses = rolled.poses[chosen, : steps + 1]
    moved = np.diff(poses, axis=1)
    way = np.hypot(moved[..., 0], moved[..., 1]) / every
    for k in range(every):
        at = slice(change.onset + k, change.onset + every * steps, every)
        rows[:, at, :3] = poses[:, :-1] + moved * k / every
        rows[:, at, 3] = way
    return rows


def _tale(trace: Trace, rolled: RollOut, value: int, step: int) -> Tale:
    frame = int(rolled.frames[step])
    x, y, heading = rolled.poses[value, step]
    ego, info = trace.states[frame, 0], trace.actors[0]
    dx, dy = x - ego[X], y - ego[Y]
    cos, sin = math.cos(ego[HEADING]), math.sin(ego[HEADING])
    ahead, left = (dx * cos + dy * sin) / info.length_m, (dy * cos - dx * sin) / info.width_m
    side = (0 if ahead > 0 else 2) if abs(ahead) >= abs(left) else (1 if left > 0 else 3)
    course = round((heading - ego[HEADING]) / (math.tau / _QUARTERS)) % _QUARTERS
    kind = trace.actors[rolled.change.actor].kind
    role = kind if kind in PEDESTRIAN_KINDS or kind == "bicycle" else "vehicle"
    return Tale(role, course, side, int(trace.lanes[frame, 0]), bool(ego[SPEED] < EGO_STANDS_MPS))


def in_order(promises: Sequence[ReachPromise], settings: ReachSettings) -> list[ReachPromise]:
    """Return the promises, best first: each is rated by the kinds of contact that those before it do not have.

    Each earlier promise lowers the worth of its kinds of contact, in proportion to their share in it. Of two equal
    promises, the one with the later onset comes first, because it leaves less time unused.
    """
    tales = list(dict.fromkeys(tale for candidate in promises for tale in candidate.tales))
    column = {tale: k for k, tale in enumerate(tales)}
    shares = np.zeros((len(promises), len(tales)))
    for k, candidate in enumerate(promises):
        for tale, share in candidate.tales.items():
            shares[k, column[tale]] = share
    worth: FloatArray = np.ones(len(tales))
    left = list(range(len(promises)))
    order: list[ReachPromise] = []
    while left and len(order) < settings.proposals:
        gains = np.round(shares[left] @ worth, 9)
        best = max(range(len(left)), key=lambda k: (gains[k], promises[left[k]].onset, -left[k]))
        if gains[best] <= 0:
            break
        own_shares = shares[left[best]] / shares[left[best]].sum()
        worth = worth * (1.0 - (1.0 - settings.again) * own_shares)
        order.append(promises[left.pop(best)])
    return order


@dataclass(frozen=True)
class ReachRanker:
    """Ranks changes (a moment, an actor and an operator each) by the contacts with the ego that they can cause.

    Attributes:
        mutations: how clips will be mutated; None: by the preset `focused`, with the default vehicle of each class.
        goal: a goal whose margin is ranked in the place of the distance to the ego; None: contacts are ranked.
    """

    settings: ReachSettings = field(default_factory=ReachSettings)
    mutations: Mutations | None = None
    goal: PairGoal | None = None
    name: str = "reach"

    def before(self, mutations: Mutations) -> ReachRanker:
        """Return the ranker for clips that are mutated in this way."""
        return replace(self, mutations=mutations)

    def toward(self, goal: PairGoal) -> ReachRanker:
        """Return the ranker of changes that may break a goal: changes of the actor that the goal is about."""
        return replace(self, goal=goal)

    def rank(
        self, trace: Trace, *, seed: int = 0, before_s: float = 5.0, after_s: float = 5.0
    ) -> tuple[RiskyPoint, ...]:
        """Rank the changes of a run; see `Ranker.rank`.

        The clip of a change begins with the change, so its point may lie nearer to the run's beginning than `before_s`.
        """
        s, gaps = self.settings, _gaps(trace)
        run = RecordedRun.of(trace, {name: spec.height_m for name, spec in self._models(trace).items()})
        best = in_order(self.promises(trace), s)
        if self.goal is not None:
            points = [_goal_point(trace, gaps, promised, self.goal) for promised in best]
        else:
            points = [_point(trace, gaps, promised, _avoided(run, promised, s)) for promised in best]
        rest = ForeseeRanker() if self.goal is None else MarginRanker(ForeseeRanker())
        for other in rest.rank(trace, seed=seed, before_s=before_s, after_s=after_s):
            if all(other.actor != p.actor or abs(other.time_s - p.time_s) >= before_s for p in points):
                points.append(replace(other, score=0.0))
        return tuple(replace(p, rank=k) for k, p in enumerate(points, start=1))

    def promises(self, trace: Trace) -> list[ReachPromise]:
        """Return the promises of all changes that the ranker examines, in the order of their onsets."""
        s, gaps = self.settings, _gaps(trace)
        rolling = self.rolling(trace, gaps)
        changes = [
            change
            for onset in range(0, trace.frames - round(1 / STEP_S), round(s.every_s / STEP_S))
            for change in rolling.changes(onset, self._examined(trace, gaps[:, onset]))
        ]
        moving = gaps.copy()
        moving[[info.kind == "obstacle" or self.goal is not None for info in trace.actors]] = np.inf
        return [_promise(trace, rolled, moving, s) for rolled in rolling.rolled(changes)]

    def _examined(self, trace: Trace, gaps: FloatArray) -> list[int]:
        """Return the columns of the actors whose changes are rolled out at a moment."""
        if self.goal is None:
            return _nearest(gaps, self.settings)
        return [k for k, info in enumerate(trace.actors) if info.id == self.goal.actor and np.isfinite(gaps[k])]

    def rolling(self, trace: Trace, gaps: FloatArray) -> Rolling:
        """Return the object that rolls out the changes of a run. `gaps`: [A, T] m between each actor and the ego."""
        chosen = preset(self.mutations.preset) if self.mutations is not None else preset("focused")
        return Rolling(trace, self._models(trace), chosen, self.settings, _operators(chosen), gaps, goal=self.goal)

    def _models(self, trace: Trace) -> Mapping[str, ModelSpec]:
        return self.mutations.models if self.mutations is not None else _usual(trace)


def _operators(chosen: MutationPreset) -> list[Numeric | ModelSwap]:
    """Return those operators of a preset that can be rolled out."""
    by_name = operators()
    names = dict.fromkeys(name for recipe in chosen.recipes for name in recipe)
    return [operator for name in names if isinstance(operator := by_name[name], Numeric | ModelSwap)]


def _gaps(trace: Trace) -> FloatArray:
    """Return the distances of all actors to the ego, [A, T] m; infinite for the ego itself and where actors are
    absent."""
    own = np.full((1, trace.frames), np.inf)
    return np.vstack([own, distances_to_ego(trace, range(1, len(trace.actors)))])


def _nearest(gaps: FloatArray, s: ReachSettings) -> list[int]:
    """Return the columns of the nearest actors at a moment, at most `s.nearest`, all within `s.within_m` of the ego."""
    order = np.argsort(gaps, kind="stable")
    return [int(k) for k in order if gaps[k] <= s.within_m][: s.nearest]


def _usual(trace: Trace) -> Mapping[str, ModelSpec]:
    """Return the models of the actors of a trace; vehicles have the default values of their class, with their recorded
    size.
    """
    specs = {}
    for info in trace.actors:
        base = CLASS_DEFAULTS[cast(ActorKind, info.kind)]
        wheelbase = info.wheelbase_m or base.wheelbase_share * info.length_m
        specs[info.model] = ModelSpec(
            info.model, cast(ActorKind, info.kind), info.length_m, info.width_m, wheelbase,
            base.overhang_share * info.length_m, base.mass_kg, base.max_speed_mps, base.acceleration_mps2,
            base.braking_mps2, base.emergency_braking_mps2, math.radians(base.max_steer_deg),
            math.radians(base.steer_rate_deg_s), base.height_m,
        )  # fmt: skip
    return specs


def _point(trace: Trace, gaps: FloatArray, best: ReachPromise, avoided: tuple[int, int]) -> RiskyPoint:
    change, frame, count = best.rolled.change, best.contact_frame, len(best.rolled.values)
    actor = trace.actors[change.actor].id
    onset_s, contact_s = trace.time_s[change.onset], trace.time_s[frame]
    if len(best.reaching):
        does = (
            f"{len(best.reaching)} of {count} changes reach the ego, at about {contact_s:.1f} s; "
            f"a careful driver avoids {avoided[0]} of {avoided[1]} that were tried"
        )
    else:
        does = f"none of {count} changes reaches the ego; the nearest one is closest at {contact_s:.1f} s"
    return RiskyPoint(
        rank=0,
        frame=frame,
        time_s=float(contact_s),
        actor=actor,
        group="close",
        distance_m=float(gaps[change.actor, frame]),
        trajectory_distance_m=math.nan,
        score=round(sum(best.tales.values()), 6),
        why=f"{change.operator.name} of {actor} from {onset_s:.1f} s: {does}",
        operator=change.operator.name,
        begins=change.onset,
    )


def _goal_point(trace: Trace, gaps: FloatArray, best: ReachPromise, goal: PairGoal) -> RiskyPoint:
    """Return the point of a change that may break the goal; the judges know contacts only and are not asked."""
    point = _point(trace, gaps, best, (0, 0))
    change, count = best.rolled.change, len(best.rolled.values)
    does = f"{len(best.reaching)} of {count} changes break {goal.name}" if len(best.reaching) else (
        f"none of {count} changes breaks {goal.name}; it is closest at {point.time_s:.1f} s"
    )  # fmt: skip
    onset_s = trace.time_s[change.onset]
    return replace(point, why=f"{change.operator.name} of {point.actor} from {onset_s:.1f} s: {does}")
