"""The mutation operators: model swap and steering (paper, 3.4); ours: timing, delay, head start, line and style."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Mapping
from functools import lru_cache

import numpy as np

from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.derive.operators.ours import DelayShift, HeadStart, HeavyWeather, LineShift, StyleChange, TimingShift
from foresee_dsl.derive.operators.paper import ModelSwap, Steer
from foresee_dsl.derive.operators.situation import ActorsRun, BuiltIn, Operator, Situation
from foresee_dsl.errors import ForeseeError
from foresee_dsl.forecast.pair_goal import PairGoal
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.boxes import box_distance
from foresee_dsl.language.model import Change
from foresee_dsl.plugins import PluginGroup
from foresee_dsl.simulate.trace import SPEED, STEP_S, Trace

__all__ = ["OPERATORS", "Operator", "Situation", "operators", "predicted_gap_m"]

OPERATORS = PluginGroup("foresee_dsl.operators", "operator", ForeseeError)
"""The operators of other packages. A package adds its own with `[project.entry-points."foresee_dsl.operators"]` and
`mine = "package.module:MINE"`, an object with a `name` and `changes`."""

_OURS: tuple[BuiltIn, ...] = (
    ModelSwap(), Steer(), TimingShift(), DelayShift(), HeadStart(), LineShift(), StyleChange(), HeavyWeather()
)  # fmt: skip
_BY_PROPERTY = {operator.property: operator for operator in _OURS}


def operators() -> dict[str, Operator]:
    """Return all operators by name, ours and those of installed packages. If two have the same name, it is ours."""
    return {**_added(tuple(sys.path)), **{o.name: o for o in _OURS}}


@lru_cache(maxsize=8)
def _added(path: tuple[str, ...]) -> dict[str, Operator]:  # noqa: ARG001  (the cache's key)
    """Return the operators of installed packages; cached, because a look-up takes 5 ms and a worker mutates
    many clips.
    """
    return {name: OPERATORS.load(name) for name in OPERATORS.names()}


def predicted_gap_m(
    trace: Trace,
    actor: int,
    changes: Iterable[Change],
    models: Mapping[str, ModelSpec],
    goal: PairGoal | None = None,
) -> tuple[float, float]:
    """Return the smallest distances of a changed actor to the recorded ego, m: between footprints, and between centres.

    With a goal about this actor, the first number is its smallest margin instead, in SI units.

    This is the roll-out: each operator changes the actor's recorded track as the simulation would, without the ego's
    reaction. The result tells which of many draws are worth a simulation, not how they end.

    `trace`: the clip's unmutated run. `actor`: the actor's column. Changes of properties that our operators do not
    change are ignored.
    """
    boxes = trace.boxes(actor)
    for change in changes:
        if change.property in _BY_PROPERTY:
            boxes = _BY_PROPERTY[change.property].rolled_out(boxes, change, ActorsRun(trace, actor, models))
    ego = trace.boxes(0)
    present = ~np.isnan(boxes[:, 0]) & ~np.isnan(ego[:, 0])
    if not present.any():
        return math.inf, math.inf
    if goal is not None and goal.actor == trace.actors[actor].id:
        gaps = goal.margins(ego[present], trace.states[present, 0, SPEED], boxes[present], _speeds(boxes)[present])
    else:
        gaps = box_distance(ego[present], boxes[present])
    return float(gaps.min()), float(np.hypot(*(ego[present, :2] - boxes[present, :2]).T).min())


def _speeds(boxes: FloatArray) -> FloatArray:
    """Return the speed along a track of footprints, [T] m/s; NaN where the actor is absent."""
    moved = np.hypot(*np.diff(boxes[:, :2], axis=0).T) / STEP_S
    return np.append(moved, moved[-1:]) if len(moved) else np.zeros(len(boxes))
