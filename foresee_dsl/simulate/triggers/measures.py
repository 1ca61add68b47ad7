"""Computes the measures of conditions in a run (`ego.speed`, `distance(a, b)`), and ranks them by their cost."""

from __future__ import annotations

import math
from enum import IntEnum
from typing import assert_never

from foresee_dsl.kernels.conditions import gap_within, time_to_touch
from foresee_dsl.language import model as m
from foresee_dsl.language.traversal import word_of
from foresee_dsl.simulate.actors.moved_actors import PathActor
from foresee_dsl.simulate.actors.states import SimulatedActor
from foresee_dsl.simulate.results.metrics import ETA_SLOWEST_MPS, eta, headway, relative_speed
from foresee_dsl.simulate.trace import ACCELERATION, SPEED
from foresee_dsl.simulate.triggers.conditions import Conditions


class Cost(IntEnum):
    """Cost of evaluating a condition; the parts of an `and` or `or` are evaluated in this order.

    Projecting a SUMO vehicle onto its line is incremental, so a condition that uses such a projection must be evaluated
    in every step (`EVERY_STEP`), even when another part already decides. Of the other costs, `NUMBER` reads one number
    of the state table, `PAIR` computes with two footprints, `AREA` with a footprint and an outline or a way, and
    `MARGIN` computes the whole outcome.
    """

    EVERY_STEP = 0
    NUMBER = 1
    PAIR = 2
    AREA = 3
    MARGIN = 4


class BoundMeasure:
    """A measure such as `ego.speed`, bound to one run.

    Attributes:
        cost: how expensive it is to compute its value.
    """

    def __init__(self, measure: m.Measure, run: Conditions) -> None:
        self.what, self.run, self.cost = measure.what, run, cost_of(measure, run)
        self.name, self.other = measure.actor or "", word_of(measure.other or "")

    def value(self) -> float:
        """Return the current value of the measure; NaN if it has none."""
        raise NotImplementedError

    def until(self, bound: float) -> float:
        """Return the value, or infinity if the value is certainly above this bound, which may be cheaper to
        find out.
        """
        del bound
        return self.value()


class _Time(BoundMeasure):
    """The measure `time`."""

    def __init__(self, measure: m.Measure, run: Conditions) -> None:
        super().__init__(measure, run)
        self.cost = Cost.NUMBER

    def value(self) -> float:
        return self.run.simulation.time_s


class _State(BoundMeasure):
    """The measures `a.speed` and `a.acceleration`: numbers of the state table."""

    def __init__(self, measure: m.Measure, run: Conditions) -> None:
        super().__init__(measure, run)
        self._place = run.rows.get(self.name, 0), SPEED if self.what == "speed" else ACCELERATION
        self.cost = Cost.NUMBER

    def value(self) -> float:
        return math.nan if self.run.actor(self.name) is None else self.run.states.item(*self._place)


class _ToJunction(BoundMeasure):
    """The measures `distance(a, j4)` and `a.eta(j4)`: along the route to the point where the actor enters a
    junction.
    """

    def __init__(self, measure: m.Measure, run: Conditions) -> None:
        super().__init__(measure, run)
        actor = run.simulation.by_id.get(self.name)
        self.cost = Cost.AREA if actor is None or _looks_anywhere(actor, run) else Cost.EVERY_STEP

    def value(self) -> float:
        actor, simulation = self.run.actor(self.name), self.run.simulation
        if actor is None:
            return math.nan
        left_m = simulation.progress.to_junction(actor, self.other, simulation.frame)
        if self.what == "distance":
            return left_m
        return math.inf if math.isnan(left_m) else eta(left_m, actor.speed)


class _BetweenFootprints(BoundMeasure):
    """The measures between footprints: `distance(a, b)`, `ttc(a, b)`, `headway(a, b)`."""

    def __init__(self, measure: m.Measure, run: Conditions) -> None:
        super().__init__(measure, run)
        self.cost = Cost.PAIR
        rows = run.rows.get(self.name, 0), run.rows.get(self.other, 0)
        self._table = run.states, run.sizes, *rows

    def value(self) -> float:
        actor, other = self.run.actor(self.name), self.run.actor(self.other)
        if actor is None or other is None:
            return math.nan
        if self.what == "ttc":
            return float(time_to_touch(*self._table))
        gap_m = self.run.gap(actor, other)
        return gap_m if self.what == "distance" else headway(gap_m, actor.speed)

    def until(self, bound: float) -> float:
        actor, other = self.run.actor(self.name), self.run.actor(self.other)
        if self.what == "ttc" or actor is None or other is None:
            return self.value()
        if self.what == "distance":
            return gap_within(*self._table, bound)
        speed_mps = max(actor.speed, ETA_SLOWEST_MPS)
        return gap_within(*self._table, bound * speed_mps) / speed_mps


class _Offset(BoundMeasure):
    """The measure `a.offset`: the lateral distance from the centreline of the actor's lane."""

    def value(self) -> float:
        actor = self.run.actor(self.name)
        lane = None if actor is None else self.run.ways.lane(actor)
        return math.nan if lane is None else lane[1]


class _Deviation(BoundMeasure):
    """The measure `ego.deviation`: the distance from the place at which the actor's recorded track has it now."""

    def __init__(self, measure: m.Measure, run: Conditions) -> None:
        super().__init__(measure, run)
        self.cost = Cost.NUMBER

    def value(self) -> float:
        actor = self.run.actor(self.name)
        playback = None if actor is None else actor.placed.playback
        if actor is None or playback is None:
            return math.nan
        now_s = playback.start_s + self.run.simulation.time_s
        if not playback.track.covers(now_s):
            return math.nan
        x, y, *_ = playback.track.at(now_s)
        return math.hypot(actor.x - x, actor.y - y)


class _AlongTheWay(BoundMeasure):
    """The measures along an actor's way: `lateral(a, b)`, `overlap(a, b)`, `ttc_along(a, b)`,
    `relative_speed(a, b)`.
    """

    def value(self) -> float:
        actor, other = self.run.actor(self.name), self.run.actor(self.other)
        if actor is None or other is None:  # an actor of the traffic may not have been placed
            return math.nan
        if self.what == "lateral":
            return self.run.ways.lateral_m(actor, other)
        if self.what == "overlap":
            return self.run.ways.overlap_m(actor, other)
        if self.what == "ttc_along":
            return self.run.ways.side_by_side_s(actor, other)
        return relative_speed(actor.speed, other.speed, other.heading - actor.heading)


def measured(measure: m.Measure, run: Conditions) -> BoundMeasure:
    """Return a measure, bound to a run."""
    kind: type[BoundMeasure]
    match measure.what:
        case "time":
            kind = _Time
        case "speed" | "acceleration":
            kind = _State
        case "eta":
            kind = _ToJunction
        case "distance":
            to_junction = run.is_junction(word_of(measure.other or ""))
            kind = _ToJunction if to_junction else _BetweenFootprints
        case "ttc" | "headway":
            kind = _BetweenFootprints
        case "offset":
            kind = _Offset
        case "deviation":
            kind = _Deviation
        case "lateral" | "overlap" | "ttc_along" | "relative_speed":
            kind = _AlongTheWay
        case _:
            assert_never(measure.what)
    return kind(measure, run)


def _looks_anywhere(actor: SimulatedActor, run: Conditions) -> bool:
    """Return whether an actor's position on its line does not depend on earlier projections.

    That is so for the ego, which is projected in every frame, and for an actor on a path, because the state table holds
    its length along the path.
    """
    return actor is run.simulation.ego or isinstance(actor, PathActor)


def cost_of(item: m.Condition | m.Measure, run: Conditions) -> Cost:
    """Return the cost of computing a measure, or the whole outcome of a condition."""
    by_id = run.simulation.by_id
    actors = (by_id.get(name) for name in (getattr(item, "actor", None), getattr(item, "other", None)) if name)
    anywhere = all(actor is None or _looks_anywhere(actor, run) for actor in actors)
    return Cost.MARGIN if anywhere else Cost.EVERY_STEP
