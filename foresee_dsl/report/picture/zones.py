"""Trigger places: the places that conditions of triggers and expectations name, as outlines and lines in metres."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np
import shapely

from foresee_dsl.compile.bundle import PlacedActor
from foresee_dsl.compile.compiler import Sketch
from foresee_dsl.compile.placement.checks import footprint
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.language import model as m
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.printer import print_item
from foresee_dsl.language.traversal import all_actions, parts, si_of, word_of
from foresee_dsl.report.drawing.sheet import TextPlace
from foresee_dsl.report.picture.subject import Zone
from foresee_dsl.report.picture.text_places import TextPlaces
from foresee_dsl.simulate.results.metrics import ETA_SLOWEST_MPS

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

ACROSS_M = 3.0
"""Half the length of a line across a way, m. Ours: it reaches beyond the sides of a lane, and not to the next
street."""


def zones_of(case: TestCase, sketch: Sketch, texts: TextPlaces) -> tuple[Zone, ...]:
    """Return the trigger places of a test case; conditions without a place are left out."""
    actors = {actor.id: actor for actor in sketch.actors}
    zones: dict[tuple[str, tuple[float, float]], Zone] = {}
    for number, when in enumerate(case.scenario.all(m.When)):
        text = texts.trigger(m.When, number)
        thens = (a.condition for a in all_actions(when.actions) if isinstance(a, m.Then) and a.condition is not None)
        for condition in (when.condition, *thens):
            for zone in _of_condition(condition, sketch, actors, text):
                zones.setdefault((zone.label, zone.at), zone)
    for number, expect in enumerate(case.scenario.all(m.Expect)):
        for zone in _of_condition(expect.condition, sketch, actors, texts.trigger(m.Expect, number)):
            zones.setdefault((zone.label, zone.at), zone)
    return tuple(zones.values())


def _of_condition(
    condition: m.Condition, sketch: Sketch, actors: Mapping[str, PlacedActor], text: TextPlace | None
) -> Iterator[Zone]:
    for part in parts(condition):
        if isinstance(part, m.Within):
            shape = _thing(part.of, sketch, actors)
            if shape is not None:
                yield _around(shape, si_of(part.distance), print_item(part), text)
        elif isinstance(part, m.InJunction) and part.junction is not None:
            junction = sketch.network.junctions.get(word_of(part.junction))
            if junction is not None and len(junction.polygon) > 2:
                yield _around(shapely.Polygon(junction.polygon), 0.0, print_item(part), text)
        elif isinstance(part, m.Comparison) and isinstance(part.left, m.Measure) and part.left.other is not None:
            yield from _measured(part, part.left, actors, text)


def _measured(
    part: m.Comparison, left: m.Measure, actors: Mapping[str, PlacedActor], text: TextPlace | None
) -> Iterator[Zone]:
    """Yield the place of a comparison such as `distance(a, b) < 5 m` or `a.eta(j) < 4 s`."""
    actor, other = actors.get(left.actor or ""), word_of(left.other) if left.other is not None else ""
    if not isinstance(part.right, m.Quantity):
        return
    if left.what == "distance" and other in actors:
        yield _around(_box(actors[other]), si_of(part.right), print_item(part), text)
        return
    line = actor.line if actor is not None else None
    passage = line.passage(other) if line is not None else None
    if actor is None or line is None or passage is None or left.what not in ("distance", "eta"):
        return
    speed = max(actor.cruise_mps, ETA_SLOWEST_MPS) if left.what == "eta" else 1.0
    s = passage.entry_s - si_of(part.right) * speed
    if s <= line.project(actor.x, actor.y)[0]:
        return  # a condition that holds from the beginning has no place
    x, y, heading = line.at(s)
    aside_x, aside_y = -math.sin(heading) * ACROSS_M, math.cos(heading) * ACROSS_M
    across = np.array(((x + aside_x, y + aside_y), (x - aside_x, y - aside_y)))
    yield Zone(print_item(part), (across,), False, (x, y), text)


def _thing(of: m.Item, sketch: Sketch, actors: Mapping[str, PlacedActor]) -> BaseGeometry | None:
    """Return the shape up to which a distance is measured; None if it is unknown."""
    if isinstance(of, m.Named):
        name = word_of(of.name)
        if name in actors:
            return _box(actors[name])
        junction = sketch.network.junctions.get(name)
        return shapely.Polygon(junction.polygon) if junction is not None and len(junction.polygon) > 2 else None
    at = where_is(of, sketch)
    return shapely.Point(at) if at is not None else None


def where_is(place: m.Item, sketch: Sketch) -> tuple[float, float] | None:
    """Return the point of a place in a condition or action, m; None if the point is known only during a run."""
    if isinstance(place, m.Point):
        return si_of(place.x), si_of(place.y)
    return next((xy for written, xy in sketch.places.items() if written == place), None)


def _box(actor: PlacedActor) -> BaseGeometry:
    return shapely.Polygon(footprint(actor))


def _around(shape: BaseGeometry, distance_m: float, label: str, text: TextPlace | None) -> Zone:
    grown = shapely.buffer(shape, distance_m, quad_segs=12)
    outline: FloatArray = shapely.get_coordinates(grown.exterior if hasattr(grown, "exterior") else grown.envelope)
    x, y = shape.centroid.x, shape.centroid.y
    return Zone(label, (outline,), True, (x, y), text)
