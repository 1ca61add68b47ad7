"""Finds conditions that can never hold, because the actor's way never comes near the place or junction they name."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping

from foresee_dsl.compile.bundle import PlacedActor
from foresee_dsl.compile.roads.polyline import XY, Points, distance_to
from foresee_dsl.compile.roads.topology import Topology
from foresee_dsl.errors import measured
from foresee_dsl.language import model as m
from foresee_dsl.language.project.document import Problem
from foresee_dsl.language.traversal import all_actions, parts, si_of, word_of

BESIDE_M = {"ego": 30.0, "sumo": 30.0, "path": 1.0, "static": 0.0}
"""Largest distance of an actor from the middle of its way, m, by its control. Ours: for `ego` and `sumo` the width of
eight lanes, for `path` more than rounding errors; a `static` actor does not move.
"""


def never_near(
    scenario: m.Scenario, placed: Iterable[PlacedActor], places: Mapping[m.Place | m.AtStop, XY], network: Topology
) -> Iterator[Problem]:
    """Yield a problem for each condition `within LENGTH of` a place or junction that its actor's way does not reach.

    `placed` holds the actors at the first frame; `places` holds the coordinates of the places on routes and edges, m.
    """
    by_name = {actor.id: actor for actor in placed}
    for kind, condition in _conditions(scenario):
        for part in parts(condition):
            actor = by_name.get(part.actor) if isinstance(part, m.Within) else None
            if not isinstance(part, m.Within) or actor is None:
                continue
            there = _outline(part.of, places, network)
            if not there:
                continue
            off = min(distance_to(x, y, _way(actor)) for x, y in there)
            room = math.hypot(actor.model.length_m, actor.model.width_m) / 2 + BESIDE_M[actor.control] + _size(there)
            if off > si_of(part.distance) + room:
                away = measured(f"{off:.0f}") + " m away"
                message = f"{actor.id} never comes within that distance: its way remains " + away
                yield Problem("", kind, "FS330", message, "name a place that its way passes", part=part.of)


def _conditions(scenario: m.Scenario) -> Iterator[tuple[str, m.Condition]]:
    for when in scenario.all(m.When):
        yield when.kind, when.condition
        for action in all_actions(when.actions):
            if isinstance(action, m.Then) and action.condition is not None:
                yield when.kind, action.condition
    for expect in scenario.all(m.Expect):
        yield expect.kind, expect.condition


def _outline(of: m.Named | m.Place, places: Mapping[m.Place | m.AtStop, XY], network: Topology) -> Points:
    """Return the point of a place, or the corners of a junction; empty for a place that moves."""
    if isinstance(of, m.Named):
        junction = network.junctions.get(word_of(of.name))
        return junction.polygon if junction is not None else ()
    if isinstance(of, m.Point):
        return ((si_of(of.x), si_of(of.y)),)
    return (places[of],) if of in places else ()


def _size(outline: Points) -> float:
    """Return the largest distance between the first corner and another one, m, because a way may pass between two
    corners.
    """
    (x, y), *rest = outline
    return max((math.hypot(a - x, b - y) for a, b in rest), default=0.0)


def _way(actor: PlacedActor) -> Points:
    if actor.line is not None:
        return actor.line.xy
    return actor.path if len(actor.path) > 1 else ((actor.x, actor.y), (actor.x, actor.y))
