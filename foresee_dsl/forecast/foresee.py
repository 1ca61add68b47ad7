"""The misbehaviour forecaster of the paper (section 3.2), steps 1a to 1d."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.forecast.geometry import (
    distances_to_ego,
    enters_from_side,
    ever_near,
    feet_on_path,
    local_minima,
    paths_cut,
    thinned_path,
)
from foresee_dsl.forecast.protocol import Group, RiskyPoint
from foresee_dsl.forecast.settings import PEDESTRIAN_KINDS, ForeseeSettings
from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.simulate.trace import HEADING, SPEED, STEP_S, Trace, X, Y

_GROUPS: tuple[Group, ...] = ("critical crossing", "crossing", "critical")
"""The groups of actors, the riskiest first. Ours (the paper prints no order): an actor that crosses close by is nearer
to a collision than one that crosses elsewhere, and both are nearer than one that stays beside the ego's path."""


@dataclass(frozen=True, slots=True)
class CloseEncounter:
    """A close encounter of step 1a: frame, actor (its column in the trace), and distance between the footprints, m."""

    actor: int
    frame: int
    distance_m: float


def close_encounters(trace: Trace, settings: ForeseeSettings, *, before_s: float) -> list[CloseEncounter]:
    """Step 1a: return every local minimum of the distance to an actor within its class's radius, in order of
    appearance.

    Encounters in the first `before_s` seconds are left out, as the paper does for its exhaustive search (section
    4.4.3): no clip of full length can begin before the run. If the ego and the actor stay about as close for longer
    (both stand, or one follows the other), the encounter is the closest moment that is late enough.
    """
    earliest = math.ceil(before_s / STEP_S - 1e-9)
    radii = [settings.radius_m(info.kind) for info in trace.actors]
    actors = [actor for actor, radius in enumerate(radii) if actor > 0 and radius > 0]
    within_m = np.array([radii[actor] for actor in actors])
    encounters = []
    all_gaps = distances_to_ego(trace, actors, within_m + settings.prominence_m)
    for actor, gaps in zip(actors, all_gaps, strict=True):
        for first, last in local_minima(gaps, within_m=radii[actor], prominence_m=settings.prominence_m):
            frame = (
                first if first >= earliest or last < earliest else earliest + int(gaps[earliest : last + 1].argmin())
            )
            if frame >= earliest:
                encounters.append(CloseEncounter(actor, frame, float(gaps[frame])))
    return sorted(encounters, key=lambda e: (e.frame, e.actor))


@dataclass(frozen=True)
class _PerturbedEgo:
    """The ego's recorded path and its perturbed trajectories."""

    trace: Trace
    settings: ForeseeSettings
    errors: NDArray[np.float64]
    """Errors of speed and yaw rate of each perturbed trajectory, as shares of the bounds, [N, 2] from -1 to 1."""

    @cached_property
    def path(self) -> NDArray[np.float64]:
        """Return the ego's recorded path with fewer points."""
        return thinned_path(self.trace.states[:, 0, [X, Y]], self.settings.path_step_m)

    def perturbed(self, first: int, last: int, horizon: int) -> NDArray[np.float64]:
        """Return the recorded motion of frames `first` to `last` with constant small errors of speed and yaw rate, [N,
        T, 3] poses.

        The errors are such that after `horizon` frames the trajectory deviates by at most the bounds.
        """
        s = self.settings
        recorded = self.trace.states[first : last + 1, 0]
        span_s = max(horizon, 1) * STEP_S
        driven_m = float(np.nansum(recorded[:horizon, SPEED])) * STEP_S
        # A constant yaw-rate error e turns the path by e t after t seconds; after d metres the deviation to the side is
        # e t d / 2.
        yaw_bound = s.heading_error_rad / span_s
        if driven_m > 0:
            yaw_bound = min(yaw_bound, 2 * s.lateral_error_m / (driven_m * span_s))
        since_s = np.arange(last - first + 1) * STEP_S
        turned = self.errors[:, 1:] * yaw_bound * since_s
        # The recorded steps are turned and stretched, so that errors of zero give exactly the recorded
        # trajectory.
        steps = np.diff(recorded[:, [X, Y]], axis=0)
        extra = self.errors[:, :1] * (s.longitudinal_error_m / span_s) * STEP_S
        moves = recorded[:-1, SPEED] > STANDS_MPS
        heading = recorded[:-1, HEADING]
        dx = steps[:, 0] + extra * moves * np.cos(heading)
        dy = steps[:, 1] + extra * moves * np.sin(heading)
        cos, sin = np.cos(turned[:, :-1]), np.sin(turned[:, :-1])
        states = np.empty((len(self.errors), len(recorded), 3))
        states[:, 0, :2] = recorded[0, [X, Y]]
        states[:, 1:, 0] = recorded[0, X] + np.cumsum(cos * dx - sin * dy, axis=1)
        states[:, 1:, 1] = recorded[0, Y] + np.cumsum(sin * dx + cos * dy, axis=1)
        states[..., 2] = recorded[:, HEADING] + turned
        return states


def crosses(trace: Trace, actor: int, ego_path: NDArray[np.float64], settings: ForeseeSettings) -> bool:
    """Step 1b: return whether an actor's recorded path meets the ego's, at any time of the run.

    They meet if the two paths intersect at an angle, or if the actor enters from the side (a merge, a cut-in) the
    corridor around the ego's path, which extends on each side by half of both bodies' widths together. An actor that
    stays ahead or behind in the ego's lane does not meet the path; step 1c examines it."""
    path = thinned_path(trace.states[:, actor, [X, Y]], settings.path_step_m)
    half_width_m = (trace.actors[0].width_m + trace.actors[actor].width_m) / 2
    return paths_cut(path, ego_path, angle_rad=settings.crossing_angle_rad) or enters_from_side(
        path, ego_path, half_width_m=half_width_m
    )


@dataclass(frozen=True)
class ForeseeRanker:
    """Ranks as the paper does: by group, then pedestrians before vehicles, then by distance to the ego's trajectory.

    The best encounter of each actor comes first, because the paper collects one frame per actor; further encounters
    follow in the same order, for budgets larger than the number of actors."""

    settings: ForeseeSettings = field(default_factory=ForeseeSettings)
    name: str = "foresee"

    def rank(
        self, trace: Trace, *, seed: int = 0, before_s: float = 5.0, after_s: float = 5.0
    ) -> tuple[RiskyPoint, ...]:
        """Rank the close encounters of a run; see `Ranker.rank`."""
        errors = np.random.default_rng(np.random.SeedSequence(seed)).uniform(-1, 1, (self.settings.perturbations, 2))
        ego = _PerturbedEgo(trace, self.settings, errors)
        graded = self._grade(ego, close_encounters(trace, self.settings, before_s=before_s), before_s, after_s)
        graded.sort(key=lambda p: _order(trace, p))
        firsts, others = _best_per_actor(graded, same_s=self.settings.same_encounter_s)
        return tuple(replace(p, rank=k) for k, p in enumerate(firsts + others, start=1))

    def _grade(
        self, ego: _PerturbedEgo, encounters: list[CloseEncounter], before_s: float, after_s: float
    ) -> list[RiskyPoint]:
        trace = ego.trace
        crossing = {a: crosses(trace, a, ego.path, self.settings) for a in sorted({e.actor for e in encounters})}
        points = []
        for encounter in encounters:
            group = self._group(ego, encounter, crosses_ego=crossing[encounter.actor])
            if group is not None:
                to_path_m = _distance_to_path(ego, encounter, before_s, after_s)
                points.append(_point(trace, encounter, group, to_path_m))
        return points

    def _group(self, ego: _PerturbedEgo, encounter: CloseEncounter, *, crosses_ego: bool) -> Group | None:
        if crosses_ego:
            return "critical crossing" if encounter.distance_m <= self.settings.limited_distance_m else "crossing"
        return "critical" if self._is_critical(ego, encounter) else None

    def _is_critical(self, ego: _PerturbedEgo, encounter: CloseEncounter) -> bool:
        """Step 1c: return whether a perturbed ego comes within the threshold of a non-crossing actor."""
        s, trace = self.settings, ego.trace
        first = max(0, encounter.frame - round(s.horizon_s / STEP_S))
        last = min(trace.frames - 1, encounter.frame + round(s.beyond_s / STEP_S))
        rolled = ego.perturbed(first, last, encounter.frame - first)
        return ever_near(trace, encounter.actor, rolled, first, s.perturbed_radius_m)


def _distance_to_path(ego: _PerturbedEgo, encounter: CloseEncounter, before_s: float, after_s: float) -> float:
    """Return the smallest distance of an actor's centre to the ego's recorded path in the window around an encounter,
    m."""
    first = max(0, encounter.frame - round(before_s / STEP_S))
    last = min(ego.trace.frames - 1, encounter.frame + round(after_s / STEP_S))
    points = thinned_path(ego.trace.states[first : last + 1, encounter.actor, [X, Y]], ego.settings.path_step_m)
    if paths_cut(points, ego.path, angle_rad=0.0):
        return 0.0
    return float(feet_on_path(points, ego.path)[0].min())


def _order(trace: Trace, point: RiskyPoint) -> tuple[int, bool, float, float, int, str]:
    """Return the sort key of step 1d.

    Trajectory distances are rounded to 0.1 m (ours), because thinning the path changes smaller differences.
    """
    pedestrian = trace.actors[trace.index(point.actor)].kind in PEDESTRIAN_KINDS
    near_m = round(point.trajectory_distance_m, 1)
    return _GROUPS.index(point.group), not pedestrian, near_m, point.distance_m, point.frame, point.actor


def _best_per_actor(ranked: list[RiskyPoint], *, same_s: float) -> tuple[list[RiskyPoint], list[RiskyPoint]]:
    """Return the best point of every actor, and its further points without those that repeat an encounter."""
    firsts: list[RiskyPoint] = []
    others: list[RiskyPoint] = []
    times: dict[str, list[float]] = {}
    for point in ranked:
        seen = times.setdefault(point.actor, [])
        if any(abs(t - point.time_s) < same_s for t in seen):
            continue
        (others if seen else firsts).append(point)
        seen.append(point.time_s)
    return firsts, others


def _point(trace: Trace, encounter: CloseEncounter, group: Group, to_path_m: float) -> RiskyPoint:
    info = trace.actors[encounter.actor]
    # The score has one unit per group, half a unit for a pedestrian, and less than half a unit for the distance, so
    # that it gives the same order as `_order`.
    score = len(_GROUPS) - _GROUPS.index(group) + 0.5 * (info.kind in PEDESTRIAN_KINDS) + 0.49 / (1 + to_path_m)
    return RiskyPoint(
        rank=0,
        frame=encounter.frame,
        time_s=float(trace.time_s[encounter.frame]),
        actor=info.id,
        group=group,
        distance_m=encounter.distance_m,
        trajectory_distance_m=to_path_m,
        score=round(score, 6),
        why=f"{group}: {passes(trace, encounter, crossing=group != 'critical')}",
    )


def passes(trace: Trace, encounter: CloseEncounter, *, crossing: bool = False) -> str:
    """Return the clause of the report, such as `runner passes 1.9 m behind the ego at 17.40 s`.

    For a crossing actor that is ahead of or behind the ego, the clause says so even if the actor is farther away to the
    side.
    """
    state = trace.states[encounter.frame, encounter.actor]
    verb = "passes" if state[SPEED] > STANDS_MPS else "stands"
    place = f"{encounter.distance_m:.1f} m {_side(trace, encounter, crossing=crossing)} the ego"
    return f"{trace.actors[encounter.actor].id} {verb} {place} at {trace.time_s[encounter.frame]:.2f} s"


def _side(trace: Trace, encounter: CloseEncounter, *, crossing: bool) -> str:
    """Return on which side of the ego the actor's nearest part is: ahead of its front, behind its rear, or
    beside it.
    """
    ego, info = trace.states[encounter.frame, 0], trace.actors[0]
    state, other = trace.states[encounter.frame, encounter.actor], trace.actors[encounter.actor]
    dx, dy = state[X] - ego[X], state[Y] - ego[Y]
    cos, sin = math.cos(ego[HEADING]), math.sin(ego[HEADING])
    ahead, left = dx * cos + dy * sin, dy * cos - dx * sin
    turn = state[HEADING] - ego[HEADING]
    c, s = abs(math.cos(turn)), abs(math.sin(turn))
    gap_along = abs(ahead) - (info.length_m + other.length_m * c + other.width_m * s) / 2
    gap_across = abs(left) - (info.width_m + other.length_m * s + other.width_m * c) / 2
    if gap_along >= (min(gap_across, 0.0) if crossing else gap_across):
        return "ahead of" if ahead >= 0 else "behind"
    return "left of" if left >= 0 else "right of"
