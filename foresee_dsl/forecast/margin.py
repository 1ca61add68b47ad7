"""Ranks the moments at which a run came nearest to breaking the goal of its campaign."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from foresee_dsl.forecast.geometry import distances_to_ego, local_minima
from foresee_dsl.forecast.protocol import Ranker, RiskyPoint
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.simulate.results.goal import GoalSeries
from foresee_dsl.simulate.trace import STEP_S, Trace

PROMINENCE = 0.05
"""Two minima of the margin count as one if it rises by less than this between them, as a share of the margin that
counts as far from the bound. Ours: `foresee` uses 0.1 m, which is this share of 2 m."""
NEAR_M = 50.0
"""Without an actor that the goal names, a point is about the nearest actor within this, m. Ours: the radius of the
ranker `foresee` for pedestrians."""
FAR = 0.5
"""Score of a margin as large as the bound itself. Ours: at twice the required distance, for example, a small change
does not break the goal."""
SHIFTS_S = (-2.0, 2.0)
"""Times by which a point is moved for further clips of the same minimum, s. Ours, on the even half of
`tests/cases/goals` with `pdm`: twelve children a test case of points moved by -2, 0 and 2 s broke the goal 28, 26 and
25 times, in 12, 9 and 9 stories. Points that came after the smallest margin, most about other actors, never did."""


@dataclass(frozen=True)
class MarginRanker:
    """Ranks the local minima of the goal's margin, the smallest first, and then the points of another ranker.

    Before minima that are far from the bound, those that are near it are proposed again with other beginnings of their
    clips, because the actors that the goal names may meet only once. If the run has no margin (its goal is a fact
    without a number, or its actors never met), only the other ranker's points remain.

    Attributes:
        then: the other ranker.
        first: whether the minima come before the other ranker's points. Ours: not with a ranker that proposes changes.
            On the even half of `tests/cases/goals` such changes broke a goal that could not be rolled out 12 times in
            12 children with `pdm`, and the minima 3 times.
    """

    then: Ranker
    first: bool = True
    name: str = "margin"

    def rank(
        self, trace: Trace, *, seed: int = 0, before_s: float = 5.0, after_s: float = 5.0
    ) -> tuple[RiskyPoint, ...]:
        """Rank the moments of a run; see `Ranker.rank`."""
        minima = _minima(trace, before_s)
        near = [point for point in minima if point.score > FAR]
        moved = [again for shift_s in SHIFTS_S for point in near for again in _moved(trace, point, shift_s, before_s)]
        by_margin = [*near, *moved, *(point for point in minima if point.score <= FAR)]
        others = [
            replace(point, why=f"{point.why} (not by the goal's margin)")
            for point in self.then.rank(trace, seed=seed, before_s=before_s, after_s=after_s)
            if not self.first
            or all(point.actor != own.actor or abs(point.time_s - own.time_s) >= before_s for own in minima)
        ]
        before, after = (by_margin, others) if self.first else (others, by_margin)
        points = [*before, *(replace(point, score=0.0) for point in after)]
        return tuple(replace(point, rank=k) for k, point in enumerate(points, start=1))


def _minima(trace: Trace, before_s: float) -> list[RiskyPoint]:
    """Return the local minima of the margin from `before_s` on, the smallest first."""
    series = GoalSeries.in_meta(trace.meta)
    if series is None or series.worst is None or not series.unit:
        return []
    earliest = min(math.ceil(before_s / STEP_S - 1e-9), trace.frames - 1)
    margins = np.where(np.isfinite(series.margins), series.margins, np.inf)[earliest : trace.frames]
    if not np.isfinite(margins).any():
        return []
    most = float(margins[np.isfinite(margins)].max())
    minima = local_minima(margins, within_m=most, prominence_m=PROMINENCE * series.scale)
    gaps = _gaps(trace, series)
    frames = sorted((float(margins[first]), first + earliest) for first, _ in minima)
    return [_point(trace, series, gaps, frame, margin) for margin, frame in frames]


def _moved(trace: Trace, point: RiskyPoint, shift_s: float, before_s: float) -> list[RiskyPoint]:
    """Return the point at a later or earlier moment, so that its clip begins later or earlier; none if the run has no
    such moment.
    """
    frame = point.frame + round(shift_s / STEP_S)
    if not math.ceil(before_s / STEP_S - 1e-9) <= frame < trace.frames:
        return []
    why = f"{point.why}, {abs(shift_s):g} s {'before' if shift_s > 0 else 'after'} this moment"
    return [replace(point, frame=frame, time_s=float(trace.time_s[frame]), score=point.score / 2, why=why)]


def _gaps(trace: Trace, series: GoalSeries) -> dict[str, FloatArray]:
    """Return the distances to the ego of the actors that a point may be about, [T] m: those that the goal names; if it
    names none, all except obstacles.
    """
    columns = [k for k, info in enumerate(trace.actors) if k and info.id in series.actors]
    columns = columns or [k for k, info in enumerate(trace.actors) if k and info.kind != "obstacle"]
    return {trace.actors[k].id: row for k, row in zip(columns, distances_to_ego(trace, columns), strict=True)}


def _point(
    trace: Trace,
    series: GoalSeries,
    gaps: dict[str, FloatArray],
    frame: int,
    margin: float,
) -> RiskyPoint:
    far_m, actor = min(((float(row[frame]), name) for name, row in gaps.items()), default=(math.inf, ""))
    if not math.isfinite(far_m) or (actor not in series.actors and far_m > NEAR_M):
        far_m, actor = math.nan, ""
    return RiskyPoint(
        rank=0,
        frame=frame,
        time_s=float(trace.time_s[frame]),
        actor=actor,
        group="close" if actor else "none",
        distance_m=far_m,
        trajectory_distance_m=math.nan,
        score=round(1.0 / (1.0 + max(margin, 0.0) / series.scale), 6),
        why=f"{series.name} is {margin:.2f} {series.unit} from being broken",
    )
