"""Explains the decisions of a bundled driver by the effect of each signal and each object alone.

This is computed only on request, not while driving. The driver then decides again: without actors and with all signals
green, then with one signal or one object at a time. A signal or object that makes it slower, or changes its place in
the lane, is a reason. If the driver brakes harder than for any signal or object alone, each object is left out in turn.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

import numpy as np

from foresee_dsl.drivers.pdm.situation import RoadSituation, read_situation, signal_brakings
from foresee_dsl.drivers.protocol import Reason, SignalColour
from foresee_dsl.drivers.tracking import Tracks
from foresee_dsl.kernels.arrays import Records
from foresee_dsl.kernels.pdm import settings as cfg
from foresee_dsl.kernels.pdm.prediction import match, predict
from foresee_dsl.kernels.pdm.proposals import FAR_M, find_leaders, find_passable
from foresee_dsl.kernels.pdm.right_of_way import find_wall
from foresee_dsl.kernels.pdm.route import near_foes

LEAST_MPS2 = 0.2
"""Smallest change of the acceleration that makes an object or a signal a reason, m/s^2. Ours: a tenth of everyday
braking."""
LEAST_M = 0.3
"""Smallest change of the lateral position in the lane that makes an object a reason, m. Ours."""


FREE_ROAD = "free road"
"""The rule of a decision without a reason to be slower."""


class Wish(NamedTuple):
    """What a driver decides: an acceleration, m/s^2, and the offset from the middle of its lane, m (left positive)."""

    acceleration_mps2: float
    offset_m: float = 0.0


Decide = Callable[[Tracks, Mapping[str, SignalColour]], Wish]
"""A function that returns what a driver would decide at the current step with other tracks and colours; it must not
change the driver's state."""


def reasons_alone(now: RoadSituation, tracks: Tracks, decide: Decide) -> tuple[Reason, ...]:
    """Return the signals and objects that by themselves make a driver slower or change its place in the lane, the
    strongest first.

    `tracks`: the tracks from which `now` was read.
    """
    green: dict[str, SignalColour] = {key: "green" for _, key in now.route.signals}
    empty = only(tracks, None)
    free, real = decide(empty, green), decide(tracks, now.signals)
    reasons = [*_signals(now, empty, green, free, decide), *_objects(now, tracks, green, free, decide)]
    strongest = min([free.acceleration_mps2, *(reason.acceleration_mps2 or 0.0 for reason in reasons)])
    if real.acceleration_mps2 < strongest - LEAST_MPS2:
        reasons += _together(now, tracks, real, decide)
    if not reasons:
        reasons.append(_free(now, free))
    return tuple(sorted(reasons, key=lambda reason: reason.acceleration_mps2 or 0.0))


def _signals(
    now: RoadSituation, empty: Tracks, green: Mapping[str, SignalColour], free: Wish, decide: Decide
) -> Iterator[Reason]:
    """Yield the signals that by themselves make the driver slower."""
    for index, key in now.route.signals:
        alone: dict[str, SignalColour] = {name: c for name, c in green.items() if name != key}
        colour = now.signals.get(key)
        wish = decide(empty, alone if colour is None else {**alone, key: colour})
        if wish.acceleration_mps2 < free.acceleration_mps2 - LEAST_MPS2:
            passage = now.route.passages[index]
            text = f"{colour or 'not seen, so it is ready to stop'} at {passage.junction}"
            yield Reason("signal", text, None, key, wish.acceleration_mps2, max(passage.stop_s - now.ego.front_s, 0.0))


def _objects(
    now: RoadSituation, tracks: Tracks, green: Mapping[str, SignalColour], free: Wish, decide: Decide
) -> Iterator[Reason]:
    """Yield the objects that by themselves make the driver slower, or change its place in the lane."""
    for k in range(len(tracks.table)):
        wish = decide(only(tracks, k), green)
        slower = wish.acceleration_mps2 < free.acceleration_mps2 - LEAST_MPS2
        aside = wish.offset_m - free.offset_m
        if slower:
            rule, text = _rule(now, k)
        elif abs(aside) >= LEAST_M:
            rule, text = "passing", f"keeps {abs(aside):.1f} m to the {'left' if aside > 0 else 'right'} of it"
        else:
            continue
        yield Reason(rule, text, tracks.numbers[k], None, wish.acceleration_mps2, _room(now, k))


def _together(now: RoadSituation, tracks: Tracks, real: Wish, decide: Decide) -> list[Reason]:
    """Return the objects without which the driver would be faster, but which slow it down only together with others."""
    reasons = []
    for k in range(len(tracks.table)):
        wish = decide(_without(tracks, k), now.signals)
        if wish.acceleration_mps2 > real.acceleration_mps2 + LEAST_MPS2:
            rule, text = _rule(now, k)
            text = f"{text}, together with others"
            reasons.append(Reason(rule, text, tracks.numbers[k], None, real.acceleration_mps2, _room(now, k)))
    text = "several objects or signals together: none slows it down alone, and leaving out one changes nothing"
    return reasons or [Reason("several", text, acceleration_mps2=real.acceleration_mps2)]


def _free(now: RoadSituation, free: Wish) -> Reason:
    """Return the reason if no actor and no signal slows the ego down."""
    if free.acceleration_mps2 >= -LEAST_MPS2:
        return Reason(FREE_ROAD, "no actor and no signal holds it up", acceleration_mps2=free.acceleration_mps2)
    stands = now.ego.speed < cfg.SENSED_STANDS_MPS
    text = "it rejects every proposal to set off" if stands else "for its route: a bend, a limit, or its own lanes"
    return Reason("own plan", f"{text}; no actor and no signal holds it up", acceleration_mps2=free.acceleration_mps2)


def only(tracks: Tracks, k: int | None) -> Tracks:
    """Return the tracks with object `k` only; without any object if `k` is None."""
    rows = slice(0, 0) if k is None else slice(k, k + 1)
    return Tracks(tracks.table[rows], tracks.numbers[rows], tracks.kinds[rows])


def _without(tracks: Tracks, k: int) -> Tracks:
    """Return the tracks of all objects except `k`."""
    rest = [row for row in range(len(tracks.table)) if row != k]
    numbers, kinds = (tuple(values[row] for row in rest) for values in (tracks.numbers, tracks.kinds))
    return Tracks(tracks.table[rest], numbers, kinds)  # type: ignore[arg-type]


def situation_of(now: RoadSituation, tracks: Tracks, signals: Mapping[str, SignalColour]) -> RoadSituation:
    """Return the situation of the same step with other tracks and colours."""
    return read_situation(now.route, now.vehicle, now.observation, tracks, signals)


def _room(now: RoadSituation, k: int) -> float:
    """Return the distance from the ego's front to an object along the route, m; 0 if the object is beside or behind the
    front.
    """
    return max(float(now.actors["s"][k] - now.actors["half_length"][k]) - now.ego.front_s, 0.0)


def _rule(now: RoadSituation, k: int) -> tuple[str, str]:
    """Return the rule that makes the ego react to an object, and in words what it means here."""
    route, actors, egos = now.route, now.actors[k : k + 1].copy(), now.egos.copy()
    foes = near_foes(egos, route.foes, route.junctions)
    matches = match(actors, foes, route.paths)
    find_passable(egos, actors, route.points, route.junctions)
    for name, f in _priorities(now, egos, actors, foes, matches):
        walking = bool(foes["walking"][f])
        return "right of way", f"{'walks over the crossing' if walking else 'has priority'} at {name}"
    free = signal_brakings(route, now.ego.strongest, {key: "green" for _, key in route.signals})
    if find_wall(egos, actors, foes[:0], matches[:, :0], route.junctions, free, route.points) < np.inf:
        return "keep clear", "behind it there is not enough room for the ego beyond the junction"
    predicted = predict(egos, actors, foes, route.paths, matches, route.points)
    leaders = find_leaders(egos, actors, predicted, np.zeros(1))["s"][0]
    ahead = np.flatnonzero(leaders < FAR_M)
    if ahead.size and ahead[0] == 0:
        moves = "walks" if bool(actors["pedestrian"][0]) else "drives"
        stands = float(actors["speed"][0]) < cfg.SENSED_STANDS_MPS
        return "distance", f"{'stands' if stands else moves} ahead in its lane"
    if bool(actors["pedestrian"][0]):
        return "pedestrian", "is about to be in its way"
    return ("distance", "comes into its lane") if ahead.size else ("collision", "would hit it if both went on")


def _priorities(
    now: RoadSituation, egos: Records, actors: Records, foes: Records, matches: Records
) -> Iterator[tuple[str, int]]:
    """Yield the streams in which an actor makes the ego wait: the name of the junction and the index of the stream."""
    free = np.full(len(now.route.passages), -1.0)
    for f in range(len(foes)):
        foe, with_foe = foes[f : f + 1], np.ascontiguousarray(matches[:, f : f + 1])
        if find_wall(egos, actors, foe, with_foe, now.route.junctions, free, now.route.points) < np.inf:
            yield now.route.passages[int(foes["junction"][f])].junction, f
