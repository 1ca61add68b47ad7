"""Whether a condition of the language holds for recorded actors, at many rows at once.

The outcomes are those of `simulate.triggers`: a part that cannot be evaluated is `UNKNOWN`, one part that fails decides
an `and`, and a `for` must have held at every frame of its time.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.language import model as m
from foresee_dsl.language.model.conditions import MEASURED
from foresee_dsl.language.printer import written
from foresee_dsl.language.traversal import parts, quantity_of, si_of, word_of
from foresee_dsl.simulate.trigger_record import frames_of
from foresee_recordings.mining.lanes import MapFacts, map_facts
from foresee_recordings.mining.measures import BETWEEN, PairOnWay, gap, values_until
from foresee_recordings.mining.rows import Rows, pairs_of
from foresee_recordings.mining.traffic import HEADING, IntArray, Traffic, X, Y
from foresee_recordings.recording import FloatArray, RecordingError

Truths = NDArray[np.int8]
HOLDS, FAILS, UNKNOWN = 1, 0, -1
LANE_M = 3.5
"""Width of a lane where a recording has no map, m. Ours: lanes of motorways are usually 3.5 m to 3.75 m wide, those of
towns 3.0 m to 3.5 m."""
_CHEAP = ("time", "speed", "acceleration", "relative_speed")
_ALONG = ("lateral", "overlap", "ttc_along")


def truths(condition: m.Condition, rows: Rows) -> Truths:
    """Return at which rows a condition holds, [R]: `HOLDS`, `FAILS` or `UNKNOWN`.

    Raises:
        RecordingError: the condition needs what recordings do not say.
    """
    match condition:
        case m.Not():
            inner = truths(condition.condition, rows)
            return np.where(inner == UNKNOWN, UNKNOWN, 1 - inner).astype(np.int8)
        case m.Both() | m.Either():
            return _joined(condition, rows)
        case m.Sustained():
            return _sustained(condition, rows)
        case m.Comparison():
            return _compared(condition, rows)
        case _:
            return _fact(condition, rows)


def check(condition: m.Condition) -> None:
    """Check that a condition can be searched for in a recording.

    Raises:
        RecordingError: it cannot; the message names the part.
    """
    for part in parts(condition):
        text = written(part)
        if isinstance(part, m.Comparison):
            if not isinstance(part.left, m.Measure) or not isinstance(part.right, m.Quantity):
                raise RecordingError(f"`{text}` cannot be searched for: a measure is compared with a value")
            needed, quantity = MEASURED[part.left.what], quantity_of(part.right)
            if quantity.dimension != needed:
                raise RecordingError(f"`{text}` compares a {needed} with a {quantity.dimension}")
            if part.left.what not in (*BETWEEN, "time", "speed", "acceleration"):
                raise RecordingError(f"`{text}` cannot be searched for: recorded actors have no planned route")
        elif isinstance(part, m.Within):
            if not isinstance(part.of, m.Named | m.Point):
                raise RecordingError(f"`{text}` cannot be searched for: name an actor or a point, such as (12 m, 3 m)")
        elif isinstance(part, m.Predicate) and part.what == "arrived":
            raise RecordingError(f"`{text}` cannot be searched for: recorded actors have no goal")
        elif not isinstance(
            part,
            m.Predicate
            | m.Ahead
            | m.Behind
            | m.SameLane
            | m.InLane
            | m.InJunction
            | m.Not
            | m.Both
            | m.Either
            | m.Sustained,
        ):
            raise RecordingError(f"`{text}` cannot be searched for in a recording: it does not say that")


def _joined(condition: m.Both | m.Either, rows: Rows) -> Truths:
    """Return the outcomes of `and` or `or`; a part is evaluated where the cheaper ones before it have not decided."""
    decides = FAILS if isinstance(condition, m.Both) else HOLDS
    out = np.full(len(rows), 1 - decides, dtype=np.int8)
    open_: IntArray = np.arange(len(rows))
    for part in sorted(condition.conditions, key=_cost):
        if not len(open_):
            break
        if any(isinstance(inner, m.Sustained) for inner in parts(part)):
            whole = np.isin(rows.group, np.unique(rows.group[open_]))  # a `for` needs the frames before
            outcomes = np.full(len(rows), UNKNOWN, dtype=np.int8)
            outcomes[whole] = truths(part, rows.at(whole))
            outcome = outcomes[open_]
        else:
            outcome = truths(part, rows.at(open_))
        out[open_[outcome == UNKNOWN]] = UNKNOWN
        decided = outcome == decides
        out[open_[decided]] = decides
        open_ = open_[~decided]
    return out


def _cost(condition: m.Condition) -> int:
    """Return the rank of a condition by its computing time."""
    kinds = list(parts(condition))
    if any(isinstance(part, m.SameLane | m.InLane | m.InJunction) for part in kinds):
        return 4
    if any(isinstance(part, m.Ahead | m.Behind) for part in kinds):
        return 3
    measured = [part.left.what for part in kinds if isinstance(part, m.Comparison) and isinstance(part.left, m.Measure)]
    if any(what in _ALONG for what in measured):
        return 3
    return 1 if measured and all(what in _CHEAP for what in measured) else 2


def _sustained(condition: m.Sustained, rows: Rows) -> Truths:
    inner = truths(condition.condition, rows)
    frames = frames_of(si_of(condition.duration))
    at = np.arange(len(rows))
    begins = np.maximum.accumulate(np.where(np.diff(rows.group, prepend=-1) != 0, at, 0)) if len(rows) else at
    since = at - frames
    window = np.maximum(since, begins)
    fails = np.maximum.accumulate(np.where(inner == FAILS, at, -1)) >= window if len(rows) else at > 0
    unknown = np.maximum.accumulate(np.where(inner == UNKNOWN, at, -1)) >= window if len(rows) else at > 0
    out = np.where(fails, FAILS, np.where(unknown | (since < begins), UNKNOWN, HOLDS))
    return out.astype(np.int8)


def _compared(condition: m.Comparison, rows: Rows) -> Truths:
    if not isinstance(condition.left, m.Measure):
        raise TypeError("`check` lets only measures pass")
    bound = si_of(condition.right)
    measured = values_until(condition.left, rows, bound)
    slack = measured - bound if condition.op[0] == ">" else bound - measured
    # Infinite values are fine: their slack is infinite. Only NaN is unknown.
    held = slack >= 0 if condition.op[-1] == "=" else slack > 0
    return _outcomes(held, np.isnan(measured))


def _outcomes(held: NDArray[np.bool_], unknown: NDArray[np.bool_] | bool = False) -> Truths:
    return np.where(unknown, UNKNOWN, held).astype(np.int8)


def _fact(condition: m.Condition, rows: Rows) -> Truths:
    match condition:
        case m.Ahead():
            return _outcomes(PairOnWay(rows, condition.other, condition.actor).gap_ahead >= 0)
        case m.Behind():
            return _outcomes(PairOnWay(rows, condition.other, condition.actor).gap_behind >= 0)
        case m.SameLane():
            return _same_lane(condition, rows)
        case m.Within():
            return _outcomes(_away(condition, rows) <= si_of(condition.distance))
        case m.Predicate(what="collision"):
            touching = collisions(rows.traffic)
            return _outcomes(touching[rows.states[condition.actor]])
        case _:
            return _fact_on_map(condition, rows)


def _same_lane(condition: m.SameLane, rows: Rows) -> Truths:
    """Return whether actors are in one lane; without a map, whether one is on the way of the other."""
    actor, other = condition.actor, condition.other
    facts = map_facts(rows.traffic)
    if facts is not None:
        depth = facts.same_lane(rows, actor, other)
        return _outcomes(depth >= 0, np.isnan(depth))
    left = np.minimum(np.abs(PairOnWay(rows, other, actor).left), np.abs(PairOnWay(rows, actor, other).left))
    return _outcomes(left <= LANE_M / 2)


def _fact_on_map(condition: m.Condition, rows: Rows) -> Truths:
    match condition:
        case m.InLane():
            road = None if condition.road is None else word_of(condition.road)
            depth = _on_map(condition, rows).in_lane(rows, condition.actor, round(si_of(condition.number)), road)
            return _outcomes(depth >= 0, np.isnan(depth))
        case m.InJunction():
            junction = None if condition.junction is None else word_of(condition.junction)
            return _outcomes(_on_map(condition, rows).in_junction(rows, condition.actor, junction))
        case _:
            raise RecordingError(f"`{written(condition)}` cannot be searched for in a recording")


def _on_map(condition: m.Condition, rows: Rows) -> MapFacts:
    facts = map_facts(rows.traffic)
    if facts is None:
        raise RecordingError(f"`{written(condition)}` needs a map, and the recording has none: name one with --map")
    return facts


def _away(condition: m.Within, rows: Rows) -> FloatArray:
    """Return the distance of a footprint from another one, or from a point, [R] m."""
    if isinstance(condition.of, m.Named):
        return gap(rows, condition.actor, word_of(condition.of.name))
    if not isinstance(condition.of, m.Point):
        raise TypeError("`check` lets only actors and points pass")
    at = rows.states[condition.actor]
    states, sizes = rows.traffic.states[at], rows.traffic.sizes[at]
    dx, dy = si_of(condition.of.x) - states[:, X], si_of(condition.of.y) - states[:, Y]
    cos, sin = np.cos(states[:, HEADING]), np.sin(states[:, HEADING])
    along = np.maximum(np.abs(dx * cos + dy * sin) - sizes[:, 0] / 2, 0.0)
    across = np.maximum(np.abs(dy * cos - dx * sin) - sizes[:, 1] / 2, 0.0)
    return np.hypot(along, across)


@lru_cache(maxsize=2)
def collisions(traffic: Traffic) -> NDArray[np.bool_]:
    """Return at which rows of the table of states an actor touches another one, [R of the traffic]."""
    touching = np.zeros(len(traffic.states), dtype=np.bool_)
    for rows in pairs_of(traffic):
        hit = gap(rows, "a", "b") <= 0.0
        touching[rows.states["a"][hit]] = True
        touching[rows.states["b"][hit]] = True
    return touching


def names_in(condition: m.Condition) -> Sequence[str]:
    """Return the names of the actors in a condition, `ego` first, then in the order of the text."""
    names: dict[str, None] = {}
    for part in parts(condition):
        for holder in (part, getattr(part, "left", None), getattr(part, "of", None)):
            for field in ("actor", "other", "name"):
                value = getattr(holder, field, None)
                if isinstance(value, str):
                    names.setdefault(value)
    return sorted(names, key=lambda name: (name != "ego", list(names).index(name)))
